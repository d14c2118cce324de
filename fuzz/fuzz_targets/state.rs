#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| prpf_fuzz::state(bytes));
