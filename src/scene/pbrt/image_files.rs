//! The images that a scene names: noted as they are met, and read all together at the end, in
//! parallel, each once for each way of decoding it.

use std::collections::HashMap;
use std::path::PathBuf;

use rayon::prelude::*;

use super::state::Reader;
use super::{Fault, Place, Result};
use crate::scene::ImageId;
use crate::scene::texture::{self, Channels, Encoding};

struct ImageFile {
    path: PathBuf,
    encoding: Encoding,
    channels: Channels,
    upside_down: bool,
    /// Where the scene names it first.
    place: Place,
    /// Whether nothing but a square would do.
    square: bool,
}

/// Images to be read; an [`ImageId`] is an index into the list.
#[derive(Default)]
pub struct ImageFiles {
    list: Vec<ImageFile>,
    ids: HashMap<(PathBuf, String), ImageId>,
}

impl Reader {
    /// An image that the scene will have; `encoding` is what parameters ask for.
    pub fn image(
        &mut self,
        file: &str,
        encoding: Option<Encoding>,
        channels: Channels,
        place: Place,
    ) -> ImageId {
        let path = self.resolve_content(file);
        let encoding = self.dialect.encoding_of(&path, encoding);
        let upside_down = self.dialect.reads_upwards(&path);
        let list = &mut self.images.list;
        let key = (path.clone(), format!("{encoding:?} {channels:?}"));
        *self.images.ids.entry(key).or_insert_with(|| {
            list.push(ImageFile { path, encoding, channels, upside_down, place, square: false });
            ImageId((list.len() - 1) as u32)
        })
    }

    /// Makes it an error if the image turns out not to be square.
    pub fn image_must_be_square(&mut self, id: ImageId) {
        self.images.list[id.0 as usize].square = true;
    }

    /// Reads the images into the scene.
    pub fn load_images(&mut self) -> Result<()> {
        let load = |file: &ImageFile| {
            let fault = |message: String, accepted: &str| {
                let name = file.path.display();
                Fault::new(file.place, format!("image \"{name}\": {message}; {accepted} would be accepted"))
            };
            let image = texture::load(&file.path, file.encoding, file.channels)
                .map_err(|message| fault(message, "a sound image file"))?;
            let (width, height) = (image.width(), image.height());
            if file.square && width != height {
                return Err(fault(format!("{width}x{height} texels"), "a square one"));
            }
            Ok(if file.upside_down { image.upside_down() } else { image })
        };
        let images: Vec<Result<_>> = std::mem::take(&mut self.images.list).par_iter().map(load).collect();
        for image in images {
            self.textures.add_image(image?);
        }
        Ok(())
    }
}
