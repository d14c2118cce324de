//! Every measurement of an experiment, in a CSV file that grows with each, so that a run that was
//! stopped goes on where it was.
//!
//! One row holds one number: scene, seed, settings, quantity, value, cores, commit. A measurement is
//! all rows of one [`Key`], and stands if it was taken at the same commit of what it measures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use serde::{Deserialize, Serialize};

/// What results follow from; the reports that they end in are not among it.
const MEASURED: [&str; 4] = ["src", "scenes", "Cargo.toml", "Cargo.lock"];

/// The numbers of one measurement, by quantity.
pub type Values = BTreeMap<String, f64>;

/// What is measured: everything that the numbers depend on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    pub scene: String,
    pub seed: u64,
    /// All settings, as `name=value` and separated by blanks.
    pub settings: String,
}

impl Key {
    pub fn new(scene: &str, seed: u64, settings: impl Into<String>) -> Self {
        Self { scene: scene.to_owned(), seed, settings: settings.into() }
    }
}

/// Where measurements are taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    pub cores: usize,
    /// The latest commit of what is measured, with a `+` if it was changed since.
    pub commit: String,
}

impl Machine {
    pub fn here() -> Self {
        let git = |arguments: &[&str]| {
            let output = Command::new("git").args(arguments).arg("--").args(MEASURED).output().ok()?;
            output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        let changed = git(&["status", "--porcelain"]).is_some_and(|files| !files.is_empty());
        let commit = git(&["log", "-1", "--format=%h"]).unwrap_or_else(|| "unknown".to_owned());
        Self {
            cores: rayon::current_num_threads(),
            commit: format!("{commit}{}", if changed { "+" } else { "" }),
        }
    }
}

/// A row of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    scene: String,
    seed: u64,
    settings: String,
    quantity: String,
    value: f64,
    cores: usize,
    commit: String,
}

/// The measurements of an experiment.
pub struct Ledger {
    path: PathBuf,
    pub machine: Machine,
    known: BTreeMap<Key, Values>,
    /// Keys that this run asked for, in this order.
    asked: Vec<Key>,
}

impl Ledger {
    /// Opens a file, if there is one; `fresh` starts anew. Measurements of another machine or commit are
    /// forgotten.
    ///
    /// # Errors
    /// A file that is no ledger, or cannot be written.
    pub fn open(path: &Path, machine: Machine, fresh: bool) -> anyhow::Result<Self> {
        let mut known: BTreeMap<Key, Values> = BTreeMap::new();
        if path.exists() && !fresh {
            let mut reader =
                csv::Reader::from_path(path).with_context(|| format!("reading {}", path.display()))?;
            for row in reader.deserialize::<Row>() {
                // The last line of a run that was stopped while writing is no row.
                let Ok(row) = row else { break };
                if row.cores == machine.cores && row.commit == machine.commit {
                    let key = Key { scene: row.scene, seed: row.seed, settings: row.settings };
                    known.entry(key).or_default().insert(row.quantity, row.value);
                }
            }
        }
        let ledger = Self { path: path.to_owned(), machine, known, asked: Vec::new() };
        ledger.write(ledger.known.keys())?;
        Ok(ledger)
    }

    /// The numbers of a measurement: found, or else taken and kept. It is taken again where a file that it
    /// leaves behind is missing.
    ///
    /// # Errors
    /// The measurement's own, or a file that cannot be written.
    pub fn measure(
        &mut self,
        key: Key,
        files: &[PathBuf],
        take: impl FnOnce() -> anyhow::Result<Values>,
    ) -> anyhow::Result<Values> {
        let found = self.known.get(&key).filter(|_| files.iter().all(|file| file.is_file())).cloned();
        let values = match found {
            Some(values) => values,
            None => {
                let values = take().with_context(|| format!("{}: {}", key.scene, key.settings))?;
                self.known.insert(key.clone(), values.clone());
                self.append(&key)?;
                values
            }
        };
        if !self.asked.contains(&key) {
            self.asked.push(key);
        }
        Ok(values)
    }

    /// Leaves in the file what this run asked for, in this order.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        self.write(self.asked.iter())
    }

    fn rows<'a>(&'a self, key: &'a Key) -> impl Iterator<Item = Row> + 'a {
        self.known[key].iter().map(|(quantity, &value)| Row {
            scene: key.scene.clone(),
            seed: key.seed,
            settings: key.settings.clone(),
            quantity: quantity.clone(),
            value,
            cores: self.machine.cores,
            commit: self.machine.commit.clone(),
        })
    }

    /// In one piece, so that a run that is stopped leaves measurements whole.
    fn append(&self, key: &Key) -> anyhow::Result<()> {
        use std::io::Write;
        let empty = std::fs::metadata(&self.path).map_or(true, |data| data.len() == 0);
        let mut writer = csv::WriterBuilder::new().has_headers(empty).from_writer(Vec::new());
        self.rows(key).try_for_each(|row| writer.serialize(row))?;
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&self.path)?;
        file.write_all(&writer.into_inner()?).with_context(|| format!("writing {}", self.path.display()))
    }

    fn write<'a>(&'a self, keys: impl Iterator<Item = &'a Key>) -> anyhow::Result<()> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for key in keys {
            self.rows(key).try_for_each(|row| writer.serialize(row))?;
        }
        std::fs::write(&self.path, writer.into_inner()?)
            .with_context(|| format!("writing {}", self.path.display()))
    }
}

/// Numbers by their names.
pub fn values<const N: usize>(values: [(&str, f64); N]) -> Values {
    values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(commit: &str) -> Machine {
        Machine { cores: 2, commit: commit.to_owned() }
    }

    /// Measures in a file and tells whether anything was taken.
    fn takes(ledger: &mut Ledger, key: &Key, files: &[PathBuf]) -> bool {
        let mut taken = false;
        let found = ledger.measure(key.clone(), files, || {
            taken = true;
            Ok(values([("mse", 0.1 + 0.2), ("seconds", 2.0)]))
        });
        assert_eq!(found.unwrap()["mse"], 0.1 + 0.2, "to the last bit");
        taken
    }

    #[test]
    fn a_measurement_is_taken_once_and_again_for_another_key_or_commit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        let key = Key::new("pool", 1, "method=rpf spp=8");
        let mut first = Ledger::open(&path, machine("a"), false).unwrap();
        assert!(takes(&mut first, &key, &[]));
        assert!(!takes(&mut first, &key, &[]));
        assert!(takes(&mut first, &Key { seed: 2, ..key.clone() }, &[]));
        // Stopped here.
        let mut second = Ledger::open(&path, machine("a"), false).unwrap();
        assert!(!takes(&mut second, &key, &[]));
        assert!(takes(&mut second, &key, &[folder.path().join("picture.png")]));
        let mut fresh = Ledger::open(&path, machine("a"), true).unwrap();
        assert!(takes(&mut fresh, &key, &[]));
        let mut other = Ledger::open(&path, machine("b"), false).unwrap();
        assert!(takes(&mut other, &key, &[]));
    }

    #[test]
    fn what_was_not_asked_for_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        let (old, new) = (Key::new("pool", 1, "spp=8"), Key::new("pool", 1, "spp=16"));
        let mut ledger = Ledger::open(&path, machine("a"), false).unwrap();
        takes(&mut ledger, &old, &[]);
        let mut ledger = Ledger::open(&path, machine("a"), false).unwrap();
        takes(&mut ledger, &new, &[]);
        ledger.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("scene,seed,settings,quantity,value,cores,commit\n"), "{text}");
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(!text.contains("spp=8"), "{text}");
    }
}
