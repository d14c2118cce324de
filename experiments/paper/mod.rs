//! Do the paper's claims hold here?

use crate::bench::Bench;

pub fn run(_bench: &mut Bench) -> anyhow::Result<()> {
    Ok(())
}
