//! Image textures: decoding, mapping, wrapping and sharing.

use std::path::Path;

use glam::{Vec2, Vec3};
use image::{DynamicImage, GrayImage, Rgb, RgbImage, Rgba, RgbaImage};

use crate::scene::pbrt::dialect::Dialect::{self, V2, V3, V4};
use crate::scene::pbrt::read_str;
use crate::scene::texture::TexturePoint;
use crate::scene::{MaterialKind, Scene};

/// A world of a dialect, of which the files are in a folder.
pub(super) fn dialect_world(dialect: Dialect, folder: &Path, text: &str) -> Scene {
    let (header, end) = match dialect {
        V2 => ("Renderer \"sampler\"", "WorldEnd"),
        V3 => ("Integrator \"path\"", "WorldEnd"),
        V4 => ("", ""),
    };
    let scene = read_str(&format!("{header} WorldBegin {text} {end}"), folder);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.warnings.is_empty(), "{text}: {:?}", scene.warnings);
    scene
}

/// A folder with an image in it.
pub(super) fn folder_with(name: &str, image: impl Into<DynamicImage>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    image.into().save(folder.path().join(name)).unwrap();
    folder
}

/// Two rows of two texels: .2 and .4 above .6 and .8, if they are linear.
pub(super) fn four_texels() -> GrayImage {
    GrayImage::from_raw(2, 2, vec![51, 102, 153, 204]).unwrap()
}

pub(super) fn at_uv([u, v]: [f32; 2]) -> TexturePoint {
    TexturePoint { uv: Vec2::new(u, v), position: Vec3::ZERO }
}

#[track_caller]
pub(super) fn assert_near(found: Vec3, expected: impl Into<Vec3>, of: &str) {
    let expected = expected.into();
    assert!((found - expected).abs().max_element() < 1e-5, "{found} is not {expected}: {of}");
}

/// The colour of a diffuse material.
pub(super) fn reflectance(scene: &Scene, material: usize, at: TexturePoint) -> Vec3 {
    let MaterialKind::Diffuse { reflectance } = scene.materials[material].kind else { panic!() };
    scene.textures.rgb(reflectance, at)
}

/// A texture of `a.png`, and a material of it.
fn textured(params: &str) -> String {
    format!(
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\" {params}
         Material \"matte\" \"texture Kd\" \"t\""
    )
}

/// The colour that a texture of an image has at a place.
fn colour(dialect: Dialect, image: impl Into<DynamicImage>, params: &str, at: TexturePoint) -> Vec3 {
    let folder = folder_with("a.png", image);
    reflectance(&dialect_world(dialect, folder.path(), &textured(params)), 1, at)
}

/// What a float texture of an image says, three times.
fn number(dialect: Dialect, image: DynamicImage, params: &str) -> Vec3 {
    let folder = folder_with("a.png", image);
    let relief = if dialect == V4 { "displacement" } else { "bumpmap" };
    let text = format!(
        "Texture \"f\" \"float\" \"imagemap\" \"string filename\" \"a.png\" {params}
         Material \"matte\" \"texture {relief}\" \"f\""
    );
    let scene = dialect_world(dialect, folder.path(), &text);
    Vec3::splat(scene.textures.float(scene.materials[1].displacement.unwrap(), at_uv([0.5; 2])))
}

/// What has the bytes of an image taken for linear values.
fn as_linear(dialect: Dialect) -> &'static str {
    match dialect {
        V2 => r#""float gamma" 1"#,
        V3 => r#""bool gamma" false"#,
        V4 => r#""string encoding" "linear""#,
    }
}

#[test]
fn the_filter_point_takes_the_nearest_texel() {
    let between = [0.3, 0.8];
    let smooth = linear(V4, "", between);
    assert_near(linear(V4, "\"string filter\" \"point\"", between), linear(V4, "", [0.25, 0.75]), "point");
    assert!((smooth - linear(V4, "", [0.25, 0.75])).length() > 0.01, "the default is bilinear");
}

/// The value of the image of four texels, taken as linear, at a (u, v).
fn linear(dialect: Dialect, params: &str, uv: [f32; 2]) -> Vec3 {
    colour(dialect, four_texels(), &format!("{} {params}", as_linear(dialect)), at_uv(uv))
}

#[test]
fn an_image_is_wrapped_by_its_mode() {
    // Left of, right of, above and below the image.
    let outside = [[-0.25, 0.75], [1.25, 0.25], [0.25, 1.25], [0.75, -0.25]];
    for dialect in [V3, V4] {
        for (wrap, expected) in [
            ("", [0.4, 0.6, 0.6, 0.4]),
            ("\"string wrap\" \"repeat\"", [0.4, 0.6, 0.6, 0.4]),
            ("\"string wrap\" \"clamp\"", [0.2, 0.8, 0.2, 0.8]),
            ("\"string wrap\" \"black\"", [0.0; 4]),
        ] {
            for (uv, expected) in outside.into_iter().zip(expected) {
                assert_near(linear(dialect, wrap, uv), [expected; 3], wrap);
            }
        }
    }
}

