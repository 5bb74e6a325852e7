//! Writes the C header that declares `src/ffi` to stdout:
//!
//!     cargo run -p volraster-header > include/volraster.h

use std::error::Error;
use std::path::Path;

/// In the order in which the header has them.
const SOURCES: [&str; 10] =
    ["result", "info", "host", "gpu", "data", "scene", "scene_from", "view", "plan", "recording"];

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
    println!("\n/* Checksum of the sources: {:016x} */", checksum(&ffi)?);
    Ok(())
}

/// FNV-1a of the files of a folder, in the order of their names. A test compares it with the one in the header, which is
/// quicker than to build this program.
fn checksum(folder: &Path) -> std::io::Result<u64> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        files.push(entry?.path());
    }
    files.sort();
    let mut sum = 0xcbf2_9ce4_8422_2325_u64;
    for file in files {
        for byte in std::fs::read(file)? {
            sum = (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    Ok(sum)
}
