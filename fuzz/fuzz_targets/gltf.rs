#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| volraster_fuzz::read("a.gltf", bytes));
