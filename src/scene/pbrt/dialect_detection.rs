//! Detects the dialect of a scene from the directives in its main file and in the files it includes.

use std::collections::HashSet;
use std::io::Read;
use std::path::Path;

use super::dialect::Dialect;
use super::files;
use super::parser::{Lexer, TokenKind};

/// Limits of the search through included files: their number, their total size in bytes, and their
/// depth. The deciding directives are in small files near the start.
const MAX_FILES: usize = 64;
const MAX_BYTES: u64 = 1 << 23;
const MAX_DEPTH: usize = 8;

/// Shapes, materials and samplers of v3.
const V3_NAMES: [&str; 8] =
    ["plymesh", "curve", "disney", "fourier", "hair", "sobol", "02sequence", "maxmindist"];

/// Directives that are specific to a dialect.
#[derive(Default)]
struct DialectClues {
    /// `WorldEnd`: only the older dialects have it.
    world_end: bool,
    /// A directive of v2, or of v3 and later, that the other does not have.
    v2: bool,
    v3: bool,
    /// A name that v3 has and v2 does not, or an image that v2 cannot read; a material or a texture of v2 may be called
    /// so, too.
    v3_name: bool,
}

impl DialectClues {
    /// Collects clues from a text. Returns the names of the files it includes.
    fn scan(&mut self, text: &[u8]) -> Vec<String> {
        let mut lexer = Lexer::new(text, 0);
        let mut included = Vec::new();
        let mut is_film = false;
        // Errors are reported when the file is read
        while let Ok(Some(token)) = lexer.next() {
            let word = match token.kind {
                TokenKind::Word(word) => word,
                TokenKind::Quoted(name) => {
                    // v2 writes PNG files, but reads none
                    let is_image = !is_film && name.to_ascii_lowercase().ends_with(".png");
                    self.v3_name |=
                        is_image || V3_NAMES.contains(&&*name) || name.ends_with(" remaproughness");
                    continue;
                }
                _ => continue,
            };
            is_film = word == "Film";
            match &*word {
                "WorldEnd" => self.world_end = true,
                "SurfaceIntegrator" | "VolumeIntegrator" | "Renderer" => self.v2 = true,
                "Integrator" | "MediumInterface" | "MakeNamedMedium" => self.v3 = true,
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

    /// Whether the dialect is decided.
    fn are_sufficient(&self) -> bool {
        self.world_end && (self.v2 || self.v3)
    }

    fn dialect(&self) -> Dialect {
        let is_v3 = self.v3 || self.v3_name && !self.v2;
        match (self.world_end, is_v3) {
            (false, _) => Dialect::V4,
            (true, true) => Dialect::V3,
            (true, false) => Dialect::V2,
        }
    }
}

impl Dialect {
    /// Detects the dialect from the main file's text and, if that does not decide, from the included
    /// files, breadth first. Files that cannot be read are skipped.
    pub(super) fn detect(text: &[u8], folder: &Path) -> Self {
        let mut clues = DialectClues::default();
        let mut level = clues.scan(text);
        let mut seen = HashSet::new();
        let mut bytes_left = MAX_BYTES;
        for _ in 0..MAX_DEPTH {
            let mut next_level = Vec::new();
            for name in std::mem::take(&mut level) {
                if clues.are_sufficient() || seen.len() == MAX_FILES || bytes_left == 0 {
                    return clues.dialect();
                }
                let path = folder.join(name);
                if !seen.insert(path.clone()) {
                    continue;
                }
                if let Some(text) = start_of(&path, bytes_left) {
                    bytes_left -= text.len() as u64;
                    next_level.extend(clues.scan(&text));
                }
            }
            level = next_level;
        }
        clues.dialect()
    }
}

/// The first `most` bytes of a file, if it can be read.
fn start_of(path: &Path, most: u64) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    files::open(path).ok()?.reader.take(most).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detect(text: &str) -> Dialect {
        Dialect::detect(text.as_bytes(), Path::new(""))
    }

    #[test]
    fn dialects_are_detected_by_their_own_directives() {
        assert_eq!(detect("Integrator \"path\" WorldBegin # WorldEnd"), Dialect::V4);
        assert_eq!(detect("Integrator \"path\" WorldBegin WorldEnd"), Dialect::V3);
        assert_eq!(detect("SurfaceIntegrator \"path\" WorldBegin WorldEnd"), Dialect::V2);
        assert_eq!(detect("WorldBegin Shape \"sphere\" WorldEnd"), Dialect::V2);
        for v3 in ["Shape \"plymesh\"", "Material \"metal\" \"bool remaproughness\" \"false\""] {
            assert_eq!(detect(&format!("WorldBegin {v3} WorldEnd")), Dialect::V3);
        }
        assert_eq!(detect("Film \"image\" \"string filename\" \"a.png\" WorldBegin WorldEnd"), Dialect::V2);
        let image = "Texture \"t\" \"color\" \"imagemap\" \"string filename\" \"a.PNG\"";
        assert_eq!(detect(&format!("WorldBegin {image} WorldEnd")), Dialect::V3);
        assert_eq!(detect(&format!("Renderer \"sampler\" WorldBegin {image} WorldEnd")), Dialect::V2);
        let named = "VolumeIntegrator \"single\" WorldBegin NamedMaterial \"hair\" WorldEnd";
        assert_eq!(detect(named), Dialect::V2);
    }

    #[test]
    fn missing_and_recursive_includes_are_searched_within_limits() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("itself", "Include \"itself\" Include \"nowhere\" Include \".\" Include \"last\"");
        write("last", "WorldEnd");
        let detect_in = |text: &str| Dialect::detect(text.as_bytes(), folder.path());
        assert_eq!(detect_in("Include \"itself\""), Dialect::V2);
        // Beyond the limits of depth, number and size
        for level in 0..20 {
            write(&level.to_string(), &format!("Include \"{}\"", level + 1));
        }
        write("8", "WorldEnd");
        assert_eq!([detect_in("Include \"0\""), detect_in("Include \"1\"")], [Dialect::V4, Dialect::V2]);
        let others = |count: usize| (0..count).map(|i| format!("Include \"none{i}\"\n")).collect::<String>();
        assert_eq!(
            [64, 63].map(|count| detect_in(&(others(count) + "Include \"last\""))),
            [Dialect::V4, Dialect::V2]
        );
        let filled = |bytes: u64| "#".repeat(bytes as usize) + "\nWorldEnd";
        write("large", &filled(MAX_BYTES));
        write("fits", &filled(MAX_BYTES - 9));
        assert_eq!(
            [detect_in("Include \"large\""), detect_in("Include \"fits\"")],
            [Dialect::V4, Dialect::V2]
        );
    }
}
