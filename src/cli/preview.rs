//! `prpf preview`, and `--preview` of `render`: the live page over a render.

use std::time::Instant;

use clap::Args;

use super::failure::Failure;
use super::mode::Mode;
use super::options::RenderOptions;
use super::render;

/// `prpf preview`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf preview scenes/pool/pool.pbrt
  prpf preview scene.pbrt --spp 0 --target-error 1e-3
  prpf preview scene.pbrt --preview 0.0.0.0:8080

Prints an address to open in a browser. Only this machine can reach it, unless ADDR:PORT is given; then \
the address holds a token: anyone who has it can watch, steer, and open the scenes in the folder of SCENE \
and below. No image is written until the page's Save is used: NAME-0001.exr and .png, the name being that \
of -o or of the scene's film. Ends with Ctrl-C (or SIGTERM), at once, with exit status 0: that is how a \
preview is closed. With --state what was rendered of the scene's own view is kept, when the preview is \
paused as well, and --resume goes on from there.")]
#[command(mut_arg("report", |option| option.hide(true)))]
#[command(mut_arg("samples", |option| option.hide(true)))]
#[command(mut_arg("reference", |option| option.help("Also show this image, the difference from it, and the true error")))]
pub(super) struct PreviewOptions {
    #[command(flatten)]
    render: RenderOptions,
}

pub(super) fn run(options: &PreviewOptions, start: Instant) -> Result<u8, Failure> {
    if let Some(report) = &options.render.report {
        return Err(Failure::Input(anyhow::anyhow!(
            "--report {}: found with preview, whose renders do not end; accepted with `prpf render --preview`",
            report.display()
        )));
    }
    render::run(&options.render, Mode::Preview, start)
}
