//! How materials scatter: no energy from nowhere, and samples that follow their density.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use prpf::geometry::SurfacePoint;
use prpf::render::bsdf::Bsdf;
use prpf::scene::{MaterialId, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Bound::{AtLeast, AtMost};
use super::pictures::scene;
use super::{Case, Effort, largest};

/// Beyond it, a normal deviate is no accident: over the two hundred tests of all sections it is exceeded
/// once in seven hundred runs.
pub const NO_ACCIDENT: f64 = 4.5;

pub fn cases(effort: Effort) -> Vec<Case> {
    [furnaces(effort.of(100, 1000)), densities(effort.of(40_000, 1_000_000))].concat()
}

/// A scene of nothing but one material.
fn of_material(material: &str) -> Scene {
    scene(&format!("WorldBegin Material {material} Shape \"sphere\""))
}

/// A point of a surface that faces z.
fn facing_z() -> SurfacePoint {
    SurfacePoint {
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

/// Share of the light from `wo` that is scattered, and its standard error; refracted radiance counts
/// as energy.
fn furnace(bsdf: &Bsdf, wo: Vec3, side: usize) -> (f64, f64) {
    let mut numbers = Pcg32::seed_from_u64(3);
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..side * side {
        let cell = Vec2::new((i / side) as f32, (i % side) as f32);
        let u = (cell + Vec2::new(numbers.random(), numbers.random())) / side as f32;
        let energy =
            bsdf.sample(wo, numbers.random(), u).map_or(0.0, |s| f64::from(s.weight.y * s.eta * s.eta));
        sum += energy;
        squares += energy * energy;
    }
    let n = (side * side) as f64;
    let mean = sum / n;
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

/// White materials at roughness 0, 10⁻⁴ and 1, from above and at grazing angles.
fn furnaces(side: usize) -> Vec<Case> {
    const COSINES: [f32; 5] = [1.0, 0.5, 0.1, 0.01, 0.001];
    const SINGLE: &str = "light that meets a second microfacet is lost, as in pbrt-v4: none is ever made";
    let white = "\"rgb reflectance\" [ 1 1 1 ]";
    let rough = |alpha: f64| format!("\"bool remaproughness\" false \"float roughness\" {alpha}");
    let mut lossless = vec![
        ("diffuse".to_owned(), format!("\"diffuse\" {white}")),
        ("thin glass".to_owned(), "\"thindielectric\"".to_owned()),
    ];
    let halves = "\"rgb reflectance\" [ 0.5 0.5 0.5 ] \"rgb transmittance\" [ 0.5 0.5 0.5 ]";
    lossless.push((
        "diffuse transmission".to_owned(),
        format!("\"diffusetransmission\" {halves} \"float scale\" 1"),
    ));
    for alpha in [0.0, 1e-4] {
        lossless.push((
            format!("conductor, roughness {alpha}"),
            format!("\"conductor\" {white} {}", rough(alpha)),
        ));
        lossless.push((format!("glass, roughness {alpha}"), format!("\"dielectric\" {}", rough(alpha))));
    }
    for alpha in [0.0, 1e-4, 1.0] {
        lossless.push((
            format!("coated diffuse, roughness {alpha}"),
            format!("\"coateddiffuse\" {white} {}", rough(alpha)),
        ));
    }
    let mut cases = Vec::new();
    for (name, material) in lossless {
        let scene = of_material(&material);
        let off = COSINES.map(|cos| {
            let wo = direction(cos);
            let (energy, error) = furnace(&bsdf(&scene, wo), wo, side);
            ((energy - 1.0).abs() - 4.0 * error).max(0.0)
        });
        let name = format!("white furnace, {name}");
        cases.push(Case::new(name, "energy off 1, beyond noise", AtMost(0.01), largest(off)));
    }
    for (name, material) in [
        ("conductor, roughness 1", format!("\"conductor\" {white} {}", rough(1.0))),
        ("glass, roughness 1", format!("\"dielectric\" {}", rough(1.0))),
        (
            "coated conductor, roughness 1",
            format!(
                "\"coatedconductor\" {white} \"bool remaproughness\" false \"float interface.roughness\" 1 \
                 \"float conductor.roughness\" 1"
            ),
        ),
    ] {
        let scene = of_material(&material);
        let over = COSINES.map(|cos| {
            let wo = direction(cos);
            let (energy, error) = furnace(&bsdf(&scene, wo), wo, side);
            energy - 1.0 - 4.0 * error
        });
        let name = format!("white furnace, {name}");
        cases.push(
            Case::new(name, "energy over 1, beyond noise", AtMost(1e-4), largest(over)).instead(SINGLE),
        );
    }
    let scene = of_material(&format!("\"conductor\" {white} {}", rough(1.0)));
    let (energy, error) = furnace(&bsdf(&scene, Vec3::Z), Vec3::Z, side);
    // ∫ cos ∕ (1 + cos) dcos for microfacets of roughness 1 from straight above.
    let closed = 1.0 - std::f64::consts::LN_2;
    let z = (energy - closed).abs() / (error + 1e-4 * closed);
    cases.push(Case::new(
        "what single scattering leaves of the rough conductor",
        "deviations from 1 − ln 2",
        AtMost(NO_ACCIDENT),
        z,
    ));
    cases
}

/// How far, in deviations of a normal variable, counts are from what is expected (Pearson's χ²).
pub fn deviations(counts: &[f64], expected: &[f64]) -> f64 {
    /// Cells are put together until this much is expected in them.
    const LEAST: f64 = 20.0;
    let (mut statistic, mut groups) = (0.0, 0);
    let (mut observed, mut mean) = (0.0, 0.0);
    for (count, expected) in counts.iter().zip(expected) {
        observed += count;
        mean += expected;
        if mean >= LEAST {
            statistic += (observed - mean).powi(2) / mean;
            groups += 1;
            (observed, mean) = (0.0, 0.0);
        }
    }
    // What is left expects little, and is a group of its own: samples may be where none should.
    if observed + mean > 0.0 {
        statistic += (observed - mean).powi(2) / mean.max(1.0);
        groups += 1;
    }
    normal_deviate(statistic, groups - 1)
}

/// χ² as a normal variable (Wilson and Hilferty 1931).
pub fn normal_deviate(chi_squared: f64, freedom: i32) -> f64 {
    let freedom = f64::from(freedom.max(1));
    let spread = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - 1.0 + spread) / spread.sqrt()
}

/// Cells of equal solid angle over the sphere.
pub struct Cells;

impl Cells {
    const ROWS: usize = 24;
    const COLUMNS: usize = 24;
    /// Quadrature nodes along each side of a cell. Densities end at outlines: with 16 a million samples tell
    /// the quadrature's error there from their own noise.
    const NODES: usize = 40;
    pub const COUNT: usize = Self::ROWS * Self::COLUMNS;

    pub fn of(w: Vec3) -> usize {
        let row = ((0.5 * (w.z + 1.0) * Self::ROWS as f32) as usize).min(Self::ROWS - 1);
        let phi = w.y.atan2(w.x) / TAU + 0.5;
        row * Self::COLUMNS + ((phi * Self::COLUMNS as f32) as usize).min(Self::COLUMNS - 1)
    }

    /// Integral of a density over each cell.
    pub fn integrate(pdf: impl Fn(Vec3) -> f32) -> Vec<f64> {
        let mut mass = vec![0.0; Self::COUNT];
        let (rows, columns) = (Self::ROWS * Self::NODES, Self::COLUMNS * Self::NODES);
        let area = 2.0 * std::f64::consts::TAU / (rows * columns) as f64;
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let z = (2 * row + 1) as f32 / rows as f32 - 1.0;
            let phi = TAU * ((column as f32 + 0.5) / columns as f32 - 0.5);
            let ring = (1.0 - z * z).sqrt();
            let w = Vec3::new(ring * phi.cos(), ring * phi.sin(), z);
            mass[row / Self::NODES * Self::COLUMNS + column / Self::NODES] += f64::from(pdf(w)) * area;
        }
        mass
    }
}

/// Deviations of a material's samples from a density.
fn sampled(bsdf: &Bsdf, wo: Vec3, samples: usize, pdf: impl Fn(Vec3) -> f32) -> f64 {
    let mut numbers = Pcg32::seed_from_u64(7);
    // The last cell is for what the density does not account for: specular samples and none.
    let mut counts = vec![0.0; Cells::COUNT + 1];
    for _ in 0..samples {
        let sample = bsdf.sample(wo, numbers.random(), Vec2::new(numbers.random(), numbers.random()));
        counts[sample.filter(|s| !s.specular).map_or(Cells::COUNT, |s| Cells::of(s.wi))] += 1.0;
    }
    let mut mass = Cells::integrate(pdf);
    mass.push((1.0 - mass.iter().sum::<f64>()).max(0.0));
    mass.iter_mut().for_each(|m| *m *= samples as f64);
    deviations(&counts, &mass)
}

/// Lobes that are wide enough for cells of one size.
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
        let scene = of_material(material);
        let off = [0.95, 0.5, 0.2, -0.6].map(|cos| {
            let wo = direction(cos);
            let bsdf = bsdf(&scene, wo);
            sampled(&bsdf, wo, samples, |wi| bsdf.pdf(wo, wi))
        });
        let name = format!("samples of {name} against their density");
        cases.push(Case::new(name, "deviations, by χ²", AtMost(NO_ACCIDENT), largest(off)));
    }
    let (scene, wo) = (of_material(&materials[0].1), direction(0.6));
    let wrong = sampled(&bsdf(&scene, wo), wo, samples, |wi| if wi.z > 0.0 { 1.0 / TAU } else { 0.0 });
    cases.push(Case::new(
        "planted: a density that forgets its cosine",
        "deviations, by χ²",
        AtLeast(NO_ACCIDENT),
        wrong,
    ));
    cases
}
