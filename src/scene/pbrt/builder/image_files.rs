//! Image files that a scene names.
//!
//! Files are collected while the scene is parsed and decoded in parallel at its end, each once per
//! encoding and channel selection.

use std::collections::HashMap;
use std::path::PathBuf;

use rayon::prelude::*;

use crate::scene::pbrt::parser::{FileLoc, ParseError, Result, Warnings};
use crate::scene::texture::{self, Content, Encoding};
use crate::scene::{ImageId, TextureImage};

struct ImageFile {
    path: PathBuf,
    encoding: Encoding,
    content: Content,
    /// Whether the image is flipped vertically after decoding.
    flip_rows: bool,
    /// Encoded value of the image if it cannot be read; `None` if that is an error.
    replacement: Option<f32>,
    /// Location of the first reference.
    loc: FileLoc,
    /// Whether an image that is not square is an error.
    must_be_square: bool,
}

/// Image files to be decoded. An [`ImageId`] is an index into the list.
#[derive(Default)]
pub struct ImageFiles {
    list: Vec<ImageFile>,
    ids: HashMap<(PathBuf, String), ImageId>,
}

impl ImageFiles {
    /// Adds a reference to an image file; equal references share one id.
    pub fn add(
        &mut self,
        path: PathBuf,
        encoding: Encoding,
        content: Content,
        flip_rows: bool,
        replacement: Option<f32>,
        loc: FileLoc,
    ) -> ImageId {
        let list = &mut self.list;
        let key = (path.clone(), format!("{encoding:?} {content:?} {replacement:?}"));
        *self.ids.entry(key).or_insert_with(|| {
            list.push(ImageFile {
                path,
                encoding,
                content,
                flip_rows,
                replacement,
                loc,
                must_be_square: false,
            });
            ImageId((list.len() - 1) as u32)
        })
    }

    /// Requires the image to be square; [`Self::load`] checks it.
    pub fn require_square(&mut self, id: ImageId) {
        self.list[id.0 as usize].must_be_square = true;
    }

    /// Decodes all images, in the order of their ids. A warning names each that a constant replaces.
    ///
    /// # Errors
    /// If a file without a replacement is missing, damaged or not square where it must be.
    pub fn load(self, warnings: &mut Warnings) -> Result<Vec<TextureImage>> {
        let images: Vec<_> = self.list.par_iter().map(ImageFile::load).collect();
        let or_replacement =
            |(file, image): (&ImageFile, Result<TextureImage>)| match (image, file.replacement) {
                (Err(error), Some(value)) => {
                    warnings.add(error.loc, format!("{}; using the constant {value}", error.message));
                    Ok(texture::one_texel(value, file.encoding))
                }
                (image, _) => image,
            };
        self.list.iter().zip(images).map(or_replacement).collect()
    }
}

impl ImageFile {
    fn load(&self) -> Result<TextureImage> {
        let error = |message: String, expected: &str| {
            let name = self.path.display();
            ParseError::new(self.loc, format!("image \"{name}\": {message}; expected {expected}"))
        };
        let image = texture::load(&self.path, self.encoding, self.content)
            .map_err(|message| error(message, "a valid image file"))?;
        let (width, height) = (image.width(), image.height());
        if self.must_be_square && width != height {
            return Err(error(format!("{width}x{height} texels"), "a square image"));
        }
        Ok(if self.flip_rows { image.upside_down() } else { image })
    }
}
