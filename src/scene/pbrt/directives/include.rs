//! `Include` and `Import`.

use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::files;
use crate::scene::pbrt::parser::{ParseError, Result, Statement};

/// Nesting limit of includes; real scenes have two or three levels.
const MAX_INCLUDE_DEPTH: usize = 32;
/// Bytes of files that are included again, in total. Without a limit, thirty files that each include the next one twice
/// would expand to 2³⁰ files.
const MAX_REPEATED_BYTES: u64 = 1 << 34;
/// Bytes that a repeated inclusion counts as at least, so that there are at most 2¹⁶.
const MIN_REPEATED_BYTES: u64 = 1 << 18;

impl SceneBuilder {
    /// Reads another scene file in place of the directive.
    pub fn include(&mut self, statement: &Statement) -> Result<()> {
        // Read the file
        let name = &statement.strings[0];
        let path = self.resolve(name);
        let error = |message: String| ParseError::new(statement.loc, message);
        let text = files::read(&path).map_err(|e| {
            error(format!("\"{}\" cannot be read: {e}; expected a scene file", path.display()))
        })?;

        // Reject recursive, deep and repeated includes
        let canonical = path.canonicalize().unwrap_or_else(|_| path.clone());
        if self.open_files.contains(&canonical) {
            return Err(error(format!("\"{name}\" is being read already; expected another file")));
        }
        if self.open_files.len() >= MAX_INCLUDE_DEPTH {
            return Err(error(format!(
                "includes are nested too deep; expected at most {MAX_INCLUDE_DEPTH} levels"
            )));
        }
        if !self.included_files.insert(canonical.clone()) {
            self.repeated_bytes += (text.len() as u64).max(MIN_REPEATED_BYTES);
        }
        if self.repeated_bytes > MAX_REPEATED_BYTES {
            let message = "files are included again too often; expected at most 65536 times, and 16 GiB";
            return Err(error(message.into()));
        }

        // Carry out its directives
        self.open_files.push(canonical);
        self.files.push(path.display().to_string());
        self.read_text(&text, (self.files.len() - 1) as u32)?;
        self.open_files.pop();
        Ok(())
    }

    /// Reads another scene file and restores the graphics state afterwards.
    pub fn import(&mut self, statement: &Statement) -> Result<()> {
        let saved = self.state.clone();
        self.include(statement)?;
        self.state = saved;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::pbrt::read;

    #[test]
    fn exponentially_many_includes_are_an_error() {
        let folder = tempfile::tempdir().unwrap();
        for level in 0..30 {
            let next = format!("Include \"{}\"\n", level + 1);
            std::fs::write(folder.path().join(level.to_string()), next.repeat(2)).unwrap();
        }
        std::fs::write(folder.path().join("30"), "Identity").unwrap();
        let error = read(&folder.path().join("0")).unwrap_err();
        assert!(error.message.contains("at most 65536 times"), "{error}");
    }
}
