//! From the numbers of nodes or elements, which may be sparse, to indices.

use crate::error::Result;
use crate::io::file::source::Source;
use crate::num;

/// A map from tags to indices.
#[derive(Debug)]
pub(crate) enum Tags {
    /// Tags are consecutive.
    Consecutive { first: u64, count: u64 },
    /// The index of each tag from the first on; `u32::MAX` for missing tags.
    Dense { first: u64, indices: Vec<u32> },
    /// Pairs of tag and index, sorted by tag.
    Sorted(Vec<(u64, u32)>),
}

impl Tags {
    /// The memory per tag, in bytes, while the map is built from pairs.
    pub(crate) const BYTES: u64 = 24;

    pub(crate) fn none() -> Self {
        Self::Consecutive { first: 0, count: 0 }
    }

    pub(crate) fn new(source: &Source, what: &str, mut pairs: Vec<(u64, u32)>) -> Result<Self> {
        let Some(&(first, _)) = pairs.first() else { return Ok(Self::none()) };
        if pairs.iter().all(|&(tag, index)| tag.checked_sub(first) == Some(index.into())) {
            return Ok(Self::Consecutive { first, count: num::wide(pairs.len()) });
        }
        let (first, last) =
            pairs.iter().fold((first, first), |(lo, hi), &(tag, _)| (lo.min(tag), hi.max(tag)));
        let twice = |tag: u64| source.error(format!("{what} {tag}"), "there are two of this number");
        let span = usize::try_from(last - first).unwrap_or(usize::MAX);
        // The list takes no more memory than the pairs.
        if span < pairs.len().saturating_mul(2) {
            let mut indices = vec![u32::MAX; span + 1];
            for &(tag, index) in &pairs {
                let place = &mut indices[usize::try_from(tag - first).unwrap_or(span)];
                if *place != u32::MAX {
                    return Err(twice(tag));
                }
                *place = index;
            }
            return Ok(Self::Dense { first, indices });
        }
        pairs.sort_unstable();
        if let Some(pair) = pairs.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(twice(pair[0].0));
        }
        Ok(Self::Sorted(pairs))
    }

    /// Returns the memory of the map, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::Consecutive { .. } => 0,
            Self::Dense { indices, .. } => num::wide(indices.len()).saturating_mul(4),
            Self::Sorted(pairs) => num::wide(pairs.capacity()).saturating_mul(16),
        }
    }

    pub(crate) fn get(&self, tag: u64) -> Option<u32> {
        match self {
            Self::Consecutive { first, count } => {
                let index = tag.checked_sub(*first).filter(|index| index < count)?;
                u32::try_from(index).ok()
            }
            Self::Dense { first, indices } => {
                let index = usize::try_from(tag.checked_sub(*first)?).ok()?;
                indices.get(index).copied().filter(|&index| index != u32::MAX)
            }
            Self::Sorted(pairs) => {
                let place = pairs.binary_search_by_key(&tag, |&(tag, _)| tag).ok()?;
                Some(pairs[place].1)
            }
        }
    }
}
