//! Features that say nothing, features that say everything, and what separates pixels.

use prpf::filter::mutual_information;
use prpf::filter::prpf::{PrpfSettings, feature_weights};
use prpf::image::Planes;
use prpf::stats::{Block, Layout, Store};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Bound::{AtLeast, AtMost, Exactly};
use super::stores::{QUALITIES, filtered, not_finite, store, store_of};
use super::{Case, Effort, largest};

pub fn cases(_: Effort) -> Vec<Case> {
    [weights(), constant_in_the_pixel(), horizon(), information()].concat()
}

/// Weight of the features whose names start so: mean over the image, largest of the passes.
fn weight(store: &Store, features: &[&str]) -> f64 {
    let settings = PrpfSettings { windows: vec![35, 17], ..PrpfSettings::paper() };
    let (names, passes) = feature_weights(store, &settings, 1);
    let wanted = |name: &str| {
        features.iter().any(|feature| name.strip_prefix("beta ").is_some_and(|n| n.starts_with(feature)))
    };
    largest(passes.iter().map(|planes| {
        let all = names.iter().zip(0..).filter(|(name, _)| wanted(name));
        all.map(|(_, k)| planes.plane(k).iter().map(|&v| f64::from(v)).sum::<f64>() / planes.pixels() as f64)
            .sum()
    }))
}

/// A wall whose albedo alone makes its colour, and whose normal is nothing but the lens and the time.
fn weights() -> Vec<Case> {
    let layout = Layout::with_blocks(|block| {
        matches!(block, Block::Normal1 | Block::Albedo | Block::Lens | Block::Time | Block::Hit)
    });
    type Count = fn(usize, usize) -> u32;
    let counts: [(&str, Count); 3] =
        [("8", |_, _| 8), ("64", |_, _| 64), ("1 to 64", |x, y| 1 + (x * 31 + y * 17) as u32 % 64)];
    let of_counts = |(name, count): (&str, Count)| {
        let store = store_of(layout.clone(), (56, 56), count, |x, _, _, _, sample| {
            let albedo = 0.1 + 0.01 * x as f32;
            sample.lit([albedo, 0.5 * albedo, 0.2]);
            sample.write(Block::Normal1, &[0, 1, 2].map(|k| sample.random(k)));
            sample.write(Block::Albedo, &[albedo, albedo, 0.2]);
        });
        let (noise, explains) = (weight(&store, &["N1"]), weight(&store, &["albedo.r", "albedo.g"]));
        [
            Case::new(
                format!("a feature that is noise, {name} samples"),
                "weight",
                AtMost(0.02),
                noise,
            ),
            Case::new(
                format!("a feature that explains the colour, {name} samples"),
                "its part of all features' weight",
                AtLeast(0.97),
                explains / (explains + noise),
            ),
            Case::new(format!("the same, {name} samples"), "weight", AtLeast(0.6), explains).instead(
                "a weight is a share of all that explains the colour, of which the position is part by definition; \
                 the feature has nearly all of what features have",
            ),
            Case::new(
                format!("a constant feature, {name} samples"),
                "weight",
                Exactly(0.0),
                weight(&store, &["albedo.b"]),
            ),
        ]
    };
    counts.map(of_counts).concat()
}

/// Two blocks whose normals are constant within every pixel and make the noisy colour.
fn constant_in_the_pixel() -> Vec<Case> {
    let truth = |x: usize| if (x / 16).is_multiple_of(2) { 0.2 } else { 0.8 };
    let store = store(
        (64, 48),
        |_, _| 8,
        |x, _, _, numbers, sample| {
            sample.lit([truth(x) * 2.0 * numbers.random::<f32>(); 3]);
            let turned = f32::from((x / 16).is_multiple_of(2));
            sample.write(Block::Normal1, &[turned, 0.0, 1.0 - turned]);
        },
    );
    let of_quality = |(quality, name)| {
        let filtered = filtered(&store, quality);
        let beside = (0..48).flat_map(|y| [15, 16, 31, 32, 47, 48].map(|x| (x, y)));
        let off = beside.map(|(x, y)| f64::from((filtered.image.at(0, x, y) - truth(x)) / 0.6).powi(2));
        let squares = off.collect::<Vec<_>>();
        Case::new(
            format!("a feature constant in the pixel but not in the window, {name}"),
            "error at the edge, of its step",
            AtMost(0.1),
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() + not_finite(&filtered) as f64,
        )
    };
    QUALITIES.map(of_quality).to_vec()
}

