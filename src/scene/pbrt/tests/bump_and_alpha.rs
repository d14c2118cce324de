//! Images for displacement, normals and alpha.

use image::{GrayImage, Rgb, RgbImage, Rgba, RgbaImage};

use super::image_textures::{assert_near, at_uv, dialect_world, folder_with, four_texels};
use super::{error, world};
use crate::scene::pbrt::dialect::Dialect::{V2, V3, V4};
use crate::scene::pbrt::read_str;

/// A float texture of `a.png`.
const HEIGHTS: &str = r#"Texture "h" "float" "imagemap" "string filename" "a.png""#;

#[test]
fn displacement_is_named_bumpmap_in_the_older_dialects() {
    let folder = folder_with("a.png", GrayImage::from_raw(2, 1, vec![0, 255]).unwrap());
    for (dialect, material, name) in [
        (V2, "Material \"matte\"", "bumpmap"),
        (V3, "Material \"plastic\"", "bumpmap"),
        (V4, "Material \"diffuse\"", "displacement"),
        (V3, "MakeNamedMaterial \"m\" \"string type\" \"matte\"", "bumpmap"),
        (V4, "MakeNamedMaterial \"m\" \"string type\" \"conductor\"", "displacement"),
    ] {
        let text = format!("{HEIGHTS} {material} \"texture {name}\" \"h\" Material \"matte\"");
        let scene = dialect_world(dialect, folder.path(), &text);
        let height = |u| scene.textures.float(scene.materials[1].displacement.unwrap(), at_uv([u, 0.5]));
        assert_eq!([height(0.25), height(0.75)], [0.0, 1.0], "{dialect:?} {material}");
        assert_eq!(scene.materials[2].displacement, None);
    }
}

#[test]
fn a_constant_displacement_is_dropped() {
    let flat = r#"Texture "h" "float" "constant" "float value" 3 Material "diffuse""#;
    for displaced in ["\"texture displacement\" \"h\"", "\"float displacement\" 3"] {
        assert_eq!(world(&format!("{flat} {displaced}")).materials[1].displacement, None);
    }
    let coloured = r#"Texture "h" "spectrum" "checkerboard" Material "diffuse" "texture displacement" "h""#;
    assert!(error(&format!("WorldBegin {coloured}")).message.contains("a float texture"));
}

#[test]
fn a_normal_map_is_linear_and_repeats_from_the_bottom() {
    let texels = [[51, 102, 153], [102, 102, 102], [255, 0, 51], [0, 51, 255]];
    let image = RgbImage::from_raw(2, 2, texels.concat()).unwrap();
    let folder = folder_with("a.png", image);
    let scene = dialect_world(V4, folder.path(), r#"Material "diffuse" "string normalmap" "a.png""#);
    let normal = |uv| scene.textures.rgb(scene.materials[1].normal_map.unwrap(), at_uv(uv));
    assert_near(normal([0.25, 0.75]), [0.2, 0.4, 0.6], "top left");
    assert_near(normal([0.75, 0.25]), [0.0, 0.2, 1.0], "bottom right");
    assert_near(normal([-0.75, 3.25]), [1.0, 0.0, 0.2], "bottom left");
    assert_eq!(scene.materials[0].normal_map, None);
}

#[test]
fn an_alpha_image_cuts_out_a_shape() {
    let alpha = |dialect, image: image::DynamicImage| {
        let folder = folder_with("a.png", image);
        let scene = dialect_world(
            dialect,
            folder.path(),
            &format!("{HEIGHTS} Shape \"sphere\" \"texture alpha\" \"h\""),
        );
        let alpha = scene.primitives[0].alpha.expect("an image");
        [0.25, 0.75].map(|u| scene.textures.float(alpha, at_uv([u, 0.5])))
    };
    let leaf = RgbaImage::from_fn(2, 1, |x, _| Rgba([255, 255, 255, 51 * x as u8]));
    assert_eq!(alpha(V4, leaf.into()), [0.0, 0.2]);
    let mask = GrayImage::from_raw(2, 1, vec![0, 128]).unwrap();
    let encoded = alpha(V4, mask.clone().into());
    assert!(encoded[0] == 0.0 && (encoded[1] - 0.215_861).abs() < 1e-5, "{encoded:?}");
    for dialect in [V2, V3] {
        assert_eq!(alpha(dialect, mask.clone().into()), [0.0, 1.0]);
    }
    let white = RgbImage::from_pixel(2, 1, Rgb([255; 3]));
    assert_eq!(alpha(V4, white.into()), [1.0, 1.0]);
}

#[test]
fn alpha_is_a_float_texture() {
    let text = |kind: &str| {
        format!(
            "WorldBegin Texture \"h\" \"{kind}\" \"imagemap\" \"string filename\" \"a.png\"
             Shape \"sphere\" \"texture alpha\" \"h\""
        )
    };
    let folder = folder_with("a.png", four_texels());
    assert!(read_str(&text("float"), folder.path()).is_ok());
    let error = read_str(&text("spectrum"), folder.path()).unwrap_err();
    assert_eq!((error.line, error.column), (2, 29), "{error}");
    assert!(error.message.contains("\"h\"; expected a float texture"), "{error}");
}
