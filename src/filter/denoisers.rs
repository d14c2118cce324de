//! The list of all denoisers. To add one, implement [`Denoiser`] and add a line to [`DENOISERS`]: command line, page,
//! report and render states know it from there.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::denoiser::{Denoiser, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::{learned, nlm, none, oidn, prpf, rpf};
use crate::stats::Store;

/// All denoisers, in the order of lists. Of one method the first preset is its default.
pub static DENOISERS: [&dyn Denoiser; 10] = [
    &learned::STANDARD,
    &learned::DRAFT,
    &nlm::STANDARD,
    &nlm::DRAFT,
    &prpf::PRPF,
    &prpf::INTERIM,
    &rpf::RPF,
    &oidn::STANDARD,
    &oidn::DRAFT,
    &none::NONE,
];

/// The default denoiser.
pub static DEFAULT: &dyn Denoiser = &learned::STANDARD;

/// The default denoisers under a time budget, each faster or of less memory, and less exact, than the one before.
pub static DEFAULTS_BY_COST: [&dyn Denoiser; 4] =
    [&learned::STANDARD, &learned::DRAFT, &nlm::STANDARD, &nlm::DRAFT];

/// The mean of the samples: the fallback if time is short.
pub static UNFILTERED: &dyn Denoiser = &none::NONE;

/// Returns the denoiser of a method and one of its presets; without a preset the method's default.
pub fn find(method: &str, preset: Option<&str>) -> Option<&'static dyn Denoiser> {
    let matches = |name: DenoiserName| name.method == method && (preset.is_none() || name.preset == preset);
    DENOISERS.into_iter().find(|denoiser| matches(denoiser.name()))
}

/// Returns the name of the trained weights by which a denoiser filters, if it has any.
pub fn weights_of(name: DenoiserName) -> Option<&'static str> {
    find(name.method, name.preset).and_then(Denoiser::weights)
}

/// Returns the presets of a method, its default first; none if it has no presets.
pub fn presets(method: &str) -> Vec<&'static str> {
    let names = DENOISERS.into_iter().map(Denoiser::name).filter(|name| name.method == method);
    names.filter_map(|name| name.preset).collect()
}

/// Returns the draft of a denoiser's method; without one the denoiser's stand-in, which may be of another method.
pub fn draft_of(denoiser: &'static dyn Denoiser) -> &'static dyn Denoiser {
    find(denoiser.name().method, Some("draft")).unwrap_or(denoiser.stand_in())
}

/// Returns a denoiser's draft, or that of `nlm` where it reads sample vectors.
pub fn draft_without_vectors(denoiser: &'static dyn Denoiser) -> &'static dyn Denoiser {
    let draft = draft_of(denoiser);
    let reads_vectors = draft.reads().sample_vectors != SampleVectors::None;
    if reads_vectors { &nlm::DRAFT } else { draft }
}

/// Returns the draft of a denoiser for a store with fewer samples than pixels, where better presets leave the same error; the
/// denoiser itself for others.
pub fn draft_if_sparse(store: &Store, denoiser: &'static dyn Denoiser) -> &'static dyn Denoiser {
    let is_sparse = store.samples_taken() < store.pixels() as u64;
    if is_sparse { draft_of(denoiser) } else { denoiser }
}

/// A name in files.
#[derive(Deserialize)]
struct NameFields {
    denoiser: String,
    quality: Option<String>,
}

impl<'de> Deserialize<'de> for &'static dyn Denoiser {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let NameFields { denoiser, quality } = NameFields::deserialize(deserializer)?;
        find(&denoiser, quality.as_deref()).ok_or_else(|| {
            let quality = quality.map_or_else(String::new, |quality| format!(" {quality}"));
            D::Error::custom(format!("unknown denoiser {denoiser}{quality}"))
        })
    }
}

impl<'de> Deserialize<'de> for DenoiserName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <&'static dyn Denoiser>::deserialize(deserializer).map(Denoiser::name)
    }
}

impl Serialize for dyn Denoiser {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.name().serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::SampleVectors;
    use crate::filter::synthetic::{store, wall};
    use crate::image::Planes;
    use crate::stats::{Block, Layout, Part};

    #[test]
    fn every_denoiser_is_found_by_its_name_and_no_two_share_one() {
        for (i, denoiser) in DENOISERS.into_iter().enumerate() {
            let name = denoiser.name();
            assert_eq!(find(name.method, name.preset), Some(denoiser));
            assert!(DENOISERS[..i].iter().all(|other| other.name() != name), "{name}");
            assert!(!denoiser.summary().is_empty());
        }
        assert_eq!(find("nlm", None).map(Denoiser::name), Some(nlm::STANDARD.name()), "the default preset");
        assert_eq!(find("nlm", Some("paper")), None);
        assert_eq!(find("none", Some("standard")), None);
    }

