//! Gaussian splats in PLY files: plain, or compressed in chunks of 256.
//!
//! Plain: properties of the element `vertex`, by name, in any order and of any type: `x y z`, `f_dc_0..2`, `f_rest_i` of
//! degree 0 to 3 with the coefficients of each channel together, `opacity` (a logit), `scale_0..2` (logarithms), `rot_0..3` (w,
//! x, y, z). Without `scale_2` splats are flat. Other properties and elements are skipped, but must be complete. Axes are
//! right, down, front. [`packed`] reads compressed files.

mod packed;
mod properties;

use crate::error::Result;
use crate::io::build::gaussians::Columns;
use crate::io::file::budget::Budget;
use crate::io::file::scanner::Scanner;
use crate::io::formats::gaussian::ply::properties::{about, find, place_of, places, rest};
use crate::io::formats::ply::header::Header;
use crate::io::options::Request;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Gaussians, TrainedMode};

/// The arrangement of splats in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Plain,
    Packed,
}

/// Returns the arrangement of splats, if a header is that of splats.
pub(crate) fn form(header: &Header) -> Option<Form> {
    let vertex = find(header, "vertex").map(|place| &header.elements[place])?;
    if find(header, "chunk").is_some() && place_of(vertex, "packed_position").is_some() {
        return Some(Form::Packed);
    }
    // Points may have some of these. With one missing, a file is a broken scene of splats.
    let own = ["f_dc_0", "opacity", "scale_0", "rot_0"];
    (own.iter().filter(|name| place_of(vertex, name).is_some()).count() >= 3).then_some(Form::Plain)
}

/// Reads the elements after the header.
pub(crate) fn read(scanner: Scanner, header: &Header, form: Form, request: &Request) -> Result<Found> {
    match form {
        Form::Plain => plain(scanner, header, request),
        Form::Packed => packed::read(scanner, header, request),
    }
}

fn plain(mut scanner: Scanner, header: &Header, request: &Request) -> Result<Found> {
    let source = scanner.source();
    let mut budget = Budget::new(source, request);
    let (place, axes) = header.vertex(source)?;
    let vertex = &header.elements[place];
    let mut wanted = axes.to_vec();
    let fixed =
        ["rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0", "f_dc_1", "f_dc_2", "scale_0", "scale_1"];
    wanted.extend(places(&scanner, vertex, &fixed)?);
    let (rest, degree) = rest(&scanner, vertex)?;
    let first_rest = wanted.len();
    wanted.extend(rest);
    let third = place_of(vertex, "scale_2");
    wanted.extend(third);

    for element in &header.elements[..place] {
        header.pass(&mut scanner, element)?;
    }
    header.holds(&scanner, vertex)?;
    let mut columns = Columns::new(source, &mut budget, vertex.count, degree)?;
    let last_rest = wanted.len() - usize::from(third.is_some());
    let mut i = 0;
    header.each(&mut scanner, vertex, &wanted, &mut |row| {
        let number = |k: usize| num::f32_of(row[k]);
        columns.parts.centres[i] = [0, 1, 2].map(number);
        columns.parts.rotations[i] = [3, 4, 5, 6].map(number);
        columns.parts.opacities[i] = Gaussians::opacity_of_logit(row[7]);
        let flat = if third.is_some() { number(last_rest) } else { f32::NEG_INFINITY };
        columns.parts.log_scales[i] = [number(11), number(12), flat];
        for (k, value) in columns.harmonics(i).iter_mut().zip(8..11) {
            *k = num::f32_of(row[value]);
        }
        for (place, value) in row[first_rest..last_rest].iter().enumerate() {
            columns.set_rest(i, place, num::f32_of(*value));
        }
        i += 1;
    })?;
    for element in &header.elements[place + 1..] {
        header.pass(&mut scanner, element)?;
    }
    header.end(&mut scanner)?;
    let mut about = about(header, "PLY of Gaussian splats", &["vertex"]);
    if third.is_none() {
        about.notes.push("without scale_2: flat splats".to_owned());
        if about.mode == TrainedMode::Unknown {
            about.mode = TrainedMode::Flat;
        }
    }
    about.notes.insert(0, "the properties are those of Gaussian splats".to_owned());
    columns.finish(source, &mut budget, about, request)
}
