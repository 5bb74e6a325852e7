#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| volraster_fuzz::read("a_3x2x2_int16.raw", bytes));
