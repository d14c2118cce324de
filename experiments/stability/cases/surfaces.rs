//! Cases on materials: energy conservation, and samples against their density.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use prpf::geometry::SurfaceInteraction;
use prpf::render::bsdf::Bsdf;
use prpf::scene::{MaterialId, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::case::Bound::{AtLeast, AtMost};
use super::case::{Case, largest};
use super::chi_squared::{MAX_Z, chi_squared_z};
use super::effort::Effort;
use super::renders::scene;
use super::sphere_cells::SphereCells;

pub fn cases(effort: Effort) -> Vec<Case> {
    [furnaces(effort.select(100, 1000)), densities(effort.select(40_000, 1_000_000))].concat()
}

/// A scene with one sphere of a material.
fn material_scene(material: &str) -> Scene {
    scene(&format!("WorldBegin Material {material} Shape \"sphere\""))
}

/// A surface interaction whose normal is z.
fn facing_z() -> SurfaceInteraction {
    SurfaceInteraction {
        position: Vec3::ZERO,
        position_error: Vec3::ZERO,
        geometric_normal: Vec3::Z,
        shading_normal: Vec3::Z,
        dpdu: Vec3::X,
        dpdv: Vec3::Y,
        uv: Vec2::splat(0.5),
        primitive: 0,
        element: 0,
    }
}

fn bsdf(scene: &Scene, wo: Vec3) -> Bsdf<'_> {
    let material = scene.primitives.first().map_or(MaterialId(0), |primitive| primitive.material);
    Bsdf::new(scene, material, &facing_z(), wo, 0.5).expect("a material that scatters")
}

