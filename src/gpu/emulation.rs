//! Emulation of tighter devices: the words that lower limits and leave out features of an open device.

use super::feature::OptionalFeature;
use super::options::GpuOptions;
use crate::error::{Error, Result};

/// The words of [`GpuOptions::emulating`], and what they do.
const WORDS: [(&str, &str); 10] = [
    (
        "as-hardware",
        "gives a software device the passes of a GPU: wide workgroups, an invocation for each pixel",
    ),
    ("coarse-weights", "rounds filter weights to 8 bits, as the samplers of most GPUs do"),
    ("permute", "has workgroups take their work in reverse order"),
    ("loop=N", "limits the loop iterations of a shader invocation"),
    (
        "buffer=BYTES",
        "limits the bytes of a buffer that a descriptor shows; larger ones are found by address",
    ),
    ("allocation=BYTES", "limits one allocation of device memory"),
    ("memory=BYTES", "limits device memory in all"),
    ("pages=BYTES", "keeps grids in pages, each in a pool of so many bytes"),
    ("subgroup=N", "lowers the invocations of a subgroup that passes count on"),
    ("no-NAME", "leaves out an optional feature that `devices` lists; no-features leaves out all"),
];

impl GpuOptions {
    /// Makes the device behave like a tighter one, as a list of words separated by commas says. Bytes may have the units KiB, MiB
    /// and GiB.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for an unknown word or value.
    pub fn emulating(mut self, list: &str) -> Result<Self> {
        for word in list.split(',').filter(|word| !word.is_empty()) {
            if !self.emulate(word) {
                let known: Vec<String> = if word.starts_with("no-") {
                    let names = OptionalFeature::ALL.iter().map(|feature| feature.name());
                    std::iter::once("features").chain(names).map(|name| format!("no-{name}")).collect()
                } else {
                    WORDS.iter().map(|(word, _)| (*word).to_string()).collect()
                };
                let why = format!("\"{word}\": must be {}", known.join(", "));
                return Err(Error::Invalid { what: "emulate".to_string(), why });
            }
        }
        Ok(self)
    }

    /// Returns the words that [`GpuOptions::emulating`] takes, each with what it does.
    #[must_use]
    pub fn emulations() -> &'static [(&'static str, &'static str)] {
        &WORDS
    }

    /// Reads a number of bytes above 0 as those words have it, with an optional unit: KiB, MiB or GiB.
    #[must_use]
    pub fn bytes(text: &str) -> Option<u64> {
        let units = [("KiB", 10), ("MiB", 20), ("GiB", 30)];
        let unit = units.iter().find_map(|(unit, bits)| Some((text.strip_suffix(unit)?, *bits)));
        let (digits, bits) = unit.unwrap_or((text, 0));
        digits.parse::<u64>().ok().filter(|&n| n > 0)?.checked_mul(1 << bits)
    }

    /// Returns whether limits or features are emulated, so that a device may refuse what it could draw otherwise.
    #[must_use]
    pub fn is_tightened(&self) -> bool {
        let limits = [
            self.loop_limit.is_some(),
            self.storage_range.is_some(),
            self.allocation_size.is_some(),
            self.memory_budget.is_some(),
            self.page_pool.is_some(),
        ];
        limits.contains(&true) || !self.without.is_empty()
    }

    /// Applies a word; `false` if it is unknown.
    fn emulate(&mut self, word: &str) -> bool {
        if let Some(name) = word.strip_prefix("no-") {
            let is_named = |feature: &OptionalFeature| name == "features" || feature.name() == name;
            let known = self.without.len();
            self.without.extend(OptionalFeature::ALL.iter().filter(|feature| is_named(feature)));
            return self.without.len() > known;
        }
        let Some((name, value)) = word.split_once('=') else {
            match word {
                "as-hardware" => self.as_hardware = true,
                "coarse-weights" => self.emulate_filter_weights = true,
                "permute" => self.permute = true,
                _ => return false,
            }
            return true;
        };
        let number = || value.parse().ok().filter(|&n: &u32| n > 0);
        let narrow = |bytes: u64| u32::try_from(bytes).ok();
        match name {
            "loop" => self.loop_limit = number(),
            "subgroup" => self.subgroup_size = number(),
            "buffer" => self.storage_range = Self::bytes(value).and_then(narrow),
            "allocation" => self.allocation_size = Self::bytes(value),
            "memory" => self.memory_budget = Self::bytes(value),
            "pages" => self.page_pool = Self::bytes(value),
            _ => return false,
        }
        match name {
            "loop" => self.loop_limit.is_some(),
            "subgroup" => self.subgroup_size.is_some(),
            "buffer" => self.storage_range.is_some(),
            "allocation" => self.allocation_size.is_some(),
            "pages" => self.page_pool.is_some(),
            _ => self.memory_budget.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_set_options() {
        let all = "as-hardware,coarse-weights,permute,loop=1500,buffer=64KiB,allocation=4096,memory=2GiB,subgroup=4,no-timestamps";
        let options = GpuOptions::default().emulating(all).unwrap();
        assert!(
            options.as_hardware
                && options.emulate_filter_weights
                && options.permute
                && options.is_tightened()
        );
        assert_eq!(
            [options.loop_limit, options.storage_range, options.subgroup_size],
            [Some(1500), Some(65536), Some(4)]
        );
        assert_eq!([options.allocation_size, options.memory_budget], [Some(4096), Some(2 << 30)]);
        assert_eq!(options.without, [OptionalFeature::Timestamps]);
        let none = GpuOptions::default().emulating("no-features").unwrap();
        assert_eq!(none.without, OptionalFeature::ALL);
        assert!(!GpuOptions::default().emulating("permute,subgroup=4").unwrap().is_tightened());
    }

    #[test]
    fn unknown_words_and_values_are_refused() {
        for wrong in [
            "loop",
            "loop=0",
            "loop=x",
            "buffer=8GiB",
            "memory=1TiB",
            "no-",
            "no-such",
            "permute=1",
            "x=1",
            " permute",
        ] {
            let error = GpuOptions::default().emulating(wrong).unwrap_err().to_string();
            let known = if wrong.starts_with("no-") { "no-features, no-" } else { "as-hardware, " };
            assert!(error.contains(&format!("\"{wrong}\": must be {known}")), "{wrong}: {error}");
        }
    }
}
