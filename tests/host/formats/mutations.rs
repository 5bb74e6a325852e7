//! Hostile input: small files of every format, damaged at random but repeatably.
//!
//! Whatever the bytes, reading ends, within the memory that it may take, in data or in one line that says
//! what is wrong.

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use volraster::io::{ReadOptions, read_arrays_memory, read_memory};

use super::container;
use super::support::Sample;

/// Cases for each reader.
const CASES: u64 = 20_000;

/// Damaged files that are kept to be damaged further.
const KEPT: usize = 64;

/// Memory that data may take in these cases.
const LIMIT: u64 = 1 << 20;

/// Memory beside it: buffers, windows of decompression, what a header takes.
const BESIDE: u64 = 2 << 20;

/// xorshift64*: small, and the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

/// Numbers on which size checks break.
const NUMBERS: [&str; 24] = [
    "0",
    "1",
    "2",
    "-1",
    "3",
    "7",
    "127",
    "128",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967294",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "1e308",
    "nan",
    "inf",
    "0.5",
];
const WORDS: [u64; 14] = [
    0,
    1,
    2,
    0x7f,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0xffff_ffff_ffff_ffff,
];

/// Changes bytes, and says how.
fn mutate(random: &mut Random, bytes: &mut Vec<u8>, said: &mut String) {
    let len = bytes.len();
    if len == 0 {
        return;
    }
    // Headers are at the beginning: half of all changes go there.
    let reach = if random.below(2) == 0 { len.min(512) } else { len };
    let at = random.below(reach);
    match random.below(9) {
        0 | 1 => {
            let bit = random.below(8);
            bytes[at] ^= 1 << bit;
            let _ = write!(said, "bit {bit} of byte {at}; ");
        }
        2 => {
            let value =
                random.pick(&[0, 1, 0x20, 0x0a, 0x7f, 0x80, 0xff, b'0', b'9', b'-', b'<', b'"', b'%']);
            bytes[at] = value;
            let _ = write!(said, "byte {at} = {value}; ");
        }
        3 => {
            let keep = random.below(len);
            bytes.truncate(keep);
            let _ = write!(said, "cut to {keep}; ");
        }
        4 => {
            let count = 1 + random.below(16);
            let end = len.min(at + count);
            bytes.drain(at..end);
            let _ = write!(said, "bytes {at} to {end} removed; ");
        }
        5 => {
            let count = 1 + random.below(64);
            let piece: Vec<u8> = bytes[at..len.min(at + count)].to_vec();
            let to = random.below(len);
            let _ = write!(said, "{} bytes from {at} repeated at {to}; ", piece.len());
            bytes.splice(to..to, piece);
        }
        6 | 7 => {
            // The next number in words becomes another.
            let digit = |byte: &u8| byte.is_ascii_digit();
            let Some(begin) = bytes[at..].iter().position(digit).map(|i| at + i) else { return };
            let end = bytes[begin..].iter().position(|byte| !digit(byte)).map_or(len, |i| begin + i);
            let number = random.pick(&NUMBERS);
            bytes.splice(begin..end, number.bytes());
            let _ = write!(said, "number at {begin} = {number}; ");
        }
        _ => {
            let word = random.pick(&WORDS).wrapping_add(random.next() % 3).wrapping_sub(1);
            let size = random.pick(&[2, 4, 8]);
            let mut new = word.to_le_bytes()[..size].to_vec();
            if random.below(2) == 0 {
                new.reverse();
            }
            let end = len.min(at + size);
            bytes[at..end].copy_from_slice(&new[..end - at]);
            let _ = write!(said, "{size} bytes at {at} = {word:#x}; ");
        }
    }
}

/// Names and contents.
type Files = Vec<(String, Vec<u8>)>;

/// What reads files in memory.
pub type Read = fn(&[(&str, &[u8])], &ReadOptions) -> volraster::Result<()>;

/// Reads what may be anything, and checks how that ends: whether in data.
fn survive(files: &[(&str, &[u8])], what: &dyn Fn() -> String) -> bool {
    survive_by(|files, options| read_memory(files, options).map(drop), files, what)
}

fn survive_by(read: Read, files: &[(&str, &[u8])], what: &dyn Fn() -> String) -> bool {
    let options = ReadOptions::within(LIMIT);
    let given: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let mut outcome = None;
    let memory = allocation_counter::measure(|| {
        outcome = Some(catch_unwind(AssertUnwindSafe(|| read(files, &options))));
    });
    let read = matches!(outcome, Some(Ok(Ok(()))));
    match outcome {
        Some(Ok(Ok(()))) => {}
        Some(Ok(Err(error))) => {
            let text = error.to_string();
            assert_eq!(error.exit_code(), 2, "{}: {text}", what());
            assert!(!text.contains('\n') && text.len() < 4000, "{}: not one short line: {text}", what());
        }
        _ => panic!("{}: panicked", what()),
    }
    let most = LIMIT + BESIDE + 2 * given as u64;
    assert!(memory.bytes_max <= most, "{}: {} bytes of memory, at most {most}", what(), memory.bytes_max);
    read
}

