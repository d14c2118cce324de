//! An option directive or its default.

use crate::scene::pbrt::builder::TransformSet;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary};

/// An option directive, or the default in its place.
pub struct OptionEntity<'k> {
    pub kind: &'k str,
    pub params: &'k ParameterDictionary,
    pub loc: FileLoc,
    pub ctm: TransformSet,
}
