//! Scenes that are valid, and scenes with one invalid field.

use std::f32::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, Vec2, Vec3};

use super::ValidationError;
use crate::scene::light::{Environment, EnvironmentMap};
use crate::scene::pbrt::read_str;
use crate::scene::texture::{ImageFilter, ImageTexture, Texture, TextureMapping, WrapMode};
use crate::scene::{
    AnimatedTransform, FloatTextureId, ImageId, Instance, Integrator, Light, MaterialId, MaterialKind,
    PixelFilter, RgbTextureId, Scene, Shape, TextureImage, TriangleMesh,
};

/// A scene with a mesh, a sphere, a disk, an instance, and lights of all kinds without images.
fn scene() -> Scene {
    let text = "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" \"float lensradius\" .1 WorldBegin
        LightSource \"point\" LightSource \"spot\" LightSource \"distant\" LightSource \"infinite\"
        Texture \"t\" \"spectrum\" \"checkerboard\"
        Material \"coateddiffuse\" \"texture reflectance\" \"t\"
        AttributeBegin AreaLightSource \"diffuse\" Shape \"sphere\" Shape \"disk\" AttributeEnd
        Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1 0 0 1 0 0 1]
        ObjectBegin \"o\" Shape \"sphere\" \"float alpha\" .5 ObjectEnd ObjectInstance \"o\"";
    read_str(text, Path::new("")).unwrap_or_else(|error| panic!("{error}"))
}

/// The field that is invalid after `change`.
fn invalid_field<T>(change: impl FnOnce(&mut Scene) -> T) -> String {
    let mut scene = scene();
    change(&mut scene);
    let error = scene.validate().expect_err("the change is invalid");
    assert!(error.to_string().contains("; expected "), "{error}");
    error.field().to_owned()
}

fn mesh(scene: &mut Scene) -> &mut TriangleMesh {
    let Shape::Mesh(mesh) = &mut scene.primitives[2].shape else { panic!("a mesh is expected") };
    Arc::make_mut(mesh)
}

#[test]
fn scenes_of_the_reader_are_valid() {
    scene().validate().unwrap();
    let empty = read_str("WorldBegin", Path::new("")).unwrap();
    empty.validate().unwrap();
}

#[test]
fn invalid_films_and_cameras_are_named() {
    assert_eq!(invalid_field(|s| s.origin.x = f64::NAN), "origin");
    assert_eq!(invalid_field(|s| s.film.width = 0), "film.width");
    assert_eq!(invalid_field(|s| s.film.height = 1 << 20), "film.height");
    assert_eq!(invalid_field(|s| s.film.pixel_bounds[1] = 0), "film.pixel_bounds");
    assert_eq!(invalid_field(|s| s.film.pixel_bounds[3] += 1), "film.pixel_bounds");
    assert_eq!(invalid_field(|s| s.film.scale = f32::INFINITY), "film.scale");
    let balance = Some(glam::Mat3::from_diagonal(glam::Vec3::new(1.0, f32::NAN, 1.0)));
    assert_eq!(invalid_field(|s| s.film.white_balance = balance), "film.white_balance");
    let filter = PixelFilter::Box { radius: [0.5, 0.0] };
    assert_eq!(invalid_field(|s| s.film.filter = filter), "film.filter.radius[1]");
    let filter = PixelFilter::Mitchell { radius: [2.0; 2], b: f32::NAN, c: 0.3 };
    assert_eq!(invalid_field(|s| s.film.filter = filter), "film.filter.b");
    assert_eq!(
        invalid_field(|s| s.camera.screen_window[0] = s.camera.screen_window[1]),
        "camera.screen_window"
    );
    assert_eq!(invalid_field(|s| s.camera.lens_radius = -1.0), "camera.lens_radius");
    assert_eq!(invalid_field(|s| s.camera.focal_distance = 0.0), "camera.focal_distance");
    assert_eq!(invalid_field(|s| s.camera.shutter_close = -1.0), "camera.shutter_close");
    let flat = AnimatedTransform::fixed(DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0)));
    assert_eq!(invalid_field(|s| s.camera.to_render = flat), "camera.to_render");
    assert_eq!(invalid_field(|s| s.spp = 0), "spp");
    let deep = Integrator::Path { max_depth: u32::MAX };
    assert_eq!(invalid_field(|s| s.integrator = deep), "integrator.max_depth");
}

