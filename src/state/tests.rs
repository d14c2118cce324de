use std::sync::{Arc, LazyLock};

use proptest::prelude::*;

use super::checkpoint_writer::CheckpointWriter;
use super::*;
use crate::filter::prpf::PRPF;
use crate::filter::{DENOISERS, Interpolation};
use crate::image::Planes;
use crate::progressive::{
    Budget, Checkpoint, ErrorEstimate, Grain, InterimPass, PassRecord, Position, SampleBatch, Settings, Speed,
};
use crate::render::Shard;
use crate::stats::{Block, Layout, Store};

const WIDTH: usize = 19;
const HEIGHT: usize = 5;

fn metadata() -> ImageMetadata {
    ImageMetadata {
        source: "scene.pbrt".into(),
        hash: "0123".into(),
        film: [30, 20],
        pixel_bounds: [3, 3 + WIDTH, 2, 2 + HEIGHT],
        integrator: "path, depth 5".into(),
        effects: vec!["area-lights".into()],
        camera: "Camera \"orthographic\"".into(),
        origin: [0.1, 1e9, -3.0],
        diameter: 0.3,
    }
}

fn settings() -> Settings {
    Settings {
        budget: Budget { spp: Some(8), seconds: Some(0.1), target_error: None },
        denoiser: &PRPF,
        seed: u64::MAX - 1,
        max_spp: 99,
        reservoir: 3,
        ..Settings::default()
    }
}

/// A state with everything that a state may have.
fn state(seed: u64, shard: Shard) -> RenderState {
    let layout = Layout::with_blocks(|block| block == Block::Lens);
    let mut store = Store::new(WIDTH, HEIGHT, layout.clone(), 3, seed);
    let value = |i: usize, k: usize| ((i * 31 + k * 17) as u64 ^ seed) as f32 % 1.7 + 0.1;
    for i in 0..WIDTH * HEIGHT {
        for sample in 0..i % 7 {
            let values: Vec<f32> = (0..layout.len()).map(|k| value(i + 1000 * sample, k)).collect();
            store.push(i % WIDTH, i / WIDTH, &values);
        }
        store.push(i % WIDTH, i / WIDTH, &vec![f32::NAN; layout.len()]);
    }
    let planes = |count: usize, offset: usize| {
        let mut planes = Planes::new(WIDTH, HEIGHT, count);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = value(i, offset));
        planes
    };
    let pixels = WIDTH * HEIGHT;
    let mut tiles = Planes::new(2, 1, 1);
    tiles.data_mut().copy_from_slice(&[0.1, 0.3]);
    let interim = InterimPass {
        made_by: DENOISERS[1].name(),
        image: planes(3, 3),
        variance: planes(3, 4),
        residual: planes(1, 5),
        interpolation: Some(Interpolation { failure: planes(1, 6), success: 0.7 }),
        estimate: Some(ErrorEstimate {
            value: 0.1 + 0.2,
            deviation: 1e-300,
            unfiltered: 2.0 / 3.0,
            samples: store.samples(),
            tiles,
        }),
    };
    let pass = PassRecord {
        index: 1,
        seconds: 0.1 + 0.2,
        estimated_error: Some(1.0 / 3.0),
        ..PassRecord::default()
    };
    RenderState {
        metadata: metadata(),
        settings: Settings { seed, ..settings() },
        weights: Some("0123456789abcdef".to_owned()),
        streams: vec![Stream::new(seed, shard)],
        checkpoint: Checkpoint {
            store: Arc::new(store),
            position: Position::Render(SampleBatch {
                counts: (0..pixels as u32).collect(),
                done: 0.1 + 0.2,
                grain: Grain::Block,
            }),
            passes: vec![PassRecord::default(), pass],
            interim: Some(interim),
            speed: Speed { samples: 12.5, seconds: 0.1 + 0.2 },
        },
    }
}

fn encoded(state: &RenderState) -> Vec<u8> {
    let mut file = Vec::new();
    encode(state, &mut file);
    file
}

static FILE: LazyLock<Vec<u8>> = LazyLock::new(|| encoded(&state(7, Shard::WHOLE)));

#[test]
fn the_documentation_has_the_version_of_the_format() {
    assert!(include_str!("../../docs/outputs.md").contains(&format!("({VERSION} now)")));
}

#[test]
fn what_is_read_is_what_was_written_to_the_last_bit() {
    let (written, read) = (state(7, Shard::WHOLE), decode(&FILE).unwrap());
    assert_eq!(read.checkpoint.store.rows(), written.checkpoint.store.rows());
    assert_eq!(read.checkpoint.interim, written.checkpoint.interim);
    assert_eq!(read.checkpoint.position, written.checkpoint.position);
    assert_eq!(read.checkpoint.speed, written.checkpoint.speed);
    assert_eq!((&read.metadata, &read.streams), (&written.metadata, &written.streams));
    assert_eq!(encoded(&read), *FILE, "filter passes and settings too");
}

