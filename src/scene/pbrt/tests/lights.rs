//! Positions, maps and scales of lights.

use glam::Vec3;

use super::image_textures::dialect_world;
use super::{mesh, scene};
use crate::scene::Light;
use crate::scene::light::{Environment, EnvironmentMap};
use crate::scene::pbrt::dialect::Dialect::{self, V2, V3, V4};

/// The colour of each light of a world.
fn colours(dialect: Dialect, text: &str) -> Vec<Vec3> {
    let colour = |light: &Light| match light {
        Light::Point { intensity, .. }
        | Light::Spot { intensity, .. }
        | Light::Projector { intensity, .. } => *intensity,
        Light::Distant { radiance, .. } => *radiance,
        Light::Environment(environment) => environment.scale,
    };
    dialect_world(dialect, "".as_ref(), text).lights.iter().map(colour).collect()
}

/// The light of a folder with one image, 2 by `height`, of the colour 1, 2, 3.
fn environment(dialect: Dialect, height: usize, params: &str) -> (Environment, Vec<Vec3>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    exr::prelude::write_rgb_file(path, 2, height, |_, _| (1f32, 2f32, 3f32)).unwrap();
    let scene = dialect_world(dialect, folder.path(), &format!("LightSource \"infinite\" {params}"));
    let Light::Environment(environment) = &scene.lights[0] else { panic!() };
    (environment.clone(), scene.textures.images().iter().map(|image| image.rgb(1, 0)).collect())
}

#[test]
fn environment_maps_are_lat_long_in_the_older_dialects_and_square_in_v4() {
    let file = Vec3::new(1.0, 2.0, 3.0);
    for dialect in [V2, V3] {
        let (light, images) = environment(dialect, 1, "\"string mapname\" \"sky.exr\"");
        assert!(matches!(light.map, Some(EnvironmentMap::LatLong(_))), "{light:?}");
        assert_eq!((light.scale, images), (Vec3::ONE, vec![file]));
    }
    let (light, images) = environment(V4, 2, "\"string filename\" \"sky.exr\"");
    assert!(matches!(light.map, Some(EnvironmentMap::EqualArea(_))), "{light:?}");
    assert_eq!((light.scale, images), (Vec3::ONE, vec![file]));
}

#[test]
fn older_point_lights_are_moved_and_neither_rotated_nor_scaled() {
    for (dialect, expected) in [(V2, [2.0, 0.0, 3.0]), (V3, [2.0, 0.0, 3.0]), (V4, [3.0, 0.0, 3.0])] {
        let text = "Translate 1 0 3 Scale 2 2 2 LightSource \"point\" \"point3 from\" [ 1 0 0 ]";
        let scene = dialect_world(dialect, "".as_ref(), text);
        let Light::Point { position, .. } = scene.lights[0] else { panic!() };
        assert_eq!(position.as_dvec3() + scene.origin, glam::DVec3::from(expected), "{dialect:?}");
    }
}

#[test]
fn a_mirrored_sphere_that_is_a_light_shines_outwards() {
    let flips = |dialect, light: &str| {
        let text = format!("Scale -1 1 1 {light} Shape \"sphere\"");
        dialect_world(dialect, "".as_ref(), &text).primitives[0].flip_normal
    };
    for dialect in [V2, V3, V4] {
        assert!(!flips(dialect, "AreaLightSource \"diffuse\""), "{dialect:?}");
        assert!(flips(dialect, "ReverseOrientation AreaLightSource \"diffuse\""), "{dialect:?}");
    }
    assert_eq!([V2, V3, V4].map(|dialect| flips(dialect, "")), [false, true, true]);
}

#[test]
fn a_mirrored_cylinder_has_its_front_where_a_mirrored_sphere_has_it() {
    let is_front_inside = |dialect, text: &str| {
        let text = format!("Scale -1 1 1 {text} Shape \"cylinder\"");
        let scene = dialect_world(dialect, "".as_ref(), &text);
        let mesh = mesh(&scene, 0);
        mesh.positions[0].truncate().dot(mesh.normals[0].truncate()) < 0.0
    };
    assert_eq!([V2, V3, V4].map(|dialect| is_front_inside(dialect, "")), [false, true, true]);
    for dialect in [V2, V3, V4] {
        assert!(!is_front_inside(dialect, "AreaLightSource \"diffuse\""), "{dialect:?}");
        assert!(is_front_inside(dialect, "ReverseOrientation AreaLightSource \"diffuse\""), "{dialect:?}");
    }
}

#[test]
fn an_infinite_light_without_a_map_is_constant() {
    for (dialect, params) in [(V2, ""), (V3, "\"string mapname\" \"\""), (V4, "\"string filename\" \"\"")] {
        let (light, images) = environment(dialect, 2, params);
        assert_eq!((light.scale, light.map, images.len()), (Vec3::ONE, None, 0));
    }
}

