//! Materials, films and integrators that differ between the dialects.

use std::path::Path;

use crate::scene::Integrator;
use crate::scene::film::PixelFilter;
use crate::scene::material::{Additive, MaterialKind, RoughnessScale};
use crate::scene::pbrt::Dialect;
use crate::scene::pbrt::read_str;
use crate::scene::texture::Encoding;

/// The materials that a main file of each older dialect makes, without the default one.
fn materials(dialect: Dialect, world: &str) -> Vec<MaterialKind> {
    let header = if dialect == Dialect::V2 { "" } else { "Integrator \"path\"" };
    let scene = read_str(&format!("{header} WorldBegin {world} WorldEnd"), Path::new(""));
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    scene.materials.into_iter().skip(1).map(|material| material.kind).collect()
}

fn additive(dialect: Dialect, world: &str) -> Additive {
    match &materials(dialect, world)[..] {
        [MaterialKind::Additive(parts)] => **parts,
        other => panic!("{other:?}"),
    }
}

#[test]
fn plastic_is_diffuse_and_glossy_with_an_inverted_index() {
    for (dialect, scale) in
        [(Dialect::V2, RoughnessScale::InverseExponent), (Dialect::V3, RoughnessScale::Logarithm)]
    {
        let parts = additive(dialect, "Material \"plastic\" \"color Kd\" [.4 .2 .2]");
        assert!(parts.diffuse[0].is_some() && parts.diffuse[1].is_none() && parts.dielectric.is_none());
        let gloss = parts.gloss.unwrap();
        assert_eq!((gloss.eta, gloss.roughness.scale), (1.0 / 1.5, scale));
        assert_eq!(parts.inverts_gloss_behind, dialect == Dialect::V3);
    }
}

#[test]
fn uber_and_translucent_differ_between_the_dialects() {
    let uber = |dialect| additive(dialect, "Material \"uber\" \"float index\" 2 \"color Kr\" [1 1 1]");
    assert_eq!(uber(Dialect::V2).dielectric.unwrap().eta, 0.5);
    assert_eq!(uber(Dialect::V3).dielectric.unwrap().eta, 2.0);
    assert!(uber(Dialect::V3).inverts_gloss_behind && !uber(Dialect::V2).inverts_gloss_behind);
    let translucent = |dialect| additive(dialect, "Material \"translucent\"");
    assert!(translucent(Dialect::V2).dielectric.is_none() && translucent(Dialect::V2).gloss.is_some());
    assert!(translucent(Dialect::V3).dielectric.is_some() && translucent(Dialect::V3).gloss.is_none());
}

#[test]
fn the_amount_of_an_older_mix_weights_its_first_material() {
    let named = "MakeNamedMaterial \"a\" \"string type\" \"matte\"
        MakeNamedMaterial \"b\" \"string type\" \"mirror\"";
    let mix = "Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\"
        \"color amount\" [.2 .2 .2]";
    let kinds = materials(Dialect::V3, &format!("{named} {mix}"));
    let MaterialKind::Mix { first, second, .. } = kinds[2] else { panic!("{:?}", kinds[2]) };
    assert_eq!((first.0, second.0), (2, 1));
}

#[test]
fn rough_matte_is_oren_nayar_and_coloured_glass_keeps_its_colours() {
    let world = "Material \"matte\" \"float sigma\" 20 Material \"matte\" Material \"glass\"
        Material \"glass\" \"color Kt\" [1 .5 .5] Material \"substrate\"";
    let kinds = materials(Dialect::V2, world);
    assert!(matches!(kinds[0], MaterialKind::OrenNayar { .. }));
    assert!(matches!(kinds[1], MaterialKind::Diffuse { .. }));
    assert!(matches!(kinds[2], MaterialKind::Dielectric { .. }));
    assert!(matches!(&kinds[3], MaterialKind::Additive(parts) if parts.dielectric.is_some()));
    assert!(matches!(kinds[4], MaterialKind::FresnelBlend { .. }));
}

#[test]
fn glass_of_v3_is_smooth_unless_it_has_a_roughness_along_an_axis() {
    let roughness = |dialect, params: &str| {
        let kinds = materials(dialect, &format!("Material \"glass\" {params}"));
        let MaterialKind::Dielectric { roughness, .. } = kinds[0] else { panic!("{kinds:?}") };
        roughness.scale
    };
    assert_eq!(roughness(Dialect::V3, ""), RoughnessScale::Alpha);
    assert_eq!(roughness(Dialect::V3, "\"float uroughness\" 0"), RoughnessScale::Alpha);
    assert_eq!(roughness(Dialect::V3, "\"float vroughness\" .1"), RoughnessScale::Logarithm);
    assert_eq!(roughness(Dialect::V2, ""), RoughnessScale::Alpha);
    // A smooth surface of pbrt's other materials is rough in v3
    let tinted = additive(Dialect::V3, "Material \"glass\" \"color Kt\" [1 .5 .5]");
    assert_eq!(tinted.dielectric.unwrap().roughness.scale, RoughnessScale::Alpha);
    let plastic = additive(Dialect::V3, "Material \"plastic\" \"float roughness\" 0");
    assert_eq!(plastic.gloss.unwrap().roughness.scale, RoughnessScale::Logarithm);
}

