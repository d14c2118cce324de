//! Options of `render` that have to do with its state, and what they set in motion.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail, ensure};
use clap::Args;

use super::Failure;
use super::options::parse_duration;
use crate::progressive::{Budget, Memory, Settings, reservoir_capacity};
use crate::render::{Renderer, Shard};
use crate::state::{self, CheckpointWriter, ImageMetadata, RenderState, Stream};
use crate::stats::{Layout, Store};

#[derive(Args)]
pub(super) struct StateOptions {
    /// Keep the render's state in this file: from time to time, when stopped, and at the end
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Go on from --state where it stopped; without such a file, start
    #[arg(long, requires = "state")]
    pub resume: bool,
    /// Time from one state to the next
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, default_value = "40s")]
    pub state_every: f64,
    /// Render the K-th of N shards of the samples that --spp means; `prpf merge` adds their states
    #[arg(long, value_name = "K/N", value_parser = parse_shard, default_value = "1/1")]
    pub shard: Shard,
    /// Whole sample vectors to keep per pixel, for another --quality or an export later on; `paper` keeps 8
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_reservoir)]
    pub reservoir: usize,
}

/// More per pixel says nothing new of it.
const LARGEST_RESERVOIR: usize = 1024;

fn parse_reservoir(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n <= LARGEST_RESERVOIR => Ok(n),
        _ => Err(format!("found `{text}`; accepted are whole numbers from 0 to {LARGEST_RESERVOIR}")),
    }
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    text.split_once('/')
        .and_then(|(k, n)| Shard::new(k.parse().ok()?, n.parse().ok()?))
        .ok_or_else(|| format!("found `{text}`; accepted is K/N with 1 <= K <= N, e.g. 2/4"))
}

impl StateOptions {
    /// Which samples are rendered.
    pub fn stream(&self, seed: u64) -> Stream {
        Stream::new(seed, self.shard)
    }

    /// Whether a state that is there will be replaced.
    ///
    /// # Errors
    /// What is there is something else.
    pub fn replaces_one(&self) -> anyhow::Result<bool> {
        self.state.as_deref().filter(|_| !self.resume).map_or(Ok(false), replaces_state)
    }

    /// Turns a budget of all shards into that of this one.
    pub fn budget(&self, budget: &mut Budget) -> anyhow::Result<()> {
        if let Some(spp) = &mut budget.spp {
            let (all, most) = (*spp, spp.div_ceil(2));
            ensure!(
                self.shard.count() <= most,
                "--shard {}: found shards without samples, of {all} per pixel; accepted are at most {most} shards",
                self.shard,
            );
            *spp = self.shard.samples_among(all);
        }
        Ok(())
    }

    /// What the file says, if it is to go on and there is one.
    pub fn resumed(
        &self,
        metadata: &ImageMetadata,
        stream: Stream,
        renderer: &Renderer,
        settings: &Settings,
    ) -> anyhow::Result<Option<Memory>> {
        let Some(path) = self.state.as_deref().filter(|path| self.resume && path.exists()) else {
            return Ok(None);
        };
        let state = RenderState::read(path)?;
        fits(&state, metadata, stream, renderer.layout(), settings)
            .with_context(|| path.display().to_string())?;
        Ok(Some(state.memory))
    }

    /// Begins to keep states, if there is a file for them.
    pub fn keeper(
        &self,
        metadata: &ImageMetadata,
        stream: Stream,
        renderer: &Renderer,
        settings: &Settings,
    ) -> anyhow::Result<Option<Kept>> {
        let Some(path) = &self.state else { return Ok(None) };
        let (width, height) = renderer.resolution();
        let size = state::estimate_size(renderer.layout(), reservoir_capacity(settings), width * height);
        let writer =
            CheckpointWriter::new(path, size.unwrap_or(usize::MAX)).with_context(|| unwritable(path))?;
        Ok(Some(Kept {
            every: self.state_every,
            path: path.clone(),
            writer,
            failed: AtomicBool::new(false),
            metadata: metadata.clone(),
            stream,
        }))
    }
}

