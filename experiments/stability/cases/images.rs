//! Cases on images: their sizes, crops of them, and interpolation of weights that always or never fails.

use prpf::filter::Denoiser;
use prpf::filter::prpf::{PrpfSettings, filter as prpf_filter};
use prpf::stats::{Block, Part, Store};
use rand::RngExt;

use super::case::Bound::{AtLeast, AtMost, Exactly};
use super::case::{Case, largest, relative};
use super::effort::Effort;
use super::stores::{FILTERS, filtered, noisy_wall, not_finite, store};

pub fn cases(effort: Effort) -> Vec<Case> {
    [sizes(effort), crops(), interpolation()].concat()
}

/// From 1×1 to 70×70 pixels.
fn sizes(effort: Effort) -> Vec<Case> {
    const LARGEST: usize = 70;
    let all = (1..=LARGEST).flat_map(|height| (1..=LARGEST).map(move |width| (width, height)));
    let degenerate = [(1, 1), (1, 70), (70, 1), (2, 2), (7, 6), (55, 54), (56, 57), (70, 70)];
    // A stride coprime to 70 reaches every width and height among the 4900 sizes.
    let sizes: Vec<_> = all.step_by(effort.select(173, 1)).chain(degenerate).collect();
    let case = |(denoiser, name): (&'static dyn Denoiser, &str)| {
        let wrong = sizes.iter().filter(|&&(width, height)| {
            let store = noisy_wall((width, height), 4, |_, _| 0.5);
            let filtered = filtered(&store, denoiser);
            let [unfiltered, a, b] = [Part::Whole, Part::Half(0), Part::Half(1)]
                .map(|part| store.means(part, store.layout().radiance()));
            let (image, input) = (filtered.image.data(), unfiltered.data());
            let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
            let is_complete = (filtered.image.width(), filtered.image.height()) == (width, height)
                && not_finite(&filtered) == 0;
            // Noise of standard deviation 0.29 in 4 samples per pixel; filters weigh samples unequally.
            let tolerance = 4.0 * 0.29 / (4.0 * (width * height) as f32).sqrt();
            // Filtered pixels are means of unfiltered ones, in each half by itself.
            let [min, max] = (a.data().iter().chain(b.data()))
                .fold([f32::INFINITY, 0.0], |[min, max], &v| [v.min(min), v.max(max)]);
            let is_mean = image.iter().all(|v| (min..=max).contains(v));
            !(is_complete && is_mean && (mean(image) - mean(input)).abs() < tolerance)
        });
        let name = format!("{} sizes from 1×1 to 70×70, {name}", sizes.len());
        Case::new(name, "images with a wrong size, mean or number", Exactly(0.0), wrong.count() as f64)
    };
    FILTERS.map(case).to_vec()
}

/// A part of a textured wall. A point's samples do not depend on the part's corner.
fn textured(corner: (usize, usize), size: (usize, usize)) -> Store {
    let whole = |x: usize, y: usize| (x + corner.0, y + corner.1);
    store(
        size,
        |_, _| 8,
        |x, y, index, _, sample| {
            let (x, y) = whole(x, y);
            let mut rng = super::stores::rng(x, y, index);
            sample.white_wall(x, y, &mut rng);
            let light = 0.1 + 0.4 * ((x / 9 + y / 7) % 2) as f32;
            sample.lit([light * 2.0 * rng.random::<f32>(); 3]);
        },
    )
}

