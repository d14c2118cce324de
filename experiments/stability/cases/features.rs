//! Cases on features: feature weights, edges that only features show, sky, and mutual information.

use prpf::filter::mutual_information;
use prpf::filter::prpf::{PrpfSettings, feature_weights};
use prpf::image::Planes;
use prpf::stats::{Block, Layout, Store};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::case::Bound::{AtLeast, AtMost, Exactly};
use super::case::{Case, largest};
use super::effort::Effort;
use super::stores::{FILTERS, filtered, not_finite, store, store_with_layout};

pub fn cases(_: Effort) -> Vec<Case> {
    [weights(), constant_in_the_pixel(), horizon(), information()].concat()
}

/// Sum of the weights of the features with these prefixes: mean over the image, largest over the passes.
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

/// Weights on a wall whose colour depends on its albedo alone, and whose normal is random.
fn weights() -> Vec<Case> {
    // Keep only the dimensions that the case is about
    let layout = Layout::with_blocks(|block| {
        matches!(block, Block::Normal1 | Block::Albedo | Block::Lens | Block::Time | Block::Hit)
    });
    // Measure the weights at three distributions of sample counts
    type Count = fn(usize, usize) -> u32;
    let counts: [(&str, Count); 3] =
        [("8", |_, _| 8), ("64", |_, _| 64), ("1 to 64", |x, y| 1 + (x * 31 + y * 17) as u32 % 64)];
    let cases = |(name, count): (&str, Count)| {
        let store = store_with_layout(layout.clone(), (56, 56), count, |x, _, _, _, sample| {
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
                "fraction of the sum of all weights",
                AtLeast(0.97),
                explains / (explains + noise),
            ),
            Case::new(format!("the same, {name} samples"), "weight", AtLeast(0.6), explains).with_limitation(
                "a weight is a fraction of everything that explains the colour, by definition including the position; \
                 the feature has nearly all of the features' weight",
            ),
            Case::new(
                format!("a constant feature, {name} samples"),
                "weight",
                Exactly(0.0),
                weight(&store, &["albedo.b"]),
            ),
        ]
    };
    counts.map(cases).concat()
}

/// Stripes whose normals are constant within every pixel and determine the mean of the noisy colour.
fn constant_in_the_pixel() -> Vec<Case> {
    let truth = |x: usize| if (x / 16).is_multiple_of(2) { 0.2 } else { 0.8 };
    let store = store(
        (64, 48),
        |_, _| 8,
        |x, _, _, rng, sample| {
            sample.lit([truth(x) * 2.0 * rng.random::<f32>(); 3]);
            let normal_x = f32::from((x / 16).is_multiple_of(2));
            sample.write(Block::Normal1, &[normal_x, 0.0, 1.0 - normal_x]);
        },
    );
    let case = |(denoiser, name)| {
        let filtered = filtered(&store, denoiser);
        let beside = (0..48).flat_map(|y| [15, 16, 31, 32, 47, 48].map(|x| (x, y)));
        let off = beside.map(|(x, y)| f64::from((filtered.image.at(0, x, y) - truth(x)) / 0.6).powi(2));
        let squares = off.collect::<Vec<_>>();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() + not_finite(&filtered) as f64;
        let case = |bound| {
            let case = format!("a feature constant in the pixel but not in the window, {name}");
            Case::new(case, "rms error at the edge, relative to its step", AtMost(bound), rms)
        };
        if name == "learned, draft" {
            case(0.15).with_limitation(
                "its network leaves more noise beside edges than `nlm`, which `learned` is mixed with",
            )
        } else {
            case(0.1)
        }
    };
    FILTERS.map(case).to_vec()
}

/// An image whose upper half is sky.
fn horizon() -> Vec<Case> {
    const HORIZON: usize = 32;
    const BLUE: [f32; 3] = [0.0, 0.0, 5.0];
    // Render noisy and noiseless ground, with and without sky
    let image = |sky: bool, noise: f32| {
        store(
            (64, 64),
            |_, _| 16,
            |_, y, _, rng, sample| {
                let light = 0.2 + noise * (rng.random::<f32>() - 0.5);
                sample.lit([light, light, 0.0]);
                if sky && y < HORIZON {
                    sample.sky(BLUE.map(|v| v * (1.0 + noise * (rng.random::<f32>() - 0.5))));
                }
            },
        )
    };
    let (noiseless, noisy, ground_only) = (image(true, 0.0), image(true, 0.4), image(false, 0.4));

    // Measure what each half takes from the other
    let ground = || (HORIZON..64).flat_map(|y| (0..64).map(move |x| (x, y)));
    let sky = || (0..HORIZON).flat_map(|y| (0..64).map(move |x| (x, y)));
    let brightest = |image: &Planes, channel: usize, pixels: &mut dyn Iterator<Item = (usize, usize)>| {
        largest(pixels.map(|(x, y)| f64::from(image.at(channel, x, y).abs())))
    };
    let case = |(denoiser, name)| {
        let (with, without) = (filtered(&noisy, denoiser).image, filtered(&ground_only, denoiser).image);
        let image = filtered(&noiseless, denoiser).image;
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
                format!("noiseless sky over ground, {name}"),
                "change of the sky",
                AtMost(1e-4),
                changed,
            ),
            // The unfiltered noise is 0.029; without the sky's pixels, fewer neighbours leave a little more of it.
            Case::new(
                format!("ground with and without sky, {name}"),
                "rms difference at a mean of 0.2",
                AtMost(0.004),
                difference,
            ),
        ]
    };
    FILTERS.map(case).concat()
}

/// The estimator of mutual information.
fn information() -> Vec<Case> {
    // Average the estimate of independent variables, less its known bias
    const COUNT: usize = 64;
    let mut rng = Pcg32::seed_from_u64(5);
    let normal = |rng: &mut Pcg32, count: usize| -> Vec<f32> {
        (0..count).map(|_| (0..12).map(|_| unit(rng)).sum::<f32>() - 6.0).collect()
    };
    // The bias of a plug-in estimate over 5×5 bins is (5 − 1)² ∕ (2 N ln 2) bits.
    let bias = 16.0 / (2.0 * COUNT as f64 * std::f64::consts::LN_2);
    const PAIRS: usize = 400;
    let sum: f64 = (0..PAIRS)
        .map(|_| {
            let (a, b) = (normal(&mut rng, COUNT), normal(&mut rng, COUNT));
            f64::from(mutual_information(&a, &b))
        })
        .sum();
    let independent = sum / PAIRS as f64 - bias;

    // Scale and shift one of two dependent variables
    let a = normal(&mut rng, 1024);
    let mut b = normal(&mut rng, 1024);
    b.iter_mut().zip(&a).for_each(|(b, a)| *b += a);
    let unchanged = mutual_information(&a, &b);
    let moved = largest([(1e-3, 0.0), (1e3, 0.0), (1.0, 50.0), (0.125, -64.0)].map(|(scale, shift)| {
        let moved: Vec<f32> = b.iter().map(|v| v * scale + shift).collect();
        f64::from((mutual_information(&a, &moved) - unchanged).abs())
    }));
    vec![
        Case::new(
            "independent variables, 64 samples",
            "bits beyond the known bias",
            super::case::Bound::Between(-0.04, 0.04),
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

fn unit(rng: &mut impl Rng) -> f32 {
    rng.random()
}

/// Entropy of a variable in five bins of one standard deviation around its mean; the outer bins are open.
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
