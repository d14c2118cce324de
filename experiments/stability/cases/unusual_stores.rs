//! Cases on stores that no renderer makes: empty halves, and sample vectors of arbitrary values.

use std::panic::{AssertUnwindSafe, catch_unwind};

use prpf::filter::FilterResult;
use prpf::filter::rpf::{self, RpfSettings};
use prpf::stats::{Group, LARGEST_VALUE, Layout, Part, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use super::case::Bound::Exactly;
use super::case::Case;
use super::effort::Effort;
use super::stores::{FILTERS, filtered, not_finite, store};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = halves();
    cases.extend(arbitrary_values(effort.select(24, 5000)));
    cases
}

/// Stores with one or both halves empty, in all pixels or some.
fn halves() -> Vec<Case> {
    let store_with = |even: fn(usize, usize) -> bool, odd: fn(usize, usize) -> bool| {
        store(
            (33, 31),
            |_, _| 8,
            move |x, y, index, rng, sample| {
                let is_valid = if index % 2 == 0 { even(x, y) } else { odd(x, y) };
                sample.lit([if is_valid { rng.random::<f32>() } else { f32::NAN }; 3]);
            },
        )
    };
    let stores = [
        ("the first half empty", store_with(|_, _| false, |_, _| true)),
        ("the second half empty", store_with(|_, _| true, |_, _| false)),
        ("either half empty in each pixel", store_with(|x, _| x % 2 == 0, |x, _| x % 2 == 1)),
        ("one pixel with samples", store_with(|x, y| (x, y) == (16, 15), |x, y| (x, y) == (16, 15))),
        ("both halves empty", store_with(|_, _| false, |_, _| false)),
    ];
    let case = |(name, store): (&str, Store)| {
        let samples = store.counts(Part::Whole).iter().any(|&n| n > 0);
        let wrong = FILTERS.iter().filter(|(denoiser, _)| {
            let filtered = filtered(&store, *denoiser);
            let mean = filtered.image.data().iter().sum::<f32>() / filtered.image.data().len() as f32;
            let expected = if samples { (0.2..0.8).contains(&mean) } else { mean == 0.0 };
            not_finite(&filtered) > 0 || !expected
        });
        Case::new(name, "filters with a wrong mean or value", Exactly(0.0), wrong.count() as f64)
    };
    stores.map(case).to_vec()
}

/// The part of the sample vector that holds arbitrary values; the rest is in [0, 1).
#[derive(Clone, Copy, PartialEq, Eq)]
enum Arbitrary {
    Colours,
    Features,
    All,
}

type Filter = Box<dyn Fn(&Store) -> FilterResult + Send + Sync>;

/// Arbitrary values in images of any shape, up to the largest that a store accepts and beyond.
fn arbitrary_values(count: u64) -> Vec<Case> {
    let settings = RpfSettings::energy_kept();
    let mut filters: Vec<(&str, Filter)> =
        vec![("rpf", Box::new(move |store| rpf::filter(store, &settings, 1)))];
    for (denoiser, name) in FILTERS {
        filters.push((name, Box::new(move |store| filtered(store, denoiser))));
    }
    // The last seeds once gave NaN, because negative radiance left a relative error without a reference.
    let seeds = || (0..count).chain([150, 176, 1195, 1376, 1544]);
    let stores = |arbitrary: Arbitrary, max: f32| {
        seeds().map(|seed| arbitrary_store(seed, arbitrary, max)).collect::<Vec<_>>()
    };
    let kinds = [
        ("any accepted colours", stores(Arbitrary::Colours, LARGEST_VALUE)),
        ("any accepted features", stores(Arbitrary::Features, LARGEST_VALUE)),
        ("any accepted values", stores(Arbitrary::All, LARGEST_VALUE)),
        ("any values up to 10³⁰, accepted or not", stores(Arbitrary::All, 1e30)),
    ];
    let mut cases = Vec::new();
    for (name, filter) in &filters {
        for (what, stores) in &kinds {
            let bad =
                |store| catch_unwind(AssertUnwindSafe(|| filter(store))).map_or(1, |it| not_finite(&it));
            let bad: usize = stores.par_iter().map(bad).sum();
            let case = format!("{} stores with {what}, {name}", stores.len());
            cases.push(Case::new(case, "values not finite, and panics", Exactly(0.0), bad as f64));
        }
    }
    cases
}

/// Makes a store of random shape and layout, with values up to `max`.
fn arbitrary_store(seed: u64, arbitrary: Arbitrary, max: f32) -> Store {
    // Choose layout, size and kinds of values
    let mut rng = Pcg32::seed_from_u64(seed);
    let blocks: u32 = rng.random();
    let layout = Layout::with_blocks(|block| blocks >> block as u32 & 1 == 1);
    let radiance: Vec<usize> = layout.colour().chain(layout.radiance()).collect();
    let (width, height) = (rng.random_range(1..24), rng.random_range(1..24));
    let mut store = Store::new(width, height, layout.clone(), 8, seed);
    // Half of the stores hold values of one kind only.
    let kinds = if rng.random() {
        0..6
    } else {
        let kind = rng.random_range(0..6);
        kind..kind + 1
    };

    // Push up to six samples into each pixel
    for i in 0..width * height {
        for _ in 0..rng.random_range(0..7) {
            let sample: Vec<f32> = (0..layout.len())
                .map(|dim| {
                    let feature = matches!(layout.dimensions()[dim].group, Group::Feature(_));
                    let part = if radiance.contains(&dim) { Arbitrary::Colours } else { Arbitrary::Features };
                    let is_normalized = arbitrary != Arbitrary::All
                        && (part != arbitrary || arbitrary == Arbitrary::Features && !feature);
                    if is_normalized {
                        return rng.random();
                    }
                    let size = match rng.random_range(kinds.clone()) {
                        0 => 0.0,
                        1 => f32::from_bits(rng.random_range(1..1 << 23)),
                        2 => 10f32.powf(rng.random_range(-38.0..max.log10())),
                        3 => max,
                        4 => 1.0,
                        _ => rng.random(),
                    };
                    if radiance.contains(&dim) || rng.random() { size } else { -size }
                })
                .collect();
            store.push(i % width, i / width, &sample);
        }
    }
    store
}
