//! What reading takes is bounded by a constant times what there is to read: small files that stand for
//! much, or say so, each in a process of its own.
#![cfg(target_os = "linux")]

use std::io::Write;
use std::path::Path;
use std::process::Command;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use prpf::image::Planes;

#[path = "../fuzz/harness.rs"]
mod harness;

/// Most bytes of memory for a byte that is read: what DEFLATE makes of it (1032), times what an element of
/// a byte becomes, which is a vertex of 64 bytes while a mesh is read, and 100 when it is done.
const PER_BYTE: u64 = 1032 * 164;
/// What a process takes that reads next to nothing, and renders: threads, tables, code.
const ANYWAY: u64 = 64 << 20;

/// The child's part: feeds a target from a file and says the most that it took.
#[test]
#[ignore = "is run by the test below"]
fn one_input_in_a_process_of_its_own() {
    let [name, path] = ["PRPF_TARGET", "PRPF_INPUT"].map(|name| std::env::var(name).unwrap());
    let target = harness::TARGETS.iter().find(|target| target.0 == name).unwrap().1;
    target(&std::fs::read(path).unwrap());
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    println!("{}", status.lines().find(|line| line.starts_with("VmHWM:")).unwrap());
}

/// Most bytes that a process had in memory which fed a target with this input.
fn peak(name: &str, input: &[u8]) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("input");
    std::fs::write(&path, input).unwrap();
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["one_input_in_a_process_of_its_own", "--exact", "--ignored", "--nocapture"])
        .env("PRPF_TARGET", name)
        .env("PRPF_INPUT", path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let peak = text.lines().find_map(|line| line.split_once("VmHWM:"));
    let peak = peak.unwrap_or_else(|| panic!("{name}: {text}{}", String::from_utf8_lossy(&output.stderr)));
    1024 * peak.1.split_whitespace().next().unwrap().parse::<u64>().unwrap()
}

/// A PNG of 1 bit a texel, all black.
fn blank_png(side: usize) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::best());
    packer.write_all(&vec![0; side * (1 + side / 8)]).unwrap();
    let size = (side as u32).to_be_bytes();
    let mut file = b"\x01\x89PNG\r\n\x1a\n".to_vec();
    let header = [&size, &size, &[1, 0, 0, 0, 0][..]].concat();
    for (kind, data) in [(b"IHDR", header), (b"IDAT", packer.finish().unwrap()), (b"IEND", Vec::new())] {
        let body = [&kind[..], &data].concat();
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&body);
        file.extend(crc32fast::hash(&body).to_be_bytes());
    }
    file
}

/// An EXR all black, as the program writes it.
fn blank_exr(side: usize) -> Vec<u8> {
    use prpf::image::exr_file::{Channel, Precision, Windows, encode};
    let planes = Planes::new(side, side, 1);
    let channels = ["R", "G", "B"].map(|name| Channel::new(name, planes.plane(0), Precision::Half));
    [vec![0], encode(Windows::whole(side, side), &channels, &[]).unwrap()].concat()
}

/// A gzipped mesh whose vertices are all the same.
fn repeated_ply(vertices: usize) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty char x\nproperty char y\n\
         property char z\nelement face 1\nproperty list uchar char vertex_indices\nend_header\n"
    );
    let mut packer = GzEncoder::new(Vec::new(), Compression::best());
    packer.write_all(header.as_bytes()).unwrap();
    packer.write_all(&vec![1; 3 * vertices]).unwrap();
    packer.write_all(&[0]).unwrap();
    packer.finish().unwrap()
}

/// A mesh that promises a list of billions.
const ENDLESS_LIST: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 9\nproperty list uint float x\n\
    element face 1\nproperty list uint int vertex_indices\nend_header\n4000000000 1";

/// A table of reflectances that names its dimensions, as MERL's do, and has none of them.
fn promised_brdf() -> Vec<u8> {
    let dimensions = [i32::MAX, 90, 180].map(i32::to_le_bytes).concat();
    [&[1], &dimensions[..], &[0; 64]].concat()
}

/// Samples of one pixel: what is kept of them does not grow with their number.
fn pushed_samples(count: usize) -> Vec<u8> {
    let all_blocks = [0xff, 0x3f];
    let image_and_reservoir = [0, 0, 8, 0];
    [&all_blocks[..], &image_and_reservoir, &vec![100; count]].concat()
}

#[test]
fn small_files_that_stand_for_much_take_no_more_than_their_size_allows() {
    let promised = |header: &str| [&[4], header.as_bytes(), &[0; 64]].concat();
    let includes: Vec<String> = (1..8).map(|next| format!("Include \"{next}\" Include \"{next}\"")).collect();
    let last = "TransformBegin TransformEnd ".repeat(100);
    let cases = [
        ("texture", blank_png(8192)),
        ("texture", blank_exr(2048)),
        ("texture", promised("PF 16384 16384 -1\n")),
        ("ply", repeated_ply(2_000_000)),
        ("ply", ENDLESS_LIST.to_vec()),
        ("scene", format!("{}\0{last}", includes.join("\0")).into_bytes()),
        ("scene", format!("WorldBegin {}", "AttributeBegin ".repeat(20_000)).into_bytes()),
        ("spectrum", "400 1 ".repeat(200_000).into_bytes()),
        ("brdf", promised_brdf()),
        ("brdf", [b"\0", "1 ".repeat(200_000).as_bytes()].concat()),
        ("message", format!("{}\n", "[".repeat(1 << 20)).into_bytes()),
        ("message", "{\"type\":\"camera\"}\n".repeat(1 << 14).into_bytes()),
        ("store", pushed_samples(4 << 20)),
        ("state", std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/state/b")).unwrap()),
    ];
    for (name, input) in cases {
        let (peak, size) = (peak(name, &input), input.len() as u64);
        println!("{name}: {size} bytes, {} MiB", peak >> 20);
        assert!(peak <= ANYWAY + PER_BYTE * size, "{name}: {size} bytes became {peak}");
    }
}