#[test]
fn bytes_are_decoded_by_their_encoding() {
    let [srgb, gamma, plain] = [0.215_861, 0.219_520, 0.501_961];
    for (dialect, params, expected) in [
        (V4, "", srgb),
        (V4, "\"string encoding\" \"sRGB\"", srgb),
        (V4, "\"string encoding\" \"linear\"", plain),
        (V4, "\"string encoding\" \"gamma 2.2\"", gamma),
        (V3, "", srgb),
        (V3, "\"bool gamma\" true", srgb),
        (V3, "\"bool gamma\" false", plain),
        (V3, "\"bool gamma\" \"false\"", plain),
        (V2, "", plain),
        (V2, "\"float gamma\" 1", plain),
        (V2, "\"float gamma\" 2.2", gamma),
    ] {
        let image = RgbImage::from_pixel(1, 1, Rgb([0, 128, 255]));
        let found = colour(dialect, image, params, at_uv([0.5; 2]));
        assert_near(found, [0.0, expected, 1.0], &format!("{dialect:?} {params}"));
    }
}

#[test]
fn invalid_encodings_and_wrap_modes_are_errors() {
    let folder = folder_with("a.png", four_texels());
    for (name, value) in [
        ("encoding", "rec709"),
        ("encoding", "gamma 0"),
        ("encoding", "gamma inf"),
        ("encoding", "gamma"),
        ("wrap", "mirror"),
    ] {
        let text = format!("WorldBegin\n  {}", textured(&format!("\"string {name}\" \"{value}\"")));
        let error = read_str(&text, folder.path()).unwrap_err();
        assert_eq!((error.line, error.column), (2, 3), "{error}");
        assert!(error.message.contains(&format!("{name} \"{value}\"")), "{error}");
    }
    let error = read_str("WorldBegin Texture \"t\" \"float\" \"imagemap\"", folder.path()).unwrap_err();
    assert!(error.message.contains("without a file"), "{error}");
}

#[test]
fn an_image_is_scaled_then_inverted_and_never_below_zero() {
    let [dark, bright] = [[0.25, 0.75], [0.75, 0.25]];
    for dialect in [V2, V3, V4] {
        let uv = if dialect == V2 { [0.25; 2] } else { dark };
        assert_near(linear(dialect, "\"float scale\" 3", uv), [0.6; 3], "scaled");
    }
    assert_near(linear(V4, "\"bool invert\" true", bright), [0.2; 3], "inverted");
    let both = "\"float scale\" 2 \"bool invert\" true";
    assert_near(linear(V4, both, dark), [0.6; 3], both);
    // A constant of v4's `scale` is the image's
    let folder = folder_with("a.png", four_texels());
    let image = textured(&format!("{} \"bool invert\" true", as_linear(V4)));
    let scaled = "Texture \"s\" \"spectrum\" \"scale\" \"texture tex\" \"t\" \"float scale\" 2
        Material \"matte\" \"texture Kd\" \"s\"";
    let scene = dialect_world(V4, folder.path(), &format!("{image} {scaled}"));
    assert_near(reflectance(&scene, 2, at_uv(dark)), [0.6; 3], "scaled before it is inverted");
    assert_near(linear(V4, both, bright), [0.0; 3], both);
    // What is scaled is light, not what stands in the file.
    let gray = GrayImage::from_pixel(1, 1, image::Luma([128]));
    assert_near(colour(V3, gray, "\"float scale\" 2", at_uv([0.5; 2])), [0.431_722; 3], "sRGB");
}

#[test]
fn coordinates_are_scaled_then_offset_then_flipped() {
    let params = "\"float uscale\" .5 \"float udelta\" .25 \"float vscale\" 2 \"float vdelta\" .25";
    let places = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.25], [1.0, 0.25]];
    for (dialect, expected) in
        [(V2, [0.2, 0.4, 0.6, 0.8]), (V3, [0.6, 0.8, 0.2, 0.4]), (V4, [0.6, 0.8, 0.2, 0.4])]
    {
        for (uv, expected) in places.into_iter().zip(expected) {
            assert_near(linear(dialect, params, uv), [expected; 3], &format!("{dialect:?} {uv:?}"));
        }
    }
}

