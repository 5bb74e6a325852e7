//! Several files in one: what fuzzing mutates, and what past findings are kept as.
//!
//! The first file's bytes, then for each further one a zero byte, `FILE:`, its name, a zero byte, its bytes.

/// What stands before a further file's name.
const MARK: &[u8] = b"\0FILE:";

/// Packs files. Names of further ones must not hold a zero byte.
pub fn pack(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut packed = Vec::new();
    for (i, (name, bytes)) in files.iter().enumerate() {
        if i > 0 {
            packed.extend_from_slice(MARK);
            packed.extend_from_slice(name.as_bytes());
            packed.push(0);
        }
        packed.extend_from_slice(bytes);
    }
    packed
}

/// The files of any bytes; the first one gets `name`.
pub fn unpack<'a>(name: &'a str, packed: &'a [u8]) -> Vec<(&'a str, &'a [u8])> {
    let mut files = Vec::new();
    let (mut name, mut rest) = (name, packed);
    loop {
        let further = find(rest, MARK).and_then(|at| {
            let after = rest.get(at + MARK.len()..)?;
            let end = after.iter().position(|&byte| byte == 0)?;
            let name = std::str::from_utf8(after.get(..end)?).ok()?;
            Some((at, name, after.get(end + 1..)?))
        });
        let Some((at, next, after)) = further else {
            files.push((name, rest));
            return files;
        };
        files.push((name, &rest[..at]));
        (name, rest) = (next, after);
    }
}

fn find(bytes: &[u8], mark: &[u8]) -> Option<usize> {
    bytes.windows(mark.len()).position(|window| window == mark)
}
