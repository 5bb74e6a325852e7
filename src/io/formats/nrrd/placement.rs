//! Spacing, origin, directions and anatomy.

use glam::{DMat3, DVec3};

use crate::error::Result;
use crate::io::build::volume::Placement;
use crate::io::file::text;
use crate::io::formats::nrrd::axes::Axes;
use crate::io::formats::nrrd::header::Header;
use crate::scene::Anatomy;

impl<'a> Header<'a> {
    /// Returns the placement of the grid and the anatomy of the world axes.
    pub(crate) fn placement(&self, axes: &Axes) -> Result<Placement> {
        let fields = &self.fields;
        let anatomy = match fields.get("space").map(str::to_lowercase).as_deref() {
            Some("right-anterior-superior" | "ras") => Anatomy::Ras,
            Some("left-anterior-superior" | "las") => Anatomy::Las,
            Some("left-posterior-superior" | "lps") => Anatomy::Lps,
            None | Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") => Anatomy::Unknown,
            Some(other) => {
                let rule = format!(
                    "\"{}\": must be one of right-anterior-superior, left-anterior-superior, \
                     left-posterior-superior, scanner-xyz, 3D-right-handed, 3D-left-handed",
                    text::shown(other)
                );
                return Err(fields.error("space", rule));
            }
        };
        if let Some(dimension) = fields.get("space dimension") {
            if fields.get("space").is_some() {
                return Err(fields.error("space dimension", "must not be given together with space"));
            }
            if dimension != "3" {
                let rule = format!("{}: a volume lies in 3", text::shown(dimension));
                return Err(fields.error("space dimension", rule));
            }
        }
        let origin = match fields.get("space origin") {
            None => None,
            Some(text) => match self.vectors("space origin", text)?.as_slice() {
                &[Some(origin)] => Some(origin),
                others => {
                    return Err(self
                        .fields
                        .error("space origin", format!("{} vectors: must be one", others.len())));
                }
            },
        };
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        let rank = axes.sizes.len();
        let (place, spacing, origin, direction) = match (self.directions(rank)?, fields.get("spacings")) {
            (Some(_), Some(_)) => {
                return Err(self
                    .fields
                    .error("spacings", "must not be given together with space directions"));
            }
            (Some(directions), None) => {
                let &[Some(x), Some(y), Some(z)] = &directions[axes.first..axes.first + 3] else {
                    let rule = "none: all three axes of a volume must have a direction";
                    return Err(fields.error("space directions", rule));
                };
                let lengths = DVec3::new(x.length(), y.length(), z.length());
                let direction = DMat3::from_cols(x / lengths.x, y / lengths.y, z / lengths.z);
                ("space directions", lengths, origin.unwrap_or(DVec3::ZERO), direction)
            }
            (None, spacings) => {
                if let Some(space) = fields.get("space").filter(|_| spacings.is_some()) {
                    warnings.push(format!(
                        "spacings in a space ({space}) do not say where the axes run: taken along the space's"
                    ));
                }
                let place = if spacings.is_some() { "spacings" } else { "sizes" };
                let (steps, first) = self.scale(axes)?;
                if origin.is_none() && first.is_some() {
                    notes.push("axis mins place the grid".to_owned());
                }
                let direction = DMat3::from_diagonal(steps.map(|step| if step < 0.0 { -1.0 } else { 1.0 }));
                (place, steps.abs(), origin.or(first).unwrap_or(DVec3::ZERO), direction)
            }
        };
        Ok(Placement { place, spacing, origin, direction, anatomy, notes, warnings })
    }

    /// Returns the steps along the axes of a file without directions, and the position of the first sample if it is
    /// given.
    fn scale(&self, axes: &Axes) -> Result<(DVec3, Option<DVec3>)> {
        let rank = axes.sizes.len();
        let spacings = self.fields.numbers("spacings", rank)?;
        let mins = self.fields.numbers("axis mins", rank)?;
        let maxs = self.fields.numbers("axis maxs", rank)?;
        let centers: Vec<&str> = self.fields.get("centers").unwrap_or_default().split_whitespace().collect();
        let mut steps = [1.0; 3];
        let mut origin = [0.0; 3];
        for i in 0..3 {
            let axis = axes.first + i;
            // NaN means unknown.
            let at = |list: &Option<Vec<f64>>| list.as_ref().map_or(f64::NAN, |list| list[axis]);
            let (min, max) = (at(&mins), at(&maxs));
            let node = centers.get(axis).is_some_and(|center| center.eq_ignore_ascii_case("node"));
            let size = f64::from(axes.sizes[axis]);
            let gaps = if node { size - 1.0 } else { size };
            let (spacing, spanned) = (at(&spacings), (max - min) / gaps);
            steps[i] = [spacing, spanned].into_iter().find(|step| !step.is_nan()).unwrap_or(1.0);
            origin[i] = if node { min } else { min + 0.5 * steps[i] };
        }
        // If one is unknown, the origin is unknown.
        let known = mins.is_some_and(|mins| mins.iter().skip(axes.first).take(3).all(|min| !min.is_nan()));
        Ok((steps.into(), known.then_some(origin.into())))
    }
}
