//! Stores that no renderer makes, filtered.

use std::panic::{AssertUnwindSafe, catch_unwind};

use prpf::filter::Filtered;
use prpf::filter::rpf::{self, RpfSettings};
use prpf::stats::{Group, LARGEST_VALUE, Layout, Part, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Bound::Exactly;
use super::stores::{QUALITIES, filtered, not_finite, store};
use super::{Case, Effort};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = halves();
    cases.extend(any_numbers(effort.of(24, 5000)));
    cases
}

/// One half or both without samples, in all pixels or some.
fn halves() -> Vec<Case> {
    let with = |even: fn(usize, usize) -> bool, odd: fn(usize, usize) -> bool| {
        store(
            (33, 31),
            |_, _| 8,
            move |x, y, index, numbers, sample| {
                let wanted = if index % 2 == 0 { even(x, y) } else { odd(x, y) };
                sample.lit([if wanted { numbers.random::<f32>() } else { f32::NAN }; 3]);
            },
        )
    };
    let stores = [
        ("the first half empty", with(|_, _| false, |_, _| true)),
        ("the second half empty", with(|_, _| true, |_, _| false)),
        ("either half empty in each pixel", with(|x, _| x % 2 == 0, |x, _| x % 2 == 1)),
        ("one pixel with samples", with(|x, y| (x, y) == (16, 15), |x, y| (x, y) == (16, 15))),
        ("both halves empty", with(|_, _| false, |_, _| false)),
    ];
    let of_store = |(what, store): (&str, Store)| {
        let samples = store.counts(Part::Whole).iter().any(|&n| n > 0);
        let wrong = QUALITIES.iter().filter(|(quality, _)| {
            let filtered = filtered(&store, *quality);
            let mean = filtered.image.data().iter().sum::<f32>() / filtered.image.data().len() as f32;
            let expected = if samples { (0.2..0.8).contains(&mean) } else { mean == 0.0 };
            not_finite(&filtered) > 0 || !expected
        });
        Case::new(what, "qualities with a wrong mean or number", Exactly(0.0), wrong.count() as f64)
    };
    stores.map(of_store).to_vec()
}

/// A part of the sample vector that may hold any number; the rest is in [0, 1).
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wild {
    Colours,
    Features,
    All,
}

type Filter = Box<dyn Fn(&Store) -> Filtered>;

/// Vectors of any numbers in images of any shape: up to the largest that a store accepts, and beyond it.
fn any_numbers(stores: u64) -> Vec<Case> {
    let settings = RpfSettings::report();
    let mut filters: Vec<(&str, Filter)> =
        vec![("random parameter filtering", Box::new(move |store| rpf::filter(store, &settings, 1)))];
    for (quality, name) in QUALITIES {
        filters.push((name, Box::new(move |store| filtered(store, quality))));
    }
    // The last were no numbers once: light below none left nothing that an error could be relative to.
    let seeds = || (0..stores).chain([150, 176, 1195, 1376, 1544]);
    let stores = |wild: Wild, most: f32| seeds().map(|seed| odd_store(seed, wild, most)).collect::<Vec<_>>();
    let kinds = [
        ("any colours that are accepted", stores(Wild::Colours, LARGEST_VALUE)),
        ("any features that are accepted", stores(Wild::Features, LARGEST_VALUE)),
        ("anything that is accepted", stores(Wild::All, LARGEST_VALUE)),
        ("anything up to 10³⁰, accepted or not", stores(Wild::All, 1e30)),
    ];
    let mut cases = Vec::new();
    for (name, filter) in &filters {
        for (what, stores) in &kinds {
            let bad =
                |store| catch_unwind(AssertUnwindSafe(|| filter(store))).map_or(1, |it| not_finite(&it));
            let bad: usize = stores.iter().map(bad).sum();
            let what = format!("{} stores with {what}, {name}", stores.len());
            cases.push(Case::new(what, "numbers not finite, and panics", Exactly(0.0), bad as f64));
        }
    }
    cases
}

/// Numbers up to `most`.
fn odd_store(seed: u64, wild: Wild, most: f32) -> Store {
    let mut numbers = Pcg32::seed_from_u64(seed);
    let blocks: u32 = numbers.random();
    let layout = Layout::with_blocks(|block| blocks >> block as u32 & 1 == 1);
    let radiance: Vec<usize> = layout.colour().chain(layout.radiance()).collect();
    let (width, height) = (numbers.random_range(1..24), numbers.random_range(1..24));
    let mut store = Store::new(width, height, layout.clone(), 8, seed);
    // All of a store's numbers are of one kind as often as not.
    let kinds = if numbers.random() {
        0..6
    } else {
        let kind = numbers.random_range(0..6);
        kind..kind + 1
    };
    for i in 0..width * height {
        for _ in 0..numbers.random_range(0..7) {
            let sample: Vec<f32> = (0..layout.len())
                .map(|dim| {
                    let feature = matches!(layout.dimensions()[dim].group, Group::Feature(_));
                    let part = if radiance.contains(&dim) { Wild::Colours } else { Wild::Features };
                    let tame = wild != Wild::All && (part != wild || wild == Wild::Features && !feature);
                    if tame {
                        return numbers.random();
                    }
                    let size = match numbers.random_range(kinds.clone()) {
                        0 => 0.0,
                        1 => f32::from_bits(numbers.random_range(1..1 << 23)),
                        2 => 10f32.powf(numbers.random_range(-38.0..most.log10())),
                        3 => most,
                        4 => 1.0,
                        _ => numbers.random(),
                    };
                    if radiance.contains(&dim) || numbers.random() { size } else { -size }
                })
                .collect();
            store.push(i % width, i / width, &sample);
        }
    }
    store
}
