//! Objects between `ObjectBegin` and `ObjectEnd`, and their instances.

use super::TransformSet;
use crate::scene::pbrt::parser::FileLoc;

/// A named object.
pub struct ObjectDefinition {
    pub name: String,
    pub parts: Vec<ObjectPart>,
}

/// A group of primitives as a part of an object.
#[derive(Clone)]
pub struct ObjectPart {
    /// Index into [`super::SceneBuilder::groups`].
    pub group: usize,
    /// The group's motion in object space; the identity if it does not move.
    pub transforms: TransformSet,
}

/// An `ObjectInstance` directive.
pub struct InstanceEntity {
    pub name: String,
    /// Object space to world space.
    pub transforms: TransformSet,
    pub loc: FileLoc,
}
