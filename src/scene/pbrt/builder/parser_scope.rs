//! Blocks that save and restore the graphics state.

use super::{GraphicsState, SceneBuilder};
use crate::scene::pbrt::parser::FileLoc;

/// The kind of a block, such as `AttributeBegin` ... `AttributeEnd`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScopeKind {
    Attribute,
    Transform,
    Object,
}

impl ScopeKind {
    /// The directive's name without `Begin` or `End`.
    pub fn name(self) -> &'static str {
        match self {
            ScopeKind::Attribute => "Attribute",
            ScopeKind::Transform => "Transform",
            ScopeKind::Object => "Object",
        }
    }
}

/// An open block.
pub struct ParserScope {
    /// The graphics state at the block's beginning.
    pub saved: GraphicsState,
    pub block: ScopeKind,
    /// Location of the directive that opened the block.
    pub loc: FileLoc,
    /// Bring back what definitions in the block have replaced.
    pub restorations: Vec<Restoration>,
}

/// Brings back a definition that another one of the same name has replaced.
pub type Restoration = Box<dyn FnOnce(&mut SceneBuilder)>;
