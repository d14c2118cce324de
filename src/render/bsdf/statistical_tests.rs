//! Tests of every scattering model: samples follow their density, weights are `eval / pdf`, energy is not created,
//! models are reciprocal, and no result is negative or NaN.

use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::blinn::Blinn;
use super::bxdf_sum::BxdfSum;
use super::coat::Coat;
use super::coated_conductor::CoatedConductor;
use super::coated_diffuse::CoatedDiffuse;
use super::conductor::Conductor;
use super::dielectric::Dielectric;
use super::diffuse::Diffuse;
use super::directions::{on_horizon, reflect, sample_cosine_hemisphere};
use super::fresnel_blend::FresnelBlend;
use super::ggx::Ggx;
use super::measured::Measured;
use super::microfacet_distribution::MicrofacetDistribution;
use super::microfacet_lobe::{MicrofacetFresnel, MicrofacetLobe};
use super::null_transmission::NullTransmission;
use super::oren_nayar::OrenNayar;
use super::thin_dielectric::ThinDielectric;
use super::tinted_dielectric::TintedDielectric;
use super::*;
use crate::render::chi_squared::{p_value, significance};
use crate::scene::measured_brdf::MeasuredBrdf;

fn direction(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

fn mirror_like() -> Conductor {
    let k = fresnel::absorption_from_reflectance(Vec3::ONE);
    Conductor { eta: Vec3::ONE, k, ggx: Ggx::new(0.0, 0.0) }
}

fn gold(alpha_x: f32, alpha_y: f32) -> Conductor {
    let (eta, k) = (Vec3::new(0.18, 0.42, 1.37), Vec3::new(3.42, 2.35, 1.77));
    Conductor { eta, k, ggx: Ggx::new(alpha_x, alpha_y) }
}

/// A sum of all four bxdfs, with reflection and transmission each.
fn sum(distribution: MicrofacetDistribution, colour: Vec3, dark: Vec3) -> BxdfSum {
    let (diffuse, fresnel) =
        (0.3 * colour, MicrofacetFresnel::Dielectric { front: 1.0 / 1.5, back: 1.0 / 1.5 });
    let dielectric = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
    BxdfSum {
        diffuse: Some(Diffuse { reflectance: diffuse, transmittance: 0.2 * dark }),
        microfacet: Some(MicrofacetLobe {
            reflectance: 0.5 * dark,
            transmittance: 0.2 * colour,
            distribution,
            fresnel,
        }),
        dielectric: Some(TintedDielectric { dielectric, reflected: dark, transmitted: dark }),
        null: Some(NullTransmission(0.1 * colour)),
    }
}

/// Rough glass of the older dialects without reflection.
fn only_transmitting(transmitted: Vec3) -> BxdfSum {
    let dielectric = Dielectric { eta: 1.5, ggx: Ggx::new(0.5, 0.5) };
    let glass = TintedDielectric { dielectric, reflected: Vec3::ZERO, transmitted };
    BxdfSum { dielectric: Some(glass), ..BxdfSum::default() }
}

/// A diffuse base with a highlight.
static MEASURED: LazyLock<MeasuredBrdf> = LazyLock::new(|| {
    MeasuredBrdf::new(|wo, wi| {
        let half = (wo + wi).normalize();
        Vec3::new(0.2, 0.1, 0.05) + Vec3::splat(half.z.powi(80))
    })
});

/// Models of every kind with a bxdf that is not specular, with their names.
fn glossy_bxdfs() -> Vec<(String, Box<dyn Bxdf>)> {
    let mut bxdfs: Vec<(String, Box<dyn Bxdf>)> = Vec::new();
    let mut add = |name: String, bxdf: Box<dyn Bxdf>| bxdfs.push((name, bxdf));
    let (colour, dark) = (Vec3::new(0.8, 0.5, 0.1), Vec3::new(0.1, 0.3, 0.2));
    add("diffuse".into(), Box::new(Diffuse { reflectance: colour, transmittance: Vec3::ZERO }));
    add("diffuse transmission".into(), Box::new(Diffuse { reflectance: dark, transmittance: colour }));
    for (x, y) in [(1e-3, 1e-3), (0.03, 0.03), (0.3, 0.3), (1.0, 1.0), (1.6, 1.6), (0.05, 0.4)] {
        let ggx = Ggx::new(x, y);
        add(format!("conductor {x} {y}"), Box::new(gold(x, y)));
        add(format!("dielectric {x} {y}"), Box::new(Dielectric { eta: 1.5, ggx }));
        let coat = Coat::new(1.5, ggx, 0.01);
        add(format!("coated diffuse {x} {y}"), Box::new(CoatedDiffuse::new(coat, colour)));
        add(format!("coated conductor {x} {y}"), Box::new(CoatedConductor::new(coat, gold(0.1, 0.2))));
    }
    add("dense dielectric".into(), Box::new(Dielectric { eta: 2.4, ggx: Ggx::new(0.2, 0.2) }));
    add("thin dielectric bubble".into(), Box::new(Dielectric { eta: 1.0 / 1.33, ggx: Ggx::new(0.2, 0.2) }));
    add("dielectric that only transmits".into(), Box::new(only_transmitting(colour)));
    add("oren-nayar".into(), Box::new(OrenNayar::new(colour, 30.0)));
    for (x, y) in [(3.0, 3.0), (200.0, 200.0), (20.0, 500.0)] {
        let distribution = MicrofacetDistribution::Blinn(Blinn::new(x, y));
        let (eta, k) = (gold(1.0, 1.0).eta, gold(1.0, 1.0).k);
        let fresnel = MicrofacetFresnel::Conductor { eta, k };
        let metal =
            MicrofacetLobe { reflectance: Vec3::ONE, transmittance: Vec3::ZERO, distribution, fresnel };
        add(format!("blinn metal {x} {y}"), Box::new(metal));
        let fresnel = MicrofacetFresnel::Dielectric { front: 1.0 / 1.5, back: 1.5 };
        let plastic = MicrofacetLobe { fresnel, ..metal };
        add(format!("blinn plastic {x} {y}"), Box::new(plastic));
        add(
            format!("blend {x} {y}"),
            Box::new(FresnelBlend { diffuse: colour, specular: dark, distribution }),
        );
        add(format!("sum {x} {y}"), Box::new(sum(distribution, colour, dark)));
    }
    let distribution = MicrofacetDistribution::Ggx(Ggx::new(0.2, 0.3));
    add("blend ggx".into(), Box::new(FresnelBlend { diffuse: colour, specular: dark, distribution }));
    add("measured".into(), Box::new(Measured { table: &MEASURED }));
    let smooth = Coat::new(1.5, Ggx::new(0.0, 0.0), 0.1);
    add("smoothly coated diffuse".into(), Box::new(CoatedDiffuse::new(smooth, colour)));
    for alpha in [0.05, 0.5] {
        let bxdf = CoatedConductor::new(smooth, gold(alpha, alpha));
        add(format!("smoothly coated conductor {alpha}"), Box::new(bxdf));
    }
    bxdfs
}

fn outgoing() -> Vec<Vec3> {
    let above = [(1.0, 0.0), (0.8, 0.5), (0.4, 2.0), (0.08, -1.0)].map(|(cos, phi)| direction(cos, phi));
    above.into_iter().chain([direction(0.7, 1.0), direction(0.2, 4.0)].map(|w| -w)).collect()
}

/// A partition of the sphere into cells that are small around the directions of specular reflection and
/// refraction. Each hemisphere has rings around one of these poles, cut at the horizon.
struct Cells {
    poles: [ShadingFrame; 2],
}

impl Cells {
    const RINGS: usize = 20;
    const SECTORS: usize = 8;
    const COUNT: usize = 2 * Self::RINGS * Self::SECTORS;
    /// The rings are bounded by the angles π tᵖ of uniformly spaced t.
    const POWER: f32 = 4.0;
    /// Quadrature nodes along each side of a cell.
    const NODES: usize = 32;

    fn new(wo: Vec3, eta: f32) -> Self {
        let normal = Vec3::Z * wo.z.signum();
        let eta = if wo.z > 0.0 { eta } else { 1.0 / eta };
        let refracted = fresnel::refract(wo, normal, eta).unwrap_or(-wo);
        let (up, down) = if wo.z > 0.0 { (reflect(wo), refracted) } else { (refracted, reflect(wo)) };
        Self { poles: [up, down].map(|pole| ShadingFrame::new(pole, Vec3::X)) }
    }

    fn index(&self, w: Vec3) -> usize {
        let side = usize::from(w.z < 0.0);
        let local = self.poles[side].to_local(w);
        let sin = local.x.hypot(local.y);
        let t = (sin.atan2(local.z) / PI).powf(1.0 / Self::POWER);
        let ring = ((t * Self::RINGS as f32) as usize).min(Self::RINGS - 1);
        let phi = local.y.atan2(local.x) / (2.0 * PI) + 0.5;
        let sector = ((phi * Self::SECTORS as f32) as usize).min(Self::SECTORS - 1);
        (side * Self::RINGS + ring) * Self::SECTORS + sector
    }

    /// Integral of a density over each cell.
    fn integrate(&self, pdf: impl Fn(Vec3) -> f32) -> Vec<f64> {
        let mut mass = vec![0.0; Self::COUNT];
        let (rows, columns) = (Self::RINGS * Self::NODES, Self::SECTORS * Self::NODES);
        for (side, pole) in self.poles.iter().enumerate() {
            for row in 0..rows {
                let t = (row as f32 + 0.5) / rows as f32;
                let theta = PI * t.powf(Self::POWER);
                let d_theta = PI * Self::POWER * t.powf(Self::POWER - 1.0) / rows as f32;
                let area = theta.sin() * d_theta * 2.0 * PI / columns as f32;
                for column in 0..columns {
                    let phi = 2.0 * PI * ((column as f32 + 0.5) / columns as f32 - 0.5);
                    let local = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                    let w = pole.to_render(local);
                    if !on_horizon(w) && usize::from(w.z < 0.0) == side {
                        let cell =
                            (side * Self::RINGS + row / Self::NODES) * Self::SECTORS + column / Self::NODES;
                        mass[cell] += f64::from(pdf(w) * area);
                    }
                }
            }
        }
        mass
    }
}

/// The p-value of the hypothesis that the samples of a model follow a density.
fn chi_squared(bxdf: &dyn Bxdf, wo: Vec3, eta: f32, pdf: impl Fn(Vec3) -> f32) -> f64 {
    const SAMPLES: usize = 40_000;
    let cells = Cells::new(wo, eta);
    let mut rng = Pcg32::seed_from_u64(7);
    // The last cell counts what the density excludes: specular samples, and no sample.
    let mut counts = vec![0.0; Cells::COUNT + 1];
    for _ in 0..SAMPLES {
        let sample = bxdf.sample(wo, rng.random(), Vec2::new(rng.random(), rng.random()));
        let cell = sample.filter(|s| !s.specular).map_or(Cells::COUNT, |s| cells.index(s.wi));
        counts[cell] += 1.0;
    }
    let mut mass = cells.integrate(pdf);
    mass.push((1.0 - mass.iter().sum::<f64>()).max(0.0));
    mass.iter_mut().for_each(|m| *m *= SAMPLES as f64);
    p_value(&counts, &mass)
}

fn index_of_refraction(name: &str) -> f32 {
    match name {
        "dense dielectric" => 2.4,
        "thin dielectric bubble" => 1.0 / 1.33,
        _ => 1.5,
    }
}

#[test]
fn samples_follow_their_density() {
    let (bxdfs, directions) = (glossy_bxdfs(), outgoing());
    let level = significance(bxdfs.len() * directions.len());
    for (name, bxdf) in &bxdfs {
        for &wo in &directions {
            let p = chi_squared(&**bxdf, wo, index_of_refraction(name), |wi| bxdf.pdf(wo, wi));
            assert!(p > level, "{name} from {wo}: p = {p:e}");
        }
    }
}

#[test]
fn wrong_densities_are_rejected() {
    let bxdf = Diffuse { reflectance: Vec3::ONE, transmittance: Vec3::ZERO };
    let wo = direction(0.6, 0.0);
    let wrong = |wi: Vec3| if wi.z > 0.0 { FRAC_1_PI / 2.0 } else { 0.0 };
    assert!(chi_squared(&bxdf, wo, 1.5, wrong) < 1e-9);
    let bxdf = gold(0.3, 0.3);
    let wrong = |wi: Vec3| bxdf.pdf(wo, wi) * 0.95;
    assert!(chi_squared(&bxdf, wo, 1.5, wrong) < 1e-9);
}

#[test]
fn weights_are_eval_over_pdf() {
    let mut rng = Pcg32::seed_from_u64(11);
    for (name, bxdf) in glossy_bxdfs() {
        for wo in outgoing() {
            for _ in 0..200 {
                let u = Vec2::new(rng.random(), rng.random());
                let Some(s) = bxdf.sample(wo, rng.random(), u).filter(|s| !s.specular) else { continue };
                let (eval, pdf) = (bxdf.eval(wo, s.wi), bxdf.pdf(wo, s.wi));
                assert!((pdf - s.pdf).abs() <= 1e-4 * pdf, "{name} {wo} {s:?}: pdf {pdf}");
                let error = (eval / pdf - s.weight).abs().max_element();
                // Microfacets at the horizon lose digits in the half vector.
                assert!(error <= 5e-3 * s.weight.max_element() + 1e-5, "{name} {wo} {s:?}: {}", eval / pdf);
            }
        }
    }
}

/// Albedo in a white furnace, with refracted radiance converted to energy, and its standard error.
fn furnace(bxdf: &dyn Bxdf, wo: Vec3) -> (Vec3, f32) {
    const GRID: usize = 40;
    let mut rng = Pcg32::seed_from_u64(3);
    let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
    let count = (GRID * GRID) as f32;
    for i in 0..GRID * GRID {
        // Stratification makes a few samples enough.
        let cell = Vec2::new((i / GRID) as f32, (i % GRID) as f32);
        let u = (cell + Vec2::new(rng.random(), rng.random())) / GRID as f32;
        if let Some(s) = bxdf.sample(wo, rng.random(), u) {
            let energy = s.weight * (s.eta * s.eta);
            sum += energy;
            squares += energy.max_element().powi(2);
        }
    }
    let mean = sum / count;
    let error = ((squares / count - mean.max_element().powi(2)).max(0.0) / count).sqrt();
    (mean, error)
}

#[test]
fn energy_is_not_created() {
    for (name, bxdf) in glossy_bxdfs() {
        for wo in outgoing() {
            let (energy, error) = furnace(&*bxdf, wo);
            assert!(energy.max_element() <= 1.0 + 4.0 * error + 1e-4, "{name} {wo}: {energy} ± {error}");
        }
    }
}

#[test]
fn smooth_dielectrics_conserve_energy() {
    let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
    let pane = ThinDielectric { eta: 1.5 };
    let bxdfs: [&dyn Bxdf; 2] = [&glass, &pane];
    for bxdf in bxdfs {
        for wo in outgoing() {
            let (energy, _) = furnace(bxdf, wo);
            assert!((energy - 1.0).abs().max_element() < 1e-4, "{wo}: {energy}");
        }
    }
}

#[test]
fn a_white_conductor_loses_the_energy_that_microfacets_mask() {
    // From straight above, alpha = 1: ∫ 2 cos / (1 + cos) / 2 dcos = 1 − ln 2.
    for (alpha, expected) in [(0.0, 0.9999), (1.0, 1.0 - 2f32.ln())] {
        let bxdf = Conductor { ggx: Ggx::new(alpha, alpha), ..mirror_like() };
        let (energy, error) = furnace(&bxdf, Vec3::Z);
        assert!((energy - expected).abs().max_element() < 4.0 * error + 1e-4, "{alpha}: {energy}");
    }
}

#[test]
fn a_white_base_under_a_coat_conserves_energy() {
    for alpha in [0.0, 0.05, 0.4, 1.0] {
        let bxdf = CoatedDiffuse::new(Coat::new(1.5, Ggx::new(alpha, alpha), 0.0), Vec3::ONE);
        for cos in [1.0, 0.6, 0.2] {
            let (energy, error) = furnace(&bxdf, direction(cos, 0.3));
            assert!(
                (energy - 1.0).abs().max_element() < 0.01 + 4.0 * error,
                "{alpha} {cos}: {energy} ± {error}"
            );
        }
    }
}

#[test]
fn a_white_conductor_loses_similar_energy_with_and_without_a_coat() {
    for (coat, alpha) in [(0.0, 0.0), (0.0, 0.05), (0.0, 0.5), (0.2, 0.1), (0.5, 0.5)] {
        let base = Conductor { ggx: Ggx::new(alpha, alpha), ..mirror_like() };
        let bxdf = CoatedConductor::new(Coat::new(1.5, Ggx::new(coat, coat), 0.0), base);
        for cos in [1.0, 0.6, 0.2] {
            let wo = direction(cos, 0.3);
            let (energy, error) = furnace(&bxdf, wo);
            let bare = furnace(&base, coated_conductor::inside(wo, 1.5)).0;
            let (energy, bare) = (energy.max_element(), bare.max_element());
            assert!(energy < 1.01 + 4.0 * error, "{coat} {alpha} {cos}: {energy} ± {error}");
            assert!(energy > bare - 0.03 - 4.0 * error, "{coat} {alpha} {cos}: {energy} ± {error}, {bare}");
        }
    }
}

/// Albedo of a smooth coat over a diffuse base by a random walk.
fn random_walk_albedo(cos: f32, eta: f32, albedo: f32, thickness: f32, paths: usize) -> f32 {
    let mut rng = Pcg32::seed_from_u64(23);
    let mut sum = 0.0;
    let reflected = fresnel::dielectric(cos, eta);
    for _ in 0..paths {
        let crossing = |cos_inside: f32| (-thickness / cos_inside).exp();
        let mut light = (1.0 - reflected) * crossing((1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt());
        loop {
            light *= albedo;
            if light < 1e-5 {
                break;
            }
            let up = sample_cosine_hemisphere(Vec2::new(rng.random(), rng.random()));
            light *= crossing(up.z);
            let reflectance = fresnel::dielectric(up.z, 1.0 / eta);
            if rng.random::<f32>() >= reflectance {
                sum += f64::from(light);
                break;
            }
            light *= crossing(up.z);
        }
    }
    reflected + (sum / paths as f64) as f32
}

#[test]
fn the_albedo_of_a_coated_diffuse_surface_is_that_of_a_random_walk() {
    for (eta, albedo, thickness) in [
        (1.5, 0.8, 0.0),
        (1.5, 0.8, 0.01),
        (1.5, 0.2, 0.3),
        (1.8, 0.95, 0.0),
        (1.8, 0.95, 0.1),
        (1.0, 0.5, 1.0),
    ] {
        let coat = Coat::new(eta, Ggx::new(0.0, 0.0), thickness);
        let bxdf = CoatedDiffuse::new(coat, Vec3::splat(albedo));
        for cos in [1.0, 0.5, 0.15] {
            let walk = random_walk_albedo(cos, eta, albedo, thickness, 60_000);
            let (closed, error) = furnace(&bxdf, direction(cos, 0.0));
            assert!(
                (closed.x - walk).abs() < 0.01 * walk + 4.0 * error,
                "{eta} {albedo} {thickness} {cos}: {closed} {walk}"
            );
            assert!((bxdf.albedo(direction(cos, 0.0)).x - walk).abs() < 0.01 * walk);
        }
    }
}

#[test]
fn models_are_reciprocal() {
    let mut rng = Pcg32::seed_from_u64(5);
    let mut random_direction = || direction(rng.random_range(-0.99..0.99), rng.random_range(0.0..2.0 * PI));
    for (name, bxdf) in glossy_bxdfs() {
        for _ in 0..300 {
            let (a, b) = (random_direction(), random_direction());
            if on_horizon(a) || on_horizon(b) {
                continue;
            }
            let eta = match name.contains("dielectric") && a.z * b.z < 0.0 {
                true if a.z > 0.0 => index_of_refraction(&name),
                true => 1.0 / index_of_refraction(&name),
                false => 1.0,
            };
            let (forward, backward) =
                (bxdf.eval(a, b) / b.z.abs() * (eta * eta), bxdf.eval(b, a) / a.z.abs());
            let error = (forward - backward).abs().max_element();
            assert!(error <= 2e-3 * forward.max_element() + 1e-6, "{name} {a} {b}: {forward} {backward}");
        }
    }
}

#[test]
fn rough_glass_that_only_transmits_does_so_beyond_the_critical_angle() {
    let mut rng = Pcg32::seed_from_u64(17);
    let (glass, wo) = (only_transmitting(Vec3::ONE), -direction(0.5, 1.0));
    let mut sample = || glass.sample(wo, rng.random(), Vec2::new(rng.random(), rng.random()));
    let is_lit = |s: BsdfSample| s.transmission && s.weight.min_element() > 0.0;
    assert!((0..200).any(|_| sample().is_some_and(is_lit)));
}

#[test]
fn transmission_is_marked_as_such() {
    let mut rng = Pcg32::seed_from_u64(13);
    let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.3, 0.3) };
    for wo in outgoing() {
        for _ in 0..200 {
            let u = Vec2::new(rng.random(), rng.random());
            let Some(s) = glass.sample(wo, rng.random(), u) else { continue };
            let expected = match (s.wi.z * wo.z < 0.0, wo.z > 0.0) {
                (false, _) => 1.0,
                (true, true) => 1.5,
                (true, false) => 1.0 / 1.5,
            };
            assert_eq!(s.transmission, s.wi.z * wo.z < 0.0);
            assert_eq!(s.eta, expected);
        }
    }
}

