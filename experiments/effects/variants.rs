//! Switches off effects of a scene by replacing parts of its text.

use anyhow::ensure;
use serde::Deserialize;

/// An effect, and the replacements that switch it off.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    pub name: String,
    /// Parts of the text, each with its replacement.
    off: Vec<[String; 2]>,
}

/// The scene with the first few of its effects.
#[derive(Clone, Debug)]
pub struct Variant {
    /// `none`, then `+ …` with the effect that is added.
    pub name: String,
    pub text: String,
}

/// Makes the variants without effects, with the first, the first two, and so on, up to all effects.
///
/// # Errors
/// A part that does not occur exactly once in the text.
pub fn variants(text: &str, effects: &[Effect]) -> anyhow::Result<Vec<Variant>> {
    let mut variants = Vec::new();
    for on in 0..=effects.len() {
        let mut text = text.to_owned();
        for [part, replacement] in effects[on..].iter().flat_map(|effect| &effect.off) {
            let found = text.matches(part.as_str()).count();
            ensure!(found == 1, "{part:?} occurs {found} times in the scene; it has to occur once");
            text = text.replace(part.as_str(), replacement);
        }
        let name = match on.checked_sub(1) {
            None => "none".to_owned(),
            Some(last) => format!("+ {}", effects[last].name),
        };
        variants.push(Variant { name, text });
    }
    Ok(variants)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(name: &str, part: &str, replacement: &str) -> Effect {
        Effect { name: name.to_owned(), off: vec![[part.to_owned(), replacement.to_owned()]] }
    }

    #[test]
    fn variants_add_one_effect_after_another() {
        let effects = [effect("lens", "lens 1", "lens 0"), effect("motion", "move", "stay")];
        let variants = variants("lens 1 move", &effects).unwrap();
        let texts: Vec<&str> = variants.iter().map(|v| v.text.as_str()).collect();
        assert_eq!(texts, ["lens 0 stay", "lens 1 stay", "lens 1 move"]);
        assert_eq!(variants[2].name, "+ motion");
    }

    #[test]
    fn a_part_that_does_not_occur_once_is_refused() {
        assert!(variants("a a", &[effect("x", "a", "b")]).is_err());
        assert!(variants("", &[effect("x", "a", "b")]).is_err());
    }
}
