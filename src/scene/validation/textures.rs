//! Checks of textures and images.

use std::fmt::Debug;

use super::validation_error::{Result, ValidationError};
use super::values::{finite, index, require};
use crate::scene::texture::{FloatTextureId, ImageId, RgbTextureId, Texture, TextureMapping, TextureValue};
use crate::scene::{TextureImage, Textures};

/// Depth limit of texture expressions, whose evaluation is recursive.
const MAX_DEPTH: usize = 64;

/// A texture of either type.
#[derive(Clone, Copy)]
enum Node {
    Float(usize),
    Rgb(usize),
}

/// Checks all images and textures of a scene.
pub fn check_textures(textures: &Textures) -> Result {
    for (i, image) in textures.images().iter().enumerate() {
        check_image(image, || format!("textures.images[{i}]"))?;
    }
    for (i, texture) in textures.floats().iter().enumerate() {
        let field = || format!("textures.floats[{i}]");
        check_operands(textures, &operands(texture, float_node), &field)?;
        check_parameters(textures, texture, &field, |value| value.is_finite())?;
    }
    for (i, texture) in textures.rgbs().iter().enumerate() {
        let field = || format!("textures.rgbs[{i}]");
        check_operands(textures, &operands(texture, rgb_node), &field)?;
        check_parameters(textures, texture, &field, |value| value.is_finite())?;
    }
    let mut depths = Depths {
        textures,
        floats: vec![None; textures.floats().len()],
        rgbs: vec![None; textures.rgbs().len()],
    };
    (0..textures.floats().len()).try_for_each(|i| depths.visit(Node::Float(i), 1).map(drop))?;
    (0..textures.rgbs().len()).try_for_each(|i| depths.visit(Node::Rgb(i), 1).map(drop))
}

/// Requires the id of a float texture of the scene.
pub fn float_id(textures: &Textures, id: FloatTextureId, field: impl FnOnce() -> String) -> Result {
    index(id.0 as usize, textures.floats().len(), field)
}

/// Requires the id of an RGB texture of the scene.
pub fn rgb_id(textures: &Textures, id: RgbTextureId, field: impl FnOnce() -> String) -> Result {
    index(id.0 as usize, textures.rgbs().len(), field)
}

/// Requires the id of an image of the scene.
pub fn image_id(textures: &Textures, id: ImageId, field: impl FnOnce() -> String) -> Result {
    index(id.0 as usize, textures.images().len(), field)
}

fn check_image(image: &TextureImage, field: impl Fn() -> String) -> Result {
    let (width, height, channels) = (image.width(), image.height(), image.channels());
    let size = format_args!("{width}x{height} texels");
    require(width > 0 && height > 0, &field, size, "at least one texel")?;
    let channels_value = format_args!("an image with {channels} channels");
    require([1, 3, 4].contains(&channels), &field, channels_value, "1, 3 or 4 channels")?;
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let texel = image.rgb(x, y).extend(image.float(x, y));
        require(texel.is_finite(), || format!("{} at ({x}, {y})", field()), texel, "finite values")?;
    }
    Ok(())
}

/// Checks that the operands of a texture exist.
fn check_operands(textures: &Textures, operands: &[Node], field: &impl Fn() -> String) -> Result {
    for &operand in operands {
        let (i, count) = match operand {
            Node::Float(i) => (i, textures.floats().len()),
            Node::Rgb(i) => (i, textures.rgbs().len()),
        };
        index(i, count, || format!("operand of {}", field()))?;
    }
    Ok(())
}

