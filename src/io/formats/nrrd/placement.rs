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
        let anatomy = match self.get("space").map(str::to_lowercase).as_deref() {
            Some("right-anterior-superior" | "ras") => Anatomy::Ras,
            Some("left-anterior-superior" | "las") => Anatomy::Las,
            Some("left-posterior-superior" | "lps") => Anatomy::Lps,
            None | Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") => Anatomy::Unknown,
            Some(other) => {
                return Err(self.error(
                    "space",
                    format!(
                        "\"{}\": must be one of right-anterior-superior, left-anterior-superior, \
                         left-posterior-superior, scanner-xyz, 3D-right-handed, 3D-left-handed",
                        text::shown(other)
                    ),
                ));
            }
        };
        if let Some(dimension) = self.get("space dimension") {
            if self.get("space").is_some() {
                return Err(self.error("space dimension", "must not be given together with space"));
            }
            if dimension != "3" {
                let rule = format!("{}: a volume lies in 3", text::shown(dimension));
                return Err(self.error("space dimension", rule));
            }
        }
        let origin = match self.get("space origin") {
            None => None,
            Some(text) => match self.vectors("space origin", text)?.as_slice() {
                &[Some(origin)] => Some(origin),
                others => {
                    return Err(self.error("space origin", format!("{} vectors: must be one", others.len())));
                }
            },
        };
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        let rank = axes.sizes.len();
        let (place, spacing, origin, direction) = match (self.directions(rank)?, self.get("spacings")) {
            (Some(_), Some(_)) => {
                return Err(self.error("spacings", "must not be given together with space directions"));
            }
            (Some(directions), None) => {
                let &[Some(x), Some(y), Some(z)] = &directions[axes.first..axes.first + 3] else {
                    return Err(self.error(
                        "space directions",
                        "none: all three axes of a volume must have a direction",
                    ));
                };
                let lengths = DVec3::new(x.length(), y.length(), z.length());
                let direction = DMat3::from_cols(x / lengths.x, y / lengths.y, z / lengths.z);
                ("space directions", lengths, origin.unwrap_or(DVec3::ZERO), direction)
            }
            (None, spacings) => {
                if let Some(space) = self.get("space").filter(|_| spacings.is_some()) {
                    warnings.push(format!(
                        "spacings in a space ({space}) do not say where the axes run: taken along the space's"
                    ));
                }
                let place = if spacings.is_some() { "spacings" } else { "sizes" };
                let scale = self.scale(axes)?;
                if origin.is_none() && scale.from_mins {
                    notes.push("axis mins place the grid".to_owned());
                }
                let given = scale.steps;
                let direction = DMat3::from_diagonal(given.map(|step| if step < 0.0 { -1.0 } else { 1.0 }));
                (place, given.abs(), origin.unwrap_or(scale.origin), direction)
            }
        };
        Ok(Placement { place, spacing, origin, direction, anatomy, notes, warnings })
    }

    /// Returns steps and origin of a file without directions.
    fn scale(&self, axes: &Axes) -> Result<Scale> {
        let rank = axes.sizes.len();
        let spacings = self.each("spacings", rank)?;
        let mins = self.each("axis mins", rank)?;
        let maxs = self.each("axis maxs", rank)?;
        let centers: Vec<&str> = self.get("centers").unwrap_or_default().split_whitespace().collect();
        let mut steps = [1.0; 3];
        let mut origin = [0.0; 3];
        let mut from_mins = true;
        for i in 0..3 {
            let axis = axes.first + i;
            // NaN means unknown.
            let at = |list: &Option<Vec<f64>>| list.as_ref().map_or(f64::NAN, |list| list[axis]);
            let (min, max) = (at(&mins), at(&maxs));
            let node = centers.get(axis).is_some_and(|center| center.eq_ignore_ascii_case("node"));
            let size = f64::from(axes.sizes[axis]);
            let gaps = if node { size - 1.0 } else { size };
            let spacing = at(&spacings);
            let spanned = (max - min) / gaps;
            steps[i] = if !spacing.is_nan() {
                spacing
            } else if spanned.is_nan() {
                1.0
            } else {
                spanned
            };
            from_mins &= !min.is_nan();
            origin[i] = if node { min } else { min + 0.5 * steps[i] };
        }
        // If one is unknown, the origin is unknown.
        let origin = if from_mins { DVec3::from_array(origin) } else { DVec3::ZERO };
        Ok(Scale { steps: DVec3::from_array(steps), origin, from_mins })
    }

    /// Parses one number per axis, if the field exists.
    fn each(&self, name: &str, rank: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers {
            Some(numbers) if numbers.len() == rank => Ok(Some(numbers)),
            _ => Err(self.error(name, format!("\"{}\": must be {rank} numbers", text::shown(text)))),
        }
    }
}

/// The steps along the axes, and the position of the first sample.
struct Scale {
    steps: DVec3,
    origin: DVec3,
    /// Whether the origin is given.
    from_mins: bool,
}