#[test]
fn indices_out_of_range_are_named() {
    assert_eq!(invalid_field(|s| s.primitives[0].material = MaterialId(9)), "primitives[0].material");
    let no_float = Some(FloatTextureId(99));
    assert_eq!(invalid_field(|s| s.primitives[1].alpha = no_float), "primitives[1].alpha");
    let no_rgb = MaterialKind::Diffuse { reflectance: RgbTextureId(99) };
    assert_eq!(invalid_field(|s| s.materials[0].kind = no_rgb), "materials[0].kind.reflectance");
    assert_eq!(invalid_field(|s| s.materials[1].displacement = no_float), "materials[1].displacement");
    assert_eq!(invalid_field(|s| s.instances[0].object = 2), "instances[0].object");
    assert_eq!(invalid_field(|s| s.objects[1].primitives.end = 9), "objects[1].primitives");
    assert_eq!(invalid_field(|s| s.objects.clear()), "objects");
    let image = Some(ImageId(0));
    let field = invalid_field(|s| s.primitives[0].area_light.as_mut().unwrap().image = image);
    assert_eq!(field, "primitives[0].area_light.image");
    let error = {
        let mut scene = scene();
        mesh(&mut scene).indices[0][2] = 3;
        scene.validate().unwrap_err()
    };
    let field = "primitives[2].shape.indices[0]".to_owned();
    assert_eq!(error, ValidationError::IndexOutOfRange { field, index: 3, count: 3 });
    assert_eq!(error.to_string(), "primitives[2].shape.indices[0] is 3; expected an index below 3");
}

#[test]
fn references_to_the_static_object_are_named() {
    let instance = |object| Instance { object, transform: AnimatedTransform::fixed(DAffine3::IDENTITY) };
    assert_eq!(invalid_field(|s| s.instances.push(instance(0))), "instances[1].object");
    let field = invalid_field(|s| s.primitives[3].area_light = s.primitives[0].area_light);
    assert_eq!(field, "primitives[3].area_light");
}

#[test]
fn invalid_shapes_are_named() {
    assert_eq!(invalid_field(|s| mesh(s).positions[1].y = f32::NAN), "primitives[2].shape.positions[1]");
    assert_eq!(invalid_field(|s| mesh(s).positions[1].y = 1e13), "primitives[2].shape.positions[1]");
    assert_eq!(invalid_field(|s| mesh(s).normals[2] = Vec3::ZERO), "primitives[2].shape.normals[2]");
    assert_eq!(invalid_field(|s| mesh(s).uvs.push(Vec2::ZERO)), "primitives[2].shape.uvs");
    assert_eq!(invalid_field(|s| mesh(s).indices[0] = [0, 1, 1]), "primitives[2].shape.indices[0]");
    let sphere = |s: &mut Scene, change: fn(&mut crate::scene::Sphere)| match &mut s.primitives[0].shape {
        Shape::Sphere(sphere) => change(sphere),
        other => panic!("{other:?}"),
    };
    assert_eq!(invalid_field(|s| sphere(s, |x| x.radius = 0.0)), "primitives[0].shape.radius");
    assert_eq!(invalid_field(|s| sphere(s, |x| x.z_max = 2.0)), "primitives[0].shape.z_max");
    assert_eq!(invalid_field(|s| sphere(s, |x| x.phi_max = 2.0 * TAU)), "primitives[0].shape.phi_max");
    let flat = |x: &mut crate::scene::Sphere| x.to_object.matrix3.z_axis = DVec3::ZERO;
    assert_eq!(invalid_field(|s| sphere(s, flat)), "primitives[0].shape.to_object");
}