#[test]
fn extreme_parameters_give_finite_non_negative_results() {
    let alphas = [(0.0, 0.0), (1e-4, 1e-4), (1e-3, 1e-3), (1e-4, 1.0), (1.0, 1.0)];
    let cosines = [1.0, 0.5, 1e-2, 2e-6, 1e-7, 0.0, -1e-7, -2e-6, -0.5, -1.0];
    let sample_values = [0.0, 1e-7, 0.5, 1.0 - f32::EPSILON];
    let is_valid = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
    for (x, y) in alphas {
        let ggx = Ggx::new(x, y);
        let mut bxdfs = vec![
            AnyBxdf::Diffuse(Diffuse { reflectance: Vec3::ZERO, transmittance: Vec3::ZERO }),
            AnyBxdf::Diffuse(Diffuse { reflectance: Vec3::ZERO, transmittance: Vec3::X }),
            AnyBxdf::Conductor(Conductor { ggx, ..mirror_like() }),
            AnyBxdf::Conductor(Conductor { eta: Vec3::ONE, k: Vec3::ZERO, ggx }),
            AnyBxdf::Conductor(Conductor { eta: Vec3::ZERO, k: Vec3::splat(1e4), ggx }),
        ];
        for eta in [1.0, 1.0 + 1e-6, 1.5, 1e-3, 1e3] {
            let coat = Coat::new(eta, ggx, 0.01);
            bxdfs.extend([
                AnyBxdf::Dielectric(Dielectric { eta, ggx }),
                AnyBxdf::ThinDielectric(ThinDielectric { eta }),
                AnyBxdf::CoatedDiffuse(CoatedDiffuse::new(coat, Vec3::ZERO)),
                AnyBxdf::CoatedDiffuse(CoatedDiffuse::new(coat, Vec3::ONE)),
                AnyBxdf::CoatedConductor(CoatedConductor::new(coat, mirror_like())),
                AnyBxdf::CoatedConductor(CoatedConductor::new(coat, gold(1e-3, 0.5))),
                AnyBxdf::CoatedConductor(CoatedConductor::new(
                    coat,
                    Conductor { eta: Vec3::ONE, k: Vec3::ZERO, ggx: Ggx::new(1.0, 1.0) },
                )),
            ]);
        }
        let directions: Vec<Vec3> =
            cosines.iter().flat_map(|&c| [direction(c, 0.0), direction(c, PI), direction(c, 1.0)]).collect();
        for bxdf in bxdfs {
            for &wo in &directions {
                let bsdf = Bsdf { frame: ShadingFrame::new(Vec3::Z, Vec3::X), bxdf, wo };
                assert!(is_valid(bsdf.albedo()) && bsdf.albedo().max_element() <= 1.0, "{bxdf:?} {wo}");
                for &wi in &directions {
                    let (eval, pdf) = (bsdf.eval(wo, wi), bsdf.pdf(wo, wi));
                    assert!(
                        is_valid(eval) && pdf.is_finite() && pdf >= 0.0,
                        "{bxdf:?} {wo} {wi}: {eval} {pdf}"
                    );
                }
                for u_lobe in sample_values {
                    for u in sample_values.iter().flat_map(|&a| sample_values.map(|b| Vec2::new(a, b))) {
                        let Some(s) = bsdf.sample(wo, u_lobe, u) else { continue };
                        let is_sample_valid = is_valid(s.weight)
                            && s.pdf.is_finite()
                            && (s.wi.length() - 1.0).abs() < 1e-5
                            && (s.specular || s.pdf > 0.0);
                        assert!(is_sample_valid, "{bxdf:?} {wo} {u_lobe} {u}: {s:?}");
                    }
                }
            }
        }
    }
}