#[test]
fn a_state_without_samples_is_one_too() {
    let mut state = state(7, Shard::WHOLE);
    state.checkpoint.store =
        Arc::new(Store::new(WIDTH, HEIGHT, state.checkpoint.store.layout().clone(), 0, 7));
    (state.checkpoint.interim, state.checkpoint.position) = (None, Position::Plan);
    let read = decode(&encoded(&state)).unwrap();
    assert_eq!(read.checkpoint.store.rows(), state.checkpoint.store.rows());
    assert!(read.checkpoint.interim.is_none());
    assert_eq!(read.checkpoint.position, Position::Plan);
}

/// A file that says of itself that it is whole.
fn sealed(mut file: Vec<u8>) -> Vec<u8> {
    let end = file.len() - 4;
    let length = (file.len() as u64).to_le_bytes();
    file[12..20].copy_from_slice(&length);
    let checksum = crc32fast::hash(&file[..end]).to_le_bytes();
    file[end..].copy_from_slice(&checksum);
    file
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn a_changed_byte_is_noticed(at in 0..FILE.len(), change in 1u8..) {
        let mut file = FILE.clone();
        file[at] ^= change;
        prop_assert!(decode(&file).is_err());
    }

    #[test]
    fn a_file_cut_off_anywhere_is_noticed(length in 0..FILE.len()) {
        prop_assert!(decode(&FILE[..length]).is_err());
    }

    #[test]
    fn bytes_after_the_end_are_noticed(more in prop::collection::vec(any::<u8>(), 1..100)) {
        let file = [FILE.as_slice(), &more].concat();
        let noticed = matches!(decode(&file), Err(StateErrorKind::Length { .. }));
        prop_assert!(noticed);
    }

    /// Not by accident, but by whoever knows the format: an error or a state, and no panic.
    #[test]
    fn wrong_content_with_a_right_checksum_does_no_harm(at in 20..FILE.len() - 4, change in 1u8..) {
        let mut file = FILE.clone();
        file[at] ^= change;
        let _ = decode(&sealed(file));
    }

    #[test]
    fn a_cut_with_a_right_checksum_is_noticed(length in 33..FILE.len() - 1) {
        prop_assert!(decode(&sealed(FILE[..length].to_vec())).is_err());
    }
}

#[test]
fn another_version_and_other_files_are_named() {
    // Earlier and later ones.
    for version in [VERSION - 1, VERSION + 1] {
        let mut file = FILE.clone();
        file[8..12].copy_from_slice(&version.to_le_bytes());
        assert_eq!(
            decode(&file).unwrap_err().to_string(),
            format!(
                "found a render state of format version {version}; accepted is version {VERSION}: render the scene again"
            )
        );
    }
    assert!(matches!(decode(b"\x76\x2f\x31\x01"), Err(StateErrorKind::Foreign)));
    assert!(matches!(decode(b""), Err(StateErrorKind::Foreign)));
    assert!(matches!(decode(b"prpfstat"), Err(StateErrorKind::Length { found: 8, .. })));
}

#[test]
fn counts_that_do_not_add_up_are_refused() {
    let file = &FILE;
    let header = u64::from_le_bytes(file[20..28].try_into().unwrap()) as usize;
    let mut file = file.to_vec();
    file[28 + header] ^= 1;
    assert!(matches!(decode(&sealed(file)), Err(StateErrorKind::Row(_))));
}

#[test]
fn settings_that_no_render_can_follow_are_refused() {
    let mut state = state(7, Shard::WHOLE);
    state.settings.priority.cap_quantile = 9.0;
    let said = decode(&encoded(&state)).unwrap_err().to_string();
    assert!(said.contains("cap_quantile: found 9; accepted is a number from 0 to 1"), "{said}");
}

