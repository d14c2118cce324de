//! The reader as a whole, on small scenes in text and on real ones where they are there.

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use super::{SceneError, read, read_str};
use crate::scene::camera::Projection;
use crate::scene::light::EnvironmentMap;
use crate::scene::texture::TexturePoint;
use crate::scene::{Integrator, Light, MaterialKind, PixelFilter, SamplerKind, Scene, Shape, TriangleMesh};

mod attributes;
mod bump_and_alpha;
mod coordinate_systems;
mod dialects;
mod ignored_input;
mod image_textures;
mod interfaces;
mod lights;
mod older_dialects;
mod overflow;
mod real_scenes;
mod referenced_files;
mod warnings;

fn scene(text: &str) -> Scene {
    read_str(text, Path::new("")).unwrap_or_else(|error| panic!("{error}"))
}

fn error(text: &str) -> SceneError {
    match read_str(text, Path::new("")) {
        Ok(_) => panic!("no error in {text}"),
        Err(error) => error,
    }
}

fn world(text: &str) -> Scene {
    scene(&format!("WorldBegin\n{text}"))
}

fn mesh(scene: &Scene, primitive: usize) -> &TriangleMesh {
    match &scene.primitives[primitive].shape {
        Shape::Mesh(mesh) => mesh,
        other => panic!("{other:?}"),
    }
}

fn triangles(scene: &Scene) -> usize {
    let count = |shape: &Shape| if let Shape::Mesh(mesh) = shape { mesh.indices.len() } else { 0 };
    scene.primitives.iter().map(|primitive| count(&primitive.shape)).sum()
}

/// Files in a folder of their own.
fn folder(files: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let main = folder.path().join(files[0].0);
    (folder, main)
}

const TRIANGLE: &str =
    "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]\n";

#[test]
fn an_empty_scene_has_the_defaults_of_v4() {
    let scene = world("");
    assert_eq!((scene.film.width, scene.film.height), (1280, 720));
    assert_eq!(scene.film.pixel_bounds, [0, 1280, 0, 720]);
    assert_eq!(scene.film.filter, PixelFilter::Gaussian { radius: [1.5; 2], sigma: 0.5 });
    assert_eq!(scene.film.scale, 1.0);
    assert_eq!(scene.integrator, Integrator::Path { max_depth: 5 });
    assert_eq!((scene.sampler, scene.spp), (SamplerKind::Sobol, 16));
    assert_eq!((scene.objects.len(), scene.primitives.len()), (1, 0));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn the_header_is_read_in_any_order() {
    let scene = scene(
        "Sampler \"independent\" \"integer pixelsamples\" 7
         Camera \"perspective\" \"float fov\" 60 \"float lensradius\" .1 \"float focaldistance\" 3
           \"float shutteropen\" .25 \"float shutterclose\" .75
         Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 400 \"float iso\" 200
           \"float exposuretime\" 2 \"float cropwindow\" [.25 .5 0 1] \"string filename\" \"a.exr\"
         PixelFilter \"mitchell\" \"float B\" .5
         Integrator \"volpath\" \"integer maxdepth\" 9
         WorldBegin",
    );
    let camera = &scene.camera;
    let Projection::Perspective { tan_half_fov } = camera.projection else { panic!() };
    assert!((tan_half_fov - 0.57735).abs() < 1e-5);
    assert_eq!(camera.screen_window, [-1.0, 1.0, -2.0, 2.0]);
    assert_eq!([camera.lens_radius, camera.focal_distance], [0.1, 3.0]);
    assert_eq!([camera.shutter_open, camera.shutter_close], [0.25, 0.75]);
    assert_eq!(scene.film.pixel_bounds, [50, 100, 0, 400]);
    assert_eq!(scene.film.scale, 4.0);
    assert_eq!(scene.film.filename.as_deref(), Some("a.exr"));
    let third = 1.0 / 3.0;
    assert_eq!(scene.film.filter, PixelFilter::Mitchell { radius: [2.0; 2], b: 0.5, c: third });
    assert_eq!(scene.integrator, Integrator::Path { max_depth: 9 });
    assert_eq!((scene.sampler, scene.spp), (SamplerKind::Independent, 7));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn render_space_is_at_the_camera_and_keeps_precision() {
    let scene = scene(&format!(
        "LookAt 1000000 0 0  1000001 0 0  0 0 1 Camera \"perspective\" WorldBegin
         Translate 1000002 0 0 Scale .001 .001 .001 {TRIANGLE}"
    ));
    assert_eq!(scene.origin, DVec3::new(1e6, 0.0, 0.0));
    let mesh = mesh(&scene, 0);
    assert!((mesh.positions[0] - Vec3::new(2.0, 0.0, 0.0)).length() < 1e-6);
    assert!((mesh.positions[1] - mesh.positions[0] - Vec3::new(0.001, 0.0, 0.0)).length() < 1e-6);
    // The camera looks along world x, which is its z.
    let forward = scene.camera.to_render.at(0.0).transform_vector3(Vec3::Z);
    assert!((forward - Vec3::X).length() < 1e-6);
    assert!(scene.camera.to_render.at(0.0).translation.length() < 1e-6);
}

#[test]
fn transforms_concatenate_as_in_pbrt() {
    let scene = world(&format!(
        "Translate 10 0 0 Rotate 90 0 0 1 Scale 2 2 2 CoordinateSystem \"here\" {TRIANGLE}
         Identity {TRIANGLE}
         CoordSysTransform \"here\" {TRIANGLE}
         Transform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1] ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 1 1 1 1] {TRIANGLE}"
    ));
    let second_vertex = |i| mesh(&scene, i).positions[1];
    assert!((second_vertex(0) - Vec3::new(10.0, 2.0, 0.0)).length() < 1e-6);
    assert_eq!(second_vertex(1), Vec3::X);
    assert_eq!(second_vertex(2), second_vertex(0));
    assert_eq!(second_vertex(3), Vec3::new(7.0, 7.0, 8.0));
}

