//! Reads an experiment's settings from a TOML file.
//!
//! The table `quick` overrides values for quick runs.

use std::path::Path;

use anyhow::Context;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// Name of the table of overrides for quick runs.
const QUICK: &str = "quick";

/// Reads a file, with its overrides if `quick`.
///
/// # Errors
/// A file that is missing, malformed, or has other keys than `T`.
pub fn read<T: DeserializeOwned>(path: &Path, quick: bool) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text, quick).with_context(|| path.display().to_string())
}

fn parse<T: DeserializeOwned>(text: &str, quick: bool) -> anyhow::Result<T> {
    let mut table: Table = text.parse()?;
    let variant = table.remove(QUICK);
    if let (true, Some(Value::Table(variant))) = (quick, variant) {
        overlay(&mut table, variant);
    }
    Ok(Value::Table(table).try_into()?)
}

/// Replaces values of `table` by those of `variant`, and merges tables.
fn overlay(table: &mut Table, variant: Table) {
    for (name, value) in variant {
        match (table.get_mut(&name), value) {
            (Some(Value::Table(under)), Value::Table(over)) => overlay(under, over),
            (_, value) => {
                table.insert(name, value);
            }
        }
    }
}

/// The package's folder: `cargo test` runs tests there, not in the repository's folder.
#[cfg(test)]
pub fn package_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize, Debug, PartialEq)]
    struct Example {
        spp: Vec<u32>,
        inner: Inner,
    }

    #[derive(serde::Deserialize, Debug, PartialEq)]
    struct Inner {
        a: u32,
        b: u32,
    }

    const TEXT: &str = "spp = [8, 64]\n[inner]\na = 1\nb = 2\n[quick]\nspp = [8]\n[quick.inner]\nb = 3\n";

    #[test]
    fn the_quick_variant_overrides_the_values_that_it_names() {
        let full: Example = parse(TEXT, false).unwrap();
        assert_eq!(full, Example { spp: vec![8, 64], inner: Inner { a: 1, b: 2 } });
        let quick: Example = parse(TEXT, true).unwrap();
        assert_eq!(quick, Example { spp: vec![8], inner: Inner { a: 1, b: 3 } });
    }
}
