//! The blur of lens and shutter, what samplers give the camera, and the independence of a pixel's halves.

use std::f64::consts::PI;

use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::stats::{Part, Store};

use super::Bound::{AtLeast, AtMost};
use super::light::one_point;
use super::pictures::{green, mean, render, scene};
use super::surfaces::{NO_ACCIDENT, deviations, normal_deviate};
use super::{Case, Effort, largest};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = Vec::new();
    cases.extend(lens(effort.of(256, 16_384)));
    cases.push(shutter(effort.of(256, 16_384)));
    cases.push(camera(effort.of(32, 1024)));
    cases.extend(halves());
    cases
}

/// The axis of an image across which light changes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Across {
    Columns,
    Rows,
}

/// Deviations of the shares of light in the columns (or rows) of an image, which is wide (or high), from a
/// profile of `samples` binary samples per pixel: from −1 at the left (or top) to 1.
fn profile(axis: Across, camera: &str, world: &str, samples: u32, share: impl Fn(f64) -> f64) -> f64 {
    const LENGTH: usize = 32;
    const BREADTH: usize = 8;
    /// Points across a pixel.
    const NODES: usize = 64;
    let (width, height, window) = match axis {
        Across::Columns => (LENGTH, BREADTH, "-1 1 -0.25 0.25"),
        Across::Rows => (BREADTH, LENGTH, "-0.25 0.25 -1 1"),
    };
    let scene = scene(&format!(
        r#"LookAt 0 0 0  0 0 1  0 1 0 {camera} "float screenwindow" [ {window} ] Sampler "independent" PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
        Integrator "path" "integer maxdepth" 1
        Film "rgb" "integer xresolution" {width} "integer yresolution" {height} WorldBegin
        LightSource "infinite" "rgb L" [ 1 1 1 ] Material "diffuse" "rgb reflectance" [ 0 0 0 ] {world}"#
    ));
    let lit = green(&render(&scene, samples, 5), Part::Whole);
    let n = BREADTH as f64 * f64::from(samples);
    let (mut statistic, mut places) = (0.0, 0);
    for place in 0..LENGTH {
        let across =
            |node: usize| (place as f64 + (node as f64 + 0.5) / NODES as f64) / LENGTH as f64 * 2.0 - 1.0;
        let share = (0..NODES).map(|node| share(across(node))).sum::<f64>() / NODES as f64;
        let pixel = |along: usize| match axis {
            Across::Columns => along * LENGTH + place,
            Across::Rows => place * BREADTH + along,
        };
        let light = (0..BREADTH).map(|along| lit[pixel(along)]).sum::<f64>() / BREADTH as f64;
        if share * (1.0 - share) > 0.0 {
            statistic += (light - share).powi(2) * n / (share * (1.0 - share));
            places += 1;
        } else if light != share {
            return f64::INFINITY;
        }
    }
    normal_deviate(statistic, places)
}

/// A black half plane before a sky, out of focus: the sky's share is that of the lens beyond the line
/// from the point in focus over the edge.
fn lens(samples: u32) -> [Case; 3] {
    const RADIUS: f64 = 0.2;
    const FOCUS: f64 = 2.0;
    const EDGE: f64 = 5.0;
    const FIELD_OF_VIEW: f64 = 20.0;
    let image = |axis: Across, radius: f64| {
        let camera = format!(
            r#"Camera "perspective" "float fov" {FIELD_OF_VIEW} "float lensradius" {radius}
            "float focaldistance" {FOCUS}"#
        );
        // Left of the middle, or above it.
        let [left, right, bottom] = match axis {
            Across::Columns => [-9, 0, -9],
            Across::Rows => [-9, 9, 0],
        };
        let world = format!(
            r#"Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
            "point3 P" [ {left} {bottom} {EDGE}  {right} {bottom} {EDGE}  {right} 9 {EDGE}  {left} 9 {EDGE} ]"#
        );
        let half_length = FOCUS * (0.5 * FIELD_OF_VIEW.to_radians()).tan();
        profile(axis, &camera, &world, samples, |across| {
            // In focus at x, a ray from l on the lens is at l + (x − l) EDGE ∕ FOCUS at the edge's distance.
            let x = across * half_length;
            let beyond = (x * EDGE / (EDGE - FOCUS) / RADIUS).clamp(-1.0, 1.0);
            0.5 + (beyond * (1.0 - beyond * beyond).sqrt() + beyond.asin()) / PI
        })
    };
    let figure = "deviations from the profile, by χ²";
    let [upright, level] = [Across::Columns, Across::Rows].map(|axis| image(axis, RADIUS));
    let too_wide = image(Across::Columns, 1.1 * RADIUS);
    [
        Case::new("an upright edge out of focus", figure, AtMost(NO_ACCIDENT), upright),
        Case::new("a level edge out of focus", figure, AtMost(NO_ACCIDENT), level),
        Case::new("planted: a lens that is 10 % too wide", figure, AtLeast(NO_ACCIDENT), too_wide),
    ]
}