#[test]
fn blocks_restore_the_graphics_state() {
    let scene = world(&format!(
        "Material \"diffuse\" AttributeBegin Translate 1 0 0 ReverseOrientation Material \"dielectric\" AttributeEnd
         TransformBegin Translate 1 0 0 TransformEnd {TRIANGLE}"
    ));
    let primitive = &scene.primitives[0];
    assert_eq!(mesh(&scene, 0).positions[0], Vec3::ZERO);
    assert!(!primitive.flip_normal);
    assert!(matches!(scene.materials[primitive.material.0 as usize].kind, MaterialKind::Diffuse { .. }));
}

#[test]
fn crossed_blocks_are_an_error_in_v4_only() {
    let crossed = format!(
        "WorldBegin AttributeBegin ObjectBegin \"a\" AttributeBegin Translate 1 0 0 {TRIANGLE}
         AttributeEnd AttributeEnd ObjectEnd ObjectInstance \"a\""
    );
    let error = error(&crossed);
    assert_eq!((error.line, error.column), (3, 23));
    assert!(error.message.contains("AttributeEnd inside ObjectBegin of line 1"), "{error}");
    let scene = scene(&format!("{crossed} WorldEnd"));
    assert_eq!((scene.primitives.len(), scene.instances.len()), (1, 1));
}

#[test]
fn mirroring_and_reversal_flip_the_normal_and_cancel_out() {
    let scene = world(&format!(
        "{TRIANGLE} Scale -1 1 1 {TRIANGLE} ReverseOrientation {TRIANGLE} Scale -1 1 1 {TRIANGLE}"
    ));
    let flips: Vec<_> = scene.primitives.iter().map(|primitive| primitive.flip_normal).collect();
    assert_eq!(flips, [false, true, false, true]);
}

