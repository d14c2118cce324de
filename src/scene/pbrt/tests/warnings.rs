//! Warnings about unsupported input, one per message with its first location.

use glam::Vec3;

use super::image_textures::{at_uv, reflectance};
use super::{folder, scene, world};
use crate::scene::Scene;
use crate::scene::pbrt::read;

/// The colour of what says none.
const GRAY: Vec3 = Vec3::splat(0.5);

/// That a directive, given twice, is warned about in one line with the place of the first.
fn warned_once(directive: &str, message: &str) -> Scene {
    let scene = world(&format!("\n  {directive}\n{directive}"));
    assert_eq!(scene.warnings, [format!("<text>:3:3: {message} (and 1 more)")], "{directive}");
    scene
}

#[test]
fn unsupported_materials_are_diffuse() {
    let colour = Vec3::new(0.1, 0.2, 0.3);
    for (kind, params, expected) in [
        ("subsurface", "\"float scale\" 2 \"rgb sigma_a\" [1 1 1]", GRAY),
        ("subsurface", "\"rgb reflectance\" [.1 .2 .3] \"float eta\" 1.4", colour),
        ("kdsubsurface", "\"rgb Kd\" [.1 .2 .3] \"rgb mfp\" [1 1 1]", colour),
        ("disney", "\"float metallic\" 1 \"rgb color\" [.1 .2 .3]", colour),
        ("fourier", "\"string bsdffile\" \"a.bsdf\"", GRAY),
    ] {
        let message = format!("material \"{kind}\" is not supported; using \"diffuse\"");
        let scene = warned_once(&format!("Material \"{kind}\" {params}"), &message);
        assert_eq!([1, 2].map(|i| reflectance(&scene, i, at_uv([0.5; 2]))), [expected; 2], "{kind}");
        let named = format!("MakeNamedMaterial \"a\" \"string type\" \"{kind}\" {params}");
        warned_once(&named, &message);
    }
}

#[test]
fn negative_roughness_is_reported() {
    for name in ["roughness", "uroughness", "vroughness"] {
        let message = format!("\"{name}\" is -1; expected a number from 0 up");
        warned_once(&format!("Material \"conductor\" \"float {name}\" -1"), &message);
    }
}

#[test]
fn unsupported_textures_are_gray() {
    let texture = |of: &str| format!("Texture \"t\" \"{of}\" \"ptex\" \"string filename\" \"nowhere.ptx\"");
    let message = "texture \"ptex\" is not supported; using the constant 0.5";
    warned_once(&texture("float"), message);
    warned_once(&texture("spectrum"), message);
    let scene = world(&format!("{} Material \"matte\" \"texture Kd\" \"t\"", texture("color")));
    assert_eq!(reflectance(&scene, 1, at_uv([0.5; 2])), GRAY);
    // Another kind is another warning.
    let wood = texture("float").replace("ptex", "wood");
    let scene = world(&format!("{wood} {wood}\n{}", texture("float")));
    let wood =
        "<text>:2:1: texture \"wood\" is not supported; using the constant 0.5 (and 1 more)".to_owned();
    assert_eq!(scene.warnings, [wood, format!("<text>:3:1: {message}")]);
}

#[test]
fn media_are_reported_once() {
    let scene = scene(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [1 1 1]
         MediumInterface \"\" \"fog\" Camera \"perspective\" WorldBegin
         MediumInterface \"fog\" Volume \"homogeneous\" \"float g\" .5 WorldEnd",
    );
    assert_eq!(scene.warnings, ["<text>:1:1: participating media are not simulated (and 3 more)"]);
}

#[test]
fn an_unused_parameter_is_reported_with_its_directive() {
    for (directive, of) in [
        ("Material \"diffuse\"", "Material \"diffuse\""),
        ("MakeNamedMaterial \"a\" \"string type\" \"diffuse\"", "MakeNamedMaterial"),
        ("LightSource \"point\"", "LightSource \"point\""),
        ("AreaLightSource \"diffuse\"", "AreaLightSource \"diffuse\""),
        ("Texture \"t\" \"float\" \"mix\"", "Texture \"mix\""),
    ] {
        let shining = format!("{directive}\n  \"float shine\" 1");
        let scene = world(&format!("{shining} {shining} {directive} \"float gloss\"\n\n 1"));
        let gloss = shining.find('\n').unwrap() + "  \"float shine\" 1  ".len();
        assert_eq!(
            scene.warnings,
            [
                format!("<text>:3:3: parameter \"shine\" of {of} is not used (and 1 more)"),
                format!("<text>:4:{}: parameter \"gloss\" of {of} is not used", gloss + 1),
            ]
        );
    }
    let scene = scene("Film \"rgb\" \"float shine\" 1\nCamera \"perspective\" \"float shine\" 1 WorldBegin");
    assert_eq!(
        scene.warnings,
        [
            "<text>:2:22: parameter \"shine\" of Camera \"perspective\" is not used",
            "<text>:1:12: parameter \"shine\" of Film \"rgb\" is not used",
        ]
    );
}

#[test]
fn a_warning_may_be_located_in_an_included_file() {
    let (folder, main) = folder(&[
        ("main.pbrt", "WorldBegin Include \"a.pbrt\"\nMaterial \"disney\""),
        ("a.pbrt", "\n  Material \"disney\""),
    ]);
    let place = folder.path().join("a.pbrt").display().to_string();
    let expected =
        format!("{place}:2:3: material \"disney\" is not supported; using \"diffuse\" (and 1 more)");
    assert_eq!(read(&main).unwrap().warnings, [expected]);
}
