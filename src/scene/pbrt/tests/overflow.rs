//! Values that overflow or underflow in combination.

use glam::Vec3;

use super::{error, scene, world};
use crate::scene::Light;

#[test]
fn an_overflowing_light_is_an_error() {
    for light in [
        "LightSource \"point\" \"rgb I\" [1e38 0 1e38]\n \"float power\" 1e30",
        "LightSource \"spot\" \"rgb I\" [1e38 0 1e38]\n \"float power\" 1e30",
        "LightSource \"distant\" \"rgb L\" [1e38 0 1e38]\n \"float illuminance\" 1e30",
        "LightSource \"infinite\" \"rgb L\" [1e38 0 1e38]\n \"float illuminance\" 1e30",
        "AreaLightSource \"diffuse\" \"rgb L\" [1e38 0 1e38] \"float power\" 1e30\n Shape \"sphere\"",
    ] {
        let error = error(&format!("WorldBegin {light}"));
        assert_eq!((error.line, error.column), (2, 2), "{error}");
        assert!(error.message.contains("overflows"), "{error}");
    }
}

#[test]
fn a_nearly_black_image_does_not_overflow_its_light() {
    let folder = tempfile::tempdir().unwrap();
    let texels = [1e-38f32; 48].iter().flat_map(|v| v.to_le_bytes());
    let file: Vec<u8> = "PF\n4 4\n-1\n".bytes().chain(texels).collect();
    std::fs::write(folder.path().join("a.pfm"), file).unwrap();
    let image = "\"string filename\" \"a.pfm\"";
    for light in [
        format!("LightSource \"projection\" {image} \"float power\" 1e30"),
        format!("LightSource \"goniometric\" {image} \"float power\" 1e30"),
        format!("LightSource \"infinite\" {image} \"float illuminance\" 1e30"),
        format!("AreaLightSource \"diffuse\" {image} \"float power\" 1e30 Shape \"sphere\""),
    ] {
        let error = super::read_str(&format!("WorldBegin {light}"), folder.path()).expect_err(&light);
        assert!(error.line == 1 && error.message.contains("overflows"), "{error}");
    }
}

#[test]
fn the_axis_of_a_light_is_normalised_at_any_length() {
    let lights = world(
        "LightSource \"spot\" \"point from\" [0 0 0] \"point to\" [1e-200 0 0]
         LightSource \"distant\" \"point from\" [0 0 0] \"point to\" [0 1e-300 0]",
    )
    .lights;
    assert!(matches!(lights[0], Light::Spot { axis: Vec3::X, .. }), "{lights:?}");
    assert!(matches!(lights[1], Light::Distant { direction: Vec3::NEG_Y, .. }), "{lights:?}");
    let same = "WorldBegin LightSource \"spot\" \"point from\" [1 2 3] \"point to\" [1 2 3]";
    assert!(error(same).message.contains("the same point"));
}

#[test]
fn the_position_of_a_light_is_finite() {
    for light in ["\"point\" \"point from\" [1e38 0 0]", "\"spot\" \"point from\" [1e38 0 0]"] {
        let error = error(&format!("WorldBegin Scale 10 10 10\nLightSource {light}"));
        assert!(error.line == 2 && error.message.contains("finite position"), "{error}");
    }
}

#[test]
fn a_portal_below_single_precision_is_an_error() {
    let tiny = "\"infinite\" \"point3 portal\" [0 0 0 0 1e-30 0 1e-30 1e-30 0 1e-30 0 0]";
    let error = error(&format!("WorldBegin\nLightSource {tiny}"));
    assert!(error.line == 2 && error.message.contains("invertible transform"), "{error}");
}

#[test]
fn transforms_with_an_overflowing_determinant_are_errors() {
    let huge = "Scale 1e38 1e38 1e38 ".repeat(3);
    for then in [
        "LightSource \"infinite\"",
        "LightSource \"distant\"",
        "Shape \"sphere\"",
        "ObjectBegin \"a\" ObjectEnd ObjectInstance \"a\"",
        "Texture \"t\" \"float\" \"checkerboard\" \"integer dimension\" 3",
    ] {
        let error = error(&format!("WorldBegin {huge}\n{then}"));
        assert!(error.line == 2 && error.message.contains("singular"), "{error}");
    }
    assert!(error(&format!("{huge} Camera \"perspective\" WorldBegin")).message.contains("singular"));
}

#[test]
fn shapes_beyond_the_coordinate_limit_are_ignored() {
    let light = "AreaLightSource \"diffuse\"";
    for shape in [
        "\"sphere\" \"float radius\" 2e12",
        "\"disk\" \"float radius\" 2e12",
        "\"disk\" \"float height\" -2e12",
        "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 2e12 0]",
        "\"cylinder\" \"float radius\" 2e12",
    ] {
        let scene = world(&format!("{light} Shape {shape} Shape \"sphere\" \"float radius\" 9e11"));
        assert_eq!(scene.primitives.len(), 1, "{shape}");
        assert!(scene.warnings[0].starts_with("<text>:2:27: ") && scene.warnings[0].contains("1e12"));
    }
    let moved = scene(&format!("WorldBegin Translate 0 3e12 0 {light} Shape \"sphere\""));
    assert!(moved.primitives.is_empty() && !moved.is_lit());
    let two = world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 2e12 0 0] \"integer indices\" [0 1 2 0 3 2]",
    );
    assert_eq!((super::triangles(&two), two.warnings.len()), (1, 1));
}
