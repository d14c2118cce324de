use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::compression::Compression;
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer};
use exr::math::Vec2;
use exr::meta::attribute::LineOrder;
use exr::meta::header::LayerAttributes;
use half::f16;

use super::*;
use crate::image::{Planes, Problem};

const COMPRESSIONS: [Compression; 8] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
    Compression::PXR24,
    Compression::B44,
    Compression::B44A,
];

fn ramp(count: usize, scale: f32) -> Vec<f32> {
    (0..count).map(|i| i as f32 * scale).collect()
}

/// A temporary folder, deleted at the end of the test, and a file name in it.
fn scratch() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    (folder, path)
}

/// Writes channels R, G and B with the `exr` crate's own writer.
fn write_foreign(path: &Path, compression: Compression, blocks: Blocks, samples: [FlatSamples; 3]) {
    let list = ["B", "G", "R"].into_iter().zip(samples).map(|(name, samples)| AnyChannel::new(name, samples));
    let channels = AnyChannels::sort(list.collect());
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let layer = Layer::new((7, 37), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(path).unwrap();
}

#[test]
fn every_layer_and_attribute_round_trips() {
    let (_folder, path) = scratch();
    let (width, height) = (33, 50);
    let names = ["R", "G", "B", "Noisy.R", "P.X", "P.Y", "P.Z", "SampleCount.X"];
    let planes: Vec<_> = (1..=names.len()).map(|i| ramp(width * height, 0.1 * i as f32)).collect();
    let channels: Vec<_> =
        names.iter().zip(&planes).map(|(name, plane)| Channel::new(*name, plane, Precision::Float)).collect();
    let mut attributes = vec![
        (attribute_names::SAMPLES_PER_PIXEL.to_string(), Attribute::Int(64)),
        (attribute_names::RENDER_TIME_SECONDS.to_string(), Attribute::Float(12.5)),
        (attribute_names::MSE.to_string(), Attribute::Float(1e-3)),
        ("prpf.commandLine".to_string(), Attribute::Text("prpf render Küche.pbrt --spp 64".into())),
        ("prpf.batches".to_string(), Attribute::Ints(vec![4, 8, 52, 1 << 40])),
        ("prpf.none".to_string(), Attribute::Ints(vec![])),
        ("software".to_string(), Attribute::Text("prpf".into())),
        ("comments".to_string(), Attribute::Text("".into())),
    ];
    let windows = Windows { data: [-10, 23, 20, 70], display: [-5, 635, 0, 480] };
    write(&path, windows, &channels, &attributes).unwrap();

    let info = read_info(&path).unwrap();
    attributes.sort_by(|a, b| a.0.cmp(&b.0));
    assert_eq!(info.attributes, attributes);
    assert_eq!((info.width, info.height, info.windows), (width, height, windows));
    assert_eq!(info.channels, ["B", "G", "Noisy.R", "P.X", "P.Y", "P.Z", "R", "SampleCount.X"]);

    let back = read_channels(&path, &names).unwrap();
    assert_eq!((back.width(), back.height(), back.count()), (width, height, names.len()));
    for (i, plane) in planes.iter().enumerate() {
        assert_eq!(back.plane(i), plane, "{}", names[i]);
    }
    assert_eq!(read_layer(&path, None).unwrap().data(), planes[..3].concat());
    assert_eq!(read_layer(&path, Some("P")).unwrap().data(), planes[4..7].concat());
    assert_eq!(read_layer(&path, Some("SampleCount")).unwrap().plane(2), planes[7]);
}

#[test]
fn float_is_exact_and_half_is_rounded() {
    let (_folder, path) = scratch();
    let values = [0.1, -3.0, 1e-7, 65504.0, 1e9, -1e9, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    let channels =
        [Channel::new("exact", &values, Precision::Float), Channel::new("rounded", &values, Precision::Half)];
    write(&path, Windows::whole(3, 3), &channels, &[]).unwrap();
    let back = read_channels(&path, &["exact", "rounded"]).unwrap();
    assert_eq!(back.plane(0)[..8], values[..8]);
    assert_eq!(
        back.plane(1)[..8],
        [0.099975586, -3.0, 1.1920929e-7, 65504.0, 65504.0, -65504.0, f32::INFINITY, f32::NEG_INFINITY]
    );
    assert!(back.plane(0)[8].is_nan() && back.plane(1)[8].is_nan());
}

#[test]
fn one_pixel_and_one_column_round_trip() {
    let (_folder, path) = scratch();
    for (width, height) in [(1, 1), (1, 40), (40, 1)] {
        let plane = ramp(width * height, 1.0);
        write(&path, Windows::whole(width, height), &[Channel::new("X", &plane, Precision::Float)], &[])
            .unwrap();
        let back = read_channels(&path, &["X"]).unwrap();
        assert_eq!((back.width(), back.height(), back.data()), (width, height, &plane[..]));
    }
}

#[test]
fn unwritable_images_are_refused_and_the_old_file_kept() {
    let (folder, path) = scratch();
    let plane = ramp(4, 1.0);
    let channel = || Channel::new("X", &plane, Precision::Float);
    write(&path, Windows::whole(2, 2), &[channel()], &[]).unwrap();

    let refused = |windows, channels: &[Channel], attributes: &[(String, Attribute)]| {
        write(&path, windows, channels, attributes).unwrap_err().problem
    };
    for (width, height) in [(0, 0), (0, 2), (2, 0)] {
        assert!(matches!(refused(Windows::whole(width, height), &[channel()], &[]), Problem::Empty));
    }
    let backwards = Windows { data: [2, 0, 2, 0], display: [0, 2, 0, 2] };
    assert!(matches!(refused(backwards, &[channel()], &[]), Problem::Empty));
    assert!(matches!(refused(Windows::whole(2, 2), &[], &[]), Problem::Empty));
    let message = refused(Windows::whole(3, 2), &[channel()], &[]).to_string();
    assert_eq!(message, "cannot be written: channel X has 4 values for 3x2 pixels");
    let message = refused(Windows::whole(2, 2), &[channel(), channel()], &[]).to_string();
    assert_eq!(message, "cannot be written: channel X appears twice");
    let far = Windows { data: [1 << 30, (1 << 30) + 2, 0, 2], display: [0, 2, 0, 2] };
    assert!(matches!(refused(far, &[channel()], &[]), Problem::Unwritable(_)));
    let reserved = [("dataWindow".to_string(), Attribute::Int(1))];
    assert!(matches!(refused(Windows::whole(2, 2), &[channel()], &reserved), Problem::Unwritable(_)));

    assert_eq!(read_channels(&path, &["X"]).unwrap().data(), plane);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_missing_folder_is_named() {
    let (folder, _) = scratch();
    let path = folder.path().join("missing/image.exr");
    let plane = [0.0];
    let error = write(&path, Windows::whole(1, 1), &[Channel::new("X", &plane, Precision::Half)], &[]);
    let message = error.unwrap_err().to_string();
    assert!(message.ends_with("missing/image.exr: no such file or folder"), "{message}");
}

#[test]
fn the_same_image_gives_the_same_bytes() {
    let plane = ramp(64 * 64, 0.01);
    let channels = [Channel::new("X", &plane, Precision::Half)];
    let attributes: Vec<_> = (0..20).map(|i| (format!("prpf.{i}"), Attribute::Int(i))).collect();
    let first = write::encode(Windows::whole(64, 64), &channels, &attributes).unwrap();
    for _ in 0..5 {
        assert_eq!(write::encode(Windows::whole(64, 64), &channels, &attributes).unwrap(), first);
    }
}

#[test]
fn every_compression_and_tiling_of_other_programs_is_read() {
    let (_folder, path) = scratch();
    let halves: Vec<f16> = (0..7 * 37).map(|i| f16::from_f32(i as f32)).collect();
    let expected = ramp(7 * 37, 1.0);
    for compression in COMPRESSIONS {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(4, 16))] {
            let samples = [
                FlatSamples::U32((0..7 * 37).collect()),
                FlatSamples::F32(expected.clone()),
                FlatSamples::F16(halves.clone()),
            ];
            write_foreign(&path, compression, blocks, samples);
            let back = read_layer(&path, None).unwrap();
            // B44 keeps blocks of 4×4 half values to about 1 part in 60; all else here is exact.
            let lossy = matches!(compression, Compression::B44 | Compression::B44A);
            for (plane, tolerance) in [(0, if lossy { 8.0 } else { 0.0 }), (1, 0.0), (2, 0.0)] {
                for (value, expected) in back.plane(plane).iter().zip(&expected) {
                    assert!((value - expected).abs() <= tolerance, "{compression}: {value} for {expected}");
                }
            }
        }
    }
}

#[test]
fn dwa_is_refused() {
    let (_folder, path) = scratch();
    for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
        let samples = || FlatSamples::F32(ramp(7 * 37, 1.0));
        write_foreign(&path, compression, Blocks::ScanLines, [samples(), samples(), samples()]);
        assert!(matches!(read_layer(&path, None).unwrap_err().problem, Problem::Unsupported(_)));
    }
}

