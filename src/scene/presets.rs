//! Ready-made looks: a transfer function, and the mode that suits it.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::transfer::check_range;
use crate::scene::{ColourMap, Data, Kernels, Knot, Mode, Opacity, TransferFunction, auto};

/// A ready-made transfer function, with the mode that suits it.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// The name in scene files and options.
    pub name: &'static str,
    /// The purpose, as a phrase.
    pub purpose: &'static str,
    shape: Shape,
    light: Light,
}

/// Where the knots come from.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Rows over the scalars 0 to 1, with extinction for a box of side 2.
    Rows(&'static [[f64; 5]]),
    /// Rows over Hounsfield units with relative extinction, and the optical depth of the densest tenth of the rays.
    Hounsfield(&'static [[f64; 5]], f64),
    /// The automatic choice.
    Auto,
    /// The automatic choice in grey.
    Grey,
    /// White, for maximum intensity projection.
    Maximum,
    /// Both ways from a middle.
    Diverging,
    /// White, in proportion to the scalar.
    Radiograph,
    /// Over the decades of the scalars.
    Decades,
}

/// Whether light falls on a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Light {
    On,
    Off,
}

/// Hounsfield units of air and of dense bone.
const HOUNSFIELD: [f64; 2] = [-1000.0, 2000.0];
/// The number that scanners of 12 bits add to Hounsfield units to make them positive.
const OFFSET: f64 = 1024.0;
/// Optical depth of the densest tenth of the rays through a radiograph: no ray saturates.
const RADIOGRAPH: f64 = 1.5;

impl Preset {
    /// Returns the preset of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming all presets.
    pub fn named(name: &str) -> Result<Self> {
        PRESETS.into_iter().find(|preset| preset.name == name).ok_or_else(|| {
            let names = PRESETS.map(|preset| preset.name).join(", ");
            Error::invalid("preset", format!("\"{name}\": must be one of {names}"))
        })
    }

    /// Makes the transfer function for data, over a range of scalars or that which suits the data.
    ///
    /// The extinction of the presets `grey`, `fog`, `shells`, `bone` and `surface` suits a box of side 2; without
    /// `tau_scale` it is multiplied by 2 / the longest side of the data's box. That of the others is derived from the data; `tau_scale`, by
    /// default 1, multiplies it.
    ///
    /// Those for computed tomography stand in Hounsfield units if the data have scalars below -200 and above 200, or, increased by 1024, if they reach from 0 or
    /// more to 1,500 to 4,095; else -1000 to 2000 are stretched over `range`, or over all scalars.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if `range` is empty or not finite, if `tau_scale` is negative or not finite, and for data that the preset does not suit: other than grids
    /// for `mip`, without different positive scalars for `log`.
    pub fn transfer(
        &self,
        data: &Data,
        kernels: Option<&Kernels>,
        range: Option<[f64; 2]>,
        tau_scale: Option<f64>,
    ) -> Result<TransferFunction> {
        range.map_or(Ok(()), check_range)?;
        let over = |transfer: TransferFunction| {
            range.map_or(Ok(transfer.clone()), |range| transfer.stretched(range))
        };
        let fitted = |transfer: TransferFunction, depth| auto::fitted(data, kernels, &transfer, depth);
        let transfer = match self.shape {
            Shape::Rows(rows) => {
                let scale = tau_scale.unwrap_or_else(|| 2.0 / longest_side(data));
                return placed(rows, [0.0, 1.0], range.unwrap_or_else(|| data.range()))?.thickened(scale);
            }
            Shape::Hounsfield(rows, depth) => {
                let range = range.unwrap_or_else(|| hounsfield(data.range()));
                fitted(placed(rows, HOUNSFIELD, range)?, depth)?
            }
            Shape::Auto | Shape::Grey => {
                let transfer = auto::transfer_of(data, kernels)?;
                let transfer = if let Some(range) = range {
                    fitted(transfer.stretched(range)?, auto::DEPTH)?
                } else {
                    transfer
                };
                if matches!(self.shape, Shape::Grey) { transfer.coloured(ColourMap::Grey) } else { transfer }
            }
            Shape::Maximum => over(auto::maximum(data)?)?,
            Shape::Diverging => fitted(over(auto::diverging(data)?)?, auto::DEPTH)?,
            Shape::Radiograph => {
                let white = over(auto::transfer_of(data, kernels)?)?.in_colour(DVec3::ONE)?;
                fitted(Opacity::Linear.over(&white)?, RADIOGRAPH)?
            }
            Shape::Decades => fitted(decades(range.map_or_else(|| auto::decades(data), Ok)?)?, auto::DEPTH)?,
        };
        tau_scale.map_or(Ok(transfer.clone()), |scale| transfer.thickened(scale))
    }

