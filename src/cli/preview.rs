//! `prpf preview`, and `--preview` of `render`: the live page over a render.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use super::Failure;
use super::options::RenderOptions;
use super::render;
use crate::preview::{Hub, Server, TevClient};
use crate::scene::Scene;

/// Images saved under one name are numbered up to this.
const LAST_NUMBER: u32 = 9999;

/// `prpf preview`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf preview scenes/pool/pool.pbrt
  prpf preview scene.pbrt --spp 0 --target-error 1e-3
  prpf preview scene.pbrt --preview 0.0.0.0:8080

Prints an address to open in a browser. Only this machine can reach it, unless ADDR:PORT is given; then
the address holds a token, and whoever has it may look and steer. No image is written until the page's
Save is used: NAME-0001.exr and .png, the name being that of -o or of the scene's film. Ends with Ctrl-C
(or SIGTERM), at once, with exit status 0: that is how a preview is closed. With --state what was rendered
of the scene's own view is kept, when the preview is paused as well, and --resume goes on from there.")]
pub(super) struct PreviewOptions {
    #[command(flatten)]
    render: RenderOptions,
}

pub(super) fn run(options: &PreviewOptions, start: Instant) -> Result<u8, Failure> {
    render::run(&options.render, render::Mode::Preview, start)
}

/// Starts to serve a page, if one is asked for, and says where it is.
pub(super) fn serve(hub: &Arc<Hub>, address: Option<SocketAddr>) -> Result<(), Failure> {
    let server = Server::start(hub.clone(), address).map_err(|error| Failure::Input(error.into()))?;
    super::say(&format!("preview at {}\n", server.address)).map_err(Failure::Run)
}

/// Starts to send images to a display server, if one is asked for.
pub(super) fn display(
    hub: &Arc<Hub>,
    address: Option<&str>,
    scene: &Scene,
    warn: impl FnMut(&str) + Send + 'static,
) -> Result<Option<TevClient>, Failure> {
    let name = Path::new(&scene.source).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let start = |address: &str| TevClient::start(hub.clone(), address.to_owned(), name, warn);
    address.map(start).transpose().map_err(|error| Failure::Run(error.into()))
}

/// Names for the next saved image that no file has yet: `NAME-0001.exr` and `.png` beside it.
pub(super) fn next_names(outfile: &Path) -> Option<[PathBuf; 2]> {
    let stem = outfile.file_stem()?.to_string_lossy().into_owned();
    (1..=LAST_NUMBER)
        .map(|number| ["exr", "png"].map(|kind| outfile.with_file_name(format!("{stem}-{number:04}.{kind}"))))
        .find(|names| names.iter().all(|name| !name.exists()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_image_replaces_none() {
        let folder = tempfile::tempdir().unwrap();
        let outfile = folder.path().join("a.b.exr");
        let [exr, png] = next_names(&outfile).unwrap();
        assert_eq!(exr, folder.path().join("a.b-0001.exr"));
        std::fs::write(png, b"").unwrap();
        assert_eq!(next_names(&outfile).unwrap()[0], folder.path().join("a.b-0002.exr"));
    }
}
