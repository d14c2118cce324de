//! The options of `render` that concern its state.

use std::path::PathBuf;

use anyhow::ensure;
use clap::{Args, ValueEnum};

use super::parse;
use crate::output::paths::replaces_state;
use crate::progressive::{Budget, RecordedStatistics};
use crate::render::Shard;
use crate::state::Stream;

#[derive(Clone, Args)]
pub(super) struct StateOptions {
    /// Keep the render's state in this file: from time to time, when stopped, and at the end
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Go on from --state where it stopped; without such a file, start
    #[arg(long, requires = "state")]
    pub resume: bool,
    /// Time from one state to the next
    #[arg(long, value_name = "DURATION", value_parser = parse::duration, default_value = "40s", requires = "state")]
    pub state_every: f64,
    /// Render the K-th of N shards of the samples that --spp means; `prpf merge` adds their states
    #[arg(long, value_name = "K/N", value_parser = parse::shard, default_value = "1/1")]
    pub shard: Shard,
    /// Dimensions of which statistics are kept: those that the denoiser and the outputs read, or, for an export or
    /// another denoiser later, every one
    #[arg(long, value_enum, default_value_t = StatisticsOption::Needed)]
    pub statistics: StatisticsOption,
    /// Sample vectors to keep per pixel, with every dimension, for another denoiser or an export later;
    /// `--denoiser prpf` keeps 8
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse::reservoir)]
    pub reservoir: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum StatisticsOption {
    Needed,
    All,
}

impl From<StatisticsOption> for RecordedStatistics {
    fn from(option: StatisticsOption) -> Self {
        match option {
            StatisticsOption::Needed => Self::Needed,
            StatisticsOption::All => Self::All,
        }
    }
}

impl StateOptions {
    /// Returns the stream of samples that is rendered.
    pub fn stream(&self, seed: u64) -> Stream {
        Stream::new(seed, self.shard)
    }

    /// Returns whether an existing state will be replaced.
    ///
    /// # Errors
    /// The file exists and is no state.
    pub fn replaces_one(&self) -> anyhow::Result<bool> {
        let replaced = self.state.as_deref().filter(|_| !self.resume);
        Ok(replaced.map_or(Ok(false), replaces_state)?)
    }

    /// Reduces a budget of all shards to that of this one.
    ///
    /// # Errors
    /// More shards than the budget has samples for.
    pub fn apply_shard(&self, budget: &mut Budget) -> anyhow::Result<()> {
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
}