#[test]
fn missing_channels_are_named_with_those_present() {
    let (_folder, path) = scratch();
    let plane = [0.0];
    let channels = [("A.X", ()), ("B.X", ())].map(|(name, ())| Channel::new(name, &plane, Precision::Half));
    write(&path, Windows::whole(1, 1), &channels, &[]).unwrap();
    let message = read_layer(&path, None).unwrap_err().problem.to_string();
    assert_eq!(message, "channels R, G, B are missing; the file has A.X, B.X");
    let message = read_channels(&path, &["A.X", "C.X"]).unwrap_err().problem.to_string();
    assert_eq!(message, "channels A.X, C.X are missing; the file has A.X, B.X");
}

/// Replaces the value of an attribute of the first header, of the same length.
fn patch(file: &mut [u8], attribute: &[u8], value: &[u8]) {
    let at = file.windows(attribute.len()).position(|bytes| bytes == attribute).unwrap();
    let value_at = at + attribute.len() + 4;
    file[value_at..value_at + value.len()].copy_from_slice(value);
}

#[test]
fn a_header_with_a_too_large_size_is_refused_before_allocation() {
    let (_folder, path) = scratch();
    let plane = ramp(4, 1.0);
    let whole =
        write::encode(Windows::whole(2, 2), &[Channel::new("X", &plane, Precision::Float)], &[]).unwrap();
    let problem = |last: i32| {
        let mut file = whole.clone();
        let window: Vec<u8> = [0, 0, last, last].into_iter().flat_map(i32::to_le_bytes).collect();
        patch(&mut file, b"dataWindow\0box2i\0", &window);
        patch(&mut file, b"chunkCount\0int\0", &(last / 16 + 1).to_le_bytes());
        std::fs::write(&path, &file).unwrap();
        read_channels(&path, &["X"]).unwrap_err().problem
    };
    // 17 GB of values; sides of 10⁹ pixels; a valid size, but more blocks than the file can hold.
    assert!(matches!(problem((1 << 16) - 1), Problem::TooLarge { .. }));
    assert!(matches!(problem(1_000_000_000), Problem::TooLarge { .. }));
    assert!(matches!(problem(29_999), Problem::Malformed(_)));
}

