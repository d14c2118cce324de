#![no_main]

libfuzzer_sys::fuzz_target!(
    // Panics inside the decoder of EXR are caught by the reader; the usual hook would abort at them.
    init: drop(std::panic::take_hook()),
    |bytes: &[u8]| prpf_fuzz::import(bytes)
);
