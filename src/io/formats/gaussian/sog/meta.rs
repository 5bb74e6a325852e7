//! The description of splats in `meta.json`.

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::file::json::parse;
use crate::io::file::source::Source;
use crate::io::file::text::shown;

/// The file that names the others.
pub(super) const META: &str = "meta.json";

/// The facts of both versions.
#[derive(Debug)]
pub(super) struct Meta {
    pub(super) version: u32,
    pub(super) count: u64,
    pub(super) antialias: bool,
    pub(super) positions: Positions,
    pub(super) scales: Coded,
    /// The image of quaternions.
    pub(super) rotations: String,
    /// The constant coefficients, and opacities.
    pub(super) colours: Coded,
    pub(super) harmonics: Option<Harmonics>,
    pub(super) texts: Vec<String>,
}

/// Limits of each coordinate on the logarithmic scale, and the images of low and high bytes.
#[derive(Debug)]
pub(super) struct Positions {
    pub(super) limits: [[f64; 2]; 3],
    pub(super) files: [String; 2],
}

/// An image, and what its bytes stand for.
#[derive(Debug)]
pub(super) struct Coded {
    pub(super) values: Values,
    pub(super) file: String,
}

/// Coefficients but the constant ones.
#[derive(Debug)]
pub(super) struct Harmonics {
    pub(super) degree: u32,
    /// The number of entries of the palette, if the file tells it.
    pub(super) entries: Option<u64>,
    pub(super) values: Values,
    /// The palette, and the entry of each splat.
    pub(super) files: [String; 2],
}

/// The numbers that bytes stand for.
#[derive(Debug)]
pub(super) enum Values {
    /// A number for each byte.
    Table(Vec<f64>),
    /// The numbers of bytes 0 and 255, for each channel.
    Limits(Vec<[f64; 2]>),
}

impl Values {
    /// Returns the number of a byte of a channel.
    pub(super) fn of(&self, channel: usize, byte: u8) -> f64 {
        match self {
            Self::Table(table) => table.get(usize::from(byte)).copied().unwrap_or(f64::NAN),
            Self::Limits(limits) => {
                let [low, high] = limits.get(channel).copied().unwrap_or([f64::NAN; 2]);
                let share = f64::from(byte) / 255.0;
                low * (1.0 - share) + high * share
            }
        }
    }
}

#[derive(Deserialize)]
struct Document {
    version: Option<u32>,
    count: Option<u64>,
    #[serde(default)]
    antialias: bool,
    asset: Option<Asset>,
    means: Part,
    scales: Part,
    quats: Part,
    sh0: Part,
    #[serde(rename = "shN")]
    rest: Option<Part>,
}

#[derive(Deserialize)]
struct Asset {
    copyright: Option<String>,
    author: Option<String>,
    license: Option<String>,
}

#[derive(Deserialize)]
struct Part {
    files: Vec<String>,
    shape: Option<Vec<u64>>,
    encoding: Option<String>,
    mins: Option<Numbers>,
    maxs: Option<Numbers>,
    codebook: Option<Vec<f64>>,
    count: Option<u64>,
    bands: Option<u32>,
}

/// A number, or a list of some.
#[derive(Deserialize)]
#[serde(untagged)]
enum Numbers {
    One(f64),
    Some(Vec<f64>),
}

impl Numbers {
    fn list(self) -> Vec<f64> {
        match self {
            Self::One(number) => vec![number],
            Self::Some(list) => list,
        }
    }
}

/// A part of the document, for messages.
struct Place<'a> {
    source: &'a Source,
    name: &'static str,
}

