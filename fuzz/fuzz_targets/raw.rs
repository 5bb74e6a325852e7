#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| volraster_fuzz::read("a_4x3x2_u8.raw", bytes));
