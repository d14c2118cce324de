//! Scenes beside the repository.

use super::*;

/// A scene beside the repository; `None`, with a line, where there is none.
fn real_scene(path: &str) -> Option<Scene> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/scenes")).join(path);
    if !path.exists() {
        println!("skipped: {} is missing", path.display());
        return None;
    }
    Some(read(&path).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn the_cornell_box_is_read() {
    let Some(scene) = real_scene("pbrt-v4/cornell-box/scene-v4.pbrt") else { return };
    assert_eq!(triangles(&scene), 36);
    assert_eq!((scene.film.width, scene.film.height, scene.spp), (1024, 1024, 64));
    assert_eq!(scene.integrator, Integrator::Path { max_depth: 65 });
    assert_eq!(scene.primitives.iter().filter(|p| p.area_light.is_some()).count(), 1);
    assert_eq!(
        scene.effects().names(),
        ["area-lights", "visible-emission", "second-hit", "indirect", "varied-albedo"]
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn the_door_ajar_is_read() {
    let Some(scene) = real_scene("pbrt-v4/veach-ajar/scene-v4-dof.pbrt") else { return };
    // 382 690 are stored; 62 of the mesh Mesh015 have two vertices at one place.
    assert_eq!(triangles(&scene), 382_690 - 62);
    assert!(scene.effects().lens && scene.effects().glossy && scene.effects().specular);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_reflectance_above_one_is_reported_with_its_material() {
    let of = |value: &str| {
        let material =
            format!("MakeNamedMaterial \"paint\" \"string type\" \"diffuse\" \"rgb reflectance\" [{value}]");
        scene(&format!("WorldBegin\n{material}")).warnings
    };
    assert!(of("1 1 1").is_empty());
    let warnings = of("0.5 1.5 0");
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains(":2:1:") && warnings[0].contains("\"paint\""), "{warnings:?}");
}
