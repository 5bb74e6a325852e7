//! glTF 2.0 (`.gltf`, `.glb`) with `KHR_gaussian_splatting`: the primitives of the default scene that have the extension, at all nodes
//! that show them.
//!
//! Buffers lie in the file, beside it, or in its text. Accessors may be interleaved and sparse, and have any type that the extension
//! allows. The transforms of nodes are applied to centres, covariances and harmonics. Other meshes, materials, cameras and
//! animations are left out. Axes are left, up, front.

mod accessors;
mod document;
mod nodes;
mod primitive;

use crate::error::Result;
use crate::io::build::gaussians::{About, Columns, about_licence};
use crate::io::file::budget::Budget;
use crate::io::file::json::parse;
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::gaussian::gltf::accessors::{Buffers, Stored};
use crate::io::formats::gaussian::gltf::document::Document;
use crate::io::formats::gaussian::gltf::nodes::Instance;
use crate::io::formats::gaussian::gltf::primitive::{EXTENSION, Splats};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Axes, TrainedMode};

pub(crate) struct Gltf;

/// The beginning of a binary file.
const MAGIC: &[u8] = b"glTF";
/// Size of its header, and of that of a chunk, in bytes.
const HEADER: u64 = 12;
const CHUNK: u64 = 8;
/// Types of chunks.
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;
/// The limit on the size of the description, in bytes.
const MOST_TEXT: u64 = 1 << 30;
/// Memory of a value of it after parsing: an empty node is two values, and takes less than 500 bytes with its place in lists.
const VALUE: u64 = 256;
/// The limit on primitives that nodes show.
const MOST_PARTS: usize = 1 << 16;
/// Extensions that a file may require: those that are read, and the beginnings of those that do not matter to splats.
const KNOWN: [&str; 5] =
    [EXTENSION, "KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_"];

impl Reader for Gltf {
    fn name(&self) -> &'static str {
        "glTF"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["gltf", "glb"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.head().starts_with(MAGIC)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        if source.is_gzip() {
            return Err(source.error("content", "a gzip stream: unpack it first"));
        }
        let mut budget = Budget::new(source, request);
        let is_binary = source.head().starts_with(MAGIC);
        let [text, binary] = if is_binary { chunks(source)? } else { [Some((0, source.len())), None] };
        let (start, length) = text.unwrap_or_default();
        if length > MOST_TEXT {
            return Err(source.error("JSON", format!("{length} bytes: must have at most {MOST_TEXT}")));
        }
        // Strings are copied.
        budget.take("JSON", 2 * length)?;
        let text = source.bytes(start, length)?;
        let values = text.iter().filter(|byte| matches!(byte, b'{' | b'[' | b',')).count();
        budget.take("JSON", num::wide(values).saturating_mul(VALUE))?;
        let document: Document = parse(source.path(), &text)?;
        drop(text);
        budget.put_back(length);
        let binary = binary.map(|(start, length)| Stored { source: source.clone(), start, length });
        let format = if is_binary { "glTF, binary" } else { "glTF" };
        splats(source, &document, binary, &mut budget, format, request)
    }
}

/// Returns offset and length of the description, and of the binary chunk.
fn chunks(source: &Source) -> Result<[Option<(u64, u64)>; 2]> {
    let words = |at: u64, place: &str| {
        let bytes = source.bytes(at, 8).map_err(|_| source.error(place, "ends early"))?;
        let word =
            |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
        Ok([word(0).unwrap_or_default(), word(4).unwrap_or_default()])
    };
    let [version, length] = words(4, "header")?;
    if version != 2 {
        return Err(source.error("header", format!("version {version}: must be 2")));
    }
    if u64::from(length) != source.len() {
        let rule = format!("{length} bytes are announced, the file has {}", source.len());
        return Err(source.error("header", rule));
    }
    let (mut text, mut binary, mut at) = (None, None, HEADER);
    while at < source.len() {
        let place = format!("chunk at byte {at}");
        let [length, kind] = words(at, &place)?;
        let (start, length) = (at + CHUNK, u64::from(length));
        if start + length > source.len() {
            return Err(source.error(place, format!("{length} bytes: is longer than what follows")));
        }
        match kind {
            JSON if text.is_none() && at == HEADER => text = Some((start, length)),
            BINARY if binary.is_none() => binary = Some((start, length)),
            _ if text.is_none() => return Err(source.error(place, "must be the JSON chunk")),
            // Chunks of other types are left to extensions.
            _ => {}
        }
        at = start + length;
    }
    if text.is_none() {
        return Err(source.error("header", "there is no JSON chunk"));
    }
    Ok([text, binary])
}

