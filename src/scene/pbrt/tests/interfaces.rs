//! Interfaces between media, which are left out unless they emit.

use glam::Vec3;

use super::{TRIANGLE, scene, world};
use crate::scene::MaterialKind;

#[test]
fn interfaces_are_left_out_even_if_their_material_is_made_later() {
    let scene = world(&format!(
        "{TRIANGLE} Material \"interface\" {TRIANGLE} Shape \"sphere\"
         NamedMaterial \"late\" {TRIANGLE} MakeNamedMaterial \"late\" \"string type\" \"interface\"
         Material \"diffuse\" Shape \"disk\""
    ));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!((scene.primitives.len(), scene.objects[0].primitives.clone()), (2, 0..2));
}

#[test]
fn interfaces_of_the_older_dialects_are_left_out() {
    for kind in ["", "none"] {
        let text = format!("Integrator \"path\" WorldBegin Material \"{kind}\" {TRIANGLE} WorldEnd");
        assert!(scene(&text).primitives.is_empty(), "{kind}");
    }
}

#[test]
fn area_lights_on_interfaces_of_v3_emit() {
    for kind in ["", "none"] {
        let scene = scene(&format!(
            "Integrator \"path\" WorldBegin Material \"{kind}\" {TRIANGLE} Translate 1 0 0
             AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] {TRIANGLE} WorldEnd"
        ));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!((scene.primitives.len(), scene.objects[0].primitives.clone()), (1, 0..1), "{kind}");
        let light = scene.primitives[0].area_light.expect("the second shape emits");
        assert_eq!(light.radiance, Vec3::new(1.0, 2.0, 3.0));
        let material = &scene.materials[scene.primitives[0].material.0 as usize];
        assert!(matches!(material.kind, MaterialKind::Interface), "{material:?}");
    }
}

#[test]
fn mixes_with_an_interface_stay() {
    let scene = world(&format!(
        "MakeNamedMaterial \"a\" \"string type\" \"interface\"
         Material \"mix\" \"string materials\" [\"a\" \"a\"] {TRIANGLE}"
    ));
    assert_eq!(scene.primitives.len(), 1);
}

#[test]
fn instances_of_interfaces_alone_are_left_out() {
    let scene = world(&format!(
        "ObjectBegin \"a\" Material \"interface\" {TRIANGLE} ObjectEnd
         ObjectBegin \"b\" Material \"interface\" {TRIANGLE} Material \"diffuse\" {TRIANGLE} ObjectEnd
         ObjectInstance \"a\" ObjectInstance \"b\"
         Material \"interface\" ActiveTransform EndTime Translate 1 0 0 {TRIANGLE}"
    ));
    let objects: Vec<_> = scene.instances.iter().map(|instance| instance.object).collect();
    assert_eq!((scene.primitives.len(), &objects[..]), (1, &[2][..]));
    assert_eq!(scene.objects[2].primitives, 0..1);
    assert!(!scene.effects().motion);
}

#[test]
fn area_lights_on_interfaces_are_ignored_with_a_warning() {
    let shape = format!("AreaLightSource \"diffuse\" {TRIANGLE}");
    for text in [
        format!("Material \"interface\" {shape}"),
        format!("NamedMaterial \"a\" {shape} MakeNamedMaterial \"a\" \"string type\" \"interface\""),
    ] {
        let scene = world(&text);
        assert!(!scene.is_lit(), "{text}");
        assert_eq!(scene.warnings.len(), 1, "{text}");
        assert!(scene.warnings[0].contains("area light on the material"), "{:?}", scene.warnings);
    }
}
