//! Records of extensions: type, length, payload.

use std::io::Read as _;

use crate::error::Result;
use crate::io::file::scanner::Scanner;
use crate::io::file::text::stream_error;
use crate::num;
use crate::scene::{Axes, StoredAxes};

/// The type of the record that tells the axes.
pub(crate) const AXES: u32 = 0xadbe_0003;

/// The names of axes by their numbers, from 1.
const NAMES: [&str; 16] = [
    "ldb", "rdb", "lub", "rub", "ldf", "rdf", "luf", "ruf", "lfd", "rfd", "lfu", "rfu", "lbd", "rbd", "lbu",
    "rbu",
];

/// The facts that the records tell.
#[derive(Debug, Default)]
pub(super) struct Extensions {
    pub(super) axes: Option<StoredAxes>,
    pub(super) notes: Vec<String>,
    /// Records that were left out.
    others: usize,
}

/// Number of records left out that are named.
const NAMED: usize = 8;

impl Extensions {
    /// Reads a record, which ends before `end`.
    pub(super) fn read(&mut self, scanner: &mut Scanner, end: u64) -> Result<()> {
        let source = scanner.source();
        let place = format!("extension at byte {}", scanner.position());
        let wrong = |rule: String| source.error(&place, rule);
        let left = |scanner: &Scanner| end.saturating_sub(scanner.position()).min(scanner.available());
        if left(scanner) < 8 {
            return Err(wrong("ends early".to_owned()));
        }
        let mut words = [[0; 4]; 2];
        scanner.read_exact(words.as_flattened_mut()).map_err(|error| stream_error(source, error))?;
        let [kind, length] = words.map(u32::from_le_bytes);
        if u64::from(length) > left(scanner) {
            return Err(wrong(format!("{length} bytes: is longer than what follows")));
        }
        if kind != AXES {
            scanner.skip(length.into())?;
            self.others += 1;
            match self.others {
                0..=NAMED => self.notes.push(format!("extension {kind:#010x} left out")),
                other if other == NAMED + 1 => self.notes.push("more extensions left out".to_owned()),
                _ => {}
            }
            return Ok(());
        }
        if length != 4 {
            return Err(wrong(format!("{length} bytes: axes take 4")));
        }
        scanner.read_exact(&mut words[0]).map_err(|error| stream_error(source, error))?;
        let number = u32::from_le_bytes(words[0]);
        self.axes = match number.checked_sub(1).map(|i| NAMES.get(num::index(i))) {
            // Unspecified: as if there were no record.
            None => None,
            Some(Some(name)) => Some(Axes::named(name)?),
            Some(None) => return Err(wrong(format!("axes {number}: must be 0 to {}", NAMES.len()))),
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_name_axes() {
        let axes = |number: usize| Axes::named(NAMES[number - 1]).unwrap();
        assert_eq!([4, 6, 7].map(axes), [Axes::Rub, Axes::Rdf, Axes::Luf].map(StoredAxes::from));
        assert!(axes(8).mirrored);
        assert!((9..=16).all(|number| axes(number).axes.up().z.abs() == 1.0));
    }
}