    /// Returns the mode that suits it: lit for those of solid bodies on grids, maximum for `mip`, else emission.
    #[must_use]
    pub fn mode(&self, data: &Data, kernels: Option<&Kernels>) -> Mode {
        match self.shape {
            Shape::Maximum => Mode::Maximum,
            _ if self.light == Light::On => auto::lit(data, kernels),
            _ => Mode::Emission,
        }
    }
}

/// Returns the length of the longest edge of the data's box, or 2 where it has none.
fn longest_side(data: &Data) -> f64 {
    let corners = data.corners();
    let longest =
        [1, 2, 4].map(|corner| corners[corner].distance(corners[0])).into_iter().fold(0.0, f64::max);
    if longest > 0.0 { longest } else { 2.0 }
}

/// Returns the scalars of air and of dense bone.
fn hounsfield(range @ [least, greatest]: [f64; 2]) -> [f64; 2] {
    if least <= -200.0 && greatest >= 200.0 {
        HOUNSFIELD
    } else if least >= 0.0 && (1500.0..4096.0).contains(&greatest) {
        HOUNSFIELD.map(|units| units + OFFSET)
    } else {
        range
    }
}

/// Makes a transfer function of rows, with scalars moved from one range to another.
fn placed(rows: &[[f64; 5]], [from, to]: [f64; 2], [low, high]: [f64; 2]) -> Result<TransferFunction> {
    let place = |s: f64| low + (high - low) * ((s - from) / (to - from));
    let knot = |&[s, r, g, b, tau]: &[f64; 5]| Knot { s: place(s), colour: DVec3::new(r, g, b), tau };
    TransferFunction::new(rows.iter().map(knot).collect())
}

/// Makes a transfer function of the scalar's logarithm, with extinction that grows with the square of its share.
fn decades([low, high]: [f64; 2]) -> Result<TransferFunction> {
    const STEPS: u32 = 32;
    if low <= 0.0 {
        return Err(Error::invalid(
            "range",
            format!("[{low}, {high}]: the preset log requires scalars above zero"),
        ));
    }
    let shares = (0..=STEPS).map(|i| f64::from(i) / f64::from(STEPS));
    let knots = shares.zip(ColourMap::Inferno.colours(33)).map(|(share, colour)| Knot {
        s: low * (high / low).powf(share),
        colour,
        tau: share * share,
    });
    TransferFunction::new(knots.collect())
}

