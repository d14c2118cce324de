//! Images of any size, crops of them, and interpolation of weights that always or never fails.

use prpf::filter::Quality;
use prpf::filter::prpf::{PrpfSettings, filter as paper};
use prpf::stats::{Block, Part, Store};
use rand::RngExt;

use super::Bound::{AtLeast, AtMost, Exactly};
use super::stores::{QUALITIES, filtered, noisy_wall, not_finite, store};
use super::{Case, Effort, largest, relative};

pub fn cases(effort: Effort) -> Vec<Case> {
    [sizes(effort), crops(), interpolation()].concat()
}

/// From 1×1 to 70×70 pixels.
fn sizes(effort: Effort) -> Vec<Case> {
    const LARGEST: usize = 70;
    let all = (1..=LARGEST).flat_map(|height| (1..=LARGEST).map(move |width| (width, height)));
    let degenerate = [(1, 1), (1, 70), (70, 1), (2, 2), (7, 6), (55, 54), (56, 57), (70, 70)];
    // 4900 sizes; a stride that shares no factor with 70 reaches every width and height.
    let sizes: Vec<_> = all.step_by(effort.of(173, 1)).chain(degenerate).collect();
    let of_quality = |(quality, name)| {
        let wrong = sizes.iter().filter(|&&(width, height)| {
            let store = noisy_wall((width, height), 4, |_, _| 0.5);
            let filtered = filtered(&store, quality);
            let [unfiltered, a, b] = [Part::Whole, Part::Half(0), Part::Half(1)]
                .map(|part| store.means(part, store.layout().radiance()));
            let (image, input) = (filtered.image.data(), unfiltered.data());
            let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
            let right = (filtered.image.width(), filtered.image.height()) == (width, height)
                && not_finite(&filtered) == 0;
            // Noise of deviation 0.29 in 4 samples of each pixel, which a filter does not weigh all alike.
            let tolerance = 4.0 * 0.29 / (4.0 * (width * height) as f32).sqrt();
            // Filtered pixels are means of unfiltered ones, of either half for itself.
            let [least, most] = (a.data().iter().chain(b.data()))
                .fold([f32::INFINITY, 0.0], |[least, most], &v| [v.min(least), v.max(most)]);
            let is_mean = image.iter().all(|v| (least..=most).contains(v));
            !(right && is_mean && (mean(image) - mean(input)).abs() < tolerance)
        });
        let name = format!("{} sizes from 1×1 to 70×70, {name}", sizes.len());
        Case::new(name, "images with a wrong size, mean or number", Exactly(0.0), wrong.count() as f64)
    };
    QUALITIES.map(of_quality).to_vec()
}

/// A textured wall; pixels have the same samples wherever the corner of the image is.
fn textured(corner: (usize, usize), size: (usize, usize)) -> Store {
    let whole = |x: usize, y: usize| (x + corner.0, y + corner.1);
    store(
        size,
        |_, _| 8,
        |x, y, index, _, sample| {
            let (x, y) = whole(x, y);
            let mut numbers = super::stores::numbers(x, y, index);
            sample.white_wall(x, y, &mut numbers);
            let light = 0.1 + 0.4 * ((x / 9 + y / 7) % 2) as f32;
            sample.lit([light * 2.0 * numbers.random::<f32>(); 3]);
        },
    )
}