#[test]
fn planar_and_spherical_mappings_are_flipped() {
    // Places where s = t = 1/4.
    for (mapping, place) in [
        (r#""planar""#, [0.25, 0.25, 3.0]),
        (r#""planar" "float udelta" .5 "float vdelta" -.5"#, [-0.25, 0.75, 3.0]),
        (r#""planar" "vector v1" [0 0 1] "vector v2" [2 0 0]"#, [0.125, 9.0, 0.25]),
        (r#""spherical""#, [0.0, 1.0, 1.0]),
        // At distance 1 the height of the point is that of its direction
        (r#""cylindrical""#, [0.0, -0.968_245_8, 0.25]),
    ] {
        let at = TexturePoint { uv: Vec2::ZERO, position: place.into() };
        for (dialect, expected) in [(V2, 0.2), (V3, 0.6), (V4, 0.6)] {
            let params = format!("{} \"string mapping\" {mapping}", as_linear(dialect));
            let found = colour(dialect, four_texels(), &params, at);
            assert_near(found, [expected; 3], &format!("{dialect:?} {mapping}"));
        }
    }
}

#[test]
fn a_float_texture_of_a_colour_image_is_its_mean_or_alpha() {
    let number = |image: DynamicImage| number(V4, image, "");
    let mean = (0.215_861 + 0.051_269) / 3.0;
    assert_near(number(RgbImage::from_pixel(1, 1, Rgb([128, 64, 0])).into()), [mean; 3], "no alpha");
    let with_alpha = |alpha| RgbaImage::from_pixel(1, 1, Rgba([128, 64, 0, alpha]));
    assert_near(number(with_alpha(255).into()), [mean; 3], "opaque");
    assert_near(number(with_alpha(51).into()), [0.2; 3], "alpha, which is not encoded");
    let colour = colour(V4, with_alpha(51), "", at_uv([0.5; 2]));
    assert_near(colour, [0.215_861, 0.051_269, 0.0], "the colour does not mind the alpha");
}

#[test]
fn a_float_texture_of_the_older_dialects_is_the_encoded_luminance() {
    let image = || RgbaImage::from_pixel(1, 1, Rgba([0, 204, 0, 51]));
    // 0.7152 of 0.8, rounded to a byte.
    let stored: f32 = 146.0 / 255.0;
    let v3 = ((stored + 0.055) / 1.055).powf(2.4);
    for (dialect, params, expected) in [
        (V2, "", stored),
        (V2, "\"float gamma\" 2 \"float scale\" 3", (3.0 * stored).powi(2)),
        (V3, "", v3),
        (V3, "\"bool gamma\" false \"float scale\" 3", 3.0 * stored),
    ] {
        assert_near(number(dialect, image().into(), params), [expected; 3], params);
    }
}

#[test]
fn cylindrical_mappings_of_the_older_dialects_use_the_height_of_a_direction() {
    // t is 4.2 in v4 and 0.81 in the others.
    let at = TexturePoint { uv: Vec2::ZERO, position: Vec3::new(0.0, 3.0, 4.2) };
    for (dialect, is_lower_row) in [(V2, true), (V3, false), (V4, true)] {
        let params = format!("{} \"string mapping\" \"cylindrical\"", as_linear(dialect));
        let value = colour(dialect, four_texels(), &params, at).x;
        assert_eq!(value > 0.6, is_lower_row, "{dialect:?}: {value}");
    }
}

#[test]
fn float_images_are_decoded_by_gamma_in_the_older_dialects() {
    for (dialect, params, expected) in [
        (V2, "\"float gamma\" 2 \"float scale\" 3", [2.25, 36.0, 0.0]),
        (V3, "\"bool gamma\" true", [0.214_041, 4.953_847, 0.0]),
        (V3, "", [0.5, 2.0, 0.0]),
        (V4, "\"string encoding\" \"gamma 2\"", [0.5, 2.0, 0.0]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgb_file(path, 1, 1, |_, _| (0.5f32, 2f32, 0f32)).unwrap();
        let text = textured(params).replace("a.png", "a.exr");
        let found = reflectance(&dialect_world(dialect, folder.path(), &text), 1, at_uv([0.5; 2]));
        assert_near(found, expected, params);
    }
}

#[test]
fn each_encoding_of_a_file_is_an_image() {
    let named = |file: &str, params: &str| textured(params).replace("a.png", file);
    let folder = folder_with("a.png", GrayImage::from_pixel(1, 1, image::Luma([128])));
    let texts = ["", "\"string encoding\" \"linear\"", "\"string encoding\" \"sRGB\" \"float scale\" 2"];
    let text = texts.map(|params| named("a.png", params)).join("\n");
    let float = r#"Texture "f" "float" "imagemap" "string filename" "a.png""#;
    let normals = r#"Material "diffuse" "string normalmap" "a.png""#;
    let scene = dialect_world(V4, folder.path(), &format!("{text} {float} {normals}"));
    assert_eq!(scene.textures.images().len(), 2);
    for (i, expected) in [0.215_861, 0.501_961, 0.431_722].into_iter().enumerate() {
        assert_near(reflectance(&scene, i + 1, at_uv([0.5; 2])), [expected; 3], texts[i]);
    }
    // There is one way for a JPEG file of v4.
    let folder = folder_with("a.jpg", GrayImage::from_pixel(8, 8, image::Luma([128])));
    let scene = dialect_world(V4, folder.path(), &texts.map(|params| named("a.jpg", params)).join("\n"));
    assert_eq!(scene.textures.images().len(), 1);
}