/// Half of the image is sky.
fn horizon() -> Vec<Case> {
    const HORIZON: usize = 32;
    const BLUE: [f32; 3] = [0.0, 0.0, 5.0];
    let field = |sky: bool, noise: f32| {
        store(
            (64, 64),
            |_, _| 16,
            |_, y, _, numbers, sample| {
                let light = 0.2 + noise * (numbers.random::<f32>() - 0.5);
                sample.lit([light, light, 0.0]);
                if sky && y < HORIZON {
                    sample.sky(BLUE.map(|v| v * (1.0 + noise * (numbers.random::<f32>() - 0.5))));
                }
            },
        )
    };
    let (still, noisy, alone) = (field(true, 0.0), field(true, 0.4), field(false, 0.4));
    let ground = || (HORIZON..64).flat_map(|y| (0..64).map(move |x| (x, y)));
    let sky = || (0..HORIZON).flat_map(|y| (0..64).map(move |x| (x, y)));
    let brightest = |image: &Planes, channel: usize, pixels: &mut dyn Iterator<Item = (usize, usize)>| {
        largest(pixels.map(|(x, y)| f64::from(image.at(channel, x, y).abs())))
    };
    let of_quality = |(quality, name)| {
        let (with, without) = (filtered(&noisy, quality).image, filtered(&alone, quality).image);
        let image = filtered(&still, quality).image;
        let changed = largest(sky().map(|(x, y)| f64::from((image.at(2, x, y) - BLUE[2]).abs())));
        let squares = ground().map(|(x, y)| f64::from(with.at(0, x, y) - without.at(0, x, y)).powi(2));
        let difference = (squares.sum::<f64>() / 2048.0).sqrt();
        [
            Case::new(
                format!("noisy sky over noisy ground, {name}"),
                "blue on the ground, of 5",
                AtMost(1e-5),
                brightest(&with, 2, &mut ground()),
            ),
            Case::new(
                format!("the same, {name}"),
                "red in the sky, of 0.2",
                AtMost(1e-6),
                brightest(&with, 0, &mut sky()),
            ),
            Case::new(
                format!("sky over the ground without noise, {name}"),
                "change of the sky",
                AtMost(1e-4),
                changed,
            ),
            // Unfiltered, the noise is 0.029: neighbours that are missing leave a little more of it.
            Case::new(
                format!("ground with and without sky, {name}"),
                "rms difference at a mean of 0.2",
                AtMost(0.004),
                difference,
            ),
        ]
    };
    QUALITIES.map(of_quality).concat()
}

/// The estimator behind P-RPF's weights.
fn information() -> Vec<Case> {
    const COUNT: usize = 64;
    let mut numbers = Pcg32::seed_from_u64(5);
    let normal = |numbers: &mut Pcg32, count: usize| -> Vec<f32> {
        (0..count).map(|_| (0..12).map(|_| unit(numbers)).sum::<f32>() - 6.0).collect()
    };
    // Of a plug-in estimate over 5×5 bins: (5 − 1)² ∕ (2 N ln 2) bits.
    let bias = 16.0 / (2.0 * COUNT as f64 * std::f64::consts::LN_2);
    const PAIRS: usize = 400;
    let sum: f64 = (0..PAIRS)
        .map(|_| {
            let (a, b) = (normal(&mut numbers, COUNT), normal(&mut numbers, COUNT));
            f64::from(mutual_information(&a, &b))
        })
        .sum();
    let independent = sum / PAIRS as f64 - bias;

    let a = normal(&mut numbers, 1024);
    let mut b = normal(&mut numbers, 1024);
    b.iter_mut().zip(&a).for_each(|(b, a)| *b += a);
    let shared = mutual_information(&a, &b);
    let moved = largest([(1e-3, 0.0), (1e3, 0.0), (1.0, 50.0), (0.125, -64.0)].map(|(scale, shift)| {
        let moved: Vec<f32> = b.iter().map(|v| v * scale + shift).collect();
        f64::from((mutual_information(&a, &moved) - shared).abs())
    }));
    vec![
        Case::new(
            "independent variables, 64 samples",
            "bits beyond the known bias",
            super::Bound::Between(-0.04, 0.04),
            independent,
        ),
        Case::new(
            "identical variables",
            "bits short of their entropy",
            AtMost(1e-5),
            (f64::from(mutual_information(&a, &a)) - entropy(&a)).abs(),
        ),
        Case::new("a constant variable", "bits", Exactly(0.0), mutual_information(&a, &[0.3; 1024]).into()),
        Case::new("a variable scaled and shifted", "change in bits", AtMost(2e-3), moved),
    ]
}

fn unit(numbers: &mut impl Rng) -> f32 {
    numbers.random()
}

/// Of a variable in bins of one deviation around its mean, the outermost of the five open.
fn entropy(values: &[f32]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let deviation = (values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n).sqrt();
    let mut bins = [0.0; 5];
    values.iter().for_each(|&v| {
        bins[((f64::from(v) - mean) / deviation + 2.5).floor().clamp(0.0, 4.0) as usize] += 1.0
    });
    bins.iter().filter(|&&count| count > 0.0).map(|&count| -count / n * (count / n).log2()).sum()
}
