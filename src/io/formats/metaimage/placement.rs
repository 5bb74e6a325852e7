//! Spacing, origin, directions and anatomy.

use glam::{DMat3, DVec3};

use crate::error::Result;
use crate::io::build::volume::Placement;
use crate::io::file::text;
use crate::io::formats::metaimage::header::Header;
use crate::scene::Anatomy;

impl<'a> Header<'a> {
    pub(crate) fn placement(&self) -> Result<Placement> {
        let rank = self.rank;
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        // Without ElementSpacing, ElementSize gives the spacing.
        let mut spacing_place = "DimSize";
        let mut spacing = DVec3::ONE;
        for name in ["ElementSpacing", "ElementSize"] {
            if let Some(numbers) = self.fields.numbers(name, rank)? {
                (spacing_place, spacing) = (name, DVec3::from_slice(&numbers));
                break;
            }
        }
        let (origin_place, origin) = self.named(&["Offset", "Position", "Origin"], rank)?;
        let origin = origin.map_or(DVec3::ZERO, |numbers| DVec3::from_slice(&numbers));
        let names = ["TransformMatrix", "Rotation", "Orientation"];
        let (matrix_place, matrix) = self.named(&names, rank * rank)?;
        let direction = match matrix {
            None => DMat3::IDENTITY,
            Some(numbers) => {
                // Entries that mix the fourth axis with the others.
                let mixes = |i: usize| (i % rank == 3) != (i / rank == 3);
                if let Some((_, number)) =
                    numbers.iter().enumerate().find(|&(i, &number)| mixes(i) && number != 0.0)
                {
                    let rule = format!("{number}: the fourth axis must not mix with the others");
                    return Err(self.fields.error(matrix_place, rule));
                }
                let row = |i: usize| DVec3::from_slice(&numbers[i * rank..]);
                DMat3::from_cols(row(0), row(1), row(2))
            }
        };
        let turned = spacing.map(|number| if number < 0.0 { -1.0 } else { 1.0 });
        let direction = direction * DMat3::from_diagonal(turned);
        if turned != DVec3::ONE {
            notes.push("a negative spacing reverses its axis".to_owned());
        }

        if let Some(centre) = self.fields.numbers("CenterOfRotation", rank)?
            && DVec3::from_slice(&centre) != DVec3::ZERO
        {
            notes.push(format!("CenterOfRotation {} does not move the image", DVec3::from_slice(&centre)));
        }
        let anatomy = match self.fields.get("AnatomicalOrientation") {
            None | Some("" | "???" | "????") => Anatomy::Unknown,
            Some(name) => match sides(name) {
                None => {
                    let shown = text::shown(name);
                    warnings.push(format!("AnatomicalOrientation \"{shown}\": no orientation, left alone"));
                    Anatomy::Unknown
                }
                Some(sides) => {
                    let axes = [direction.x_axis, direction.y_axis, direction.z_axis];
                    // Oblique axes have several valid names; below this cosine the name is wrong.
                    if axes.iter().zip(sides).any(|(axis, side)| axis.normalize().dot(side) < 0.3) {
                        warnings.push(format!(
                            "AnatomicalOrientation {name} does not fit the directions of the axes, which decide"
                        ));
                    }
                    Anatomy::Lps
                }
            },
        };
        // Errors name the field that the file has.
        let bad_spacing = !(spacing.is_finite() && spacing.abs().min_element() > 0.0);
        let place = if bad_spacing {
            spacing_place
        } else if !origin.is_finite() {
            origin_place
        } else {
            matrix_place
        };
        Ok(Placement { place, spacing: spacing.abs(), origin, direction, anatomy, notes, warnings })
    }
}

/// Returns the directions of axes that start at the named sides, in LPS coordinates (x to the left, y to the back, z
/// up).
fn sides(name: &str) -> Option<[DVec3; 3]> {
    let side = |letter| match letter {
        'R' => Some(DVec3::X),
        'L' => Some(DVec3::NEG_X),
        'A' => Some(DVec3::Y),
        'P' => Some(DVec3::NEG_Y),
        'I' => Some(DVec3::Z),
        'S' => Some(DVec3::NEG_Z),
        _ => None,
    };
    let sides: Vec<DVec3> = name.chars().map(side).collect::<Option<_>>()?;
    let &[x, y, z] = sides.as_slice() else { return None };
    (x.cross(y).dot(z) != 0.0).then_some([x, y, z])
}
