//! The metadata of an image: its axes, its levels and where they lie (NGFF 0.1 to 0.5).
//!
//! Source: Moore et al., OME-Zarr: a cloud-optimized bioimaging file format, 2023; ngff.openmicroscopy.org.

use std::path::{Component, Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::Result;
use crate::io::file::json::{parse, parse_file};
use crate::io::file::source::Source;
use crate::io::options::ReadOptions;

/// The files that hold metadata, of Zarr 3 and of Zarr 2.
pub(crate) const FILES: [&str; 4] = ["zarr.json", ".zattrs", ".zarray", ".zgroup"];

/// The limit on the size of a file of metadata, in bytes.
const MAX_METADATA: u64 = 16 << 20;

/// The limit on the axes of an array.
const MAX_AXES: usize = 8;

/// The limit on the levels of an image.
const MAX_LEVELS: usize = 64;

/// Returns the file of metadata of a folder, if it is of Zarr.
pub(crate) fn file_in(folder: &Path) -> Option<PathBuf> {
    FILES.iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// An image, or an array that belongs to none.
#[derive(Debug)]
pub(super) struct Image {
    /// The file that tells of the image, for messages.
    pub(super) source: Source,
    /// The folder in which the levels are.
    pub(super) folder: PathBuf,
    /// The finest first.
    pub(super) levels: Vec<Level>,
    /// The one to read.
    pub(super) number: usize,
    axes: Vec<Axis>,
    labels: Vec<String>,
}

/// One resolution of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Level {
    pub(super) path: String,
    /// Distances between samples, and the position of the first, in the order of the axes; empty where nothing is said.
    pub(super) scale: Vec<f64>,
    pub(super) translation: Vec<f64>,
}

/// An axis of an array.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(from = "AxisText")]
pub(super) struct Axis {
    pub(super) name: String,
    kind: Option<String>,
    pub(super) unit: Option<String>,
}

/// The meaning of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Space,
    Time,
    Channel,
    Other,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum AxisText {
    /// NGFF 0.3.
    Name(String),
    Axis {
        name: String,
        #[serde(rename = "type")]
        kind: Option<String>,
        unit: Option<String>,
    },
}

impl From<AxisText> for Axis {
    fn from(text: AxisText) -> Self {
        match text {
            AxisText::Name(name) => Self { name, ..Self::default() },
            AxisText::Axis { name, kind, unit } => Self { name, kind, unit },
        }
    }
}

impl Axis {
    fn named(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    pub(super) fn kind(&self) -> Kind {
        match self.kind.as_deref().unwrap_or(&self.name) {
            "space" | "z" | "y" | "x" => Kind::Space,
            "time" | "t" => Kind::Time,
            "channel" | "c" => Kind::Channel,
            _ => Kind::Other,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
struct Attributes {
    #[serde(default)]
    multiscales: Vec<Multiscale>,
    omero: Option<Omero>,
    plate: Option<IgnoredAny>,
    well: Option<IgnoredAny>,
    #[serde(rename = "bioformats2raw.layout")]
    layout: Option<IgnoredAny>,
    /// Where NGFF 0.5 keeps all these.
    ome: Option<Box<Attributes>>,
}

#[derive(Debug, Deserialize)]
struct Multiscale {
    axes: Option<Vec<Axis>>,
    datasets: Vec<Dataset>,
    #[serde(rename = "coordinateTransformations", default)]
    transformations: Vec<Transformation>,
}

#[derive(Debug, Deserialize)]
struct Dataset {
    path: String,
    #[serde(rename = "coordinateTransformations", default)]
    transformations: Vec<Transformation>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Transformation {
    Identity,
    Scale { scale: Vec<f64> },
    Translation { translation: Vec<f64> },
}

#[derive(Debug, Deserialize)]
struct Omero {
    #[serde(default)]
    channels: Vec<Channel>,
}

#[derive(Debug, Deserialize)]
struct Channel {
    label: Option<String>,
}

/// A `zarr.json`.
#[derive(Debug, Deserialize)]
struct NodeText {
    node_type: String,
    #[serde(default)]
    attributes: Attributes,
}

/// A group or an array.
struct Node {
    source: Source,
    is_array: bool,
    attributes: Attributes,
}

impl Node {
    /// Reads the metadata in a folder, if there is any.
    fn read(folder: &Path, options: &ReadOptions) -> Result<Option<Self>> {
        let Some(path) = file_in(folder) else { return Ok(None) };
        let source = Source::open(&path, options)?;
        if source.len() > MAX_METADATA.min(options.max_bytes) {
            return Err(source
                .error("file", format!("{} bytes of metadata: the limit is {MAX_METADATA}", source.len())));
        }
        let (is_array, attributes) = if path.ends_with(FILES[0]) {
            let node: NodeText = parse(&path, &source.bytes(0, source.len())?)?;
            (node.node_type == "array", node.attributes)
        } else if path.ends_with(FILES[1]) {
            (folder.join(FILES[2]).is_file(), parse_file(&path, options)?)
        } else {
            (path.ends_with(FILES[2]), Attributes::default())
        };
        let attributes = attributes.ome.map_or(Attributes { ome: None, ..attributes }, |ome| *ome);
        Ok(Some(Self { source, is_array, attributes }))
    }
}

impl Image {
    /// Finds the image in a folder of Zarr, or of which the folder is a level.
    pub(super) fn find(folder: &Path, options: &ReadOptions) -> Result<Self> {
        let missing = |folder: &Path| crate::error::Error::file(folder, "folder", "no metadata of Zarr");
        let node = Node::read(folder, options)?.ok_or_else(|| missing(folder))?;
        if node.is_array {
            return Self::of_array(folder, node, options);
        }
        let Attributes { plate, well, layout, multiscales, .. } = &node.attributes;
        if plate.is_some() || well.is_some() {
            let what = if plate.is_some() { "plate" } else { "well" };
            return Err(node.source.error(what, "holds many images: give the folder of one of them"));
        }
        if layout.is_some() && multiscales.is_empty() {
            // The images of a converted file have numbers.
            let first = folder.join("0");
            let node = Node::read(&first, options)?.ok_or_else(|| missing(&first))?;
            return Self::of_group(&first, node);
        }
        Self::of_group(folder, node)
    }

    /// Makes the image of a group.
    fn of_group(folder: &Path, node: Node) -> Result<Self> {
        let Node { source, attributes, .. } = node;
        let Some(multiscale) = attributes.multiscales.into_iter().next() else {
            return Err(source.error("multiscales", "a group without: give the folder of one of its arrays"));
        };
        if !(1..=MAX_LEVELS).contains(&multiscale.datasets.len()) {
            let rule = format!("{} levels: must be 1 to {MAX_LEVELS}", multiscale.datasets.len());
            return Err(source.error("multiscales[0].datasets", rule));
        }
        let level = |(i, dataset): (usize, &Dataset)| {
            let place = format!("multiscales[0].datasets[{i}]");
            let within = |part: Component<'_>| matches!(part, Component::Normal(_));
            if dataset.path.is_empty() || !Path::new(&dataset.path).components().all(within) {
                let rule = format!("path \"{}\": must lie within the folder", dataset.path);
                return Err(source.error(place, rule));
            }
            let mut level = Level { path: dataset.path.clone(), ..Level::default() };
            for step in dataset.transformations.iter().chain(&multiscale.transformations) {
                level.then(step).map_err(|rule| source.error(place.clone(), rule))?;
            }
            Ok(level)
        };
        let levels = multiscale.datasets.iter().enumerate().map(level).collect::<Result<Vec<_>>>()?;
        let labels = attributes.omero.into_iter().flat_map(|omero| omero.channels);
        let labels = labels.filter_map(|channel| channel.label).collect();
        let axes = multiscale.axes.unwrap_or_default();
        Ok(Self { source, folder: folder.to_owned(), levels, number: 0, axes, labels })
    }

    /// Makes the image of which an array is a level, or one of that array alone.
    fn of_array(folder: &Path, node: Node, options: &ReadOptions) -> Result<Self> {
        let (parent, name) =
            (folder.parent(), folder.file_name().map(|name| name.to_string_lossy().into_owned()));
        if let (Some(parent), Some(name)) = (parent, &name)
            && let Some(group) = Node::read(parent, options)?
            && !group.attributes.multiscales.is_empty()
        {
            let image = Self::of_group(parent, group)?;
            if let Some(number) = image.levels.iter().position(|level| level.path == *name) {
                return Ok(Self { number, ..image });
            }
        }
        let levels = vec![Level::default()];
        let Node { source, .. } = node;
        Ok(Self {
            source,
            folder: folder.to_owned(),
            levels,
            number: 0,
            axes: Vec::new(),
            labels: Vec::new(),
        })
    }

    pub(super) fn level(&self) -> &Level {
        &self.levels[self.number]
    }

    /// The levels from the one to read on.
    pub(super) fn coarser(&self) -> &[Level] {
        &self.levels[self.number..]
    }

    /// The labels of channels.
    pub(super) fn channels(&self) -> &[String] {
        &self.labels
    }

    /// Returns the axes of an array of the image that has so many, and `names` for them: those of the image, those that the array names, or the
    /// usual ones. The last three are those of space, x fastest.
    pub(super) fn axes_of(&self, count: usize, names: Option<Vec<&str>>) -> Result<Vec<Axis>> {
        if !(3..=MAX_AXES).contains(&count) {
            let rule = format!("{count} axes: must be 3 to {MAX_AXES}, z, y and x last");
            return Err(self.source.error("shape", rule));
        }
        let axes = if !self.axes.is_empty() {
            self.axes.clone()
        } else if let Some(names) = names {
            names.iter().map(|name| Axis::named(name)).collect()
        } else {
            let usual = ["t", "c", "z", "y", "x"].map(Axis::named);
            let more = vec![Axis::default(); count.saturating_sub(usual.len())];
            more.into_iter().chain(usual.into_iter().skip(5_usize.saturating_sub(count))).collect()
        };
        if axes.len() != count {
            let rule = format!("{} axes: {} has {count}", axes.len(), self.level().path);
            return Err(self.source.error("axes", rule));
        }
        let level = self.level();
        if [&level.scale, &level.translation].iter().any(|list| ![0, count].contains(&list.len())) {
            let rule = format!("must have {count} numbers, one for each axis");
            return Err(self.source.error("coordinateTransformations", rule));
        }
        let space = &axes[count - 3..];
        let is_named = |(axis, name): (&Axis, &str)| {
            axis.kind() == Kind::Space && (axis.name == name || !"zyx".contains(&axis.name))
        };
        // A plain array may name its axes otherwise.
        if !self.axes.is_empty() && !space.iter().zip(["z", "y", "x"]).all(is_named) {
            let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            let rule = format!("{}: the last three must be z, y and x", names.join(", "));
            return Err(self.source.error("axes", rule));
        }
        Ok(axes)
    }
}

impl Level {
    /// Returns the folder of the array.
    pub(super) fn within(&self, folder: &Path) -> PathBuf {
        if self.path.is_empty() { folder.to_owned() } else { folder.join(&self.path) }
    }

    /// Applies a transformation after those before it.
    fn then(&mut self, step: &Transformation) -> std::result::Result<(), String> {
        let (name, factors) = match step {
            Transformation::Identity => return Ok(()),
            Transformation::Scale { scale } => ("scale", scale),
            Transformation::Translation { translation } => ("translation", translation),
        };
        if !(1..=MAX_AXES).contains(&factors.len()) {
            return Err(format!("{name} of {} numbers: must be 1 to {MAX_AXES}", factors.len()));
        }
        self.scale.resize(self.scale.len().max(factors.len()), 1.0);
        self.translation.resize(self.translation.len().max(factors.len()), 0.0);
        for (i, &factor) in factors.iter().enumerate() {
            if name == "scale" {
                self.scale[i] *= factor;
                self.translation[i] *= factor;
            } else {
                self.translation[i] += factor;
            }
        }
        Ok(())
    }
}
