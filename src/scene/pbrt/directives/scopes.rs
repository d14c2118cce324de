//! Blocks: `AttributeBegin`, `TransformBegin`, `ObjectBegin` and their ends.

use std::collections::HashMap;

use crate::scene::pbrt::builder::{ParserScope, SceneBuilder, ScopeKind};
use crate::scene::pbrt::parser::{FileLoc, ParseError, Result};

/// Nesting limit of blocks. Each block may hold a copy of the `Attribute` defaults.
const MAX_SCOPES: usize = 1024;

impl SceneBuilder {
    /// Opens a block: saves the graphics state.
    pub fn push_scope(&mut self, block: ScopeKind, loc: FileLoc) -> Result<()> {
        if self.scopes.len() >= MAX_SCOPES {
            let message = format!("blocks are nested too deep; expected at most {MAX_SCOPES} levels");
            return Err(ParseError::new(loc, message));
        }
        self.scopes.push(ParserScope { saved: self.state.clone(), block, loc, restorations: Vec::new() });
        Ok(())
    }

    /// Closes a block: restores the graphics state. A surplus end is a warning in all dialects.
    pub fn pop_scope(&mut self, block: ScopeKind, loc: FileLoc) -> Result<()> {
        let Some(scope) = self.scopes.pop() else {
            let name = block.name();
            self.warnings.add(loc, format!("{name}End without {name}Begin is ignored"));
            return Ok(());
        };

        // Check that the end matches the beginning
        let crosses =
            scope.block != block && (scope.block == ScopeKind::Object || block == ScopeKind::Object);
        if crosses && !self.dialect.allows_crossed_blocks() {
            let (found, opened) = (block.name(), scope.block.name());
            let line = scope.loc.line;
            let message = format!("{found}End inside {opened}Begin of line {line}; expected {opened}End");
            return Err(ParseError::new(loc, message));
        }

        // Restore the state
        if block == ScopeKind::Transform && self.dialect.transform_end_restores_transform_only() {
            self.state.ctm = scope.saved.ctm;
            self.state.active = scope.saved.active;
        } else {
            self.state = scope.saved;
        }
        scope.restorations.into_iter().rev().for_each(|restore| restore(self));
        Ok(())
    }

    /// Defines something under a name. What an older dialect has defined under the same name before the block of attributes
    /// counts again after the block.
    pub fn define<T: 'static>(
        &mut self,
        names: fn(&mut Self) -> &mut HashMap<String, T>,
        name: String,
        value: T,
    ) {
        let Some(earlier) = names(self).insert(name.clone(), value) else { return };
        let mut blocks = self.scopes.iter_mut().rev();
        let block = blocks.find(|scope| scope.block != ScopeKind::Transform);
        if let Some(block) = block.filter(|_| self.dialect.restores_definitions()) {
            block.restorations.push(Box::new(move |builder| {
                names(builder).insert(name, earlier);
            }));
        }
    }

    /// Checks the end of the main file: open blocks, missing `WorldBegin`.
    pub fn check_end(&mut self) -> Result<()> {
        while let Some(scope) = self.scopes.pop() {
            let begin = format!("{}Begin without an end", scope.block.name());
            if !self.dialect.closes_open_blocks_at_end() {
                let name = scope.block.name();
                let message = format!("{begin}; expected {name}End before the end of the file");
                return Err(ParseError::new(scope.loc, message));
            }
            self.warnings.add(scope.loc, format!("{begin} is closed at the end of the world"));
        }
        if self.options.is_none() {
            return Err(ParseError::new(FileLoc::default(), "the file has no WorldBegin; expected one"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::read_str;

    #[test]
    fn too_deeply_nested_blocks_are_an_error() {
        let nested = |depth: usize| {
            let text =
                format!("WorldBegin {} {}", "AttributeBegin ".repeat(depth), "AttributeEnd ".repeat(depth));
            read_str(&text, Path::new(""))
        };
        assert!(nested(1024).is_ok());
        assert!(nested(1025).unwrap_err().message.contains("at most 1024 levels"));
    }
}
