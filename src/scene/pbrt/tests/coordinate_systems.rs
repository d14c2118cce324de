//! Named coordinate systems.

use glam::{Vec3, Vec3A};

use super::{TRIANGLE, mesh, scene, world};
use crate::scene::Light;

#[test]
fn the_camera_coordinate_system_is_at_the_camera() {
    let scene = scene(&format!(
        "LookAt 1 2 3 1 2 4 1 0 0 Camera \"perspective\" WorldBegin Rotate 30 1 2 3 Translate 7 8 9
         CoordSysTransform \"camera\" LightSource \"point\" \"point from\" [0 0 5] {TRIANGLE}"
    ));
    let Light::Point { position, .. } = scene.lights[0] else { panic!() };
    assert!((position - Vec3::new(0.0, 0.0, 5.0)).length() < 1e-6, "{position}");
    // The view's y is the world's x.
    let [_, right, up] = mesh(&scene, 0).positions[..] else { panic!() };
    assert!((up - Vec3::X).length() < 1e-6 && (right + Vec3::Y).length() < 1e-6, "{right} {up}");
}

#[test]
fn the_world_coordinate_system_is_that_of_world_begin() {
    let scene = scene(&format!(
        "Translate 0 0 5 Camera \"perspective\" WorldBegin Translate 1 2 3
         CoordSysTransform \"world\" {TRIANGLE}"
    ));
    // Render space is world space moved by 5 along z.
    assert_eq!(mesh(&scene, 0).positions[1], Vec3::new(1.0, 0.0, 5.0));
}

#[test]
fn coordinate_systems_outlive_their_block_and_may_be_redefined() {
    let scene = world(&format!(
        "AttributeBegin Translate 1 0 0 CoordinateSystem \"a\" Translate 1 0 0 CoordinateSystem \"b\"
         AttributeEnd CoordSysTransform \"b\" {TRIANGLE} CoordSysTransform \"a\" {TRIANGLE}
         Translate 4 0 0 {TRIANGLE}
         CoordinateSystem \"a\" Identity CoordSysTransform \"a\" {TRIANGLE}"
    ));
    let x: Vec<f32> = (0..4).map(|i| mesh(&scene, i).positions[0].x).collect();
    assert_eq!(x, [2.0, 1.0, 5.0, 5.0]);
}

#[test]
fn coordinate_systems_of_the_options_block_are_known_in_the_world() {
    let scene = scene(&format!(
        "Translate 1 2 3 CoordinateSystem \"a\" Identity Camera \"perspective\" WorldBegin
         CoordSysTransform \"a\" {TRIANGLE}"
    ));
    assert_eq!(mesh(&scene, 0).positions[0], Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn a_moving_coordinate_system_moves_shapes() {
    let scene = world(&format!(
        "ActiveTransform EndTime Translate 2 0 0 ActiveTransform All CoordinateSystem \"a\" Identity
         {TRIANGLE} CoordSysTransform \"a\" {TRIANGLE}"
    ));
    let [instance] = &scene.instances[..] else { panic!("{:?}", scene.instances) };
    let at = |time| instance.transform.at(time).translation;
    assert_eq!([at(0.0), at(1.0)], [Vec3A::ZERO, 2.0 * Vec3A::X]);
}
