//! Primitives of splats: attributes, and what the extension says of them.

use crate::error::{Error, Result};
use crate::io::build::gaussians::Columns;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::gaussian::gltf::accessors::{Buffers, Numbers, components, kind_of};
use crate::io::formats::gaussian::gltf::document::{Document, Primitive, SplatExtension};
use crate::num;
use crate::scene::harmonics;

/// The extension that is read.
pub(super) const EXTENSION: &str = "KHR_gaussian_splatting";
/// The mode of a primitive of points.
const POINTS: u32 = 0;
/// The mode of a primitive that tells none.
const TRIANGLES: u32 = 4;
/// Colours that are drawn as they are.
const COLOURS: &str = "srgb_rec709_display";

/// Whether an extension packs splats.
pub(super) fn is_packed(name: &str) -> bool {
    name.contains("compression") && name.contains("splat")
}

/// A property of splats.
#[derive(Clone, Copy)]
enum Property {
    Position,
    Rotation,
    Length,
    Opacity,
    /// A coefficient of three channels, by its function.
    Coefficient(usize),
}

/// Splats of a primitive.
pub(super) struct Splats<'a> {
    pub(super) count: u64,
    pub(super) degree: u32,
    properties: Vec<(Property, Numbers<'a>)>,
}

/// Returns the splats of a mesh, and the number of its other primitives.
pub(super) fn splats<'a>(
    source: &Source,
    document: &'a Document,
    mesh: usize,
    notes: &mut Vec<String>,
) -> Result<(Vec<Splats<'a>>, usize)> {
    let (mut all, mut others) = (Vec::new(), 0);
    for (i, primitive) in document.meshes[mesh].primitives.iter().enumerate() {
        let place = format!("meshes[{mesh}].primitives[{i}]");
        let own = &primitive.extensions;
        for (packed, name) in [
            (&own.spz_2, "KHR_gaussian_splatting_compression_spz_2"),
            (&own.spz, "KHR_gaussian_splatting_compression_spz"),
            (&own.first_spz, "KHR_spz_gaussian_splats_compression"),
        ] {
            if packed.is_some() {
                return Err(packed_error(source, place, name));
            }
        }
        match &own.splats {
            Some(extension) => {
                check(source, &place, extension, notes)?;
                all.push(Splats::new(source, document, &place, primitive)?);
            }
            None => others += 1,
        }
    }
    Ok((all, others))
}

fn packed_error(source: &Source, place: String, name: &str) -> Error {
    source.error(place, format!("{} is not supported: unpack it, or write the splats as SPZ", shown(name)))
}

/// Refuses what cannot be drawn, and notes what is drawn otherwise.
fn check(source: &Source, place: &str, extension: &SplatExtension, notes: &mut Vec<String>) -> Result<()> {
    let SplatExtension { kernel, color_space, projection, sorting_method, extensions } = extension;
    if let Some(name) = extensions.keys().find(|name| is_packed(name)) {
        return Err(packed_error(source, place.to_owned(), name));
    }
    let other = |key: &str, value: &str, rule: &str| {
        source.error(place.to_owned(), format!("{key} \"{}\": {rule}", shown(value)))
    };
    if let Some(kernel) = kernel.as_ref().filter(|kernel| *kernel != "ellipse") {
        return Err(other("kernel", kernel, "must be ellipse"));
    }
    if let Some(space) = color_space.as_ref().filter(|space| *space != COLOURS) {
        let rule = format!("must be {COLOURS}: colours are blended as they are, and shown as sRGB");
        return Err(other("colorSpace", space, &rule));
    }
    let mut note = |text: String| {
        if !notes.contains(&text) {
            notes.push(text);
        }
    };
    for (key, value) in [("kernel", kernel), ("colorSpace", color_space)] {
        if value.is_none() {
            note(format!(
                "{key} is missing, and taken as {}",
                if key == "kernel" { "ellipse" } else { COLOURS }
            ));
        }
    }
    for (key, value, known) in
        [("projection", projection, "perspective"), ("sortingMethod", sorting_method, "cameraDistance")]
    {
        if let Some(value) = value.as_ref().filter(|value| *value != known) {
            note(format!("{key} \"{}\" is drawn as {known}", shown(value)));
        }
    }
    if let Some(name) = extensions.keys().next() {
        note(format!("extension {} of splats left out", shown(name)));
    }
    Ok(())
}

/// The accessor types that an attribute may have, as normalised numbers and as others.
struct Allowed(&'static [SampleType], &'static [SampleType]);

const FLOATS: Allowed = Allowed(&[], &[SampleType::F32]);
const ROTATIONS: Allowed = Allowed(&[SampleType::I8, SampleType::I16], &[SampleType::F32]);
const OPACITIES: Allowed = Allowed(&[SampleType::U8, SampleType::U16], &[SampleType::F32]);
/// Drafts had signed lengths.
const SMALL: [SampleType; 4] = [SampleType::U8, SampleType::U16, SampleType::I8, SampleType::I16];
const SMALL_OR_FLOAT: [SampleType; 5] =
    [SampleType::U8, SampleType::U16, SampleType::I8, SampleType::I16, SampleType::F32];
const LENGTHS: Allowed = Allowed(&SMALL, &SMALL_OR_FLOAT);