#[test]
fn objects_appear_at_their_instances() {
    let scene = scene(&format!(
        "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" WorldBegin
         ObjectBegin \"tree\" Translate 100 0 0 {TRIANGLE} Translate 0 1 0 {TRIANGLE} ObjectEnd
         {TRIANGLE}
         AttributeBegin Translate 0 0 3 ObjectInstance \"tree\" AttributeEnd
         Rotate 90 0 0 1 ObjectInstance \"tree\""
    ));
    assert_eq!(scene.objects.len(), 2);
    assert_eq!((scene.objects[0].primitives.clone(), scene.objects[1].primitives.clone()), (0..1, 1..3));
    assert_eq!(scene.instances.len(), 2);
    let vertex = |instance: usize, primitive: usize| {
        let to_render = scene.instances[instance].transform.at(0.0);
        to_render.transform_point3(mesh(&scene, primitive).positions[0])
    };
    // Render space is world space moved by 5 along z.
    assert!((vertex(0, 1) - Vec3::new(100.0, 0.0, 8.0)).length() < 1e-4);
    assert!((vertex(0, 2) - Vec3::new(100.0, 1.0, 8.0)).length() < 1e-4);
    assert!((vertex(1, 2) - Vec3::new(-1.0, 100.0, 5.0)).length() < 1e-4);
}

#[test]
fn v4_allows_forward_references_to_materials_and_objects() {
    let late = format!(
        "NamedMaterial \"m\" {TRIANGLE} Translate 1 0 0 ObjectInstance \"o\" Identity
         MakeNamedMaterial \"a\" \"string type\" \"dielectric\"
         MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"a\"]
         NamedMaterial \"m\" {TRIANGLE} ObjectBegin \"o\" {TRIANGLE} ObjectEnd"
    );
    let scene = world(&late);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let [first, second] = [0, 1].map(|i| scene.primitives[i].material);
    assert_eq!((first, scene.materials.len()), (second, 3));
    let material = &scene.materials[first.0 as usize];
    let MaterialKind::Mix { first: part, .. } = material.kind else { panic!("{material:?}") };
    assert_eq!((material.name.as_str(), scene.materials[part.0 as usize].name.as_str()), ("m", "a"));
    assert_eq!((scene.instances.len(), scene.instances[0].object), (1, 1));
    assert_eq!(scene.instances[0].transform.at(0.0).translation, Vec3::X.into());

    // What is never made is an error at its first name.
    let error_of = |text: &str| error(&format!("WorldBegin\n{text}"));
    let never = error_of(
        "NamedMaterial \"b\" Shape \"sphere\" NamedMaterial \"a\" Shape \"disk\"\nNamedMaterial \"b\"",
    );
    assert_eq!((never.line, never.column), (2, 1));
    assert!(never.message.contains("material \"b\""), "{never}");
    // Without a shape it does no harm.
    assert!(world("NamedMaterial \"a\" Material \"diffuse\" Shape \"sphere\"").warnings.is_empty());
    // The older dialects ignore names that are not yet defined.
    let older = read_str(&format!("WorldBegin {late} WorldEnd"), Path::new("")).unwrap();
    assert_eq!((older.instances.len(), older.warnings.len()), (0, 2), "{:?}", older.warnings);
}

#[test]
fn a_mix_of_v4_may_name_later_materials_but_not_itself() {
    let mix = |name: &str, first: &str, second: &str| {
        let parts = format!("\"string materials\" [\"{first}\" \"{second}\"]");
        format!("MakeNamedMaterial \"{name}\" \"string type\" \"mix\" {parts}\n")
    };
    let glass = |name: &str| format!("MakeNamedMaterial \"{name}\" \"string type\" \"dielectric\"\n");
    let scene = world(&(mix("m", "n", "a") + &mix("n", "a", "a") + &glass("a")));
    let index = |name: &str| scene.materials.iter().position(|material| material.name == name).unwrap();
    let parts = |name: &str| match scene.materials[index(name)].kind {
        MaterialKind::Mix { first, second, .. } => [first.0 as usize, second.0 as usize],
        ref other => panic!("{other:?}"),
    };
    assert_eq!(scene.materials.len(), 4);
    assert_eq!((parts("m"), parts("n")), ([index("n"), index("a")], [index("a"); 2]));

    let error_of = |text: &str| error(&format!("WorldBegin\n{text}"));
    for cycle in [mix("m", "m", "m"), mix("m", "n", "n") + &mix("n", "m", "m")] {
        let error = error_of(&cycle);
        assert!(error.line == 2 && error.message.contains("nested too deep"), "{error}");
    }
    assert!(error_of(&mix("m", "x", "x")).message.contains("material \"x\""));

    // Each of several mixes is made of the next
    let nested = |levels: usize| {
        let next = |i: usize| (i + 1).to_string();
        let mixes: String = (0..levels).map(|i| mix(&i.to_string(), &next(i), &next(i))).collect();
        mixes + &glass(&levels.to_string())
    };
    assert_eq!(world(&nested(8)).materials.len(), 10);
    assert!(error_of(&nested(9)).message.contains("nested too deep"));
}

