//! Parameter defaults that `Attribute` directives set.

use std::collections::HashMap;
use std::rc::Rc;

use super::Parameter;

/// Default parameters for one kind of directive, by name.
///
/// Parameters are shared, because every block that sets one keeps a copy of the table.
#[derive(Clone, Debug, Default)]
pub struct AttributeDefaults(HashMap<String, Rc<Parameter>>);

impl AttributeDefaults {
    /// Adds defaults; each replaces an earlier one of the same name.
    pub fn extend(&mut self, params: impl IntoIterator<Item = Parameter>) {
        self.0.extend(params.into_iter().map(|param| (param.name.clone(), Rc::new(param))));
    }

    /// The default for the parameter called `name`.
    pub fn get(&self, name: &str) -> Option<&Parameter> {
        self.0.get(name).map(Rc::as_ref)
    }
}
