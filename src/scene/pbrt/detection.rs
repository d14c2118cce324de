//! Which dialect a scene is written in, from the words of its main file and of those that it includes.

use std::collections::HashSet;
use std::io::Read;
use std::path::Path;

use super::dialect::Dialect;
use super::files;
use super::lexer::{Lexer, TokenKind};

/// Most included files that are looked at, their most bytes together, and the deepest of them: headers and
/// footers, which decide, are small and stand in the first ones.
const MAX_FILES: usize = 64;
const MAX_BYTES: u64 = 1 << 23;
const MAX_DEPTH: usize = 8;

/// What the directives of a scene say of its dialect.
#[derive(Default)]
struct Signs {
    /// Only the older dialects close the world.
    world_end: bool,
    /// Of these, only v2 says which of several integrators it means, and only v3 has named media.
    second: bool,
    third: bool,
}

impl Signs {
    /// Looks through a text; the files that it includes.
    fn look_through(&mut self, text: &[u8]) -> Vec<String> {
        let mut lexer = Lexer::new(text, 0);
        let mut included = Vec::new();
        // What is no token is reported when it is read in earnest.
        while let Ok(Some(token)) = lexer.next() {
            let TokenKind::Word(word) = token.kind else { continue };
            match &*word {
                "WorldEnd" => self.world_end = true,
                "SurfaceIntegrator" | "VolumeIntegrator" | "Renderer" => self.second = true,
                "Integrator" | "MediumInterface" | "MakeNamedMedium" => self.third = true,
                "Include" | "Import" => {
                    if let Ok(Some(TokenKind::Quoted(name))) = lexer.next().map(|t| t.map(|token| token.kind))
                    {
                        included.push(name.into_owned());
                    }
                }
                _ => {}
            }
        }
        included
    }

    /// Whether further files have nothing to add.
    fn suffice(&self) -> bool {
        self.world_end && (self.second || self.third)
    }

    fn dialect(&self) -> Dialect {
        match (self.world_end, self.third) {
            (false, _) => Dialect::V4,
            (true, true) => Dialect::V3,
            (true, false) => Dialect::V2,
        }
    }
}

impl Dialect {
    /// Recognises the dialect of a scene by its main file, whose text this is, and as far as that does not decide
    /// by the files that it includes, level by level. One that cannot be read is passed over here.
    pub(super) fn detect(text: &[u8], folder: &Path) -> Self {
        let mut signs = Signs::default();
        let mut level = signs.look_through(text);
        let mut seen = HashSet::new();
        let mut bytes_left = MAX_BYTES;
        for _ in 0..MAX_DEPTH {
            let mut next_level = Vec::new();
            for name in std::mem::take(&mut level) {
                if signs.suffice() || seen.len() == MAX_FILES || bytes_left == 0 {
                    return signs.dialect();
                }
                let path = folder.join(name);
                if !seen.insert(path.clone()) {
                    continue;
                }
                if let Some(text) = start_of(&path, bytes_left) {
                    bytes_left -= text.len() as u64;
                    next_level.extend(signs.look_through(&text));
                }
            }
            level = next_level;
        }
        signs.dialect()
    }
}

/// The first bytes of a file, at most so many, if it can be read.
fn start_of(path: &Path, most: u64) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    files::open(path).ok()?.reader.take(most).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alone(text: &str) -> Dialect {
        Dialect::detect(text.as_bytes(), Path::new(""))
    }

    #[test]
    fn dialects_are_told_apart_by_what_only_they_have() {
        assert_eq!(alone("Integrator \"path\" WorldBegin # WorldEnd"), Dialect::V4);
        assert_eq!(alone("Integrator \"path\" WorldBegin WorldEnd"), Dialect::V3);
        assert_eq!(alone("SurfaceIntegrator \"path\" WorldBegin WorldEnd"), Dialect::V2);
    }

    #[test]
    fn includes_that_are_endless_or_not_there_are_looked_at_within_bounds() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("itself", "Include \"itself\" Include \"nowhere\" Include \".\" Include \"last\"");
        write("last", "WorldEnd");
        let of = |text: &str| Dialect::detect(text.as_bytes(), folder.path());
        assert_eq!(of("Include \"itself\""), Dialect::V2);
        // Deeper, later and further into a file than is looked.
        for level in 0..20 {
            write(&level.to_string(), &format!("Include \"{}\"", level + 1));
        }
        write("8", "WorldEnd");
        assert_eq!([of("Include \"0\""), of("Include \"1\"")], [Dialect::V4, Dialect::V2]);
        let others = |count: usize| (0..count).map(|i| format!("Include \"none{i}\"\n")).collect::<String>();
        assert_eq!(
            [64, 63].map(|count| of(&(others(count) + "Include \"last\""))),
            [Dialect::V4, Dialect::V2]
        );
        let filled = |bytes: u64| "#".repeat(bytes as usize) + "\nWorldEnd";
        write("large", &filled(MAX_BYTES));
        write("fits", &filled(MAX_BYTES - 9));
        assert_eq!([of("Include \"large\""), of("Include \"fits\"")], [Dialect::V4, Dialect::V2]);
    }
}