#[test]
fn a_map_is_scaled_by_colour_and_scale() {
    let scaled = r#""string mapname" "sky.exr" "color L" [1 2 3] "color scale" [4 5 6]"#;
    let (light, images) = environment(V3, 1, scaled);
    assert_eq!((light.scale, images.len()), (Vec3::new(4.0, 10.0, 18.0), 1));
    let (light, _) = environment(V4, 2, "\"string filename\" \"sky.exr\" \"float scale\" 3");
    assert_eq!(light.scale, Vec3::splat(3.0));
}

/// One light of each kind that is not on a shape.
fn each(scale: &str) -> String {
    [("point", "I"), ("spot", "I"), ("distant", "L"), ("infinite", "L")]
        .map(|(kind, colour)| format!("LightSource \"{kind}\" \"rgb {colour}\" [1 2 3] {scale}"))
        .join("\n")
}

#[test]
fn every_light_has_a_scale_and_in_the_older_dialects_a_colour_scale() {
    assert_eq!(colours(V4, &each("")), [Vec3::new(1.0, 2.0, 3.0); 4]);
    assert_eq!(colours(V4, &each("\"float scale\" 2")), [Vec3::new(2.0, 4.0, 6.0); 4]);
    for dialect in [V2, V3] {
        assert_eq!(colours(dialect, &each("\"rgb scale\" [2 .5 0]")), [Vec3::new(2.0, 1.0, 0.0); 4]);
    }
    assert!(colours(V4, &each("\"float scale\" 0")).is_empty(), "lights that give no light");
}

#[test]
fn area_lights_have_a_scale() {
    for (dialect, scale, expected) in [
        (V4, "\"float scale\" 3", Some(Vec3::new(3.0, 6.0, 9.0))),
        (V3, "\"color scale\" [2 .5 0]", Some(Vec3::new(2.0, 1.0, 0.0))),
        (V2, "\"rgb scale\" [1 0 0]", Some(Vec3::X)),
        (V4, "\"float scale\" 0", None),
    ] {
        let text = format!("AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] {scale} Shape \"sphere\"");
        let scene = dialect_world(dialect, "".as_ref(), &text);
        let radiance = scene.primitives[0].area_light.map(|light| light.radiance);
        assert_eq!(radiance, expected, "{dialect:?} {scale}");
    }
}

#[test]
fn a_spot_light_narrower_than_its_falloff_has_a_bright_middle() {
    let scene = scene("WorldBegin LightSource \"spot\" \"float coneangle\" 3");
    let [Light::Spot { cos_falloff_start, .. }] = scene.lights[..] else { panic!() };
    assert!((cos_falloff_start - 2f32.to_radians().cos()).abs() < 1e-6);
}

#[test]
fn blackbodies_of_pbrt_v2_are_1_at_555_nm() {
    let [v2, v3] = [Dialect::V2, Dialect::V3].map(|dialect| {
        let text = "LightSource \"point\" \"blackbody I\" [2700 2]";
        match dialect_world(dialect, "".as_ref(), text).lights[..] {
            [Light::Point { intensity, .. }] => intensity,
            _ => panic!(),
        }
    });
    // Planck's law at 1073 nm, the peak, over that at 555 nm
    assert!((v2 / v3 - 3.84).abs().max_element() < 0.02, "{v2} {v3}");
}

#[test]
fn lights_are_placed_and_scaled() {
    let scene = scene(
        "LookAt 0 0 0 0 0 1 0 1 0 Translate -1 0 0 Camera \"perspective\" WorldBegin
         LightSource \"point\" \"point3 from\" [3 0 0] \"rgb I\" [1 2 3] \"float scale\" 2
         Rotate 90 0 1 0
         LightSource \"spot\" \"float coneangle\" 60 \"float conedeltaangle\" 30
         LightSource \"distant\" \"float illuminance\" 5
         LightSource \"infinite\" \"blackbody L\" 6500 \"float scale\" 3",
    );
    let [Light::Point { position, intensity }, spot, distant, environment] = &scene.lights[..] else {
        panic!()
    };
    assert_eq!((*position, *intensity), (Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 4.0, 6.0)));
    let Light::Spot { axis, cos_falloff_start, cos_total_width, .. } = spot else { panic!() };
    assert!((*axis - Vec3::X).length() < 1e-6);
    assert!((cos_total_width - 0.5).abs() < 1e-6 && (cos_falloff_start - 0.75f32.sqrt()).abs() < 1e-6);
    let Light::Distant { direction, radiance } = distant else { panic!() };
    assert!((*direction + Vec3::X).length() < 1e-6);
    assert_eq!(*radiance, Vec3::splat(5.0));
    let Light::Environment(environment) = environment else { panic!() };
    assert!((environment.scale.dot(Vec3::new(0.2126, 0.7152, 0.0722)) - 3.0).abs() < 0.01);
}