/// Crops at the image's borders, against the whole image.
fn crops() -> Vec<Case> {
    // Lay out the crops
    const WHOLE: (usize, usize) = (120, 110);
    /// Reach of the filters in all their steps together, in pixels: this strip along a crop's inner borders is not
    /// compared.
    const REACH: usize = 40;
    let store = textured((0, 0), WHOLE);
    // The crops touch the left and top, right and top, left and bottom, right and bottom borders.
    let corners = [(0, 0), (30, 0), (0, 30), (30, 30)];
    let size = (WHOLE.0 - 30, WHOLE.1 - 30);
    let compared = |corner: usize, side: usize| {
        let from = if corner > 0 { corner + REACH } else { 0 };
        from..if corner > 0 { corner + side } else { side - REACH }
    };

    // Compare pixels away from the inner borders
    let differences = |denoiser: &dyn Denoiser| {
        let whole = filtered(&store, denoiser).image;
        let mut differences = Vec::new();
        for (left, top) in corners {
            let crop = filtered(&textured((left, top), size), denoiser).image;
            for y in compared(top, size.1) {
                for x in compared(left, size.0) {
                    differences
                        .push(relative(crop.at(0, x - left, y - top).into(), whole.at(0, x, y).into()));
                }
            }
        }
        differences
    };

    // Bound the differences
    let case = |(denoiser, name): (&'static dyn Denoiser, &str)| {
        let differences = differences(denoiser);
        let name = format!("crops touching each border, {name}");
        let reason = match denoiser.name().method {
            "prpf" => Some(
                "the grid of its weights starts at the image's corner, and their samples are selected by position in \
                 the image, so a crop is another estimate of the same image; its noise was 0.2",
            ),
            "learned" => Some(
                "its network sees pixels a hundred away, and light and lengths in units of their means over the image, so \
                 a crop is another estimate of the same image; its noise was 0.2",
            ),
            _ => None,
        };
        match reason {
            Some(reason) => {
                let rms = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
                Case::new(name, "rms relative difference from the whole", AtMost(0.06), rms)
                    .with_limitation(reason)
            }
            None => Case::new(name, "relative difference from the whole", AtMost(2e-3), largest(differences)),
        }
    };
    FILTERS.map(case).to_vec()
}

/// Interpolation of weights where it has to fail, and where it has to succeed.
fn interpolation() -> Vec<Case> {
    let own_materials = store(
        (40, 40),
        |_, _| 8,
        |x, y, _, rng, sample| {
            sample.lit([rng.random::<f32>(); 3]);
            sample.write(Block::Albedo, &[x, y, x + 41 * y].map(|v| v as f32));
        },
    );
    // Materials that differ in one feature; positions and light are uniform
    let two_materials = |block: Block, values: [[f32; 3]; 2], is_second: fn(usize, usize) -> bool| {
        store(
            (40, 40),
            |_, _| 8,
            move |x, y, _, rng, sample| {
                sample.lit([rng.random::<f32>(); 3]);
                sample.write(block, &values[usize::from(is_second(x, y))]);
            },
        )
    };
    let checkerboard = two_materials(Block::Albedo, [[0.2; 3], [0.8; 3]], |x, y| (x + y) % 2 == 1);
    // The nodes of the sparse grid, whose weights are interpolated
    let at_nodes = |x: usize, y: usize| x % 5 == 2 && y % 5 == 2;
    let own_albedo = two_materials(Block::Albedo, [[0.2; 3], [0.8; 3]], at_nodes);
    let own_normal = two_materials(Block::Normal1, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], at_nodes);
    let flat = store((60, 60), |_, _| 8, |_, _, _, _, _| ());
    let wall = noisy_wall((60, 60), 8, |_, _| 0.5);
    let settings = PrpfSettings::paper();
    let fraction = |store: &Store| {
        f64::from(prpf_filter(store, &settings, 1).interpolation.map_or(f32::NAN, |found| found.success))
    };
    let interpolated = prpf_filter(&wall, &settings, 1).image;
    let direct = prpf_filter(&wall, &PrpfSettings { upsampling: false, ..settings.clone() }, 1).image;
    let pairs = interpolated.data().iter().zip(direct.data());
    vec![
        Case::new(
            "a material of its own for each pixel",
            "fraction interpolated",
            Exactly(0.0),
            fraction(&own_materials),
        ),
        Case::new(
            "nodes with an albedo of their own",
            "fraction interpolated",
            Exactly(0.0),
            fraction(&own_albedo),
        ),
        Case::new(
            "nodes with a normal of their own",
            "fraction interpolated",
            Exactly(0.0),
            fraction(&own_normal),
        ),
        Case::new(
            "two albedos at pixel scale",
            "fraction interpolated",
            AtLeast(0.9),
            fraction(&checkerboard),
        )
        .with_limitation("half of the nodes around a pixel have its material, and suffice"),
        Case::new("a flat wall", "fraction interpolated", Exactly(1.0), fraction(&flat)),
        Case::new(
            "interpolated weights against direct ones on a noisy wall",
            "relative difference of the image",
            AtMost(0.03),
            largest(pairs.map(|(&a, &b)| relative(a.into(), b.into()))),
        ),
    ]
}
