//! References to materials, with the parameters they were made from.

use std::rc::Rc;

use crate::scene::MaterialId;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary};

/// A material as its directive describes it.
pub struct MaterialEntity {
    /// The name that `MakeNamedMaterial` gives; empty for `Material`.
    pub name: String,
    pub kind: String,
    pub params: ParameterDictionary,
    pub loc: FileLoc,
}

/// A material, with its description if shapes may override its parameters.
#[derive(Clone, Default)]
pub struct MaterialRef {
    pub id: MaterialId,
    pub entity: Option<Rc<MaterialEntity>>,
}
