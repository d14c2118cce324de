//! Makes the meshes, textures and instance lists of the project's own scenes.
//!
//! `prpf-scenes` writes them below `scenes/`; `prpf-scenes --check` compares what it would write
//! with what is there and exits with 1 if anything differs. The scene descriptions themselves
//! (`scenes/*/*.pbrt`) are written by hand. `prpf-scenes random` writes whole scenes drawn by chance.
//!
//! Everything is computed in `f64` and rounded once, at the end, so that small differences between
//! mathematical libraries do not reach the files.

mod ajar;
mod courtyard;
mod dragon;
mod figure;
mod foliage;
mod implicit;
mod mesh;
mod noise;
mod pool;
mod random;
mod sdf;
mod seated;
mod solids;
mod statues;
mod textures;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};

/// One generated file.
pub struct Asset {
    /// Relative to the folder of the scenes, with `/`.
    pub path: String,
    pub bytes: Vec<u8>,
}

impl Asset {
    pub fn new(path: impl Into<String>, bytes: Vec<u8>) -> Self {
        Self { path: path.into(), bytes }
    }
}

/// Folders of a scene that hold generated files and nothing else.
const GENERATED_FOLDERS: [&str; 2] = ["meshes", "textures"];

/// Makes the meshes and textures of the project's own scenes.
#[derive(Parser)]
struct Arguments {
    /// Compare with the files that are there instead of writing them; exit with 1 if they differ.
    #[arg(long)]
    check: bool,
    /// Folder of the scenes.
    #[arg(long, default_value_os_t = scenes())]
    scenes: PathBuf,
    /// Only this scene.
    #[arg(long)]
    only: Option<String>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Write random scenes instead, each to a folder of its own.
    Random {
        /// Folder of the collection.
        folder: PathBuf,
        /// Number of scenes.
        #[arg(long, default_value_t = 10)]
        count: u64,
        /// Number of the first scene, to add to a collection.
        #[arg(long, default_value_t = 0)]
        first: u64,
        /// Seed of the collection.
        #[arg(long, default_value_t = 0)]
        seed: u64,
    },
}

/// A scene's name, and what makes its files.
type Generator = (&'static str, fn() -> Vec<Asset>);

const GENERATORS: [Generator; 5] = [
    ("pool", pool::assets),
    ("statues", statues::assets),
    ("figure", figure::assets),
    ("courtyard", courtyard::assets),
    ("ajar", ajar::assets),
];

/// The folder of the scenes, which this package lies in.
fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is a folder of the scenes").into()
}

fn main() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    if let Some(Command::Random { folder, count, first, seed }) = arguments.command {
        for number in first..first.saturating_add(count) {
            for asset in random::scene(seed, number) {
                write(&folder.join(&asset.path), &asset.bytes)?;
            }
        }
        return Ok(ExitCode::SUCCESS);
    }
    let mut differing = 0;
    for (scene, generate) in GENERATORS {
        if arguments.only.as_deref().is_some_and(|only| only != scene) {
            continue;
        }
        let assets = generate();
        for asset in &assets {
            let path = arguments.scenes.join(&asset.path);
            let same = fs::read(&path).is_ok_and(|bytes| bytes == asset.bytes);
            if same {
                continue;
            }
            println!("{} {}", if arguments.check { "differs:" } else { "writing" }, path.display());
            differing += 1;
            if !arguments.check {
                write(&path, &asset.bytes)?;
            }
        }
        for stray in strays(&arguments.scenes, scene, &assets)? {
            println!("not generated: {}", stray.display());
            differing += 1;
        }
    }
    Ok(if arguments.check && differing > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().context("an asset lies in a folder")?;
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Files in a scene's generated folders that the generator does not make.
fn strays(scenes: &Path, scene: &str, assets: &[Asset]) -> Result<Vec<PathBuf>> {
    let made: BTreeSet<PathBuf> = assets.iter().map(|asset| scenes.join(&asset.path)).collect();
    let mut strays = Vec::new();
    for folder in GENERATED_FOLDERS {
        let Ok(entries) = fs::read_dir(scenes.join(scene).join(folder)) else { continue };
        for entry in entries {
            let path = entry.with_context(|| format!("cannot list {scene}/{folder}"))?.path();
            if !made.contains(&path) {
                strays.push(path);
            }
        }
    }
    strays.sort();
    Ok(strays)
}
