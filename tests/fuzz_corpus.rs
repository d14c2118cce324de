//! Replays the fuzzer's corpora, and mutations of them, through the fuzz targets' own functions: what a
//! coverage-guided search (`fuzz/README.md`) has found stays found, with a stable compiler and in seconds.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

#[path = "../fuzz/harness.rs"]
mod harness;

/// Mutations of each target's corpus, fewer where the time is spent before.
const MUTATIONS: usize = 3000;
const TIME: Duration = Duration::from_secs(3);

fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

/// A few random changes: bytes set, turned or copied from elsewhere, pieces taken out or put in twice, an
/// end cut off, a number made hard.
fn mutate(bytes: &mut Vec<u8>, random: &mut Pcg64) {
    const WORDS: [&[u8]; 8] =
        [b"nan", b"-1", b"1e38", b"0", b"4294967295", &[0xff; 4], &[0; 4], &[0x7f, 0x80, 0, 0]];
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.random_range(0..bytes.len());
        let to = (at + random.random_range(1..=16)).min(bytes.len());
        match random.random_range(0..6) {
            0 => bytes[at] = random.random(),
            1 => bytes[at] ^= 1 << random.random_range(0..8),
            2 => drop(bytes.drain(at..to)),
            3 => {
                let piece = bytes[at..to].to_vec();
                let target = random.random_range(0..=bytes.len());
                bytes.splice(target..target, piece);
            }
            4 => {
                let word = WORDS[random.random_range(0..WORDS.len())];
                bytes.splice(at..to, word.iter().copied());
            }
            _ => bytes.truncate(at),
        }
    }
}

#[test]
fn the_corpora_and_mutations_of_them_break_no_promise() {
    for (name, target) in harness::TARGETS {
        let corpus = corpus(name);
        assert!(!corpus.is_empty(), "{name}");
        for (path, bytes) in &corpus {
            println!("{}", path.display());
            target(bytes);
        }
        let mut random = Pcg64::seed_from_u64(0);
        let begin = Instant::now();
        let mut count = 0;
        while count < MUTATIONS && begin.elapsed() < TIME {
            let mut bytes = corpus[random.random_range(0..corpus.len())].1.clone();
            mutate(&mut bytes, &mut random);
            let panicked = std::panic::catch_unwind(|| target(&bytes)).is_err();
            assert!(!panicked, "{name}, mutation {count}: {:?}", String::from_utf8_lossy(&bytes));
            count += 1;
        }
        println!("{name}: {} files, {count} mutations", corpus.len());
    }
}

/// A corpus of states that are all refused would search nothing behind the header.
#[test]
fn states_of_the_corpus_are_of_the_current_format() {
    for (path, bytes) in corpus("state") {
        let is_whole_file = bytes.starts_with(b"prpfstat");
        let file = if is_whole_file { bytes } else { harness::state_file(&bytes) };
        let decoded = prpf::state::decode(&file).map(drop).map_err(|error| error.to_string());
        match path.file_name().and_then(std::ffi::OsStr::to_str) {
            Some("bounds-outside-the-film") => assert!(decoded.is_err()),
            _ => assert_eq!(decoded, Ok(()), "{}", path.display()),
        }
    }
}
