//! Records every measurement of an experiment in a CSV file, so that a stopped run can be continued.
//!
//! A row holds one number: scene, seed, settings, quantity, value, cores, commit. A measurement is all rows of
//! one [`Key`]. A recorded one is reused if it was taken with as many cores and at the same commit of the
//! [measured paths](MEASURED_PATHS).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

/// The paths that results depend on: not those of experiments and reports.
const MEASURED_PATHS: [&str; 4] = ["src", "scenes", "Cargo.toml", "Cargo.lock"];

/// The values of one measurement, by quantity.
pub type Values = BTreeMap<String, f64>;

/// Identifies a measurement: everything that its values depend on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    pub scene: String,
    pub seed: u64,
    /// All settings, as `name=value`, separated by blanks.
    pub settings: String,
}

impl Key {
    pub fn new(scene: &str, seed: u64, settings: impl Into<String>) -> Self {
        Self { scene: scene.to_owned(), seed, settings: settings.into() }
    }
}

/// The machine and the code that measurements are taken with.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    pub cores: usize,
    /// The latest commit of the measured paths; a `+` follows if they have uncommitted changes.
    pub commit: String,
}

impl Machine {
    /// This machine, at the current commit.
    pub fn current() -> Self {
        let git = |arguments: &[&str]| {
            let output = Command::new("git").args(arguments).arg("--").args(MEASURED_PATHS).output().ok()?;
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

/// What becomes of the measurements in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earlier {
    /// Those of this machine and commit are reused, the others taken anew.
    Continue,
    Discard,
    /// Those of the first row's machine and commit are reused, and none is taken.
    Only,
}

/// The measurements of an experiment.
pub struct Ledger {
    path: PathBuf,
    pub machine: Machine,
    /// Whether measurements that are not recorded are taken.
    measures: bool,
    recorded: BTreeMap<Key, Values>,
    /// Keys that this run requested, in this order.
    requested: Vec<Key>,
}

impl Ledger {
    /// Reads the file if it exists. Those of its measurements that are of another machine or commit stay in it until [`Self::finish`], and
    /// are not used.
    ///
    /// # Errors
    /// A file that cannot be read or removed; one without measurements for [`Earlier::Only`].
    pub fn open(path: &Path, mut machine: Machine, earlier: Earlier) -> anyhow::Result<Self> {
        let mut recorded: BTreeMap<Key, Values> = BTreeMap::new();
        let measures = earlier != Earlier::Only;
        if path.exists() && earlier == Earlier::Discard {
            std::fs::remove_file(path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
        if path.exists() {
            cut_incomplete_line(path).with_context(|| format!("cannot write {}", path.display()))?;
            let mut reader =
                csv::Reader::from_path(path).with_context(|| format!("cannot read {}", path.display()))?;
            for row in reader.deserialize::<Row>() {
                let row =
                    row.with_context(|| format!("cannot read {}; --fresh discards it", path.display()))?;
                if !measures && recorded.is_empty() {
                    machine = Machine { cores: row.cores, commit: row.commit.clone() };
                }
                if row.cores == machine.cores && row.commit == machine.commit {
                    let key = Key { scene: row.scene, seed: row.seed, settings: row.settings };
                    recorded.entry(key).or_default().insert(row.quantity, row.value);
                }
            }
        }
        ensure!(measures || !recorded.is_empty(), "{}: found no measurement", path.display());
        Ok(Self { path: path.to_owned(), machine, measures, recorded, requested: Vec::new() })
    }

    /// Returns the recorded values of `key`, or calls `measure` and records what it returns. Measures again if
    /// one of the `files` that the measurement writes is missing.
    ///
    /// # Errors
    /// Those of `measure`, a ledger that cannot be written, or with [`Earlier::Only`] a measurement that is not recorded.
    pub fn measure(
        &mut self,
        key: Key,
        files: &[PathBuf],
        measure: impl FnOnce() -> anyhow::Result<Values>,
    ) -> anyhow::Result<Values> {
        let found = self.recorded.get(&key).filter(|_| files.iter().all(|file| file.is_file())).cloned();
        let values = match found {
            Some(values) => values,
            None => {
                ensure!(self.measures, "{}: lacks {}, {}", self.path.display(), key.scene, key.settings);
                let values = measure().with_context(|| format!("{}: {}", key.scene, key.settings))?;
                self.recorded.insert(key.clone(), values.clone());
                self.append(&key)?;
                values
            }
        };
        if !self.requested.contains(&key) {
            self.requested.push(key);
        }
        Ok(values)
    }

    /// Rewrites the file with the measurements that this run requested, in this order; leaves it as it is if none may be taken.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        if self.measures { self.write(self.requested.iter()) } else { Ok(()) }
    }

    fn rows<'a>(&'a self, key: &'a Key) -> impl Iterator<Item = Row> + 'a {
        self.recorded[key].iter().map(|(quantity, &value)| Row {
            scene: key.scene.clone(),
            seed: key.seed,
            settings: key.settings.clone(),
            quantity: quantity.clone(),
            value,
            cores: self.machine.cores,
            commit: self.machine.commit.clone(),
        })
    }

    /// Appends a measurement by a single write, so that a stopped run leaves no part of one.
    fn append(&self, key: &Key) -> anyhow::Result<()> {
        use std::io::Write;
        let empty = std::fs::metadata(&self.path).map_or(true, |data| data.len() == 0);
        let mut writer = csv::WriterBuilder::new().has_headers(empty).from_writer(Vec::new());
        self.rows(key).try_for_each(|row| writer.serialize(row))?;
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&self.path)?;
        file.write_all(&writer.into_inner()?).with_context(|| format!("cannot write {}", self.path.display()))
    }

    fn write<'a>(&'a self, keys: impl Iterator<Item = &'a Key>) -> anyhow::Result<()> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for key in keys {
            self.rows(key).try_for_each(|row| writer.serialize(row))?;
        }
        let temporary = self.path.with_extension("csv.tmp");
        std::fs::write(&temporary, writer.into_inner()?)
            .and_then(|()| std::fs::rename(&temporary, &self.path))
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// Removes an incomplete last line, which is left if a run is stopped while it writes.
fn cut_incomplete_line(path: &Path) -> std::io::Result<()> {
    let text = std::fs::read(path)?;
    let complete = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    if complete < text.len() {
        std::fs::OpenOptions::new().write(true).open(path)?.set_len(complete as u64)?;
    }
    Ok(())
}

/// Values by quantity.
pub fn values<const N: usize>(values: [(&str, f64); N]) -> Values {
    values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(commit: &str) -> Machine {
        Machine { cores: 2, commit: commit.to_owned() }
    }

    /// Whether a request of `key` calls the measurement.
    fn measures(ledger: &mut Ledger, key: &Key, files: &[PathBuf]) -> bool {
        let mut called = false;
        let found = ledger.measure(key.clone(), files, || {
            called = true;
            Ok(values([("mse", 0.1 + 0.2), ("seconds", 2.0)]))
        });
        assert_eq!(found.unwrap()["mse"], 0.1 + 0.2, "to the last bit");
        called
    }

    #[test]
    fn a_measurement_is_taken_once_for_each_key_and_commit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        let key = Key::new("pool", 1, "method=rpf spp=8");
        let mut first = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        assert!(measures(&mut first, &key, &[]));
        assert!(!measures(&mut first, &key, &[]));
        assert!(measures(&mut first, &Key { seed: 2, ..key.clone() }, &[]));
        // The first run ends without `finish`.
        let mut second = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        assert!(!measures(&mut second, &key, &[]));
        assert!(measures(&mut second, &key, &[folder.path().join("picture.png")]));
        let mut fresh = Ledger::open(&path, machine("a"), Earlier::Discard).unwrap();
        assert!(measures(&mut fresh, &key, &[]));
        let mut other = Ledger::open(&path, machine("b"), Earlier::Continue).unwrap();
        assert!(measures(&mut other, &key, &[]));
        // What another commit has measured stays until the end, whatever a stopped run left
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str("pool,1,\"meth");
        std::fs::write(&path, text).unwrap();
        let mut again = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        assert!(!measures(&mut again, &key, &[]));
        assert!(measures(&mut again, &Key { seed: 3, ..key.clone() }, &[]));
        let mut last = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        assert!(!measures(&mut last, &Key { seed: 3, ..key.clone() }, &[]));
        last.finish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 3);
    }