#[test]
fn shards_that_make_a_whole_become_it_and_others_stay_apart() {
    // Each pixel as often as it is due to the shard.
    let of_many = |k: u32, n: u32, samples: u32| {
        let mut state = state(7, Shard::new(k, n).unwrap());
        let layout = state.checkpoint.store.layout().clone();
        let mut store = Store::new(WIDTH, HEIGHT, layout.clone(), 3, 7);
        for i in 0..WIDTH * HEIGHT {
            let values = vec![0.5; layout.len() * samples as usize];
            store.push(i % WIDTH, i / WIDTH, &values);
        }
        state.checkpoint.store = Arc::new(store);
        state
    };
    let of = |k: u32, samples: u32| of_many(k, 2, samples);
    let sum = |a: RenderState, b: RenderState| {
        let mut merge = Merge::new(a);
        merge.add(&b).unwrap();
        merge.finish()
    };
    let whole = sum(of(2, 2), of(1, 4));
    assert_eq!(whole.streams, [Stream::new(7, Shard::WHOLE)]);
    assert_eq!(whole.checkpoint.store.samples_taken(), 6 * (WIDTH * HEIGHT) as u64);
    assert!(whole.checkpoint.interim.is_none() && whole.checkpoint.passes.is_empty());
    let gap = sum(of(1, 2), of(2, 4));
    assert_eq!(gap.streams.len(), 2, "indices 2 and 3 of the first shard are missing");
    assert_eq!(encoded(&decode(&encoded(&gap)).unwrap()), encoded(&gap));

    // Step by step, by way of files, in any order and grouping: 8 samples are 4, 2 and 2.
    let reread = |state: RenderState| decode(&encoded(&state)).unwrap();
    let [a, b, c] = [(1, 4), (2, 2), (3, 2)].map(|(k, samples)| move || of_many(k, 3, samples));
    for steps in [sum(reread(sum(c(), a())), b()), sum(b(), reread(sum(a(), c())))] {
        assert_eq!(steps.streams, [Stream::new(7, Shard::WHOLE)]);
    }
    assert_eq!(
        sum(reread(sum(of_many(3, 3, 4), of_many(1, 3, 2))), b()).streams.len(),
        3,
        "as many, but not these"
    );
}

#[test]
fn only_other_samples_of_the_same_image_are_added() {
    let mut merge = Merge::new(state(7, Shard::WHOLE));
    let same = merge.add(&state(7, Shard::new(2, 3).unwrap())).unwrap_err();
    assert!(matches!(same, MergeError::Overlap(..)));
    let mut other = state(8, Shard::WHOLE);
    other.metadata.pixel_bounds[0] -= 1;
    let differs = merge.add(&other).unwrap_err().to_string();
    assert!(differs.starts_with("pixelbounds: found 2,22,2,7; accepted is"), "{differs}");
    merge.add(&state(8, Shard::WHOLE)).unwrap();
    assert_eq!(merge.finish().streams.len(), 2);
}

#[test]
fn the_writer_leaves_the_latest_state_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.state");
    std::fs::write(folder.path().join(".a.state.tmp"), b"left by a killed program").unwrap();
    let writer = CheckpointWriter::new(&path, 1000).unwrap();
    assert!(!writer.is_writing());
    for seed in [1, 2, 3] {
        writer.write(&state(seed, Shard::WHOLE));
    }
    writer.wait().unwrap();
    assert!(!writer.is_writing());
    drop(writer);
    assert_eq!(RenderState::read(&path).unwrap().settings.seed, 3);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_disk_without_space_is_an_error_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.state");
    state(1, Shard::WHOLE).write(&path).unwrap();
    // More than any disk has; not every file system can tell.
    if let Err(error) = CheckpointWriter::new(&path, 1 << 55) {
        assert!(
            matches!(error.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::FileTooLarge),
            "{error}"
        );
    }
    assert_eq!(RenderState::read(&path).unwrap().settings.seed, 1);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_image_without_pixels_cannot_have_rows_without_end() {
    let header = u64::from_le_bytes(FILE[20..28].try_into().unwrap()) as usize;
    let mut header_json: serde_json::Value = serde_json::from_slice(&FILE[28..28 + header]).unwrap();
    let rows = 1u64 << 60;
    header_json["metadata"]["film"] = serde_json::json!([0, rows]);
    header_json["metadata"]["pixel_bounds"] = serde_json::json!([0, 0, 0, rows]);
    (header_json["interim"], header_json["estimate"]) = Default::default();
    header_json["position"] = "plan".into();
    let header_json = serde_json::to_vec(&header_json).unwrap();
    let mut file = [&FILE[..28], &header_json, &[0; 4]].concat();
    file[20..28].copy_from_slice(&(header_json.len() as u64).to_le_bytes());
    let problem = decode(&sealed(file)).unwrap_err().to_string();
    assert!(problem.ends_with("an image without pixels"), "{problem}");
}

#[test]
fn a_state_of_a_scene_without_size_is_refused() {
    let header = u64::from_le_bytes(FILE[20..28].try_into().unwrap()) as usize;
    let (text, arrays) = FILE[28..].split_at(header);
    let mut header_json: serde_json::Value = serde_json::from_slice(text).unwrap();
    header_json["metadata"]["diameter"] = 0.into();
    let header_json = serde_json::to_vec(&header_json).unwrap();
    let mut file = [&FILE[..28], &header_json, arrays].concat();
    file[20..28].copy_from_slice(&(header_json.len() as u64).to_le_bytes());
    let problem = decode(&sealed(file)).unwrap_err().to_string();
    assert!(problem.ends_with("a scene without finite size or origin"), "{problem}");
}
