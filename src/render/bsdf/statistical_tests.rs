//! What every lobe owes, tested alike for all: samples follow their density, weights are `eval /
//! pdf`, no energy comes from nowhere, light can be followed both ways, and nothing is ever
//! negative or not a number.

use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::render::chi_squared::{p_value, significance};
use crate::scene::measured::MeasuredBrdf;

fn direction(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

fn mirror_like() -> Conductor {
    let k = fresnel::absorption_of_reflectance(Vec3::ONE);
    Conductor { eta: Vec3::ONE, k, ggx: Ggx::new(0.0, 0.0) }
}

fn gold(alpha_x: f32, alpha_y: f32) -> Conductor {
    let (eta, k) = (Vec3::new(0.18, 0.42, 1.37), Vec3::new(3.42, 2.35, 1.77));
    Conductor { eta, k, ggx: Ggx::new(alpha_x, alpha_y) }
}

/// All kinds of parts, with gloss and diffuse light on both sides.
fn sum(facets: Facets, colour: Vec3, dark: Vec3) -> Sum {
    let (diffuse, fresnel) = (0.3 * colour, FacetFresnel::Dielectric(1.0 / 1.5));
    let boundary = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
    Sum {
        diffuse: Some(Diffuse { reflectance: diffuse, transmittance: 0.2 * dark }),
        gloss: Some(Gloss { reflectance: 0.5 * dark, transmittance: 0.2 * colour, facets, fresnel }),
        dielectric: Some(TintedDielectric { boundary, reflected: dark, transmitted: dark }),
        straight: Some(Straight(0.1 * colour)),
    }
}

/// A diffuse base with a highlight.
static MEASURED: LazyLock<MeasuredBrdf> = LazyLock::new(|| {
    MeasuredBrdf::new(|wo, wi| {
        let half = (wo + wi).normalize();
        Vec3::new(0.2, 0.1, 0.05) + Vec3::splat(half.z.powi(80))
    })
});

/// Lobes of every kind that are not specular only, with a name.
fn glossy_lobes() -> Vec<(String, Box<dyn Scatter>)> {
    let mut lobes: Vec<(String, Box<dyn Scatter>)> = Vec::new();
    let mut add = |name: String, lobe: Box<dyn Scatter>| lobes.push((name, lobe));
    let (colour, dark) = (Vec3::new(0.8, 0.5, 0.1), Vec3::new(0.1, 0.3, 0.2));
    add("diffuse".into(), Box::new(Diffuse { reflectance: colour, transmittance: Vec3::ZERO }));
    add("diffuse transmission".into(), Box::new(Diffuse { reflectance: dark, transmittance: colour }));
    for (x, y) in [(1e-3, 1e-3), (0.03, 0.03), (0.3, 0.3), (1.0, 1.0), (0.05, 0.4)] {
        let ggx = Ggx::new(x, y);
        add(format!("conductor {x} {y}"), Box::new(gold(x, y)));
        add(format!("dielectric {x} {y}"), Box::new(Dielectric { eta: 1.5, ggx }));
        let coat = Coat::new(1.5, ggx);
        add(format!("coated diffuse {x} {y}"), Box::new(CoatedDiffuse::new(coat, colour)));
        add(format!("coated conductor {x} {y}"), Box::new(CoatedConductor::new(coat, gold(0.1, 0.2))));
    }
    add("dense dielectric".into(), Box::new(Dielectric { eta: 2.4, ggx: Ggx::new(0.2, 0.2) }));
    add("thin dielectric bubble".into(), Box::new(Dielectric { eta: 1.0 / 1.33, ggx: Ggx::new(0.2, 0.2) }));
    add("oren-nayar".into(), Box::new(OrenNayar::new(colour, 30.0)));
    for (x, y) in [(3.0, 3.0), (200.0, 200.0), (20.0, 500.0)] {
        let facets = Facets::Blinn(Blinn::new(x, y));
        let (eta, k) = (gold(1.0, 1.0).eta, gold(1.0, 1.0).k);
        let fresnel = FacetFresnel::Conductor { eta, k };
        let metal = Gloss { reflectance: Vec3::ONE, transmittance: Vec3::ZERO, facets, fresnel };
        add(format!("blinn metal {x} {y}"), Box::new(metal));
        add(format!("blend {x} {y}"), Box::new(FresnelBlend { diffuse: colour, specular: dark, facets }));
        add(format!("sum {x} {y}"), Box::new(sum(facets, colour, dark)));
    }
    let facets = Facets::Ggx(Ggx::new(0.2, 0.3));
    add("blend ggx".into(), Box::new(FresnelBlend { diffuse: colour, specular: dark, facets }));
    add("measured".into(), Box::new(Measured { table: &MEASURED }));
    let smooth = Coat::new(1.5, Ggx::new(0.0, 0.0));
    add("smoothly coated diffuse".into(), Box::new(CoatedDiffuse::new(smooth, colour)));
    for alpha in [0.05, 0.5] {
        let lobe = CoatedConductor::new(smooth, gold(alpha, alpha));
        add(format!("smoothly coated conductor {alpha}"), Box::new(lobe));
    }
    lobes
}

fn outgoing() -> Vec<Vec3> {
    let above = [(1.0, 0.0), (0.8, 0.5), (0.4, 2.0), (0.08, -1.0)].map(|(cos, phi)| direction(cos, phi));
    above.into_iter().chain([direction(0.7, 1.0), direction(0.2, 4.0)].map(|w| -w)).collect()
}

/// A partition of the sphere into cells that are small around the directions where smooth glass
/// would send light. Each hemisphere has rings around its own such pole; those that reach into the
/// other hemisphere are cut at the horizon.
struct Cells {
    poles: [Frame; 2],
}

impl Cells {
    const RINGS: usize = 20;
    const SECTORS: usize = 8;
    const COUNT: usize = 2 * Self::RINGS * Self::SECTORS;
    /// Rings are bounded by angles π tᵖ of evenly spaced t.
    const POWER: f32 = 4.0;
    /// Quadrature nodes along each side of a cell.
    const NODES: usize = 32;

    fn around(wo: Vec3, eta: f32) -> Self {
        let normal = Vec3::Z * wo.z.signum();
        let eta = if wo.z > 0.0 { eta } else { 1.0 / eta };
        let through = fresnel::refract(wo, normal, eta).unwrap_or(-wo);
        let (up, down) = if wo.z > 0.0 { (frame::mirror(wo), through) } else { (through, frame::mirror(wo)) };
        Self { poles: [up, down].map(|pole| Frame::new(pole, Vec3::X)) }
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

/// Probability that samples of a lobe with this density would differ from it as much as they do.
fn chi_squared(lobe: &dyn Scatter, wo: Vec3, eta: f32, pdf: impl Fn(Vec3) -> f32) -> f64 {
    const SAMPLES: usize = 40_000;
    let cells = Cells::around(wo, eta);
    let mut rng = Pcg32::seed_from_u64(7);
    // The last cell is for what the density does not account for: specular samples and none.
    let mut counts = vec![0.0; Cells::COUNT + 1];
    for _ in 0..SAMPLES {
        let sample = lobe.sample(wo, rng.random(), Vec2::new(rng.random(), rng.random()));
        let cell = sample.filter(|s| !s.specular).map_or(Cells::COUNT, |s| cells.index(s.wi));
        counts[cell] += 1.0;
    }
    let mut mass = cells.integrate(pdf);
    mass.push((1.0 - mass.iter().sum::<f64>()).max(0.0));
    mass.iter_mut().for_each(|m| *m *= SAMPLES as f64);
    p_value(&counts, &mass)
}

fn index_of(name: &str) -> f32 {
    match name {
        "dense dielectric" => 2.4,
        "thin dielectric bubble" => 1.0 / 1.33,
        _ => 1.5,
    }
}

#[test]
fn samples_follow_their_density() {
    let (lobes, directions) = (glossy_lobes(), outgoing());
    let level = significance(lobes.len() * directions.len());
    for (name, lobe) in &lobes {
        for &wo in &directions {
            let p = chi_squared(&**lobe, wo, index_of(name), |wi| lobe.pdf(wo, wi));
            assert!(p > level, "{name} from {wo}: p = {p:e}");
        }
    }
}

#[test]
fn a_density_without_its_cosine_does_not_pass() {
    let lobe = Diffuse { reflectance: Vec3::ONE, transmittance: Vec3::ZERO };
    let wo = direction(0.6, 0.0);
    let wrong = |wi: Vec3| if wi.z > 0.0 { FRAC_1_PI / 2.0 } else { 0.0 };
    assert!(chi_squared(&lobe, wo, 1.5, wrong) < 1e-9);
    let lobe = gold(0.3, 0.3);
    let wrong = |wi: Vec3| lobe.pdf(wo, wi) * 0.95;
    assert!(chi_squared(&lobe, wo, 1.5, wrong) < 1e-9);
}

#[test]
fn weights_are_eval_over_pdf() {
    let mut rng = Pcg32::seed_from_u64(11);
    for (name, lobe) in glossy_lobes() {
        for wo in outgoing() {
            for _ in 0..200 {
                let u = Vec2::new(rng.random(), rng.random());
                let Some(s) = lobe.sample(wo, rng.random(), u).filter(|s| !s.specular) else { continue };
                let (eval, pdf) = (lobe.eval(wo, s.wi), lobe.pdf(wo, s.wi));
                assert!((pdf - s.pdf).abs() <= 1e-4 * pdf, "{name} {wo} {s:?}: pdf {pdf}");
                let error = (eval / pdf - s.weight).abs().max_element();
                // Microfacets at the horizon lose digits in the half vector.
                assert!(error <= 5e-3 * s.weight.max_element() + 1e-5, "{name} {wo} {s:?}: {}", eval / pdf);
            }
        }
    }
}

/// Mean weight of samples: the share of light that is scattered, with refracted radiance counted
/// as energy.
fn furnace(lobe: &dyn Scatter, wo: Vec3) -> (Vec3, f32) {
    const GRID: usize = 40;
    let mut rng = Pcg32::seed_from_u64(3);
    let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
    let count = (GRID * GRID) as f32;
    for i in 0..GRID * GRID {
        // Jittered where it matters most, so that a few samples are enough.
        let cell = Vec2::new((i / GRID) as f32, (i % GRID) as f32);
        let u = (cell + Vec2::new(rng.random(), rng.random())) / GRID as f32;
        if let Some(s) = lobe.sample(wo, rng.random(), u) {
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
fn no_lobe_makes_energy() {
    for (name, lobe) in glossy_lobes() {
        for wo in outgoing() {
            let (energy, error) = furnace(&*lobe, wo);
            assert!(energy.max_element() <= 1.0 + 4.0 * error + 1e-4, "{name} {wo}: {energy} ± {error}");
        }
    }
}

#[test]
fn smooth_glass_and_panes_lose_nothing() {
    let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
    let pane = ThinDielectric { eta: 1.5 };
    let lobes: [&dyn Scatter; 2] = [&glass, &pane];
    for lobe in lobes {
        for wo in outgoing() {
            let (energy, _) = furnace(lobe, wo);
            assert!((energy - 1.0).abs().max_element() < 1e-4, "{wo}: {energy}");
        }
    }
}

#[test]
fn a_white_metal_loses_only_what_microfacets_hide() {
    // From straight above, alpha = 1: ∫ 2 cos / (1 + cos) / 2 dcos = 1 − ln 2.
    for (alpha, expected) in [(0.0, 0.9999), (1.0, 1.0 - 2f32.ln())] {
        let lobe = Conductor { ggx: Ggx::new(alpha, alpha), ..mirror_like() };
        let (energy, error) = furnace(&lobe, Vec3::Z);
        assert!((energy - expected).abs().max_element() < 4.0 * error + 1e-4, "{alpha}: {energy}");
    }
}

#[test]
fn a_white_base_under_a_coat_loses_nothing() {
    for alpha in [0.0, 0.05, 0.4, 1.0] {
        let lobe = CoatedDiffuse::new(Coat::new(1.5, Ggx::new(alpha, alpha)), Vec3::ONE);
        for cos in [1.0, 0.6, 0.2] {
            let (energy, error) = furnace(&lobe, direction(cos, 0.3));
            assert!(
                (energy - 1.0).abs().max_element() < 0.01 + 4.0 * error,
                "{alpha} {cos}: {energy} ± {error}"
            );
        }
    }
}

#[test]
fn a_white_metal_loses_about_as_much_under_a_coat_as_without() {
    for (coat, alpha) in [(0.0, 0.0), (0.0, 0.05), (0.0, 0.5), (0.2, 0.1), (0.5, 0.5)] {
        let base = Conductor { ggx: Ggx::new(alpha, alpha), ..mirror_like() };
        let lobe = CoatedConductor::new(Coat::new(1.5, Ggx::new(coat, coat)), base);
        for cos in [1.0, 0.6, 0.2] {
            let wo = direction(cos, 0.3);
            let (energy, error) = furnace(&lobe, wo);
            let bare = furnace(&base, coated_conductor::inside(wo, 1.5)).0;
            let (energy, bare) = (energy.max_element(), bare.max_element());
            assert!(energy < 1.01 + 4.0 * error, "{coat} {alpha} {cos}: {energy} ± {error}");
            assert!(energy > bare - 0.03 - 4.0 * error, "{coat} {alpha} {cos}: {energy} ± {error}, {bare}");
        }
    }
}

/// Share of light that a flat coat over a diffuse base sends back, by following the light.
fn walk_under_smooth_coat(cos: f32, eta: f32, albedo: f32, paths: usize) -> f32 {
    let mut rng = Pcg32::seed_from_u64(23);
    let mut sum = 0.0;
    let reflected = fresnel::dielectric(cos, eta);
    for _ in 0..paths {
        let mut light = 1.0 - reflected;
        loop {
            light *= albedo;
            if light < 1e-5 {
                break;
            }
            let up = diffuse::cosine_sample(Vec2::new(rng.random(), rng.random()));
            let back = fresnel::dielectric(up.z, 1.0 / eta);
            if rng.random::<f32>() >= back {
                sum += f64::from(light);
                break;
            }
        }
    }
    reflected + (sum / paths as f64) as f32
}

#[test]
fn a_coated_diffuse_surface_reflects_what_a_random_walk_does() {
    for (eta, albedo) in [(1.5, 0.8), (1.5, 0.2), (1.8, 0.95)] {
        let lobe = CoatedDiffuse::new(Coat::new(eta, Ggx::new(0.0, 0.0)), Vec3::splat(albedo));
        for cos in [1.0, 0.5, 0.15] {
            let walk = walk_under_smooth_coat(cos, eta, albedo, 60_000);
            let (closed, error) = furnace(&lobe, direction(cos, 0.0));
            assert!(
                (closed.x - walk).abs() < 0.01 * walk + 4.0 * error,
                "{eta} {albedo} {cos}: {closed} {walk}"
            );
            assert!((lobe.albedo(direction(cos, 0.0)).x - walk).abs() < 0.01 * walk);
        }
    }
}

#[test]
fn light_can_be_followed_both_ways() {
    let mut rng = Pcg32::seed_from_u64(5);
    let mut random_direction = || direction(rng.random_range(-0.99..0.99), rng.random_range(0.0..2.0 * PI));
    for (name, lobe) in glossy_lobes() {
        for _ in 0..300 {
            let (a, b) = (random_direction(), random_direction());
            if on_horizon(a) || on_horizon(b) {
                continue;
            }
            let eta = match name.contains("dielectric") && a.z * b.z < 0.0 {
                true if a.z > 0.0 => index_of(&name),
                true => 1.0 / index_of(&name),
                false => 1.0,
            };
            let (there, back) = (lobe.eval(a, b) / b.z.abs() * (eta * eta), lobe.eval(b, a) / a.z.abs());
            let error = (there - back).abs().max_element();
            assert!(error <= 2e-3 * there.max_element() + 1e-6, "{name} {a} {b}: {there} {back}");
        }
    }
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
fn extreme_values_give_no_nan_and_nothing_negative() {
    let alphas = [(0.0, 0.0), (1e-4, 1e-4), (1e-3, 1e-3), (1e-4, 1.0), (1.0, 1.0)];
    let cosines = [1.0, 0.5, 1e-2, 2e-6, 1e-7, 0.0, -1e-7, -2e-6, -0.5, -1.0];
    let numbers = [0.0, 1e-7, 0.5, 1.0 - f32::EPSILON];
    let good = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
    for (x, y) in alphas {
        let ggx = Ggx::new(x, y);
        let mut lobes = vec![
            Lobe::Diffuse(Diffuse { reflectance: Vec3::ZERO, transmittance: Vec3::ZERO }),
            Lobe::Diffuse(Diffuse { reflectance: Vec3::ZERO, transmittance: Vec3::X }),
            Lobe::Conductor(Conductor { ggx, ..mirror_like() }),
            Lobe::Conductor(Conductor { eta: Vec3::ONE, k: Vec3::ZERO, ggx }),
            Lobe::Conductor(Conductor { eta: Vec3::ZERO, k: Vec3::splat(1e4), ggx }),
        ];
        for eta in [1.0, 1.0 + 1e-6, 1.5, 1e-3, 1e3] {
            let coat = Coat::new(eta, ggx);
            lobes.extend([
                Lobe::Dielectric(Dielectric { eta, ggx }),
                Lobe::ThinDielectric(ThinDielectric { eta }),
                Lobe::CoatedDiffuse(CoatedDiffuse::new(coat, Vec3::ZERO)),
                Lobe::CoatedDiffuse(CoatedDiffuse::new(coat, Vec3::ONE)),
                Lobe::CoatedConductor(CoatedConductor::new(coat, mirror_like())),
                Lobe::CoatedConductor(CoatedConductor::new(coat, gold(1e-3, 0.5))),
                Lobe::CoatedConductor(CoatedConductor::new(
                    coat,
                    Conductor { eta: Vec3::ONE, k: Vec3::ZERO, ggx: Ggx::new(1.0, 1.0) },
                )),
            ]);
        }
        let directions: Vec<Vec3> =
            cosines.iter().flat_map(|&c| [direction(c, 0.0), direction(c, PI), direction(c, 1.0)]).collect();
        for lobe in lobes {
            for &wo in &directions {
                let bsdf = Bsdf { frame: Frame::new(Vec3::Z, Vec3::X), lobe, wo };
                assert!(good(bsdf.albedo()) && bsdf.albedo().max_element() <= 1.0, "{lobe:?} {wo}");
                for &wi in &directions {
                    let (eval, pdf) = (bsdf.eval(wo, wi), bsdf.pdf(wo, wi));
                    assert!(good(eval) && pdf.is_finite() && pdf >= 0.0, "{lobe:?} {wo} {wi}: {eval} {pdf}");
                }
                for u_lobe in numbers {
                    for u in numbers.iter().flat_map(|&a| numbers.map(|b| Vec2::new(a, b))) {
                        let Some(s) = bsdf.sample(wo, u_lobe, u) else { continue };
                        let fine = good(s.weight)
                            && s.pdf.is_finite()
                            && (s.wi.length() - 1.0).abs() < 1e-5
                            && (s.specular || s.pdf > 0.0);
                        assert!(fine, "{lobe:?} {wo} {u_lobe} {u}: {s:?}");
                    }
                }
            }
        }
    }
}