impl<'a> Splats<'a> {
    fn new(source: &Source, document: &'a Document, place: &str, primitive: &'a Primitive) -> Result<Self> {
        let wrong = |rule: &str| source.error(place, rule);
        if primitive.mode.unwrap_or(TRIANGLES) != POINTS {
            return Err(wrong("mode: splats must be points"));
        }
        if primitive.indices.is_some() || primitive.targets.is_some() {
            return Err(wrong("indices and targets of splats are not supported"));
        }
        let has = |l: u32| {
            let name = format!("{EXTENSION}:SH_DEGREE_{l}_");
            primitive.attributes.keys().any(|key| key.starts_with(&name))
        };
        if has(4) {
            return Err(wrong("degree of harmonics: must be 0 to 3"));
        }
        let degree = (1..=3).rev().find(|l| has(*l)).unwrap_or(0);
        let attribute = |name: &str, width: usize, allowed: &Allowed| {
            let wrong = |rule: String| source.error(place, format!("{name}: {rule}"));
            let Some(index) = primitive.attributes.get(name).copied() else {
                return Err(wrong("is missing: splats need it".to_owned()));
            };
            numbers(document, index, width, allowed).map_err(wrong)
        };
        let own = |name: &str| format!("{EXTENSION}:{name}");
        let mut properties = vec![
            (Property::Position, attribute("POSITION", 3, &LENGTHS)?),
            (Property::Rotation, attribute(&own("ROTATION"), 4, &ROTATIONS)?),
            (Property::Length, attribute(&own("SCALE"), 3, &LENGTHS)?),
            (Property::Opacity, attribute(&own("OPACITY"), 1, &OPACITIES)?),
        ];
        for l in 0..=degree {
            let before = if l == 0 { 0 } else { harmonics::count(l - 1) };
            for n in 0..harmonics::count(l) - before {
                let numbers = attribute(&own(&format!("SH_DEGREE_{l}_COEF_{n}")), 3, &FLOATS)?;
                properties.push((Property::Coefficient(before + n), numbers));
            }
        }
        let count = properties[0].1.accessor.count;
        let other =
            properties.iter().map(|(_, numbers)| numbers.accessor.count).find(|other| *other != count);
        if let Some(other) = other {
            return Err(wrong(&format!("attributes: have {count} and {other} elements")));
        }
        Ok(Self { count, degree, properties })
    }

    /// Checks that the buffers hold all numbers.
    pub(super) fn check(&self, buffers: &mut Buffers, budget: &mut Budget) -> Result<()> {
        self.properties.iter().try_for_each(|(_, numbers)| buffers.find(*numbers, budget).map(drop))
    }

    /// Reads the splats into columns, from a place on. Returns whether the lengths are logarithms.
    pub(super) fn read(
        &self,
        buffers: &mut Buffers,
        budget: &mut Budget,
        columns: &mut Columns,
        first: usize,
    ) -> Result<bool> {
        if self.count == 0 {
            return Ok(false);
        }
        for (property, numbers) in &self.properties {
            buffers.each(*numbers, budget, &mut |i, row| {
                let number = |k: usize| num::f32_of(row[k]);
                let (i, parts) = (first + i, &mut columns.parts);
                match property {
                    Property::Position => parts.centres[i] = [0, 1, 2].map(number),
                    // The file has w last.
                    Property::Rotation => parts.rotations[i] = [3, 0, 1, 2].map(number),
                    Property::Length => parts.log_scales[i] = [0, 1, 2].map(number),
                    Property::Opacity => parts.opacities[i] = number(0),
                    Property::Coefficient(function) => {
                        let place = 3 * function;
                        columns.harmonics(i)[place..place + 3].copy_from_slice(&[0, 1, 2].map(number));
                    }
                }
            })?;
        }
        let count = usize::try_from(self.count).unwrap_or(usize::MAX);
        let lengths = &mut columns.parts.log_scales[first..first + count];
        // A single negative length is damage; splats shorter than the unit have mostly negative logarithms.
        let negative = lengths.iter().filter(|own| own.iter().any(|length| *length < 0.0)).count();
        let are_logarithms = 2 * negative > count;
        if !are_logarithms {
            for own in lengths {
                *own = own.map(|length| num::f32_of(f64::from(length).ln()));
            }
        }
        Ok(are_logarithms)
    }
}

/// Returns an accessor of elements of this width and an allowed type, else the rule that it breaks.
fn numbers<'a>(
    document: &'a Document,
    index: usize,
    width: usize,
    Allowed(normalised, others): &Allowed,
) -> std::result::Result<Numbers<'a>, String> {
    let Some(accessor) = document.accessors.get(index) else {
        return Err(format!("there is no accessors[{index}]"));
    };
    if components(&accessor.kind) != Some(width) {
        let words = ["", "SCALAR", "VEC2", "VEC3", "VEC4"];
        return Err(format!("type \"{}\": must be {}", shown(&accessor.kind), words[width]));
    }
    let list = if accessor.normalized { normalised } else { others };
    let Some(kind) = kind_of(accessor.component_type).filter(|kind| list.contains(kind)) else {
        let how = if accessor.normalized { "normalised" } else { "not normalised" };
        return Err(format!("componentType {}, {how}, is not allowed", accessor.component_type));
    };
    Ok(Numbers { accessor, index, components: width, kind })
}
