//! Differences of pbrt-v2 and v3 from v4, and detection of the dialect.

use glam::{Vec2, Vec3};

use super::{error, folder, scene, world};
use crate::scene::pbrt::{Dialect, read};
use crate::scene::texture::TexturePoint;
use crate::scene::{Light, MaterialKind, MeshTangents, Scene, Shape};

/// What a v3 file says of a world, read as such.
fn v3_world(text: &str) -> Scene {
    scene(&format!("Integrator \"path\" WorldBegin {text} WorldEnd"))
}

#[test]
fn alpha_is_binary_in_the_older_dialects() {
    let mask = "Texture \"m\" \"float\" \"checkerboard\" \"float tex1\" 0 \"float tex2\" .3";
    let shape = "Shape \"sphere\" \"texture alpha\" \"m\"";
    for (scene, elsewhere) in
        [(v3_world(&format!("{mask} {shape}")), 1.0), (world(&format!("{mask} {shape}")), 0.3)]
    {
        let alpha = scene.primitives[0].alpha.expect("a mask");
        let at =
            |u| scene.textures.float(alpha, TexturePoint { uv: Vec2::new(u, 0.5), position: Vec3::ZERO });
        assert_eq!([at(0.5), at(1.5)], [0.0, elsewhere]);
    }
    let opaque = "Shape \"sphere\" \"float alpha\" .5";
    assert_eq!(v3_world(opaque).primitives[0].alpha, None);
    assert!(world(opaque).primitives[0].alpha.is_some());
}

#[test]
fn solid_and_planar_textures_of_the_older_dialects_use_world_space() {
    let texture = |kind: &str| {
        format!(
            "Scale 2 2 2 Texture \"t\" \"float\" \"checkerboard\" {kind} \"float tex1\" 0 \"float tex2\" 1
             Shape \"sphere\" \"texture alpha\" \"t\""
        )
    };
    let value = |scene: &Scene, x: f32| {
        let alpha = scene.primitives[0].alpha.expect("a texture");
        let position = Vec3::new(x, 0.1, 0.1);
        scene.textures.float(alpha, TexturePoint { uv: Vec2::ZERO, position })
    };
    // Of x = 0.6, the transform makes 1.2 and its inverse 0.3; of 1.6 its inverse makes 0.8.
    let solid = texture("\"integer dimension\" 3");
    let (old, new) = (v3_world(&solid), world(&solid));
    assert_eq!([value(&old, 0.6), value(&new, 0.6)], [1.0, 0.0]);
    let planar = texture("\"string mapping\" \"planar\"");
    let (old, new) = (v3_world(&planar), world(&planar));
    assert_eq!([value(&old, 1.6), value(&new, 1.6)], [1.0, 0.0]);
}

#[test]
fn exposure_is_proportional_to_the_shutter_interval() {
    let scale = |text: &str| scene(&format!("{text} WorldBegin")).film.scale;
    let iso = "Film \"rgb\" \"float iso\" 10000";
    assert_eq!(scale(&format!("Camera \"perspective\" \"float shutterclose\" .01 {iso}")), 1.0);
    assert_eq!(scale(&format!("Camera \"perspective\" \"float shutterclose\" 0 {iso}")), 100.0);
    let old = "Integrator \"path\" Camera \"perspective\" \"float shutterclose\" .01 WorldBegin WorldEnd";
    assert_eq!(scene(old).film.scale, 1.0);
}

#[test]
fn media_distinguish_v3_from_v2() {
    let default_height = |text: &str| scene(&format!("{text} WorldBegin WorldEnd")).film.height;
    assert_eq!(default_height("MediumInterface \"\" \"\""), default_height("Integrator \"path\""));
    assert_ne!(default_height("MediumInterface \"\" \"\""), default_height(""));
}