    #[test]
    fn stand_ins_need_no_more_than_those_for_which_they_stand_in() {
        for denoiser in DENOISERS {
            let stand_in = denoiser.stand_in();
            assert_eq!(stand_in.stand_in(), stand_in, "a stand-in stands in for itself");
            assert!(stand_in.cost().pass_time <= denoiser.cost().pass_time);
            let reads = |denoiser: &dyn Denoiser| denoiser.reads().sample_vectors;
            let is_met = |needed| [SampleVectors::None, reads(denoiser)].contains(&needed);
            assert!(is_met(reads(stand_in)), "{}", denoiser.name());
        }
    }

    #[test]
    fn names_survive_files_and_unknown_ones_are_refused() {
        for denoiser in DENOISERS {
            let text = serde_json::to_string(denoiser).unwrap();
            assert_eq!(serde_json::from_str::<&'static dyn Denoiser>(&text).unwrap(), denoiser, "{text}");
        }
        let unknown = serde_json::from_str::<DenoiserName>(r#"{"denoiser":"nlm","quality":"best"}"#);
        assert!(unknown.unwrap_err().to_string().contains("unknown denoiser nlm best"));
    }

    #[test]
    fn layers_of_the_colour_sum_to_the_image() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Normal1));
        let noisy = store(
            40,
            30,
            layout.clone(),
            |x, y| [0, 1, 2, 8][(x + y) % 4],
            |x, y, _, rng| {
                // Light that few samples meet leaves fireflies
                let light = if rng.random_bool(0.01) { 200.0 } else { rng.random::<f32>() };
                wall(&layout, x, y, [light; 3], rng)
            },
        );
        let colour = [0, 1].map(|half| noisy.means(Part::Half(half), layout.colour()));
        let parts = [0.0, 0.3, 0.5].map(|lower| {
            let part = |i: usize| if i % 7 < 3 { lower } else { 0.5 * lower };
            colour.each_ref().map(|half| {
                let mut layer = half.clone();
                layer.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v *= part(i));
                layer
            })
        });
        let rest = [0, 1].map(|half| {
            let mut rest = colour[half].clone();
            for part in &parts {
                rest.data_mut().iter_mut().zip(part[half].data()).for_each(|(rest, v)| *rest -= v);
            }
            rest
        });
        let layers: Vec<[Planes; 2]> = parts.into_iter().chain([rest]).collect();
        let with_layers: Vec<_> = DENOISERS.into_iter().filter_map(Denoiser::layers).collect();
        assert_eq!(with_layers.len(), 4, "both presets of learned and nlm");
        for denoiser in with_layers {
            let (result, filtered) = denoiser.filter_with_layers(&noisy, 0, &layers);
            for (i, v) in result.image.data().iter().enumerate() {
                let sum: f32 = filtered.iter().map(|layer| layer.data()[i]).sum();
                assert!((sum - v).abs() <= 2e-5 * (1.0 + v.abs()), "{}: {sum} {v}", result.made_by);
            }
            assert!(filtered[0].data().iter().all(|&v| v.abs() < 1e-6), "a black layer stays black");
        }
    }

    #[test]
    fn a_store_with_fewer_samples_than_pixels_gets_the_draft() {
        let mut store = Store::new(2, 1, Layout::with_blocks(|_| false), 0, 0);
        store.push(0, 0, &[0.5; 5]);
        assert_eq!(draft_if_sparse(&store, &nlm::STANDARD).name(), nlm::DRAFT.name());
        assert_eq!(draft_if_sparse(&store, &learned::STANDARD).name(), learned::DRAFT.name());
        assert_eq!(draft_if_sparse(&store, &prpf::PRPF).name(), prpf::INTERIM.name());
        assert_eq!(draft_if_sparse(&store, &none::NONE).name(), none::NONE.name());
        store.push(1, 0, &[0.5; 5]);
        assert_eq!(draft_if_sparse(&store, &prpf::PRPF).name(), prpf::PRPF.name());
    }

    #[test]
    fn drafts_need_no_sample_vectors() {
        for denoiser in DENOISERS {
            let draft = draft_without_vectors(denoiser);
            assert_eq!(draft.reads().sample_vectors, SampleVectors::None, "{denoiser:?}");
        }
        let name = |method: &str| draft_without_vectors(find(method, None).unwrap()).name().to_string();
        assert_eq!([name("learned"), name("prpf")], ["learned draft", "nlm draft"]);
    }
}