fn crops() -> Vec<Case> {
    const WHOLE: (usize, usize) = (120, 110);
    /// The crop is smaller by this at its inner borders, and this part beside them is not compared: the
    /// filters reach as far in all their steps together.
    const REACH: usize = 40;
    let store = textured((0, 0), WHOLE);
    // Touching left and top, right and top, left and bottom, right and bottom.
    let corners = [(0, 0), (30, 0), (0, 30), (30, 30)];
    let size = (WHOLE.0 - 30, WHOLE.1 - 30);
    let compared = |corner: usize, side: usize| {
        let from = if corner > 0 { corner + REACH } else { 0 };
        from..if corner > 0 { corner + side } else { side - REACH }
    };
    let of_quality = |(quality, name): (Quality, &'static str)| {
        let whole = filtered(&store, quality).image;
        let mut differences = Vec::new();
        for (left, top) in corners {
            let crop = filtered(&textured((left, top), size), quality).image;
            for y in compared(top, size.1) {
                for x in compared(left, size.0) {
                    differences
                        .push(relative(crop.at(0, x - left, y - top).into(), whole.at(0, x, y).into()));
                }
            }
        }
        (name, differences)
    };
    let mut cases = Vec::new();
    for (name, differences) in QUALITIES.map(of_quality) {
        let name = format!("crops touching each border, {name}");
        if name.ends_with("paper") {
            let rms = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
            cases.push(Case::new(name, "rms relative difference from the whole", AtMost(0.06), rms).instead(
                "the grid of its weights begins at the image's corner and their samples are drawn by place in the \
                 image, so a crop is another estimate of the same image; its noise was 0.2",
            ));
        } else {
            cases.push(Case::new(
                name,
                "relative difference from the whole",
                AtMost(2e-3),
                largest(differences),
            ));
        }
    }
    cases
}

fn interpolation() -> Vec<Case> {
    let own_materials = store(
        (40, 40),
        |_, _| 8,
        |x, y, _, numbers, sample| {
            sample.lit([numbers.random::<f32>(); 3]);
            sample.write(Block::Albedo, &[x, y, x + 41 * y].map(|v| v as f32));
        },
    );
    // Positions and light are alike everywhere: materials differ by one feature alone.
    let two_materials = |block: Block, values: [[f32; 3]; 2], is_second: fn(usize, usize) -> bool| {
        store(
            (40, 40),
            |_, _| 8,
            move |x, y, _, numbers, sample| {
                sample.lit([numbers.random::<f32>(); 3]);
                sample.write(block, &values[usize::from(is_second(x, y))]);
            },
        )
    };
    let checkerboard = two_materials(Block::Albedo, [[0.2; 3], [0.8; 3]], |x, y| (x + y) % 2 == 1);
    // Of the sparse grid, whose weights are interpolated.
    let at_nodes = |x: usize, y: usize| x % 5 == 2 && y % 5 == 2;
    let own_albedo = two_materials(Block::Albedo, [[0.2; 3], [0.8; 3]], at_nodes);
    let own_normal = two_materials(Block::Normal1, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], at_nodes);
    let flat = store((60, 60), |_, _| 8, |_, _, _, _, _| ());
    let wall = noisy_wall((60, 60), 8, |_, _| 0.5);
    let settings = PrpfSettings::paper();
    let share =
        |store: &Store| f64::from(paper(store, &settings, 1).interpolation_success.unwrap_or(f32::NAN));
    let interpolated = paper(&wall, &settings, 1).image;
    let direct = paper(&wall, &PrpfSettings { upsampling: false, ..settings.clone() }, 1).image;
    let pairs = interpolated.data().iter().zip(direct.data());
    vec![
        Case::new("a material to each pixel", "share interpolated", Exactly(0.0), share(&own_materials)),
        Case::new("nodes of an albedo of their own", "share interpolated", Exactly(0.0), share(&own_albedo)),
        Case::new("nodes of a normal of their own", "share interpolated", Exactly(0.0), share(&own_normal)),
        Case::new("two albedos at pixel scale", "share interpolated", AtLeast(0.9), share(&checkerboard))
            .instead("half of the nodes around a pixel are of its own material, and suffice"),
        Case::new("a flat wall", "share interpolated", Exactly(1.0), share(&flat)),
        Case::new(
            "interpolated weights against direct ones on a noisy wall",
            "relative difference of the image",
            AtMost(0.03),
            largest(pairs.map(|(&a, &b)| relative(a.into(), b.into()))),
        ),
    ]
}
