//! Writes the C header that declares `src/ffi` to stdout:
//!
//!     cargo run -p volraster-header > include/volraster.h

use std::error::Error;
use std::path::Path;

/// In the order in which the header has them.
const SOURCES: [&str; 13] = [
    "result",
    "info",
    "gpu",
    "adopt",
    "samples",
    "data",
    "scene",
    "scene_with",
    "load",
    "view",
    "plan",
    "depth",
    "recording",
];

fn main() -> Result<(), Box<dyn Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml"))?;
    let ffi = here.join("../../src/ffi");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for name in SOURCES {
        builder = builder.with_src(ffi.join(name).with_extension("rs"));
    }
    let mut header = Vec::new();
    builder.generate()?.write(&mut header);
    print!("{}", String::from_utf8(header)?);
    Ok(())
}