/// A black half plane that moves before a sky: the sky's share is that of the time before it is there.
fn shutter(samples: u32) -> Case {
    let camera = r#"TransformTimes 0 1
        Camera "perspective" "float fov" 90 "float shutteropen" 0 "float shutterclose" 1"#;
    // From −0.6 to 0.4 of the half width.
    let world = r#"ActiveTransform StartTime Translate -0.6 0 0 ActiveTransform EndTime Translate 0.4 0 0
        ActiveTransform All Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ 0 -9 1  0 9 1  -9 9 1  -9 -9 1 ]"#;
    let off = profile(Across::Columns, camera, world, samples, |across| (across + 0.6).clamp(0.0, 1.0));
    Case::new("an edge that moves", "deviations from the profile, by χ²", AtMost(NO_ACCIDENT), off)
}

/// Where samples are on the film within a box filter, and the numbers of lens and shutter: uniform, one by one
/// and in pairs.
fn camera(samples: u32) -> Case {
    const GRID: usize = 8;
    const SIDE: usize = 16;
    let of_sampler = |sampler: &str| {
        let scene = scene(&format!(
            r#"TransformTimes 0 1 Sampler "{sampler}" PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
            Camera "perspective" "float lensradius" 0.1 "float shutterclose" 1
            Film "rgb" "integer xresolution" {SIDE} "integer yresolution" {SIDE} WorldBegin
            ActiveTransform EndTime Translate 1 0 0 ActiveTransform All Shape "sphere""#
        ));
        let accel = Accel::build(&scene);
        let renderer = Renderer::new(&scene, &accel, 21);
        let layout = renderer.layout().clone();
        let mut store = Store::new(SIDE, SIDE, layout.clone(), samples as usize, 0);
        renderer.render_batch(&[samples; SIDE * SIDE], &mut store);
        let dims: Vec<usize> = layout.film().chain(layout.randoms()).collect();
        let pairs = dims.iter().flat_map(|&a| dims.iter().filter(move |&&b| a < b).map(move |&b| (a, b)));
        largest(pairs.map(|(a, b)| {
            let mut counts = vec![0.0; GRID * GRID];
            let rows = store.rows().iter();
            for sample in rows.flat_map(|row| (0..SIDE).flat_map(|x| row.reservoir(x).chunks(layout.len()))) {
                let cell = |dim: usize| ((sample[dim].fract() * GRID as f32) as usize).min(GRID - 1);
                counts[cell(a) * GRID + cell(b)] += 1.0;
            }
            let drawn: f64 = counts.iter().sum();
            deviations(&counts, &vec![drawn / counts.len() as f64; counts.len()])
        }))
    };
    Case::new(
        "numbers of film, lens and shutter, by two samplers",
        "deviations of pairs, by χ²",
        AtMost(NO_ACCIDENT),
        largest(["zsobol", "independent"].map(of_sampler)),
    )
}

/// Every pixel of a plane under a sky is an estimate of the same number: those of one half must not
/// know of those of the other.
fn halves() -> [Case; 2] {
    const FLOOR: &str = r#"Material "diffuse" Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ -1 -1 4  -1 1 4  1 1 4  1 -1 4 ]
        LightSource "infinite" "rgb L" [ 1 1 1 ] AreaLightSource "diffuse" "rgb L" [ 20 20 20 ]
        Translate 0.3 1 3 Shape "sphere" "float radius" 0.3"#;
    let correlation = |a: &[f64], b: &[f64]| {
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
    let of_halves = |store| correlation(&green(store, Part::Half(0)), &green(store, Part::Half(1)));
    let planted = correlation(&green(&stores[0], Part::Half(0)), &green(&stores[0], Part::Whole));
    let figure = "deviations of their correlation";
    [
        Case::new(
            "halves of a pixel's samples, 2 to 128 of them",
            figure,
            AtMost(NO_ACCIDENT),
            largest(stores.iter().map(of_halves)),
        ),
        Case::new("planted: a half and the whole", figure, AtLeast(NO_ACCIDENT), planted),
    ]
}