#[test]
fn a_distant_object_keeps_its_precision() {
    let scene = world(&format!(
        "ObjectBegin \"a\" Translate 1e8 0 0 {TRIANGLE} ObjectEnd Translate -1e8 0 0 ObjectInstance \"a\""
    ));
    assert_eq!(mesh(&scene, 0).positions[1], Vec3::X);
    assert_eq!(scene.instances[0].transform.at(0.0).translation, Vec3::ZERO.into());
}

#[test]
fn a_moving_shape_becomes_a_moving_instance() {
    let scene = world(&format!(
        "ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 3 0 0 ActiveTransform All
         AreaLightSource \"diffuse\" {TRIANGLE} Identity {TRIANGLE}"
    ));
    assert_eq!((scene.objects.len(), scene.instances.len()), (2, 1));
    let at = |time| scene.instances[0].transform.at(time).transform_point3(mesh(&scene, 1).positions[0]);
    assert_eq!([at(0.0), at(0.5), at(1.0)].map(|p| p.x), [1.0, 2.0, 3.0]);
    let lights: Vec<_> = scene.primitives.iter().map(|p| p.area_light.is_some()).collect();
    assert_eq!(lights, [true, false]);
    assert!(scene.warnings[0].contains("area lights on moving"), "{:?}", scene.warnings);
}

#[test]
fn v_0_is_the_bottom_row_except_in_v2() {
    let (folder, _) = folder(&[("unused", "")]);
    let pixels = vec![255, 0]; // White above black.
    let image = image::GrayImage::from_raw(1, 2, pixels).unwrap();
    image.save(folder.path().join("a.png")).unwrap();
    let text = "WorldBegin Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\"
        Material \"matte\" \"texture Kd\" \"t\" Material \"diffuse\" \"texture reflectance\" \"t\"";
    let value = |text: &str, v| {
        let scene = read_str(text, folder.path()).unwrap();
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        scene.textures.rgb(reflectance, TexturePoint { uv: glam::Vec2::new(0.5, v), position: Vec3::ZERO }).x
    };
    assert_eq!((value(text, 0.25), value(text, 0.75)), (0.0, 1.0));
    let v3 = format!("Integrator \"path\" {text} WorldEnd");
    assert_eq!((value(&v3, 0.25), value(&v3, 0.75)), (0.0, 1.0));
    let v2 = format!("Renderer \"sampler\" {text} WorldEnd");
    assert_eq!((value(&v2, 0.25), value(&v2, 0.75)), (1.0, 0.0));
}

#[test]
fn an_environment_image_is_square_in_v4_and_shares_the_pool() {
    let (folder, _) = folder(&[("unused", "")]);
    for (name, height) in [("a.exr", 2), ("b.exr", 1)] {
        exr::prelude::write_rgb_file(folder.path().join(name), 2, height, |_, _| (1f32, 2f32, 3f32)).unwrap();
    }
    let read = |name: &str| {
        let light = format!("LightSource \"infinite\" \"string filename\" \"{name}\"");
        read_str(&format!("WorldBegin {light} {light}"), folder.path())
    };
    let scene = read("a.exr").unwrap();
    let maps: Vec<_> = scene
        .lights
        .iter()
        .map(|light| match light {
            Light::Environment(environment) => environment.map,
            other => panic!("{other:?}"),
        })
        .collect();
    let Some(EnvironmentMap::EqualArea(image)) = maps[0] else { panic!() };
    assert_eq!(maps[0], maps[1]);
    assert_eq!(scene.textures.image(image).rgb(1, 1), Vec3::new(1.0, 2.0, 3.0));
    assert!(read("b.exr").unwrap_err().message.contains("2x1"));
}