#[test]
fn invalid_lights_are_named() {
    let light = |s: &mut Scene, i: usize, change: fn(&mut Light)| change(&mut s.lights[i]);
    let change = |light: &mut Light| {
        if let Light::Point { intensity, .. } = light {
            intensity.y = -1.0;
        }
    };
    assert_eq!(invalid_field(|s| light(s, 0, change)), "lights[0].intensity");
    let change = |light: &mut Light| {
        if let Light::Spot { cos_falloff_start, .. } = light {
            *cos_falloff_start = -1.0;
        }
    };
    assert_eq!(invalid_field(|s| light(s, 1, change)), "lights[1].cos_falloff_start");
    let change = |light: &mut Light| {
        if let Light::Distant { direction, .. } = light {
            *direction = Vec3::ZERO;
        }
    };
    assert_eq!(invalid_field(|s| light(s, 2, change)), "lights[2].direction");
    let sky = |map| {
        let (to_render, scale) = (Affine3A::IDENTITY, Vec3::ONE);
        Light::Environment(Environment { to_render, scale, map: Some(map), portal: None })
    };
    assert_eq!(invalid_field(|s| s.lights[3] = sky(EnvironmentMap::LatLong(ImageId(0)))), "lights[3].map");
    let wide = |s: &mut Scene| {
        let image = s.textures.add_image(TextureImage::from_floats(2, 1, 1, vec![1.0; 2]));
        s.lights[3] = sky(EnvironmentMap::EqualArea(image));
    };
    assert_eq!(invalid_field(wide), "lights[3].map");
}

#[test]
fn invalid_textures_and_images_are_named() {
    let count = scene().textures.rgbs().len();
    let field = format!("textures.rgbs[{count}]");
    let nan = Texture::Constant(Vec3::new(0.0, f32::NAN, 0.0));
    assert_eq!(invalid_field(|s| s.textures.add(nan)), field);
    let empty = TextureImage::from_floats(0, 0, 1, Vec::new());
    assert_eq!(invalid_field(|s| s.textures.add_image(empty)), "textures.images[0]");
    let channels = TextureImage::from_floats(1, 1, 2, vec![0.0; 2]);
    assert_eq!(invalid_field(|s| s.textures.add_image(channels)), "textures.images[0]");
    let texel = TextureImage::from_floats(2, 1, 1, vec![0.0, f32::INFINITY]);
    assert_eq!(invalid_field(|s| s.textures.add_image(texel)), "textures.images[0] at (1, 0)");
    let mapping = TextureMapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
    let wrap = WrapMode::Repeat;
    let filter = ImageFilter::default();
    let missing = ImageTexture { image: ImageId(5), mapping, wrap, filter, scale: 1.0, invert: false };
    let missing = Texture::<Vec3>::Image(missing);
    assert_eq!(invalid_field(|s| s.textures.add(missing)), format!("{field}.image"));
    let unknown = RgbTextureId(99);
    let board = Texture::<Vec3>::Checkerboard { mapping, even: unknown, odd: unknown };
    assert_eq!(invalid_field(|s| s.textures.add(board)), format!("operand of {field}"));
}

#[test]
fn cyclic_and_deep_textures_are_invalid() {
    let mapping = TextureMapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
    let nested = |s: &mut Scene, levels: usize| {
        let mut id = s.textures.add(Texture::Constant(1.0));
        for _ in 1..levels {
            id = s.textures.add(Texture::<f32>::Dots { mapping, inside: id, outside: id });
        }
    };
    let mut deep = scene();
    nested(&mut deep, 64);
    deep.validate().unwrap();
    assert!(invalid_field(|s| nested(s, 65)).starts_with("textures.floats["));
    let cycle = |s: &mut Scene| {
        let own = FloatTextureId(s.textures.floats().len() as u32);
        s.textures.add(Texture::<f32>::Dots { mapping, inside: own, outside: own });
    };
    assert!(invalid_field(cycle).starts_with("textures.floats["));
}