impl Place<'_> {
    fn error(&self, rule: impl Into<String>) -> Error {
        self.source.error(self.name, rule)
    }

    fn files<const N: usize>(&self, files: Vec<String>) -> Result<[String; N]> {
        let count = files.len();
        files.try_into().map_err(|_| self.error(format!("{count} files: must be {N}")))
    }

    /// Returns as many limits as there are channels.
    fn limits(
        &self,
        least: Option<Numbers>,
        most: Option<Numbers>,
        channels: usize,
    ) -> Result<Vec<[f64; 2]>> {
        let (Some(least), Some(most)) = (least, most) else {
            return Err(self.error("mins and maxs are missing"));
        };
        let (least, most) = (least.list(), most.list());
        if least.len() != channels || most.len() != channels {
            let rule = format!("{} mins and {} maxs: must be {channels}", least.len(), most.len());
            return Err(self.error(rule));
        }
        Ok(least.into_iter().zip(most).map(|(least, most)| [least, most]).collect())
    }

    /// Returns the numbers of bytes in a version.
    fn values(&self, version: u32, part: &mut Part, channels: usize) -> Result<Values> {
        if version == 1 {
            return self.limits(part.mins.take(), part.maxs.take(), channels).map(Values::Limits);
        }
        match part.codebook.take() {
            Some(table) if table.len() == 256 => Ok(Values::Table(table)),
            Some(table) => Err(self.error(format!("{} numbers in the codebook: must be 256", table.len()))),
            None => Err(self.error("codebook is missing")),
        }
    }
}

impl Meta {
    pub(super) fn parse(source: &Source, text: &[u8]) -> Result<Self> {
        let place = |name| Place { source, name };
        let Document { version, count, antialias, asset, means, mut scales, quats, mut sh0, rest } =
            parse(source.path(), text)?;
        let version = version.unwrap_or(1);
        if !(1..=2).contains(&version) {
            return Err(source.error("version", format!("{version}: must be 1 or 2")));
        }
        let shape = |part: &Part, axis: usize| part.shape.as_ref().and_then(|shape| shape.get(axis)).copied();
        let count = if version == 1 { shape(&means, 0) } else { count };
        let Some(count) = count else {
            let key = if version == 1 { "means.shape" } else { "count" };
            return Err(source.error(key, "is missing: it tells the number of splats"));
        };
        let own = place("means");
        let limits = own.limits(means.mins, means.maxs, 3)?;
        let limits = [0, 1, 2].map(|k| limits.get(k).copied().unwrap_or_default());
        let positions = Positions { limits, files: own.files(means.files)? };
        let own = place("scales");
        let values = own.values(version, &mut scales, 3)?;
        let [file] = own.files(scales.files)?;
        let scales = Coded { values, file };
        let own = place("quats");
        if let Some(other) = quats.encoding.filter(|encoding| encoding != "quaternion_packed") {
            let rule = format!("encoding \"{}\": must be quaternion_packed", shown(&other));
            return Err(own.error(rule));
        }
        let [rotations] = own.files(quats.files)?;
        let own = place("sh0");
        let values = own.values(version, &mut sh0, 4)?;
        let [file] = own.files(sh0.files)?;
        let colours = Coded { values, file };
        let own = place("shN");
        let harmonics = match rest {
            Some(mut part) => {
                let degree = if version == 1 {
                    shape(&part, 1)
                        .and_then(|count| (1_u32..=3).find(|l| u64::from(3 * l * (l + 2)) == count))
                        .ok_or_else(|| own.error("shape: must have 9, 24 or 45 coefficients"))?
                } else {
                    part.bands
                        .filter(|bands| (1..=3).contains(bands))
                        .ok_or_else(|| own.error("bands: must be 1 to 3"))?
                };
                let values = own.values(version, &mut part, 1)?;
                Some(Harmonics { degree, entries: part.count, values, files: own.files(part.files)? })
            }
            None => None,
        };
        let texts = asset.map_or(Vec::new(), |Asset { copyright, author, license }| {
            let told = |what, text: Option<String>| text.map(|text| format!("{what}: {text}"));
            let texts = [told("copyright", copyright), told("author", author), told("license", license)];
            texts.into_iter().flatten().collect()
        });
        Ok(Self { version, count, antialias, positions, scales, rotations, colours, harmonics, texts })
    }
}