#[test]
fn errors_have_a_location_and_a_cause() {
    let cases = [
        ("WorldBegin\n  Sphere", (2, 3), "`Sphere`"),
        ("Shape \"sphere\"", (1, 1), "after WorldBegin"),
        ("WorldBegin Camera \"perspective\"", (1, 12), "before WorldBegin"),
        ("WorldBegin\nShape \"cube\"", (2, 1), "shape \"cube\""),
        ("WorldBegin Shape \"sphere\"\n \"float radius\" \"x\"", (2, 2), "\"radius\" is a list of strings"),
        ("WorldBegin Shape \"sphere\" \"float radius\" -1", (1, 27), "a number above 0"),
        ("WorldBegin Translate 1 2 Scale 1 1 1", (1, 26), "`Scale` after Translate"),
        ("WorldBegin Translate [1 2 3 4]", (1, 29), "`]` after 3 numbers"),
        ("WorldBegin NamedMaterial \"x\" Shape \"sphere\"", (1, 12), "material \"x\""),
        ("WorldBegin Material \"diffuse\" \"texture reflectance\" \"x\"", (1, 31), "texture \"x\""),
        ("WorldBegin ObjectInstance \"x\"", (1, 12), "object \"x\""),
        ("WorldBegin\n\nAttributeBegin", (3, 1), "AttributeBegin without an end"),
        ("WorldBegin Scale 1 0 1 Shape \"sphere\"", (1, 24), "singular"),
        ("Scale 1 0 1 Camera \"perspective\" WorldBegin", (1, 13), "singular"),
        ("Camera \"fisheye\" WorldBegin", (1, 1), "camera \"fisheye\""),
        ("Film \"rgb\" \"integer xresolution\" 1000000000 WorldBegin", (1, 12), "1000000000"),
        (
            "Film \"rgb\" \"integer xresolution\" 60000 \"integer yresolution\" 60000 WorldBegin",
            (1, 1),
            "pixels",
        ),
        ("WorldBegin LookAt 0 0 0 0 0 1 0 0 1", (1, 12), "LookAt"),
        (
            "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]",
            (1, 12),
            "index 3",
        ),
        (
            "WorldBegin Scale 10 1 1 Shape \"trianglemesh\" \"point3 P\" [0 0 0 1e38 0 0 0 1 0]",
            (1, 25),
            "vertex 1",
        ),
        ("", (0, 0), "no WorldBegin"),
    ];
    for (text, loc, part) in cases {
        let error = error(text);
        assert_eq!((error.line, error.column), loc, "{error} in {text}");
        assert!(error.message.contains(part), "{error} in {text}");
    }
}

#[test]
fn unused_input_is_reported_once() {
    let scene = world(
        "Shape \"sphere\" \"float size\" 1\nShape \"sphere\" \"float size\" 2 Shape \"nurbs\" \"float width\" 1
         MediumInterface \"a\" \"\"",
    );
    assert_eq!(
        scene.warnings,
        [
            "<text>:2:16: parameter \"size\" of Shape \"sphere\" is not used (and 1 more)",
            "<text>:3:31: shape \"nurbs\" is not supported and is ignored",
            "<text>:4:10: participating media are not simulated",
        ]
    );
}