fn direction(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

/// Fraction of the energy from `wo` that is scattered, and its standard error. Refracted radiance is converted to
/// energy.
fn furnace(bsdf: &Bsdf, wo: Vec3, side: usize) -> (f64, f64) {
    let mut rng = Pcg32::seed_from_u64(3);
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..side * side {
        let cell = Vec2::new((i / side) as f32, (i % side) as f32);
        let u = (cell + Vec2::new(rng.random(), rng.random())) / side as f32;
        let energy = bsdf.sample(wo, rng.random(), u).map_or(0.0, |s| f64::from(s.weight.y * s.eta * s.eta));
        sum += energy;
        squares += energy * energy;
    }
    let n = (side * side) as f64;
    let mean = sum / n;
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

/// White furnaces: white materials of roughness 0, 10⁻⁴ and 1, from the normal to grazing angles.
fn furnaces(side: usize) -> Vec<Case> {
    let mut cases = lossless_furnaces(side);
    cases.extend(lossy_furnaces(side));
    cases.push(single_scattering(side));
    cases
}

const COSINES: [f32; 5] = [1.0, 0.5, 0.1, 0.01, 0.001];
const WHITE: &str = "\"rgb reflectance\" [ 1 1 1 ]";

fn roughness(alpha: f64) -> String {
    format!("\"bool remaproughness\" false \"float roughness\" {alpha}")
}

/// Materials that scatter all energy.
fn lossless_furnaces(side: usize) -> Vec<Case> {
    // List the materials
    let halves = "\"rgb reflectance\" [ 0.5 0.5 0.5 ] \"rgb transmittance\" [ 0.5 0.5 0.5 ]";
    let mut materials = vec![
        ("diffuse".to_owned(), format!("\"diffuse\" {WHITE}")),
        ("thin glass".to_owned(), "\"thindielectric\"".to_owned()),
        ("diffuse transmission".to_owned(), format!("\"diffusetransmission\" {halves} \"float scale\" 1")),
    ];
    for alpha in [0.0, 1e-4] {
        let rough = roughness(alpha);
        materials.push((format!("conductor, roughness {alpha}"), format!("\"conductor\" {WHITE} {rough}")));
        materials.push((format!("glass, roughness {alpha}"), format!("\"dielectric\" {rough}")));
    }
    for alpha in [0.0, 1e-4, 1.0] {
        let name = format!("coated diffuse, roughness {alpha}");
        // A coat without thickness does not absorb
        materials
            .push((name, format!("\"coateddiffuse\" {WHITE} \"float thickness\" 0 {}", roughness(alpha))));
    }

    // Measure their energy
    let case = |(name, material): (String, String)| {
        let scene = material_scene(&material);
        let off = COSINES.map(|cos| {
            let wo = direction(cos);
            let (energy, error) = furnace(&bsdf(&scene, wo), wo, side);
            ((energy - 1.0).abs() - 4.0 * error).max(0.0)
        });
        let name = format!("white furnace, {name}");
        Case::new(name, "difference of the energy from 1, beyond noise", AtMost(0.01), largest(off))
    };
    materials.into_iter().map(case).collect()
}

/// Rough materials, which lose energy by multiple scattering.
fn lossy_furnaces(side: usize) -> Vec<Case> {
    const SINGLE_SCATTERING: &str =
        "light that hits a second microfacet is lost, as in pbrt-v4; no energy is ever created";
    let rough = roughness(1.0);
    let case = |(name, material): (&str, String)| {
        let scene = material_scene(&material);
        let over = COSINES.map(|cos| {
            let wo = direction(cos);
            let (energy, error) = furnace(&bsdf(&scene, wo), wo, side);
            energy - 1.0 - 4.0 * error
        });
        let name = format!("white furnace, {name}");
        Case::new(name, "energy over 1, beyond noise", AtMost(1e-4), largest(over))
            .with_limitation(SINGLE_SCATTERING)
    };
    let materials = [
        ("conductor, roughness 1", format!("\"conductor\" {WHITE} {rough}")),
        ("glass, roughness 1", format!("\"dielectric\" {rough}")),
        (
            "coated conductor, roughness 1",
            format!(
                "\"coatedconductor\" {WHITE} \"bool remaproughness\" false \"float interface.roughness\" 1 \
                 \"float conductor.roughness\" 1"
            ),
        ),
    ];
    materials.map(case).to_vec()
}

/// The rough conductor from the normal, against the closed form of single scattering.
fn single_scattering(side: usize) -> Case {
    let scene = material_scene(&format!("\"conductor\" {WHITE} {}", roughness(1.0)));
    let (energy, error) = furnace(&bsdf(&scene, Vec3::Z), Vec3::Z, side);
    // ∫ cos ∕ (1 + cos) dcos, for microfacets of roughness 1 seen along the normal.
    let expected = 1.0 - std::f64::consts::LN_2;
    let z = (energy - expected).abs() / (error + 1e-4 * expected);
    let name = "energy of single scattering by the rough conductor";
    Case::new(name, "z-score against 1 − ln 2", AtMost(MAX_Z), z)
}

/// z-score of a material's samples against a density.
fn sample_z(bsdf: &Bsdf, wo: Vec3, samples: usize, pdf: impl Fn(Vec3) -> f32) -> f64 {
    let mut rng = Pcg32::seed_from_u64(7);
    // The last cell counts what the density leaves out: specular and failed samples.
    let mut counts = vec![0.0; SphereCells::COUNT + 1];
    for _ in 0..samples {
        let sample = bsdf.sample(wo, rng.random(), Vec2::new(rng.random(), rng.random()));
        counts[sample.filter(|s| !s.specular).map_or(SphereCells::COUNT, |s| SphereCells::index(s.wi))] +=
            1.0;
    }
    let mut mass = SphereCells::integrate(pdf);
    mass.push((1.0 - mass.iter().sum::<f64>()).max(0.0));
    mass.iter_mut().for_each(|m| *m *= samples as f64);
    chi_squared_z(&counts, &mass)
}

/// Samples against densities, for lobes that are wide enough for the cells.
fn densities(samples: usize) -> Vec<Case> {
    let colour = "\"rgb reflectance\" [ 0.8 0.5 0.1 ]";
    let rough = "\"bool remaproughness\" false \"float roughness\" 0.4";
    let materials = [
        ("diffuse", format!("\"diffuse\" {colour}")),
        (
            "diffuse transmission",
            format!("\"diffusetransmission\" {colour} \"rgb transmittance\" [ 0.1 0.3 0.2 ]"),
        ),
        ("conductor", format!("\"conductor\" {rough}")),
        ("glass", format!("\"dielectric\" {rough}")),
        ("coated diffuse", format!("\"coateddiffuse\" {colour} {rough}")),
        (
            "coated conductor",
            "\"coatedconductor\" \"bool remaproughness\" false \"float interface.roughness\" 0.3 \
             \"float conductor.roughness\" 0.4"
                .to_owned(),
        ),
    ];
    let mut cases = Vec::new();
    for (name, material) in &materials {
        let scene = material_scene(material);
        let z = [0.95, 0.5, 0.2, -0.6].map(|cos| {
            let wo = direction(cos);
            let bsdf = bsdf(&scene, wo);
            sample_z(&bsdf, wo, samples, |wi| bsdf.pdf(wo, wi))
        });
        let name = format!("samples of {name} against their density");
        cases.push(Case::new(name, "z-score by χ²", AtMost(MAX_Z), largest(z)));
    }
    let (scene, wo) = (material_scene(&materials[0].1), direction(0.6));
    let wrong = sample_z(&bsdf(&scene, wo), wo, samples, |wi| if wi.z > 0.0 { 1.0 / TAU } else { 0.0 });
    cases.push(Case::new("planted: a density without its cosine", "z-score by χ²", AtLeast(MAX_Z), wrong));
    cases
}