fn decode(file: &[u8]) -> Result<Planes, Problem> {
    read::decode_first_present(Cursor::new(file), &read::layer_channels(None))
}

#[test]
fn a_truncated_file_is_an_error() {
    let plane = ramp(20 * 20, 1.0);
    let whole =
        write::encode(Windows::whole(20, 20), &[Channel::new("X", &plane, Precision::Float)], &[]).unwrap();
    assert!(decode(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(decode(&whole[..length]).is_err(), "{length} of {} bytes", whole.len());
    }
}

#[test]
fn a_flipped_bit_gives_an_image_or_an_error_and_never_a_panic() {
    let (_folder, path) = scratch();
    for compression in COMPRESSIONS {
        let samples = || FlatSamples::F16((0..7 * 37).map(|i| f16::from_f32((i * i % 91) as f32)).collect());
        write_foreign(&path, compression, Blocks::ScanLines, [samples(), samples(), samples()]);
        let whole = std::fs::read(&path).unwrap();
        let mut refused = 0;
        for bit in 0..8 * whole.len() {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            match decode(&damaged) {
                Ok(planes) => assert_eq!(planes.count(), 3),
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 0);
    }
}

#[test]
fn planes_are_written_and_read_as_one() {
    let (_folder, path) = scratch();
    let mut planes = Planes::new(5, 4, 3);
    planes.data_mut().copy_from_slice(&ramp(60, 0.5));
    let channels: Vec<_> = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(i, name)| Channel::new(name, planes.plane(i), Precision::Float))
        .collect();
    write(&path, Windows::whole(5, 4), &channels, &[]).unwrap();
    assert_eq!(read_layer(&path, None).unwrap(), planes);
}

#[test]
fn metadata_of_another_file_is_kept_and_long_names_are_flagged() {
    let (_folder, path) = scratch();
    let plane = ramp(4, 1.0);
    let long = "ViewLayer.Combined_light_group_of_the_lamps.R";
    let channels = [Channel::new(long, &plane, Precision::Float)];
    let text = |name: &str, value: &str| (name.to_owned(), Attribute::Text(value.to_owned()));
    let attributes = [text("kept", "a"), text("left", "b"), text("owner", "c")];
    write(&path, Windows::whole(2, 2), &channels, &attributes).unwrap();
    // Bit 10 of the version field
    assert_eq!(std::fs::read(&path).unwrap()[5] & 4, 4);

    let mut metadata = read_metadata(&path, 0).unwrap();
    metadata.shared.pixel_aspect = 2.0;
    let windows = Windows { data: [-1, 1, -3, -1], display: [0, 9, 0, 9] };
    let new = [text("kept", "new")];
    write_with_metadata(&path, windows, &channels, &new, &metadata, |name| name != "left").unwrap();
    let info = read_info(&path).unwrap();
    assert_eq!((info.attributes, info.windows), (vec![text("kept", "new"), text("owner", "c")], windows));
    assert_eq!(info.channels, [long]);
    assert_eq!(read_metadata(&path, 0).unwrap().shared.pixel_aspect, 2.0);
    // Without long names there is no flag
    write(&path, Windows::whole(2, 2), &[Channel::new("R", &plane, Precision::Float)], &[]).unwrap();
    assert_eq!(std::fs::read(&path).unwrap()[5] & 4, 0);
}
