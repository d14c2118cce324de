//! Cases on the camera: blur of lens and shutter, uniformity of its samples, independence of a pixel's halves.

use std::f64::consts::PI;

use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::stats::{Part, Store};

use super::case::Bound::{AtLeast, AtMost};
use super::case::{Case, largest};
use super::chi_squared::{MAX_Z, chi_squared_z, z_score};
use super::effort::Effort;
use super::light::one_point;
use super::renders::{green, mean, render, scene};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = Vec::new();
    cases.extend(lens(effort.select(256, 16_384)));
    cases.push(shutter(effort.select(256, 16_384)));
    cases.push(uniformity(effort.select(64, 256), effort.select(2, 4)));
    cases.extend(halves());
    cases
}

/// The axis of an image along which radiance changes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Axis {
    Columns,
    Rows,
}

/// z-score of the mean radiance of an image's columns (or rows) against `expected`, a function of the position in
/// [−1, 1] from left to right (or top to bottom). Radiance is 0 or 1 in each of the `samples` per pixel.
fn profile_z(axis: Axis, camera: &str, world: &str, samples: u32, expected: impl Fn(f64) -> f64) -> f64 {
    const LENGTH: usize = 32;
    const BREADTH: usize = 8;
    /// Quadrature nodes across a pixel.
    const NODES: usize = 64;
    let (width, height, window) = match axis {
        Axis::Columns => (LENGTH, BREADTH, "-1 1 -0.25 0.25"),
        Axis::Rows => (BREADTH, LENGTH, "-0.25 0.25 -1 1"),
    };
    let scene = scene(&format!(
        r#"LookAt 0 0 0  0 0 1  0 1 0 {camera} "float screenwindow" [ {window} ] Sampler "independent" PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
        Integrator "path" "integer maxdepth" 1
        Film "rgb" "integer xresolution" {width} "integer yresolution" {height} WorldBegin
        LightSource "infinite" "rgb L" [ 1 1 1 ] Material "diffuse" "rgb reflectance" [ 0 0 0 ] {world}"#
    ));
    let lit = green(&render(&scene, samples, 5), Part::Whole);
    let n = BREADTH as f64 * f64::from(samples);

    // Sum up the squared differences over the columns (or rows)
    let (mut statistic, mut count) = (0.0, 0);
    for line in 0..LENGTH {
        let position =
            |node: usize| (line as f64 + (node as f64 + 0.5) / NODES as f64) / LENGTH as f64 * 2.0 - 1.0;
        let expected = (0..NODES).map(|node| expected(position(node))).sum::<f64>() / NODES as f64;
        let pixel = |along: usize| match axis {
            Axis::Columns => along * LENGTH + line,
            Axis::Rows => line * BREADTH + along,
        };
        let mean = (0..BREADTH).map(|along| lit[pixel(along)]).sum::<f64>() / BREADTH as f64;
        if expected * (1.0 - expected) > 0.0 {
            statistic += (mean - expected).powi(2) * n / (expected * (1.0 - expected));
            count += 1;
        } else if mean != expected {
            return f64::INFINITY;
        }
    }
    z_score(statistic, count)
}

/// A black half plane out of focus before a sky. The fraction of sky in a pixel is the fraction of the lens that
/// sees past the edge.
fn lens(samples: u32) -> [Case; 3] {
    const RADIUS: f64 = 0.2;
    const FOCUS: f64 = 2.0;
    const EDGE: f64 = 5.0;
    const FIELD_OF_VIEW: f64 = 20.0;
    let z = |axis: Axis, radius: f64| {
        let camera = format!(
            r#"Camera "perspective" "float fov" {FIELD_OF_VIEW} "float lensradius" {radius}
            "float focaldistance" {FOCUS}"#
        );
        // Left of the centre, or above it
        let [left, right, bottom] = match axis {
            Axis::Columns => [-9, 0, -9],
            Axis::Rows => [-9, 9, 0],
        };
        let world = format!(
            r#"Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
            "point3 P" [ {left} {bottom} {EDGE}  {right} {bottom} {EDGE}  {right} 9 {EDGE}  {left} 9 {EDGE} ]"#
        );
        let half_length = FOCUS * (0.5 * FIELD_OF_VIEW.to_radians()).tan();
        profile_z(axis, &camera, &world, samples, |position| {
            // A ray from l on the lens through x in the plane of focus is at l + (x − l) EDGE ∕ FOCUS at the edge.
            let x = position * half_length;
            let beyond = (x * EDGE / (EDGE - FOCUS) / RADIUS).clamp(-1.0, 1.0);
            0.5 + (beyond * (1.0 - beyond * beyond).sqrt() + beyond.asin()) / PI
        })
    };

    let figure = "z-score against the profile, by χ²";
    let [vertical, horizontal] = [Axis::Columns, Axis::Rows].map(|axis| z(axis, RADIUS));
    let too_wide = z(Axis::Columns, 1.1 * RADIUS);
    [
        Case::new("a vertical edge out of focus", figure, AtMost(MAX_Z), vertical),
        Case::new("a horizontal edge out of focus", figure, AtMost(MAX_Z), horizontal),
        Case::new("planted: a lens that is 10 % too wide", figure, AtLeast(MAX_Z), too_wide),
    ]
}