/// Reads the splats that a description lists.
fn splats(
    source: &Source,
    document: &Document,
    binary: Option<Stored>,
    budget: &mut Budget,
    format: &'static str,
    request: &Request,
) -> Result<Found> {
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        return Err(source.error("asset.version", format!("\"{}\": must be 2.0", shown(version))));
    }
    let known =
        |name: &&String| KNOWN.iter().any(|known| name.starts_with(known)) && !primitive::is_packed(name);
    if let Some(name) = document.required.iter().find(|name| !known(name)) {
        return Err(source.error("extensionsRequired", format!("{} is not supported", shown(name))));
    }
    let mut notes = Vec::new();
    let instances = nodes::instances(source, document, &mut notes)?;
    let mut buffers = Buffers::new(source, document, binary, request);
    // The primitives of each mesh that are splats.
    let mut meshes: Vec<Option<Vec<Splats>>> = document.meshes.iter().map(|_| None).collect();
    let (mut parts, mut others): (Vec<(usize, usize)>, usize) = (Vec::new(), 0);
    for (i, Instance { mesh, .. }) in instances.iter().enumerate() {
        let own = match &mut meshes[*mesh] {
            Some(own) => own,
            unread => {
                let (own, left_out) = primitive::splats(source, document, *mesh, &mut notes)?;
                own.iter().try_for_each(|splats| splats.check(&mut buffers, budget))?;
                others += left_out;
                unread.insert(own)
            }
        };
        if parts.len() + own.len() > MOST_PARTS {
            return Err(source.error("nodes", format!("show more than {MOST_PARTS} primitives of splats")));
        }
        parts.extend((0..own.len()).map(|k| (i, k)));
    }
    let of = |(i, k): (usize, usize)| meshes[instances[i].mesh].as_ref().and_then(|own| own.get(k));
    let all: Vec<(&Instance, &Splats)> =
        parts.into_iter().filter_map(|part| Some((&instances[part.0], of(part)?))).collect();
    if all.is_empty() {
        let rule = format!("no node shows splats: primitives with {EXTENSION} are read, surfaces are not");
        return Err(source.error("content", rule));
    }
    let count = all.iter().map(|(_, splats)| splats.count).fold(0, u64::saturating_add);
    let degree = all.iter().map(|(_, splats)| splats.degree).max().unwrap_or(0);
    let mut columns = Columns::new(source, budget, count, degree)?;
    let (mut first, mut logarithms) = (0, 0);
    for (instance, splats) in &all {
        let end = first + usize::try_from(splats.count).unwrap_or(usize::MAX);
        logarithms += usize::from(splats.read(&mut buffers, budget, &mut columns, first)?);
        let moved = columns.parts.transform(first..end, instance.matrix, instance.offset);
        moved.map_err(|error| error.at_place(source.path(), &format!("node {}", instance.node)))?;
        first = end;
    }
    if all.len() > 1 {
        notes.push(format!("{} primitives of splats are merged", all.len()));
    }
    if others > 0 {
        notes.push(format!("{others} primitives without splats left out"));
    }
    let texts = [("generator", &document.asset.generator), ("copyright", &document.asset.copyright)];
    let texts = texts.into_iter().filter_map(|(key, text)| Some(format!("{key}: {}", text.as_ref()?)));
    let about = About {
        format,
        axes: Axes::Luf.into(),
        axes_from: "the convention of glTF files",
        mode: TrainedMode::Khronos,
        texts: about_licence(&texts.collect::<Vec<_>>()),
        notes,
    };
    let mut found = columns.finish(source, budget, about, request)?;
    if logarithms > 0 {
        found.report.warnings.push(format!(
            "{logarithms} primitives have negative lengths: they are taken as logarithms, as in drafts of {EXTENSION}"
        ));
    }
    Ok(found)
}