/// Checks the numbers, mapping and image of a texture.
fn check_parameters<V: TextureValue + Debug>(
    textures: &Textures,
    texture: &Texture<V>,
    field: &impl Fn() -> String,
    is_finite: impl Fn(&V) -> bool,
) -> Result {
    match texture {
        Texture::Constant(value) => {
            require(is_finite(value), field, format_args!("{value:?}"), "finite values")
        }
        Texture::Image(image) => {
            image_id(textures, image.image, || format!("{}.image", field()))?;
            finite(image.scale, || format!("{}.scale", field()))?;
            check_mapping(&image.mapping, field)
        }
        Texture::Checkerboard { mapping, .. } | Texture::Dots { mapping, .. } => {
            check_mapping(mapping, field)
        }
        Texture::Bilinear { mapping, corners } => {
            let valid = corners.iter().all(is_finite);
            require(valid, || format!("{}.corners", field()), format_args!("{corners:?}"), "finite values")?;
            check_mapping(mapping, field)
        }
        Texture::Procedural { to_texture, .. } => {
            let value = format_args!("{to_texture:?}");
            require(to_texture.is_finite(), || format!("{}.to_texture", field()), value, "finite values")
        }
        _ => Ok(()),
    }
}

fn check_mapping(mapping: &TextureMapping, field: &impl Fn() -> String) -> Result {
    let valid = match mapping {
        TextureMapping::Uv { scale, offset } => scale.is_finite() && offset.is_finite(),
        TextureMapping::Space(to_texture)
        | TextureMapping::Spherical { to_texture, .. }
        | TextureMapping::Cylindrical { to_texture, .. } => to_texture.is_finite(),
    };
    require(valid, || format!("{}.mapping", field()), format_args!("{mapping:?}"), "finite values")
}

fn float_node(id: FloatTextureId) -> Node {
    Node::Float(id.0 as usize)
}

fn rgb_node(id: RgbTextureId) -> Node {
    Node::Rgb(id.0 as usize)
}

/// Textures that a texture refers to; `node` converts ids of its own type.
fn operands<V: TextureValue>(texture: &Texture<V>, node: impl Fn(V::Id) -> Node) -> Vec<Node> {
    match texture {
        Texture::Checkerboard { even: a, odd: b, .. }
        | Texture::Dots { inside: a, outside: b, .. }
        | Texture::Product { first: a, second: b } => vec![node(*a), node(*b)],
        Texture::Mix { first, second, amount } => {
            vec![node(*first), node(*second), float_node(*amount)]
        }
        Texture::Gray(id) | Texture::NotZero(id) => vec![float_node(*id)],
        Texture::Mean(id) => vec![rgb_node(*id)],
        Texture::Constant(_) | Texture::Image(_) | Texture::Bilinear { .. } | Texture::Procedural { .. } => {
            Vec::new()
        }
    }
}

/// Depths of texture expressions, where known.
struct Depths<'t> {
    textures: &'t Textures,
    floats: Vec<Option<usize>>,
    rgbs: Vec<Option<usize>>,
}

impl Depths<'_> {
    /// The depth of a texture that is reached by `level` references.
    ///
    /// # Errors
    /// If the depth exceeds [`MAX_DEPTH`], which cycles also do.
    fn visit(&mut self, node: Node, level: usize) -> Result<usize> {
        let known = match node {
            Node::Float(i) => self.floats[i],
            Node::Rgb(i) => self.rgbs[i],
        };
        if level + known.unwrap_or(1) - 1 > MAX_DEPTH {
            let field = match node {
                Node::Float(i) => format!("textures.floats[{i}]"),
                Node::Rgb(i) => format!("textures.rgbs[{i}]"),
            };
            let (value, expected) = ("nested too deep or cyclic".into(), "at most 64 levels");
            return Err(ValidationError::InvalidValue { field, value, expected });
        }
        if let Some(depth) = known {
            return Ok(depth);
        }
        let children = match node {
            Node::Float(i) => operands(&self.textures.floats()[i], float_node),
            Node::Rgb(i) => operands(&self.textures.rgbs()[i], rgb_node),
        };
        let mut depth = 1;
        for child in children {
            depth = depth.max(1 + self.visit(child, level + 1)?);
        }
        match node {
            Node::Float(i) => self.floats[i] = Some(depth),
            Node::Rgb(i) => self.rgbs[i] = Some(depth),
        }
        Ok(depth)
    }
}
