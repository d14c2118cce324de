//! A scene's text with only the first few of its effects on.

use anyhow::ensure;
use serde::Deserialize;

/// An effect, and how it is switched off.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    pub name: String,
    /// Parts of the text, each with what stands in its place.
    off: Vec<[String; 2]>,
}

/// The scene with some effects on.
#[derive(Clone, Debug)]
pub struct Variant {
    /// `nothing`, then `+ …` for each effect that comes on.
    pub name: String,
    pub text: String,
}

/// From no effect to all of them, in their order.
///
/// # Errors
/// A part that the text does not have exactly once.
pub fn variants(text: &str, effects: &[Effect]) -> anyhow::Result<Vec<Variant>> {
    let mut variants = Vec::new();
    for on in 0..=effects.len() {
        let mut text = text.to_owned();
        for [part, instead] in effects[on..].iter().flat_map(|effect| &effect.off) {
            let found = text.matches(part.as_str()).count();
            ensure!(found == 1, "{part:?}: found it {found} times in the scene; accepted is once");
            text = text.replace(part.as_str(), instead);
        }
        let name = match on.checked_sub(1) {
            None => "nothing".to_owned(),
            Some(last) => format!("+ {}", effects[last].name),
        };
        variants.push(Variant { name, text });
    }
    Ok(variants)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(name: &str, part: &str, instead: &str) -> Effect {
        Effect { name: name.to_owned(), off: vec![[part.to_owned(), instead.to_owned()]] }
    }

    #[test]
    fn effects_come_on_one_after_another() {
        let effects = [effect("lens", "lens 1", "lens 0"), effect("motion", "move", "stay")];
        let variants = variants("lens 1 move", &effects).unwrap();
        let texts: Vec<&str> = variants.iter().map(|v| v.text.as_str()).collect();
        assert_eq!(texts, ["lens 0 stay", "lens 1 stay", "lens 1 move"]);
        assert_eq!(variants[2].name, "+ motion");
    }

    #[test]
    fn a_part_that_is_not_there_once_is_refused() {
        assert!(variants("a a", &[effect("x", "a", "b")]).is_err());
        assert!(variants("", &[effect("x", "a", "b")]).is_err());
    }
}
