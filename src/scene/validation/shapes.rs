//! Checks of primitives, shapes, objects and instances.

use std::f32::consts::TAU;

use super::textures::{float_id, image_id};
use super::validation_error::Result;
use super::values::{animated_transform, emission, finite, index, positive, require, transform};
use crate::scene::shape::LARGEST_COORDINATE;
use crate::scene::{Disk, Scene, Shape, Sphere, TriangleMesh};

/// Checks that objects are ranges of primitives, and that instances refer to them.
pub fn check_objects(scene: &Scene) -> Result {
    require(!scene.objects.is_empty(), || "objects".into(), "empty", "the static object at index 0")?;
    for (i, object) in scene.objects.iter().enumerate() {
        let range = &object.primitives;
        let valid = range.start <= range.end && range.end <= scene.primitives.len();
        let value = format_args!("{range:?}");
        require(valid, || format!("objects[{i}].primitives"), value, "a range of primitives")?;
    }
    for (i, instance) in scene.instances.iter().enumerate() {
        index(instance.object, scene.objects.len(), || format!("instances[{i}].object"))?;
        let field = || format!("instances[{i}].object");
        require(instance.object > 0, field, 0, "an object other than the static one")?;
        animated_transform(&instance.transform, || format!("instances[{i}].transform"))?;
    }
    Ok(())
}

/// Checks the shape, material, alpha and emission of all primitives.
pub fn check_primitives(scene: &Scene) -> Result {
    for (i, primitive) in scene.primitives.iter().enumerate() {
        let field = |name: &str| format!("primitives[{i}].{name}");
        check_shape(&primitive.shape, &|name| field(&format!("shape.{name}")))?;
        index(primitive.material.0 as usize, scene.materials.len(), || field("material"))?;
        if let Some(id) = primitive.alpha {
            float_id(&scene.textures, id, || field("alpha"))?;
        }
        if let Some(light) = primitive.area_light {
            let is_static = scene.objects[0].primitives.contains(&i);
            let expected = "area lights on primitives of objects[0] only";
            require(is_static, || field("area_light"), "on an instanced primitive", expected)?;
            emission(light.radiance, || field("area_light.radiance"))?;
            if let Some(id) = light.image {
                image_id(&scene.textures, id, || field("area_light.image"))?;
            }
        }
    }
    Ok(())
}

fn check_shape(shape: &Shape, field: &impl Fn(&str) -> String) -> Result {
    match shape {
        Shape::Mesh(mesh) => check_mesh(mesh, field),
        Shape::Sphere(sphere) => check_sphere(sphere, field),
        Shape::Disk(disk) => check_disk(disk, field),
    }?;
    let coordinate = shape.max_coordinate().unwrap_or(0.0);
    let name = || field("to_object");
    require(coordinate < LARGEST_COORDINATE, name, coordinate, "coordinates below 1e12 in object space")
}

fn check_mesh(mesh: &TriangleMesh, field: &impl Fn(&str) -> String) -> Result {
    // Check the lengths of the vertex attributes
    let count = mesh.positions.len();
    for (name, length) in [("normals", mesh.normals.len()), ("uvs", mesh.uvs.len())] {
        let value = format_args!("a list of {length} for {count} positions");
        require(length == 0 || length == count, || field(name), value, "none or one per position")?;
    }

    // Check the vertices
    for (i, p) in mesh.positions.iter().enumerate() {
        require(p.is_finite(), || field(&format!("positions[{i}]")), p, "finite coordinates")?;
    }
    for (i, uv) in mesh.uvs.iter().enumerate() {
        require(uv.is_finite(), || field(&format!("uvs[{i}]")), uv, "finite coordinates")?;
    }

    // Check the triangles and the vertices they use
    for (i, triangle) in mesh.indices.iter().enumerate() {
        for vertex in triangle.map(|vertex| vertex as usize) {
            index(vertex, count, || field(&format!("indices[{i}]")))?;
            let p = mesh.positions[vertex];
            let valid = p.abs().max_element() < LARGEST_COORDINATE;
            require(valid, || field(&format!("positions[{vertex}]")), p, "coordinates below 1e12")?;
            if let Some(n) = mesh.normals.get(vertex) {
                let valid = (n.length() - 1.0).abs() < 1e-3;
                require(valid, || field(&format!("normals[{vertex}]")), n, "a vector of length 1")?;
            }
        }
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let has_area = (b - a).cross(c - a).try_normalize().is_some();
        let value = format_args!("{triangle:?}");
        require(has_area, || field(&format!("indices[{i}]")), value, "a triangle with an area")?;
    }
    Ok(())
}

fn check_sphere(sphere: &Sphere, field: &impl Fn(&str) -> String) -> Result {
    let Sphere { to_object, radius, z_min, z_max, phi_max } = sphere;
    transform(to_object, || field("to_object"))?;
    positive(*radius, || field("radius"))?;
    require(*z_min >= -radius && z_min <= z_max, || field("z_min"), z_min, "-radius to z_max")?;
    require(z_max <= radius, || field("z_max"), z_max, "at most the radius")?;
    check_phi_max(*phi_max, || field("phi_max"))
}

fn check_disk(disk: &Disk, field: &impl Fn(&str) -> String) -> Result {
    let Disk { to_object, height, radius, inner_radius, phi_max } = disk;
    transform(to_object, || field("to_object"))?;
    finite(*height, || field("height"))?;
    positive(*radius, || field("radius"))?;
    let valid = (0.0..=*radius).contains(inner_radius);
    require(valid, || field("inner_radius"), inner_radius, "0 to the radius")?;
    check_phi_max(*phi_max, || field("phi_max"))
}

fn check_phi_max(phi_max: f32, field: impl FnOnce() -> String) -> Result {
    require(phi_max > 0.0 && phi_max <= TAU, field, phi_max, "radians above 0 and up to 2π")
}