    #[test]
    fn earlier_measurements_alone_are_those_of_the_first_row() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        let open = |machine, earlier| Ledger::open(&path, machine, earlier);
        assert!(open(machine("b"), Earlier::Only).is_err());
        let (known, unknown) = (Key::new("pool", 1, "spp=8"), Key::new("pool", 1, "spp=16"));
        let other = Key::new("pool", 1, "spp=32");
        let mut first = open(machine("a"), Earlier::Continue).unwrap();
        assert!(measures(&mut first, &known, &[]) && measures(&mut first, &other, &[]));
        let mut only = open(machine("b"), Earlier::Only).unwrap();
        assert_eq!(only.machine, machine("a"));
        assert!(!measures(&mut only, &known, &[]));
        let error = only.measure(unknown, &[], || unreachable!("measures nothing")).unwrap_err().to_string();
        assert!(error.ends_with("data.csv: lacks pool, spp=16"), "{error}");
        only.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(",a\n"), "the commit stays");
        assert!(text.contains("spp=32"), "so does what this report does not need");
    }

    #[test]
    fn measurements_that_were_not_requested_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        let (old, new) = (Key::new("pool", 1, "spp=8"), Key::new("pool", 1, "spp=16"));
        let mut ledger = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        measures(&mut ledger, &old, &[]);
        let mut ledger = Ledger::open(&path, machine("a"), Earlier::Continue).unwrap();
        measures(&mut ledger, &new, &[]);
        ledger.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("scene,seed,settings,quantity,value,cores,commit\n"), "{text}");
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(!text.contains("spp=8"), "{text}");
    }
}
