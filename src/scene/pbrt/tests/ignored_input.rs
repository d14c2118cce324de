//! Input that is ignored with a warning.

use super::{TRIANGLE, error, mesh, scene, triangles, world};

#[test]
fn surplus_block_ends_are_ignored() {
    for end in ["AttributeEnd", "TransformEnd"] {
        let begin = end.replace("End", "Begin");
        let expected = [format!("<text>:2:1: {end} without {begin} is ignored (and 1 more)")];
        let text = format!("WorldBegin Translate 1 0 0\n{end} {begin} {end} {end} {TRIANGLE}");
        for scene in [scene(&text), scene(&format!("{text} WorldEnd"))] {
            assert_eq!(scene.warnings, expected);
            assert_eq!(mesh(&scene, 0).positions[0].x, 1.0);
        }
    }
    // ObjectEnd is an error in all dialects.
    assert!(error("WorldBegin ObjectEnd").message.contains("ObjectEnd without"));
    // Not so of an object whose block an older dialect has ended already.
    let crossed = format!(
        "WorldBegin ObjectBegin \"a\" {TRIANGLE} AttributeEnd ObjectEnd ObjectInstance \"a\" WorldEnd"
    );
    let scene = scene(&crossed);
    assert_eq!((scene.instances.len(), scene.warnings.len()), (1, 1));
}

#[test]
fn the_older_dialects_close_blocks_at_the_end_of_the_world() {
    let open = format!("WorldBegin\n AttributeBegin TransformBegin {TRIANGLE}");
    assert_eq!((error(&open).line, error(&open).column), (2, 17));
    let scene = scene(&format!("{open} WorldEnd"));
    assert_eq!(
        scene.warnings,
        [
            "<text>:2:17: TransformBegin without an end is closed at the end of the world",
            "<text>:2:2: AttributeBegin without an end is closed at the end of the world",
        ]
    );
    assert_eq!(triangles(&scene), 1);
}

#[test]
fn vertex_attributes_of_the_wrong_length_are_ignored() {
    let at = |shape: &str, list: &str| {
        let scene = world(&format!("Shape {shape}\n{list}"));
        let name = &list[list.find(' ').unwrap() + 1..list.find('[').unwrap() - 2];
        let expected = format!("<text>:3:1: \"{name}\" does not match the number of points and is ignored");
        assert_eq!(scene.warnings, [expected]);
        mesh(&scene, 0).clone()
    };
    let triangle = "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";
    for list in ["\"point2 uv\" [0 0 1 1]", "\"float st\" [0 0]", "\"point2 uv\" [0 0 1 0 0 1 1 1]"] {
        assert!(at(triangle, list).uvs.is_empty());
    }
    assert!(at(triangle, "\"normal N\" [0 0 1]").normals.is_empty());
    let patch = "\"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]";
    assert_eq!(at(patch, "\"point2 uv\" [5 5]").uvs[3].x, 1.0);
    at(patch, "\"normal N\" [0 0 1]");
}

#[test]
fn the_older_dialects_truncate_surplus_texture_coordinates() {
    let shape = "Shape \"trianglemesh\" \"point P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]";
    let of = |uvs: &str| scene(&format!("WorldBegin {shape} \"float uv\" [{uvs}] WorldEnd"));
    let more = of("0 0 1 0 0 1 7 7");
    assert_eq!((mesh(&more, 0).uvs.len(), more.warnings.len()), (3, 0));
    let fewer = of("0 0 1 0");
    assert_eq!((mesh(&fewer, 0).uvs.len(), fewer.warnings.len()), (0, 1));
}

#[test]
fn incomplete_faces_are_ignored() {
    let points = "\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]";
    for (shape, indices, count) in [
        ("trianglemesh", "0 1 2 3", 1),
        ("trianglemesh", "0 1 2 1 3 2 0 1", 2),
        ("loopsubdiv\" \"integer levels\" 0 \"string scheme\" \"loop", "0 1 2 3", 1),
        ("bilinearmesh", "0 1 2 3 0 1", 2),
    ] {
        let scene = world(&format!("Shape \"{shape}\" {points}\n \"integer indices\" [{indices}]"));
        assert_eq!((triangles(&scene), scene.warnings.len()), (count, 1), "{shape} {indices}");
        assert!(scene.warnings[0].starts_with("<text>:3:2: \"indices\" after"), "{:?}", scene.warnings);
    }
    let none = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" []";
    assert_eq!(triangles(&world(none)), 1);
}
