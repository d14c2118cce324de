use std::path::Path;

use super::*;
use crate::scene::pbrt::read_str;
use crate::stats::Part;

const WIDTH: usize = 40;
const HEIGHT: usize = 24;
const SEEDS: u64 = 6;

/// Materials with SIMD and scalar versions, below three kinds of lights.
const MATERIALS: &str = r#"
    LightSource "infinite" "rgb L" [ .3 .4 .5 ]
    LightSource "point" "point3 from" [ -3 3 -1 ] "rgb I" [ 9 9 9 ]
    AttributeBegin
        AreaLightSource "diffuse" "rgb L" [ 8 7 6 ]
        Translate 0 4 0 Rotate 90 1 0 0 Shape "disk" "float radius" .8
    AttributeEnd
    AttributeBegin
        AreaLightSource "diffuse" "rgb L" [ 2 3 4 ]
        Shape "trianglemesh" "integer indices" [ 0 1 2 ] "point3 P" [ -4 0 2  -3 3 3  -4 3 1 ]
    AttributeEnd
    Material "diffuse" "rgb reflectance" [ .7 .5 .3 ]
    Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -9 0 -9  9 0 -9  9 0 9  -9 0 9 ]
    Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -9 0 4  9 0 4  9 9 4  -9 9 4 ]
    MakeNamedMaterial "matt" "string type" "diffuse" "rgb reflectance" [ .2 .6 .2 ]
    MakeNamedMaterial "metal" "string type" "conductor" "rgb reflectance" [ .9 .8 .6 ] "float roughness" .2
    AttributeBegin NamedMaterial "metal" Translate -2.4 .8 1 Shape "sphere" "float radius" .8 AttributeEnd
    AttributeBegin Material "mix" "string materials" [ "matt" "metal" ] "float amount" .4
        Translate -.8 .6 .6 Shape "sphere" "float radius" .6 AttributeEnd
    AttributeBegin Material "coateddiffuse" "rgb reflectance" [ .6 .2 .2 ] "float roughness" .1
        Translate .6 .6 .6 Shape "sphere" "float radius" .6 AttributeEnd
    AttributeBegin Material "diffusetransmission" Translate 2.4 .8 1 Shape "sphere" "float radius" .8 AttributeEnd
"#;

/// Perfectly specular materials and interfaces, with light behind them.
const SPECULAR: &str = r#"
    LightSource "infinite" "rgb L" [ .4 .4 .4 ]
    AttributeBegin
        AreaLightSource "diffuse" "rgb L" [ 6 6 6 ]
        Translate 1 3.5 0 Rotate 90 1 0 0 Shape "disk" "float radius" .7
    AttributeEnd
    Material "diffuse" "rgb reflectance" [ .6 .6 .6 ]
    Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -9 0 -9  9 0 -9  9 0 9  -9 0 9 ]
    AttributeBegin Material "dielectric" "float eta" 1.5
        Translate -1.2 .9 0 Shape "sphere" "float radius" .9 AttributeEnd
    AttributeBegin Material "thindielectric"
        Translate .9 1 -.5 Shape "disk" "float radius" .9 AttributeEnd
    AttributeBegin Material "conductor" "float roughness" 0
        Translate 2.6 .9 1 Shape "sphere" "float radius" .9 AttributeEnd
    AttributeBegin Material "interface"
        Translate 1 1.2 .8 Shape "sphere" "float radius" 1.1 AttributeEnd
"#;

fn scene(integrator: &str, sampler: &str, world: &str) -> Scene {
    let text = format!(
        r#"Integrator {integrator} Sampler "{sampler}"
        Film "rgb" "integer xresolution" {WIDTH} "integer yresolution" {HEIGHT}
        LookAt 0 1.5 -5  0 1 0  0 1 0
        Camera "perspective" "float fov" 50 "float lensradius" .02 "float focaldistance" 5
        WorldBegin {world}"#
    );
    read_str(&text, Path::new("")).unwrap()
}

/// The wavefront tracer and the scalar reference compute the same radiance for the same sample values. Paths
/// separate where a rounding error changes a decision, which few do.
#[test]
fn samples_match_the_scalar_reference() {
    const TOLERANCE: f32 = 2e-3;
    for (integrator, sampler, world, max_mismatches) in [
        (r#""path" "integer maxdepth" 1"#, "paddedsobol", MATERIALS, 0.002),
        (r#""path" "integer maxdepth" 6"#, "paddedsobol", MATERIALS, 0.01),
        (r#""path" "integer maxdepth" 6"#, "independent", MATERIALS, 0.01),
        (r#""path" "integer maxdepth" 8"#, "paddedsobol", SPECULAR, 0.01),
    ] {
        let scene = scene(integrator, sampler, world);
        let accel = Accel::build(&scene);
        let (mut mismatches, mut lit) = (0, 0);
        for seed in 0..SEEDS {
            let renderer = Renderer::new(&scene, &accel, seed);
            let layout = renderer.layout().clone();
            let mut store = Store::new(WIDTH, HEIGHT, layout.clone(), 1, seed);
            renderer.render_batch(&[1; WIDTH * HEIGHT], &mut store);
            let dims = layout.colour().chain(layout.radiance());
            let rendered = store.means(Part::Whole, dims);
            for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
                let reference = renderer.reference_radiance(x, y, 0, &mut |_| ());
                let colour = reference.light_sampled + reference.bsdf_sampled;
                let radiance = colour + reference.visible_emission;
                let [a, b] =
                    [0, 3].map(|first| Vec3::from_array([0, 1, 2].map(|c| rendered.at(first + c, x, y))));
                let differs =
                    |a: Vec3, b: Vec3| (a - b).abs().max_element() > TOLERANCE * (a.max_element() + 0.01);
                mismatches += u32::from(differs(a, colour) || differs(b, radiance));
                lit += u32::from(radiance != Vec3::ZERO);
            }
        }
        let samples = (WIDTH * HEIGHT) as u64 * SEEDS;
        let fraction = |count: u32| f64::from(count) / samples as f64;
        // Of the others the light that was chosen is hidden: what is compared must not be black
        assert!(fraction(lit) > 0.75, "{integrator}: {} of the samples are lit", fraction(lit));
        assert!(fraction(mismatches) <= max_mismatches, "{integrator} {sampler}: {}", fraction(mismatches));
    }
}

#[test]
fn the_first_rejected_sample_is_returned() {
    let scene = scene(r#""path""#, "independent", r#"LightSource "infinite" "rgb L" [ 1e30 1e30 1e30 ]"#);
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 0);
    let mut store = Store::new(WIDTH, HEIGHT, renderer.layout().clone(), 1, 0);
    let mut counts = [0; WIDTH * HEIGHT];
    (counts[3 * WIDTH + 20], counts[3 * WIDTH + 5], counts[7 * WIDTH]) = (3, 2, 1);
    let first = renderer.render_batch(&counts, &mut store);
    assert_eq!(first, Some(RejectedSample { y: 3, x: 5, index: 0 }));
    let next = renderer.render_batch(&counts, &mut store);
    assert_eq!(next, Some(RejectedSample { y: 3, x: 5, index: 2 }));
    assert_eq!(store.rejected(), 12);
    assert_eq!(renderer.render_batch(&[0; WIDTH * HEIGHT], &mut store), None);
}