/// Damages the samples of a format, which are read as scene data and as arrays.
pub fn damage(format: &str, samples: &[Sample]) {
    let read: Read = |files, options| {
        let scene = read_memory(files, options);
        read_arrays_memory(files, options, false)?;
        scene.map(drop)
    };
    damage_by(read, format, samples);
}

/// The same where something else reads them.
pub fn damage_by(reader: Read, format: &str, samples: &[Sample]) {
    assert!(!samples.is_empty());
    for Sample { what, files } in samples {
        let files: Vec<(&str, &[u8])> = files.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
        reader(&files, &ReadOptions::within(1 << 30)).unwrap_or_else(|e| panic!("{what}: {e}"));
    }
    let cases = std::env::var("VOLRASTER_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(CASES);
    let mut read = 0;
    // Damaged files that are still read are damaged further: of some formats few are, and what is refused early tests little.
    let mut accepted: Vec<(Files, String)> = Vec::new();
    for case in 0..cases {
        let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ (case + 1).wrapping_mul(0xd134_2543_de82_ef95));
        let sample = &samples[random.below(samples.len())];
        let (mut files, mut said) = (sample.files.clone(), format!("{}: ", sample.what));
        if !accepted.is_empty() && random.below(2) == 0 {
            (files, said) = accepted[random.below(accepted.len())].clone();
        }
        for _ in 0..random.pick(&[1, 1, 1, 2, 4]) {
            let file = random.below(files.len());
            mutate(&mut random, &mut files[file].1, &mut said);
        }
        let given: Vec<(&str, &[u8])> = files.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
        if !survive_by(reader, &given, &|| format!("{format}, case {case}, {said}")) {
            continue;
        }
        read += 1;
        // Eight changes in all: then a sample's place is better.
        if said.matches("; ").count() < 8 {
            let place = if accepted.len() < KEPT { accepted.len() } else { random.below(KEPT) };
            accepted.truncate(KEPT);
            if place == accepted.len() {
                accepted.push((files, said));
            } else {
                accepted[place] = (files, said);
            }
        }
    }
    println!("{format}: {read} of {cases} damaged files are read");
    // Damage that is never felt, or always, would test one end only.
    assert!(0 < read && read < cases, "{format}: {read} of {cases} cases were read");
}

/// Bytes that once did harm. Each folder is named as the file that its contents are read as.
#[test]
fn past_findings_do_no_harm() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/findings");
    let mut count = 0;
    for folder in std::fs::read_dir(root).unwrap() {
        let folder = folder.unwrap().path();
        if !folder.is_dir() {
            continue;
        }
        let name = folder.file_name().unwrap().to_str().unwrap();
        for file in std::fs::read_dir(&folder).unwrap() {
            let file = file.unwrap().path();
            let bytes = std::fs::read(&file).unwrap();
            survive(&container::unpack(name, &bytes), &|| file.display().to_string());
            count += 1;
        }
    }
    assert!(count > 0, "there are findings to replay");
}

/// A check of the check: what takes too much memory, and what panics, is found.
#[test]
fn the_harness_can_fail() {
    let small = allocation_counter::measure(|| drop(vec![0_u8; 1 << 16]));
    assert!(small.bytes_max >= 1 << 16);
    let bytes = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n12345678";
    assert!(survive(&[("a.nrrd", bytes)], &|| "a volume".to_owned()));
    let mut random = Random(7);
    let changed = (0..100).filter(|_| {
        let (mut copy, mut said) = (bytes.to_vec(), String::new());
        mutate(&mut random, &mut copy, &mut said);
        copy != bytes
    });
    assert!(changed.count() > 80);
}

/// Writes the samples where `tools/fuzz.sh` begins.
#[test]
#[ignore = "writes the seeds of fuzzing into the folder that VOLRASTER_CORPUS names"]
fn measure_corpus() {
    let root = std::env::var_os("VOLRASTER_CORPUS").expect("VOLRASTER_CORPUS names a folder");
    for (target, samples) in super::seeds() {
        let folder = Path::new(&root).join(target);
        std::fs::create_dir_all(&folder).unwrap();
        for (i, sample) in samples.iter().enumerate() {
            std::fs::write(folder.join(format!("sample-{i}")), container::pack(&sample.files)).unwrap();
        }
    }
}
