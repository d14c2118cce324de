//! The viewers of a render: the live page, a display server, and names for the images that they save.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::failure::Failure;
use super::terminal::print;
use crate::preview::{Hub, Server, TevClient};
use crate::scene::Scene;

/// Largest number of an image that is saved under one name.
const LAST_NUMBER: u32 = 9999;

/// What viewers are connected to, whichever scene is open.
pub(super) struct Viewers {
    pub hub: Arc<Hub>,
    pub server: Option<Server>,
    /// Dropped after the image is written: disconnecting may take time, which is part of no budget.
    pub display: Option<TevClient>,
}

/// Starts to serve the live page, and prints its address.
pub(super) fn serve(hub: &Arc<Hub>, address: Option<SocketAddr>) -> Result<Server, Failure> {
    let server = Server::start(hub.clone(), address).map_err(|error| Failure::Input(error.into()))?;
    print(&format!("preview at {}\n", server.address)).map_err(Failure::Run)?;
    Ok(server)
}

/// Starts to send images to a display server, if there is an address.
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

/// Returns the first names `NAME-0001.exr` and `.png` that no file has; `None` if all numbers are taken.
pub(super) fn next_names(outfile: &Path) -> Option<[PathBuf; 2]> {
    let stem = outfile.file_stem()?.to_string_lossy().into_owned();
    (1..=LAST_NUMBER)
        .map(|number| ["exr", "png"].map(|kind| outfile.with_file_name(format!("{stem}-{number:04}.{kind}"))))
        .find(|names| names.iter().all(|name| !name.exists()))
}

/// Returns the images `NAME-0001.exr` and so on that there are, in order.
pub(super) fn earlier_names(outfile: &Path) -> Vec<PathBuf> {
    let Some(stem) = outfile.file_stem() else { return Vec::new() };
    let stem = stem.to_string_lossy().into_owned();
    let name = |number| outfile.with_file_name(format!("{stem}-{number:04}.exr"));
    (1..=LAST_NUMBER).map(name).filter(|path| path.is_file()).collect()
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
        assert!(earlier_names(&outfile).is_empty());
        std::fs::write(folder.path().join("a.b-0007.exr"), b"").unwrap();
        assert_eq!(earlier_names(&outfile), [folder.path().join("a.b-0007.exr")]);
    }
}
