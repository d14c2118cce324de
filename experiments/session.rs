//! One run of an experiment: its settings, folders, measurements and progress display.
//!
//! Takes the experiment's name and the command line's options; gives what the experiment's module works with.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use indicatif::ProgressBar;
use serde::de::DeserializeOwned;

use crate::ledger::{Earlier, Ledger, Machine};
use crate::scenes::{Catalogue, SceneFile};
use crate::settings;

/// Folder of the experiments, relative to the repository.
const HOME: &str = "experiments";

/// A running experiment.
pub struct Session {
    name: String,
    pub quick: bool,
    /// Folder of the results.
    pub out: PathBuf,
    /// Folder of expensive intermediate files, which can be deleted.
    pub cache: PathBuf,
    pub ledger: Ledger,
    catalogue: Catalogue,
    bar: ProgressBar,
}

impl Session {
    /// Opens the experiment `name`.
    ///
    /// # Errors
    /// Folders that cannot be made, files that cannot be read.
    pub fn new(
        name: &str,
        quick: bool,
        out: Option<PathBuf>,
        scenes_dir: Option<PathBuf>,
        earlier: Earlier,
    ) -> anyhow::Result<Self> {
        let home = Path::new(HOME);
        let folder = if quick { format!("{name}-quick") } else { name.to_owned() };
        let out = out.unwrap_or_else(|| home.join("results").join(folder));
        let cache = home.join("cache");
        for folder in [&out, &cache] {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        let ledger = Ledger::open(&out.join("data.csv"), Machine::current(), earlier)?;
        let catalogue = Catalogue::read(&home.join("scenes.toml"), scenes_dir)?;
        let bar = ProgressBar::new_spinner();
        bar.enable_steady_tick(Duration::from_millis(200));
        Ok(Self { name: name.to_owned(), quick, out, cache, ledger, catalogue, bar })
    }

    /// Reads the experiment's settings.
    ///
    /// # Errors
    /// See [`settings::read`].
    pub fn settings<T: DeserializeOwned>(&self) -> anyhow::Result<T> {
        settings::read(&Path::new(HOME).join(format!("{}.toml", self.name)), self.quick)
    }

    /// Looks up scenes by name. Prints the names of those whose files are missing, and leaves them out.
    ///
    /// # Errors
    /// A name that `scenes.toml` lacks.
    pub fn scenes(&self, names: &[String]) -> anyhow::Result<Vec<SceneFile>> {
        let mut found = Vec::new();
        for name in names {
            let scene = self.catalogue.scene(name)?;
            if scene.file.is_file() {
                found.push(scene);
            } else {
                self.print(&format!("{name}: left out, the file {} is missing", scene.file.display()));
            }
        }
        Ok(found)
    }

    /// Shows the current activity beside the spinner.
    pub fn show_status(&self, activity: impl Into<String>) {
        self.bar.set_message(activity.into());
    }

    /// Prints a line above the spinner.
    pub fn print(&self, line: &str) {
        self.bar.suspend(|| println!("{line}"));
    }

    /// The command that repeats this run, for the report.
    pub fn command(&self) -> String {
        let quick = if self.quick { " --quick" } else { "" };
        format!("cargo run --release --bin prpf-experiments -- {}{quick}", self.name)
    }

    /// Writes the ledger and prints the report's path.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        self.bar.finish_and_clear();
        self.ledger.finish()?;
        println!("{}", self.out.join("report.md").display());
        Ok(())
    }
}
