//! An experiment's settings: a TOML file whose table `quick` replaces what a quick run does otherwise.

use std::path::Path;

use anyhow::Context;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// Name of the table with the quick run's settings.
const QUICK: &str = "quick";

/// Reads a file; with `quick`, its quick variant.
///
/// # Errors
/// No such file, no TOML, or not the settings that are expected.
pub fn read<T: DeserializeOwned>(path: &Path, quick: bool) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
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

/// Tables are merged, everything else is replaced.
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
    fn the_quick_variant_replaces_what_it_names_and_nothing_else() {
        let full: Example = parse(TEXT, false).unwrap();
        assert_eq!(full, Example { spp: vec![8, 64], inner: Inner { a: 1, b: 2 } });
        let quick: Example = parse(TEXT, true).unwrap();
        assert_eq!(quick, Example { spp: vec![8], inner: Inner { a: 1, b: 3 } });
    }
}
