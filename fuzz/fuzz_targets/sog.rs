#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| volraster_fuzz::read(if bytes.starts_with(b"PK") { "a.sog" } else { "meta.json" }, bytes));