#[test]
fn errors_in_included_files_name_the_file() {
    let (_folder, main) = folder(&[
        ("main.pbrt", "WorldBegin Include \"a.pbrt\" Import \"b.pbrt\" Shape \"sphere\""),
        ("a.pbrt", "Translate 1 0 0"),
        ("b.pbrt", "Translate 1 0 0 Shape \"sphere\""),
    ]);
    let scene = read(&main).unwrap();
    assert_eq!(scene.source, main.display().to_string());
    let x: Vec<_> = scene
        .primitives
        .iter()
        .map(|primitive| match &primitive.shape {
            Shape::Sphere(sphere) => sphere.to_object.translation.x,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(x, [2.0, 1.0]);

    let (_folder, main) = folder(&[("main.pbrt", "Include \"a.pbrt\""), ("a.pbrt", "\n Oops")]);
    let error = read(&main).unwrap_err();
    assert!(error.file.ends_with("a.pbrt"));
    assert_eq!((error.line, error.column), (2, 2));
}

#[test]
fn cyclic_and_missing_includes_are_errors() {
    let (_folder, main) =
        folder(&[("main.pbrt", "\nInclude \"a.pbrt\""), ("a.pbrt", "Include \"main.pbrt\"")]);
    let error = read(&main).unwrap_err();
    assert!(error.file.ends_with("a.pbrt") && error.message.contains("being read already"), "{error}");

    let (_folder, main) = folder(&[("main.pbrt", "Include \"nowhere.pbrt\"")]);
    assert!(read(&main).unwrap_err().to_string().contains("nowhere.pbrt"));
    let error = read(Path::new("nowhere.pbrt")).unwrap_err();
    assert!(error.to_string().starts_with("nowhere.pbrt: cannot be read"), "{error}");
}

#[test]
fn missing_and_broken_meshes_name_their_file() {
    let shape = "Shape \"plymesh\" \"string filename\" \"a.ply\"";
    let error = error(&format!("WorldBegin {shape}"));
    assert_eq!((error.line, error.column), (1, 12));
    assert!(error.message.contains("a.ply"));

    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n";
    let main = format!("WorldBegin {shape}");
    let (_folder, main) = folder(&[("main.pbrt", main.as_str()), ("a.ply", ply)]);
    let error = read(&main).unwrap_err();
    assert!(error.message.contains("a.ply") && error.message.contains("vertex 1 is not finite"), "{error}");
}

#[test]
fn deep_textures_and_mixes_are_errors() {
    let mut text = String::from("WorldBegin Texture \"t\" \"float\" \"checkerboard\"\n");
    for _ in 0..100 {
        text += "Texture \"t\" \"float\" \"scale\" \"texture tex\" \"t\"\n";
    }
    assert!(error(&text).message.contains("deep"));
    let mut text = String::from("WorldBegin MakeNamedMaterial \"m\" \"string type\" \"diffuse\"\n");
    for _ in 0..100 {
        text += "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]\n";
    }
    assert!(error(&text).message.contains("deep"));
}

#[test]
fn damaged_text_is_an_error_or_a_scene_but_never_a_panic() {
    let text = format!(
        "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 60 Film \"rgb\" \"integer xresolution\" [64]
         Sampler \"halton\" \"integer pixelsamples\" 4 PixelFilter \"sinc\" Integrator \"path\" WorldBegin
         LightSource \"infinite\" \"blackbody L\" [5000] Attribute \"shape\" \"float radius\" 2
         Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 2 \"spectrum tex1\" [400 .1 700 .9]
         MakeNamedMaterial \"m\" \"string type\" \"coatedconductor\" \"texture reflectance\" \"t\"
         AttributeBegin Rotate 30 0 1 0 NamedMaterial \"m\" Shape \"disk\" \"float phimax\" 90 AttributeEnd
         ObjectBegin \"o\" ActiveTransform EndTime Scale 1 2 3 {TRIANGLE} ObjectEnd ObjectInstance \"o\"
         Shape \"loopsubdiv\" \"integer levels\" 1 \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]"
    );
    let intact = scene(&text);
    assert!(intact.warnings.is_empty(), "{:?}", intact.warnings);
    let mut outcomes = [0, 0];
    for seed in 0..3000u64 {
        // A few bytes replaced by others of the text, or the end cut off.
        let mut bytes = text.clone().into_bytes();
        let mut state = seed;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for _ in 0..1 + random(3) {
            let (from, to) = (random(bytes.len()), random(bytes.len()));
            bytes[to] = bytes[from];
        }
        if seed % 5 == 0 {
            bytes.truncate(random(bytes.len()));
        }
        let result = read_str(&String::from_utf8(bytes).unwrap(), Path::new("nowhere"));
        outcomes[usize::from(result.is_ok())] += 1;
    }
    assert!(outcomes[0] > 500 && outcomes[1] > 100, "{outcomes:?}");
}
