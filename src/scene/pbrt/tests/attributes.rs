//! Defaults set by `Attribute`, and repeated parameters.

use super::{scene, world};
use crate::scene::Shape;

#[test]
fn attributes_set_defaults_that_shapes_may_override() {
    let scene = world(
        "AttributeBegin Attribute \"shape\" \"float radius\" 3 Shape \"sphere\" Shape \"sphere\" \"float radius\" 2
         AttributeEnd Shape \"sphere\"",
    );
    let radii: Vec<_> = scene
        .primitives
        .iter()
        .map(|primitive| match &primitive.shape {
            Shape::Sphere(sphere) => sphere.radius,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(radii, [3.0, 2.0, 1.0]);
}

#[test]
fn the_last_of_several_equal_parameters_counts() {
    let twice = "\"float radius\" 3 \"float radius\" 2";
    for text in [
        format!("Shape \"sphere\" {twice}"),
        format!("Attribute \"shape\" {twice} Shape \"sphere\""),
        "Attribute \"shape\" \"float radius\" 3 Attribute \"shape\" \"float radius\" 2 Shape \"sphere\""
            .to_owned(),
    ] {
        for scene in [world(&text), scene(&format!("WorldBegin {text} WorldEnd"))] {
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            let Shape::Sphere(sphere) = &scene.primitives[0].shape else { panic!("{text}") };
            assert_eq!(sphere.radius, 2.0, "{text}");
        }
    }
}

#[test]
fn shapes_use_the_defaults_of_many_attributes() {
    let attributes: String = (0..5000).map(|i| format!("Attribute \"shape\" \"float a{i}\" 1 ")).collect();
    let scene = world(&format!(
        "{attributes} Attribute \"shape\" \"float radius\" 2 {}",
        "Shape \"sphere\" ".repeat(1000)
    ));
    let radius_2 = |shape: &Shape| matches!(shape, Shape::Sphere(sphere) if sphere.radius == 2.0);
    assert_eq!(scene.primitives.iter().filter(|primitive| radius_2(&primitive.shape)).count(), 1000);
}