/// The presets.
pub const PRESETS: [Preset; 16] = [
    Preset {
        name: "grey",
        purpose: "brightness and extinction grow with the value",
        shape: Shape::Rows(&[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 4.0]]),
        light: Light::Off,
    },
    Preset {
        name: "fog",
        purpose: "translucent, from blue over cream to red",
        shape: Shape::Rows(&[
            [0.0, 0.1, 0.2, 0.7, 0.0],
            [0.06, 0.1, 0.2, 0.7, 0.0],
            [0.3, 0.2, 0.6, 0.9, 1.0],
            [0.6, 0.9, 0.85, 0.3, 3.0],
            [1.0, 1.0, 0.25, 0.1, 8.0],
        ]),
        light: Light::Off,
    },
    Preset {
        name: "shells",
        purpose: "a bright shell about 0.5 and a faint violet body above 0.8",
        shape: Shape::Rows(&[
            [0.0, 0.1, 0.2, 0.6, 0.0],
            [0.42, 0.9, 0.4, 0.1, 0.0],
            [0.5, 1.0, 0.8, 0.3, 30.0],
            [0.58, 0.2, 0.6, 0.9, 0.0],
            [0.8, 0.2, 0.6, 0.9, 0.0],
            [0.9, 0.3, 0.4, 1.0, 2.0],
            [1.0, 0.6, 0.2, 0.8, 2.0],
        ]),
        light: Light::Off,
    },
    Preset {
        name: "bone",
        purpose: "computed tomography from air to dense bone: faint soft tissue, solid bone",
        shape: Shape::Rows(&[
            [0.0, 0.35, 0.12, 0.06, 0.0],
            [0.22, 0.35, 0.12, 0.06, 0.0],
            [0.30, 0.55, 0.20, 0.10, 0.4],
            [0.38, 0.75, 0.42, 0.25, 0.6],
            [0.50, 0.95, 0.85, 0.65, 12.0],
            [1.0, 1.0, 0.98, 0.92, 40.0],
        ]),
        light: Light::Off,
    },
    Preset {
        name: "surface",
        purpose: "an opaque body from the middle of the range up, as from a mask",
        shape: Shape::Rows(&[
            [0.0, 0.6, 0.3, 0.15, 0.0],
            [0.45, 0.6, 0.3, 0.15, 0.0],
            [0.55, 0.85, 0.6, 0.4, 60.0],
            [1.0, 1.0, 0.95, 0.85, 60.0],
        ]),
        light: Light::Off,
    },
    Preset {
        name: "ct-bone",
        purpose: "computed tomography: bone, lit",
        shape: Shape::Hounsfield(
            &[
                [120.0, 0.6, 0.22, 0.12, 0.0],
                [220.0, 0.85, 0.6, 0.4, 0.15],
                [400.0, 0.95, 0.86, 0.7, 0.6],
                [1200.0, 1.0, 0.98, 0.93, 1.0],
            ],
            20.0,
        ),
        light: Light::On,
    },
    Preset {
        name: "ct-muscle",
        purpose: "computed tomography: muscle and organs without fat, over bone, lit",
        shape: Shape::Hounsfield(
            &[
                [-20.0, 0.35, 0.08, 0.05, 0.0],
                [30.0, 0.55, 0.16, 0.1, 0.25],
                [80.0, 0.7, 0.28, 0.18, 0.45],
                [160.0, 0.85, 0.6, 0.45, 0.5],
                [400.0, 0.95, 0.88, 0.75, 1.0],
            ],
            20.0,
        ),
        light: Light::On,
    },
    Preset {
        name: "ct-lung",
        purpose: "computed tomography: lung alone",
        shape: Shape::Hounsfield(
            &[
                [-960.0, 0.1, 0.25, 0.5, 0.0],
                [-850.0, 0.2, 0.5, 0.8, 0.4],
                [-650.0, 0.5, 0.75, 0.9, 1.0],
                [-500.0, 0.9, 0.75, 0.6, 0.4],
                [-300.0, 0.9, 0.5, 0.35, 0.0],
            ],
            4.0,
        ),
        light: Light::Off,
    },
    Preset {
        name: "ct-vessels",
        purpose: "computed tomography with contrast agent: vessels, red, and bone, lit",
        shape: Shape::Hounsfield(
            &[
                [130.0, 0.4, 0.03, 0.02, 0.0],
                [200.0, 0.75, 0.08, 0.05, 0.5],
                [350.0, 0.9, 0.3, 0.15, 0.7],
                [500.0, 0.95, 0.8, 0.6, 0.8],
                [1200.0, 1.0, 0.98, 0.9, 1.0],
            ],
            20.0,
        ),
        light: Light::On,
    },
    Preset {
        name: "ct-skin",
        purpose: "computed tomography: the surface of the body, lit",
        shape: Shape::Hounsfield(&[[-600.0, 0.7, 0.42, 0.28, 0.0], [-200.0, 0.8, 0.52, 0.37, 1.0]], 200.0),
        light: Light::On,
    },
    Preset {
        name: "auto",
        purpose: "what is shown without a choice: rare values more opaque than frequent ones",
        shape: Shape::Auto,
        light: Light::Off,
    },
    Preset {
        name: "mr",
        purpose: "the automatic choice in grey, lit: magnetic resonance",
        shape: Shape::Grey,
        light: Light::On,
    },
    Preset {
        name: "mip",
        purpose: "maximum intensity projection of a grid",
        shape: Shape::Maximum,
        light: Light::Off,
    },
    Preset {
        name: "diverging",
        purpose: "both ways from zero, or from the median of data of one sign: cool colours below, warm ones above",
        shape: Shape::Diverging,
        light: Light::Off,
    },
    Preset {
        name: "log",
        purpose: "by the logarithm of values above zero: densities, energies, counts",
        shape: Shape::Decades,
        light: Light::Off,
    },
    Preset {
        name: "xray",
        purpose: "white and thin, in proportion to the value: like a radiograph",
        shape: Shape::Radiograph,
        light: Light::Off,
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Field, Grid, Samples};

    fn of(name: &str, data: &Data, range: Option<[f64; 2]>) -> Result<TransferFunction> {
        Preset::named(name)?.transfer(data, None, range, None)
    }

    fn grid(samples: &[i16]) -> Data {
        Grid::new([2, 2, 2], Samples::I16(samples.to_vec())).unwrap().into()
    }

    #[test]
    fn every_preset_shows_something_of_each_kind_of_data_within_the_range_asked_for() {
        let all: [Data; 3] = [
            Field::Blobs.sample([12, 12, 12], "f32").unwrap().into(),
            Field::Blobs.tets(4).unwrap().into(),
            Field::Blobs.points(300).unwrap().with_estimated_radius().into(),
        ];
        for preset in PRESETS {
            assert!(
                PRESETS.iter().filter(|other| other.name == preset.name).count() == 1
                    && !preset.purpose.is_empty()
            );
            for data in &all {
                let made = preset.transfer(data, None, None, None);
                if preset.name == "mip" && data.kind() != "grid" {
                    assert!(made.unwrap_err().to_string().contains("requires a grid"));
                    continue;
                }
                let made = made.unwrap();
                assert!(made.max_tau() > 0.0, "{}", preset.name);
                let twice = preset.transfer(data, None, None, Some(2.0)).unwrap();
                if !matches!(preset.shape, Shape::Rows(_)) {
                    assert_eq!(twice.max_tau(), 2.0 * made.max_tau(), "{}", preset.name);
                    assert_eq!(
                        preset.mode(data, None) == Mode::Emission,
                        preset.name != "mip" && (preset.light == Light::Off || data.kind() != "grid")
                    );
                }
                let [low, high] = preset.transfer(data, None, Some([0.25, 0.5]), None).unwrap().domain();
                assert!(low >= 0.25 && high <= 0.5 + 1e-12, "{}: {low} {high}", preset.name);
            }
        }
    }

    #[test]
    fn extinction_of_rows_suits_the_box() {
        let data = Data::from(Field::Ramp.sample([4, 4, 4], "u8").unwrap());
        let small = of("fog", &data, None).unwrap();
        let Data::Grid(large) = data else { unreachable!() };
        let large = large.with_placement(DVec3::splat(100.0), DVec3::ZERO, glam::DMat3::IDENTITY).unwrap();
        let large = of("fog", &large.into(), None).unwrap();
        assert_eq!((small.max_tau(), large.max_tau()), (8.0, 8.0 * 2.0 / 300.0));
    }

    #[test]
    fn hounsfield_units_are_recognized() {
        let first = |samples: [i16; 8], range| of("ct-bone", &grid(&samples), range).unwrap().domain()[0];
        assert_eq!(first([-1000, -900, 0, 40, 60, 300, 900, 1500], None), 120.0);
        assert_eq!(first([0, 100, 1024, 1060, 1080, 1300, 1900, 3000], None), 1144.0);
        // Eight bits: from air to dense bone.
        let share = (120.0 + 1000.0) / 3000.0;
        assert_eq!(first([0, 1, 2, 100, 110, 120, 180, 255], None), 255.0 * share);
        assert_eq!(first([-1000, -900, 0, 40, 60, 300, 900, 1500], Some([0.0, 3000.0])), 1120.0);
    }

    #[test]
    fn what_a_preset_cannot_show_is_refused() {
        let data = grid(&[-4, -3, -2, -1, -1, -1, 0, 0]);
        let why = |name, range| of(name, &data, range).unwrap_err().to_string();
        assert!(why("log", None).contains("above zero"));
        assert!(why("log", Some([0.0, 1.0])).contains("above zero"));
        assert!(why("fog", Some([1.0, 1.0])).contains("the first must be below the second"));
        assert!(why("smoke", None).contains("\"smoke\": must be one of grey, fog"));
    }
}
