//! What every experiment works with: its settings, its folders, its measurements, its progress.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use indicatif::ProgressBar;
use serde::de::DeserializeOwned;

use crate::ledger::{Ledger, Machine};
use crate::scenes::{Catalogue, SceneFile};
use crate::settings;

/// Where experiments live, from the repository's folder.
const HOME: &str = "experiments";

/// The place where one experiment is run.
pub struct Bench {
    name: String,
    pub quick: bool,
    /// Folder of the results.
    pub out: PathBuf,
    /// Folder of what is expensive and can be made again.
    pub cache: PathBuf,
    pub ledger: Ledger,
    catalogue: Catalogue,
    bar: ProgressBar,
}

impl Bench {
    /// `fresh` forgets earlier measurements.
    ///
    /// # Errors
    /// Folders that cannot be made, files that cannot be read.
    pub fn new(
        name: &str,
        quick: bool,
        out: Option<PathBuf>,
        scenes_dir: Option<PathBuf>,
        fresh: bool,
    ) -> anyhow::Result<Self> {
        let home = Path::new(HOME);
        let folder = if quick { format!("{name}-quick") } else { name.to_owned() };
        let out = out.unwrap_or_else(|| home.join("results").join(folder));
        let cache = home.join("cache");
        for folder in [&out, &cache] {
            std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        }
        let ledger = Ledger::open(&out.join("data.csv"), Machine::here(), fresh)?;
        let catalogue = Catalogue::read(&home.join("scenes.toml"), scenes_dir)?;
        let bar = ProgressBar::new_spinner();
        bar.enable_steady_tick(Duration::from_millis(200));
        Ok(Self { name: name.to_owned(), quick, out, cache, ledger, catalogue, bar })
    }

    /// The settings of the experiment.
    ///
    /// # Errors
    /// See [`settings::read`].
    pub fn settings<T: DeserializeOwned>(&self) -> anyhow::Result<T> {
        settings::read(&Path::new(HOME).join(format!("{}.toml", self.name)), self.quick)
    }

    /// Those of the named scenes that are here; of the others it says that they are left out.
    ///
    /// # Errors
    /// A name that `scenes.toml` does not have.
    pub fn scenes(&self, names: &[String]) -> anyhow::Result<Vec<SceneFile>> {
        let mut found = Vec::new();
        for name in names {
            let scene = self.catalogue.scene(name)?;
            if scene.file.is_file() {
                found.push(scene);
            } else {
                self.say(&format!("{name}: left out, there is no {}", scene.file.display()));
            }
        }
        Ok(found)
    }

    /// Says what is being done.
    pub fn doing(&self, what: impl Into<String>) {
        self.bar.set_message(what.into());
    }

    /// Prints a line above the progress.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| println!("{line}"));
    }

    /// The command that runs this experiment, for its report.
    pub fn command(&self) -> String {
        let quick = if self.quick { " --quick" } else { "" };
        format!("cargo run --release --bin prpf-experiments -- {}{quick}", self.name)
    }

    /// Puts the measurements in order.
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
