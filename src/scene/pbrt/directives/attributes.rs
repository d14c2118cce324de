//! Directives that set attributes of the graphics state.

use std::borrow::Cow;
use std::rc::Rc;

use crate::scene::color_space::ColorSpace;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result, Statement};

impl SceneBuilder {
    /// `Attribute`: sets defaults for the parameters of later directives.
    pub fn attribute(&mut self, statement: &Statement) -> Result<()> {
        const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];
        let target = &statement.strings[0];
        if !TARGETS.contains(&target.as_str()) {
            let message =
                format!("unknown attribute target \"{target}\"; expected one of {}", TARGETS.join(", "));
            return Err(ParseError::new(statement.loc, message));
        }
        statement.params.mark_all_used();
        let defaults = Rc::make_mut(&mut self.state.defaults).entry(target.clone()).or_default();
        Rc::make_mut(defaults).extend(statement.params.clone().into_parameters());
        Ok(())
    }

    /// The parameters of a statement, with the `Attribute` defaults for `target`.
    pub fn params_for<'s>(&self, target: &str, statement: &'s Statement) -> Cow<'s, ParameterDictionary> {
        match self.state.defaults.get(target) {
            Some(defaults) => Cow::Owned(statement.params.clone().with_defaults(defaults)),
            None => Cow::Borrowed(&statement.params),
        }
    }

    /// `ColorSpace`: the colour space of later RGB values.
    pub fn color_space(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        let Some(space) = ColorSpace::named(name) else {
            let names = ColorSpace::names();
            return Err(ParseError::new(
                statement.loc,
                format!("unknown color space \"{name}\"; expected one of {names}"),
            ));
        };
        self.state.color_space = space;
        Ok(())
    }

    /// `ReverseOrientation`: flips the normals of later shapes.
    pub fn reverse_orientation(&mut self, _: &Statement) -> Result<()> {
        self.state.reverse_orientation = !self.state.reverse_orientation;
        Ok(())
    }
}