/// A black half plane that moves before a sky. The fraction of sky in a pixel is the fraction of the shutter's time
/// before the edge passes.
fn shutter(samples: u32) -> Case {
    let camera = r#"TransformTimes 0 1
        Camera "perspective" "float fov" 90 "float shutteropen" 0 "float shutterclose" 1"#;
    // From −0.6 to 0.4 of half the image's width
    let world = r#"ActiveTransform StartTime Translate -0.6 0 0 ActiveTransform EndTime Translate 0.4 0 0
        ActiveTransform All Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ 0 -9 1  0 9 1  -9 9 1  -9 -9 1 ]"#;
    let z = profile_z(Axis::Columns, camera, world, samples, |position| (position + 0.6).clamp(0.0, 1.0));
    Case::new("a moving edge", "z-score against the profile, by χ²", AtMost(MAX_Z), z)
}

/// Uniformity of all pairs of the dimensions of film, lens and shutter, with a box filter. χ² takes samples for independent, and those of
/// a tile are not: of two sets they are more or less even than independent ones by chance. So there are many tiles.
fn uniformity(side: usize, samples: u32) -> Case {
    const GRID: usize = 8;
    let largest_z = |sampler: &str| {
        let scene = scene(&format!(
            r#"TransformTimes 0 1 Sampler "{sampler}" PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
            Camera "perspective" "float lensradius" 0.1 "float shutterclose" 1
            Film "rgb" "integer xresolution" {side} "integer yresolution" {side} WorldBegin
            ActiveTransform EndTime Translate 1 0 0 ActiveTransform All Shape "sphere""#
        ));
        let accel = Accel::build(&scene);
        let renderer = Renderer::new(&scene, &accel, 21);
        let layout = renderer.layout().clone();
        let mut store = Store::new(side, side, layout.clone(), samples as usize, 0);
        renderer.render_batch(&vec![samples; side * side], &mut store);
        let dims: Vec<usize> = layout.film().chain(layout.randoms()).collect();
        let pairs = dims.iter().flat_map(|&a| dims.iter().filter(move |&&b| a < b).map(move |&b| (a, b)));
        largest(pairs.map(|(a, b)| {
            let mut counts = vec![0.0; GRID * GRID];
            let rows = store.rows().iter();
            for sample in rows.flat_map(|row| (0..side).flat_map(|x| row.reservoir(x).chunks(layout.len()))) {
                let cell = |dim: usize| ((sample[dim].fract() * GRID as f32) as usize).min(GRID - 1);
                counts[cell(a) * GRID + cell(b)] += 1.0;
            }
            let total: f64 = counts.iter().sum();
            chi_squared_z(&counts, &vec![total / counts.len() as f64; counts.len()])
        }))
    };
    Case::new(
        "uniformity of film, lens and shutter samples, two samplers",
        "largest z-score of a pair, by χ²",
        AtMost(MAX_Z),
        largest(["zsobol", "independent"].map(largest_z)),
    )
}

/// Independence of a pixel's halves. All pixels estimate the same radiance of a plane under a sky, so their halves
/// must be uncorrelated.
fn halves() -> [Case; 2] {
    const FLOOR: &str = r#"Material "diffuse" Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ -1 -1 4  -1 1 4  1 1 4  1 -1 4 ]
        LightSource "infinite" "rgb L" [ 1 1 1 ] AreaLightSource "diffuse" "rgb L" [ 20 20 20 ]
        Translate 0.3 1 3 Shape "sphere" "float radius" 0.3"#;
    let correlation_z = |a: &[f64], b: &[f64]| {
        let ((mean_a, _), (mean_b, _)) = (mean(a), mean(b));
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for (a, b) in a.iter().zip(b) {
            let (a, b) = (a - mean_a, b - mean_b);
            (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
        }
        (ab / (aa * bb).sqrt()).abs() * (a.len() as f64).sqrt()
    };
    let scene = one_point("0 0 0  0 0 1  0 1 0", "\"path\" \"integer maxdepth\" 2", FLOOR);
    let stores = [2, 8, 32, 33, 128].map(|samples| render(&scene, samples, 11));
    let halves_z = |store| correlation_z(&green(store, Part::Half(0)), &green(store, Part::Half(1)));
    let planted = correlation_z(&green(&stores[0], Part::Half(0)), &green(&stores[0], Part::Whole));
    let figure = "z-score of their correlation";
    [
        Case::new(
            "halves of 2 to 128 samples per pixel",
            figure,
            AtMost(MAX_Z),
            largest(stores.iter().map(halves_z)),
        ),
        Case::new("planted: a half and the whole", figure, AtLeast(MAX_Z), planted),
    ]
}