#[test]
fn shapes_may_override_material_parameters() {
    let red = "Shape \"sphere\" \"color Kd\" [1 0 0]";
    let of = |text: &str, shape: usize| {
        let v2 = scene(&format!("SurfaceIntegrator \"path\" WorldBegin {text} WorldEnd"));
        [v3_world(text), v2].map(|scene| {
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            let MaterialKind::Diffuse { reflectance } =
                scene.materials[scene.primitives[shape].material.0 as usize].kind
            else {
                panic!("{text}")
            };
            scene.textures.constant_rgb(reflectance).unwrap()
        })
    };
    assert_eq!(of(red, 0), [Vec3::X; 2]);
    assert_eq!(
        of(&format!("Material \"matte\" \"color Kd\" [0 1 0] {red} Shape \"sphere\""), 0),
        [Vec3::X; 2]
    );
    assert_eq!(
        of(&format!("Material \"matte\" \"color Kd\" [0 1 0] {red} Shape \"sphere\""), 1),
        [Vec3::Y; 2]
    );
    // Only v3 remembers what a material with a name was made of.
    let named = format!("MakeNamedMaterial \"a\" \"string type\" \"matte\" NamedMaterial \"a\" {red}");
    let named_colour = |scene: Scene| {
        let MaterialKind::Diffuse { reflectance } =
            scene.materials[scene.primitives[0].material.0 as usize].kind
        else {
            panic!()
        };
        (scene.textures.constant_rgb(reflectance).unwrap(), scene.warnings.len())
    };
    assert_eq!(named_colour(v3_world(&named)), (Vec3::X, 0));
    assert_eq!(named_colour(scene(&format!("WorldBegin {named} WorldEnd"))), (Vec3::splat(0.5), 1));
}

#[test]
fn unknown_shape_parameters_make_no_material() {
    let text = "Material \"matte\" Shape \"sphere\" \"color Ks\" [1 0 0] \"float radius\" 2";
    let scene = v3_world(text);
    assert_eq!((scene.materials.len(), scene.warnings.len()), (2, 1));
    assert!(scene.warnings[0].contains("\"Ks\" of Shape \"sphere\" is not used"), "{:?}", scene.warnings);
    // A part of it may be.
    let scene = v3_world(&text.replace("\"float radius\"", "\"float sigma\""));
    assert!(matches!(scene.materials[2].kind, MaterialKind::OrenNayar { .. }));
    assert_eq!((scene.materials.len(), scene.warnings.len()), (3, 1));
    // v4 has no such thing.
    let scene = world("Material \"diffuse\" Shape \"sphere\" \"rgb reflectance\" [1 0 0]");
    assert_eq!((scene.materials.len(), scene.warnings.len()), (2, 1));
}

#[test]
fn spectra_of_the_older_dialects_may_be_unsorted() {
    let light = |samples: &str| format!("LightSource \"point\" \"spectrum I\" [{samples}]");
    let intensity = |text: &str| match v3_world(text).lights[..] {
        [Light::Point { intensity, .. }] => intensity,
        ref other => panic!("{other:?}"),
    };
    let rising = intensity(&light("400 1 550.5 1 550.5001 5 700 5"));
    for samples in ["700 5 400 1 550.5001 5 550.5 1", "400 1 550.5 1 550.5 5 700 5"] {
        assert!((intensity(&light(samples)) / rising - 1.0).abs().max_element() < 1e-2, "{samples}");
        assert!(error(&format!("WorldBegin {}", light(samples))).message.contains("rising"), "{samples}");
    }
}

#[test]
fn the_dialect_may_be_detected_in_an_included_file() {
    let of = |files: &[(&str, &str)]| {
        let (_folder, main) = folder(files);
        read(&main).unwrap().dialect.unwrap()
    };
    let header = ("head.pbrt", "Integrator \"path\"");
    let tail = ("tail.pbrt", "WorldEnd");
    let both = ("main.pbrt", "Include \"head.pbrt\" WorldBegin Include \"tail.pbrt\"");
    assert_eq!(of(&[("main.pbrt", "Include \"head.pbrt\" WorldBegin WorldEnd"), header]), Dialect::V3);
    assert_eq!(of(&[both, header, tail]), Dialect::V3);
    assert_eq!(of(&[both, ("head.pbrt", "SurfaceIntegrator \"path\""), tail]), Dialect::V2);
    assert_eq!(of(&[both, header, ("tail.pbrt", "Identity")]), Dialect::V4);
    let import = ("main.pbrt", "WorldBegin Import \"a.pbrt\"");
    assert_eq!(of(&[import, ("a.pbrt", "Include \"tail.pbrt\""), tail]), Dialect::V2);
}