/// Whether a state stands where one will be written.
///
/// # Errors
/// What is there is something else.
pub(super) fn replaces_state(path: &Path) -> anyhow::Result<bool> {
    let Ok(there) = std::fs::metadata(path) else { return Ok(false) };
    // Whoever makes a name for a temporary file makes an empty file.
    Ok(there.is_file() && there.len() > 0 && state::check_signature(path).map(|()| true)?)
}

fn unwritable(path: &Path) -> String {
    format!("{}: the state cannot be written", path.display())
}

/// Whether a render can go on from a state.
fn fits(
    state: &RenderState,
    metadata: &ImageMetadata,
    stream: Stream,
    layout: &Layout,
    settings: &Settings,
) -> anyhow::Result<()> {
    if let Some((field, found, accepted)) = metadata.difference(&state.metadata) {
        bail!("{field}: found a state of {found}; accepted is one of this render, {accepted}");
    }
    if state.streams != [stream] {
        let found: Vec<String> = state.streams.iter().map(Stream::to_string).collect();
        bail!("seed and shard: found a state of {}; accepted is one of {stream}", found.join(" and "));
    }
    let store = &state.memory.store;
    let names = |layout: &Layout| layout.dimensions().iter().map(|d| d.name).collect::<Vec<_>>().join(" ");
    if store.layout() != layout {
        bail!("layout: found a state of {}; accepted is {}", names(store.layout()), names(layout));
    }
    let capacity = reservoir_capacity(settings);
    if store.capacity() < capacity {
        bail!(
            "reservoir: found a state with {} sample vectors per pixel; this render keeps {capacity}, as its denoiser, \
             quality or --reservoir asks for",
            store.capacity()
        );
    }
    Ok(())
}

/// States being kept of a render.
pub(super) struct Kept {
    /// Seconds from one to the next.
    pub every: f64,
    path: PathBuf,
    writer: CheckpointWriter,
    failed: AtomicBool,
    metadata: ImageMetadata,
    stream: Stream,
}

impl Kept {
    /// The render goes on even if the disk is full: there is still an image to come, and room may be made.
    pub fn keep(&self, settings: &Settings, memory: Memory) {
        let (metadata, settings, streams) = (self.metadata.clone(), settings.clone(), vec![self.stream]);
        self.writer.write(&RenderState { metadata, settings, streams, memory });
    }

    /// What went wrong since this was last asked, once for as long as it goes on; said on the terminal as well.
    pub fn news(&self) -> Option<String> {
        let news = self.writer.new_result()?;
        let is_new = !self.failed.swap(news.is_err(), Ordering::Relaxed);
        let problem = format!("{}: {}", unwritable(&self.path), news.err().filter(|_| is_new)?);
        super::complain(&format!("warning: {problem}; the render goes on"));
        Some(problem)
    }

    /// Waits until the last one is on the disk.
    ///
    /// # Errors
    /// Why it is not.
    pub fn settle(&self) -> Result<(), String> {
        self.writer.wait().map_err(|error| format!("{}: {error}", unwritable(&self.path)))
    }

    /// Does on a part of the image's rows what keeping does, to see how long it takes. What fails here
    /// will fail, and be said, at the end.
    pub fn rehearse(&self, settings: &Settings, rows: &Store) {
        let (width, height) = (rows.width(), rows.height());
        let metadata = ImageMetadata {
            film: [width, height],
            pixel_bounds: [0, width, 0, height],
            ..self.metadata.clone()
        };
        let memory = Memory {
            store: Arc::new(rows.clone()),
            batches: Vec::new(),
            estimate: None,
            rerun: None,
            under_way: None,
            recent: (0.0, 0.0),
        };
        let state = RenderState { metadata, settings: settings.clone(), streams: vec![self.stream], memory };
        let _ = state.write_and_discard(&self.path);
    }

    /// Waits until the last one is on the disk.
    pub fn finish(self) -> Result<(), Failure> {
        self.writer
            .finish()
            .map_err(anyhow::Error::msg)
            .with_context(|| unwritable(&self.path))
            .map_err(Failure::Run)
    }
}
