//! Cases on radiance: invalid samples, holes, fireflies, exposures, and constant images.

use prpf::stats::{Block, Layout, Part, Store};
use rand::RngExt;

use super::case::Bound::{AtMost, Exactly};
use super::case::{Case, largest, relative};
use super::effort::Effort;
use super::stores::{FILTERS, filtered, noisy_wall, not_finite, store};

pub fn cases(_: Effort) -> Vec<Case> {
    [invalid_samples(), holes(), firefly(), exposures(), constant_images()].concat()
}

/// Samples with invalid radiance are counted and change no statistic.
fn invalid_samples() -> Vec<Case> {
    const INVALID: [f32; 6] =
        [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::MIN_POSITIVE, -1e30];
    let layout = Layout::with_blocks(|block| block == Block::Radiance);
    let valid = vec![0.5; layout.len()];
    let mut store = Store::new(1, 1, layout.clone(), 4, 0);
    store.push(0, 0, &valid);
    for invalid in INVALID {
        for dim in layout.colour().chain(layout.radiance()) {
            let mut sample = valid.clone();
            sample[dim] = invalid;
            store.push(0, 0, &sample);
        }
    }
    let means = store.means(Part::Whole, 0..layout.len());
    let off = largest(means.data().iter().map(|&v| f64::from((v - 0.5).abs())));
    let in_reservoir = store.rows()[0].reservoir(0).len() / layout.len();
    vec![
        Case::new("NaN, ±∞ and negative radiance", "rejected of 36", Exactly(36.0), store.rejected() as f64),
        Case::new("the same", "change of a mean", Exactly(0.0), off),
        Case::new("the same", "samples in the reservoir", Exactly(1.0), in_reservoir as f64),
    ]
}

/// Pixels whose samples were all rejected are filled: a single one, and a block.
fn holes() -> Vec<Case> {
    let is_hole = |x: usize, y: usize| (x, y) == (4, 20) || ((10..13).contains(&x) && (9..12).contains(&y));
    let store = store(
        (32, 32),
        |_, _| 8,
        |x, y, _, _, sample| {
            if is_hole(x, y) {
                sample.lit([f32::NAN; 3]);
            }
        },
    );
    let case = |(denoiser, name)| {
        let image = filtered(&store, denoiser).image;
        let off = largest(image.data().iter().map(|&v| relative(v.into(), 0.5)));
        Case::new(format!("hole filling, {name}"), "relative error", AtMost(1e-4), off)
    };
    FILTERS.map(case).to_vec()
}

/// One sample of 10⁸ in noise of mean 0.5.
fn firefly() -> Vec<Case> {
    const AT: (usize, usize) = (32, 32);
    let image = |has_firefly: bool| {
        store(
            (64, 64),
            |_, _| 8,
            |x, y, index, rng, sample| {
                let value = rng.random::<f32>();
                sample.lit([if has_firefly && (x, y, index) == (AT.0, AT.1, 3) { 1e8 } else { value }; 3]);
            },
        )
    };
    let (with, without) = (image(true), image(false));
    let case = |(denoiser, name)| {
        let (with, without) = (filtered(&with, denoiser).image, filtered(&without, denoiser).image);
        let change = |(x, y): (usize, usize)| relative(with.at(0, x, y).into(), without.at(0, x, y).into());
        let others = (0..64 * 64).map(|i| (i % 64, i / 64)).filter(|&pixel| pixel != AT);
        [
            Case::new(
                format!("one sample of 10⁸ in an image of 0.5, {name}"),
                "relative change of other pixels",
                AtMost(0.05),
                largest(others.map(change)),
            ),
            Case::new(
                format!("the same, {name}"),
                "relative change of the pixel itself",
                AtMost(0.05),
                change(AT),
            ),
        ]
    };
    FILTERS.map(case).concat()
}

/// The filter's result scales with the radiance.
fn exposures() -> Vec<Case> {
    let wall = |scale: f32| noisy_wall((40, 40), 8, |x, y| scale * (0.1 + 0.01 * (x + y) as f32));
    let (dark, plain, bright) = (wall(1e-6), wall(1.0), wall(1e6));
    let case = |(denoiser, name)| {
        let reference = filtered(&plain, denoiser).image;
        let off = [(&dark, 1e6), (&bright, 1e-6)].map(|(store, back)| {
            let image = filtered(store, denoiser).image;
            let pairs = image.data().iter().zip(reference.data());
            largest(pairs.map(|(&v, &r)| relative(f64::from(v) * back, r.into())))
        });
        let name = format!("scaled by 10⁻⁶ and 10⁶, {name}");
        Case::new(name, "relative difference", AtMost(1e-3), largest(off))
    };
    FILTERS.map(case).to_vec()
}

/// Constant images stay constant.
fn constant_images() -> Vec<Case> {
    let constant = |value: f32| store((37, 29), |_, _| 8, |_, _, _, _, sample| sample.lit([value; 3]));
    let (black, values) = (constant(0.0), [0.123, 1e-6, 7.7e5]);
    let stores = values.map(constant);
    let case = |(denoiser, name)| {
        let off = stores.iter().zip(values).map(|(store, value)| {
            largest(filtered(store, denoiser).image.data().iter().map(|&v| relative(v.into(), value.into())))
        });
        let dark = filtered(&black, denoiser);
        let brightest = largest(dark.image.data().iter().map(|&v| f64::from(v.abs())));
        [
            Case::new(
                format!("all black, {name}"),
                "brightest pixel and numbers not finite",
                Exactly(0.0),
                brightest + not_finite(&dark) as f64,
            ),
            // The bound is eight steps of f32.
            Case::new(format!("all one colour, {name}"), "relative error", AtMost(1e-6), largest(off)),
        ]
    };
    FILTERS.map(case).concat()
}