#[test]
fn the_older_dialects_mix_by_colour_textures() {
    let scene = v3_world(
        "Texture \"c\" \"color\" \"checkerboard\" \"rgb tex1\" [0 .3 .6] \"rgb tex2\" [1 1 1]
         MakeNamedMaterial \"a\" \"string type\" \"matte\" MakeNamedMaterial \"b\" \"string type\" \"mirror\"
         Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\" \"texture amount\" \"c\"
         Shape \"sphere\"",
    );
    assert!(
        scene.warnings.iter().any(|warning| warning.to_string().contains("mean")),
        "{:?}",
        scene.warnings
    );
    let material = &scene.materials[scene.primitives[0].material.0 as usize].kind;
    let MaterialKind::Mix { amount, .. } = material else { panic!("{material:?}") };
    let at = |u| scene.textures.float(*amount, TexturePoint { uv: Vec2::new(u, 0.5), position: Vec3::ZERO });
    assert!((at(0.5) - 0.3).abs() < 1e-6 && at(1.5) == 1.0);
}

#[test]
fn exinfinite_is_an_infinite_light_of_v3() {
    let lights = v3_world("LightSource \"exinfinite\" \"rgb L\" [1 2 3]").lights;
    assert!(matches!(lights[..], [Light::Environment(_)]), "{lights:?}");
}

#[test]
fn unknown_textures_of_the_older_dialects_stand_for_the_default() {
    let text = "\nMaterial \"matte\" \"texture Kd\" \"a\" \"texture bumpmap\" \"b\"
        Shape \"sphere\" \"texture alpha\" \"c\"";
    for header in ["SurfaceIntegrator", "Integrator"] {
        let scene = scene(&format!("{header} \"path\" WorldBegin {text} WorldEnd"));
        assert_eq!(scene.warnings.len(), 3, "{:?}", scene.warnings);
        let expected = "<text>:2:18: parameter \"Kd\" is the unknown texture \"a\"; expected a spectrum texture that is \
            defined before; using the default";
        assert_eq!(scene.warnings[0], expected);
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        assert_eq!(scene.textures.constant_rgb(reflectance), Some(Vec3::splat(0.5)));
        assert_eq!((scene.materials[1].displacement, scene.primitives[0].alpha), (None, None));
    }
}

#[test]
fn unknown_materials_of_the_older_dialects_are_matte() {
    let text = "\nMaterial \"glossy\" \"rgb Kd\" [.1 .2 .3]";
    for (header, known) in [("SurfaceIntegrator", "shinymetal"), ("Integrator", "disney")] {
        let scene = scene(&format!("{header} \"path\" WorldBegin {text} WorldEnd"));
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(
            warning.starts_with("<text>:2:1: unknown material \"glossy\"; expected matte, "),
            "{warning}"
        );
        assert!(warning.contains(known) && warning.ends_with("; using \"matte\""), "{warning}");
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        assert_eq!(scene.textures.constant_rgb(reflectance), Some(Vec3::new(0.1, 0.2, 0.3)));
    }
    assert!(error(&format!("WorldBegin {text}")).message.contains("expected diffuse"));
}

#[test]
fn unknown_names_of_the_older_dialects_are_ignored() {
    for (directive, part) in [
        ("LightSource \"sun\" \"rgb L\" [1 1 1]", "unknown light \"sun\""),
        ("AreaLightSource \"glow\" \"rgb L\" [1 1 1] Shape \"sphere\"", "unknown area light \"glow\""),
        ("Shape \"cube\" \"float side\" 1", "unknown shape \"cube\""),
        ("Texture \"t\" \"vector\" \"constant\" \"float value\" 1", "unknown texture type \"vector\""),
        ("ObjectInstance \"tree\"", "unknown object \"tree\""),
        (
            "Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"a\"",
            "material \"a\"",
        ),
    ] {
        let scene = v3_world(&format!("\n {directive}"));
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.starts_with("<text>:2:2: ") && warning.contains(part), "{warning}");
        assert!(!scene.is_lit() && scene.instances.is_empty(), "{directive}");
        assert!(error(&format!("WorldBegin {directive}")).message.contains(part), "{directive}");
    }
}

#[test]
fn shapes_of_the_older_dialects_with_an_error_are_ignored() {
    for shape in [
        "\"plymesh\" \"string filename\" \"nowhere.ply\"",
        "\"trianglemesh\" \"integer indices\" [0 1 2]",
        "\"trianglemesh\" \"point P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]",
    ] {
        let scene = v3_world(&format!("\n Shape {shape} AreaLightSource \"diffuse\" Shape \"sphere\""));
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.starts_with("<text>:2:2: "), "{warning}");
        assert!(warning.ends_with("; the shape is ignored"), "{warning}");
        assert_eq!((scene.primitives.len(), scene.is_lit()), (1, true));
        assert_eq!(error(&format!("WorldBegin Shape {shape}")).line, 1);
    }
}