#[test]
fn older_materials_read_the_roughnesses_that_they_have() {
    let world = |material: &str| {
        format!(
            "Material \"{material}\" \"float roughness\" .5 \"float uroughness\" .25 \"float vroughness\" .75"
        )
    };
    let read = |dialect: Dialect, world: &str| {
        let header = if dialect == Dialect::V2 { "" } else { "Integrator \"path\"" };
        let text = format!("{header} WorldBegin {world} WorldEnd");
        let scene = read_str(&text, Path::new("")).unwrap();
        let roughness = match &scene.materials[1].kind {
            MaterialKind::Conductor { roughness, .. }
            | MaterialKind::FresnelBlend { roughness, .. }
            | MaterialKind::Dielectric { roughness, .. } => *roughness,
            MaterialKind::Additive(parts) => parts.gloss.or(parts.dielectric).unwrap().roughness,
            other => panic!("{other:?}"),
        };
        [roughness.u, roughness.v].map(|id| scene.textures.constant_float(id).unwrap())
    };
    let (common, axes) = ([0.5; 2], [0.25, 0.75]);
    for (material, v2, v3) in [
        ("metal", common, axes),
        ("substrate", axes, axes),
        ("plastic", common, common),
        ("translucent", common, common),
        ("uber", common, axes),
        ("glass", [0.0; 2], axes),
    ] {
        assert_eq!(read(Dialect::V2, &world(material)), v2, "{material}");
        assert_eq!(read(Dialect::V3, &world(material)), v3, "{material}");
    }
    let along_u = "Material \"uber\" \"float roughness\" .5 \"float uroughness\" .25";
    assert_eq!(read(Dialect::V3, along_u), [0.25; 2]);
}

#[test]
fn filters_and_film_have_the_dialects_names_and_defaults() {
    let film = |header: &str, end: &str| {
        let text = format!("{header} PixelFilter \"gaussian\" WorldBegin {end}");
        read_str(&text, Path::new("")).unwrap().film
    };
    let old = film("", "WorldEnd");
    assert_eq!((old.width, old.filter), (640, PixelFilter::Gaussian { radius: [2.0; 2], sigma: 0.5 }));
    assert_eq!(film("Integrator \"path\"", "WorldEnd").width, 1280);
    assert_eq!(film("", "").filter, PixelFilter::Gaussian { radius: [1.5; 2], sigma: 0.5 });
    let wide = "PixelFilter \"box\" \"float xwidth\" 2 WorldBegin WorldEnd";
    let wide = read_str(wide, Path::new("")).unwrap().film.filter;
    assert_eq!(wide, PixelFilter::Box { radius: [2.0, 0.5] });
}

#[test]
fn paths_of_v2_have_one_more_scattering_event() {
    let integrator =
        |header: &str| read_str(&format!("{header} WorldBegin WorldEnd"), Path::new("")).unwrap().integrator;
    let depth = "\"integer maxdepth\" 3";
    let path = |max_depth| Integrator::Path { max_depth };
    assert_eq!(integrator("SurfaceIntegrator \"path\""), path(6));
    assert_eq!(integrator(&format!("SurfaceIntegrator \"path\" {depth}")), path(4));
    assert_eq!(integrator(&format!("Integrator \"path\" {depth}")), path(3));
    let direct = format!("SurfaceIntegrator \"directlighting\" {depth}");
    assert_eq!(integrator(&direct), Integrator::Direct { max_depth: 3 });
}

#[test]
fn only_v4_ignores_the_encoding_of_jpeg_files() {
    let of = |dialect: Dialect, name| dialect.image_encoding(Path::new(name), Some(Encoding::Linear));
    assert_eq!(of(Dialect::V4, "a.jpg"), Encoding::Srgb);
    assert_eq!(of(Dialect::V4, "a.PNG"), Encoding::Linear);
    assert_eq!(of(Dialect::V3, "a.jpg"), Encoding::Linear);
}

#[test]
fn float_images_are_linear_except_with_gamma_in_the_older_dialects() {
    let gamma = Encoding::Gamma(2.0);
    let of = |dialect: Dialect, wanted| dialect.image_encoding(Path::new("a.exr"), wanted);
    for (dialect, asked) in [(Dialect::V2, gamma), (Dialect::V3, gamma), (Dialect::V4, Encoding::Linear)] {
        assert_eq!([of(dialect, None), of(dialect, Some(gamma))], [Encoding::Linear, asked], "{dialect:?}");
    }
    let png = |dialect: Dialect| dialect.image_encoding(Path::new("a.png"), None);
    assert_eq!(
        [png(Dialect::V2), png(Dialect::V3), png(Dialect::V4)],
        [Encoding::Linear, Encoding::Srgb, Encoding::Srgb]
    );
}

#[test]
fn ambient_occlusion_is_reported_to_need_lights() {
    let scene =
        read_str("SurfaceIntegrator \"ambientocclusion\" WorldBegin WorldEnd", Path::new("")).unwrap();
    let expected = "integrator \"ambientocclusion\" is not supported; using \"path\", whose image is black without lights";
    assert_eq!(scene.warnings, [format!("<text>:1:1: {expected}")]);
}