#[test]
fn constants_replace_the_missing_images_of_the_older_dialects() {
    let text = "\n Texture \"t\" \"color\" \"imagemap\" \"string filename\" \"nowhere.tga\"
        Material \"matte\" \"texture Kd\" \"t\" LightSource \"infinite\" \"string mapname\" \"sky.exr\"";
    // In v3 the value is decoded as sRGB
    for (header, expected) in [("SurfaceIntegrator", 1.0), ("Integrator", 0.214_041)] {
        let scene = scene(&format!("{header} \"path\" WorldBegin {text} WorldEnd"));
        assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
        assert!(scene.warnings[0].starts_with("<text>:2:2: image \"nowhere.tga\": "), "{:?}", scene.warnings);
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        let at = TexturePoint { uv: Vec2::splat(0.3), position: Vec3::ZERO };
        let colour = scene.textures.rgb(reflectance, at);
        assert!((colour - expected).abs().max_element() < 1e-5, "{colour}");
        let sky = scene.textures.images().last().expect("two images");
        assert_eq!((sky.width(), sky.height(), sky.rgb(0, 0)), (1, 1, Vec3::ONE));
    }
}

#[test]
fn misplaced_directives_of_the_older_dialects_are_ignored() {
    let scene = scene(
        "Integrator \"path\" Shape \"sphere\"
         WorldBegin Film \"image\" \"integer xresolution\" 20 Shape \"disk\" WorldEnd",
    );
    assert_eq!(
        scene.warnings,
        [
            "<text>:1:19: misplaced Shape; expected it after WorldBegin; it is ignored",
            "<text>:2:21: misplaced Film; expected it before WorldBegin; it is ignored",
        ]
    );
    assert_eq!((scene.primitives.len(), scene.film.width), (1, 1280));
}

#[test]
fn a_file_has_one_world() {
    let (_folder, main) = folder(&[
        ("main.pbrt", "Include \"a.pbrt\"\n Film \"image\" WorldBegin Shape \"disk\" WorldEnd"),
        ("a.pbrt", "Integrator \"path\" WorldBegin Shape \"sphere\" WorldEnd"),
    ]);
    let scene = read(&main).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.ends_with("main.pbrt:2:2: everything after WorldEnd is ignored"), "{warning}");
    assert_eq!(scene.primitives.len(), 1);
}

#[test]
fn a_redefined_name_counts_until_the_end_of_its_block_in_the_older_dialects() {
    let definition = |kind: &str, value: f64| {
        format!(
            "MakeNamedMaterial \"m\" \"string type\" \"{kind}\"
             Texture \"t\" \"float\" \"constant\" \"float value\" {value}"
        )
    };
    let text = |kinds: [&str; 2]| {
        let [outer, inner] = [definition(kinds[0], 0.0), definition(kinds[1], 0.75)];
        let shape = "NamedMaterial \"m\" Shape \"sphere\" \"texture alpha\" \"t\"";
        format!("{outer} AttributeBegin TransformBegin {inner} TransformEnd {shape} AttributeEnd {shape}")
    };
    let at = TexturePoint { uv: Vec2::ZERO, position: Vec3::ZERO };
    let found = |scene: &Scene, primitive: usize| {
        let primitive = &scene.primitives[primitive];
        let is_glass =
            matches!(scene.materials[primitive.material.0 as usize].kind, MaterialKind::Dielectric { .. });
        (is_glass, primitive.alpha.map(|id| scene.textures.float(id, at)))
    };
    let v3 = v3_world(&text(["matte", "glass"]));
    // Any alpha but 0 is opaque there
    assert_eq!([found(&v3, 0), found(&v3, 1)], [(true, None), (false, Some(0.0))]);
    assert!(v3.warnings.is_empty(), "{:?}", v3.warnings);
    let v4 = world(&text(["diffuse", "dielectric"]));
    assert_eq!([found(&v4, 0), found(&v4, 1)], [(true, Some(0.75)); 2]);
}

#[test]
fn meshes_have_the_tangents_of_their_dialect() {
    let text = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1 0 0 1 0 0 1]";
    for (scene, expected) in
        [(v3_world(text), MeshTangents::Opposite), (world(text), MeshTangents::Perpendicular)]
    {
        let Shape::Mesh(mesh) = &scene.primitives[0].shape else { panic!("a mesh") };
        assert_eq!(mesh.tangents, expected);
    }
}
