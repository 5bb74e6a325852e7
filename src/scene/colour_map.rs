//! Colour maps by name.

use colorgrad::{BlendMode, Color, Gradient, GradientBuilder, LinearGradient, preset};
use glam::DVec3;

use crate::error::{Error, Result};

/// A colour map: colours for the shares from 0 to 1 of a range of scalars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// From violet over green to yellow.
    Viridis,
    /// From black over red to pale yellow.
    Inferno,
    /// From black over violet to pale yellow.
    Magma,
    /// From blue over pink to yellow.
    Plasma,
    /// A rainbow without its dark and flat bands (Mikhailov 2019, by the polynomial that approximates it).
    Turbo,
    /// From blue to yellow, alike for those who see fewer colours (Nuñez, Anderton and Renslow 2018).
    Cividis,
    /// From blue over grey to red, for scalars on both sides of a middle (Moreland 2009; between its three colours CIELAB is linear).
    Coolwarm,
    /// From black to white.
    Grey,
}

impl ColourMap {
    /// The colour maps by name.
    pub const NAMED: [(&'static str, Self); 8] = [
        ("viridis", Self::Viridis),
        ("inferno", Self::Inferno),
        ("magma", Self::Magma),
        ("plasma", Self::Plasma),
        ("turbo", Self::Turbo),
        ("cividis", Self::Cividis),
        ("coolwarm", Self::Coolwarm),
        ("grey", Self::Grey),
    ];

    /// Returns the colour map of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming all colour maps.
    pub fn from_name(name: &str) -> Result<Self> {
        let found = Self::NAMED.iter().find(|(known, _)| *known == name);
        found.map(|(_, map)| *map).ok_or_else(|| {
            let names = Self::NAMED.map(|(name, _)| name).join(", ");
            Error::invalid("colour map", format!("\"{name}\": must be one of {names}"))
        })
    }

    /// Returns linear colours at `count` even shares of the range, from 0 to 1.
    #[must_use]
    pub fn colours(self, count: usize) -> Vec<DVec3> {
        // The colours are constants that parse; the tests look at them all.
        let blended = |mode, colours: &[&str]| {
            let gradient = GradientBuilder::new().html_colors(colours).mode(mode).build::<LinearGradient>();
            gradient.map_or_else(|_| preset::greys().boxed(), LinearGradient::boxed)
        };
        let gradient = match self {
            Self::Viridis => preset::viridis().boxed(),
            Self::Inferno => preset::inferno().boxed(),
            Self::Magma => preset::magma().boxed(),
            Self::Plasma => preset::plasma().boxed(),
            Self::Turbo => preset::turbo().boxed(),
            Self::Cividis => preset::cividis().boxed(),
            Self::Coolwarm => blended(BlendMode::Lab, &["#3b4cc0", "#dddddd", "#b40426"]),
            Self::Grey => blended(BlendMode::Rgb, &["#000000", "#ffffff"]),
        };
        let linear = |colour: Color| {
            let [r, g, b, _] = colour.to_linear_rgba().map(|channel| f64::from(channel.clamp(0.0, 1.0)));
            DVec3::new(r, g, b)
        };
        gradient.colors(count).map(linear).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_those_of_the_published_maps() {
        // sRGB in eight bits of the first and the last colour, from the tables of matplotlib 3.8 and ParaView 5.11.
        for (name, ends) in [
            ("viridis", [[68, 1, 84], [253, 231, 37]]),
            ("inferno", [[0, 0, 4], [252, 255, 164]]),
            ("magma", [[0, 0, 4], [252, 253, 191]]),
            ("plasma", [[13, 8, 135], [240, 249, 33]]),
            ("turbo", [[35, 23, 27], [144, 12, 0]]),
            ("cividis", [[0, 34, 78], [254, 232, 56]]),
            ("coolwarm", [[59, 76, 192], [180, 4, 38]]),
            ("grey", [[0, 0, 0], [255, 255, 255]]),
        ] {
            let colours = ColourMap::from_name(name).unwrap().colours(2);
            for (colour, end) in colours.iter().zip(ends) {
                let encoded = colour.map(|c| {
                    255.0 * if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
                });
                let end = DVec3::from(end.map(f64::from));
                assert!(encoded.distance(end) < 15.0, "{name}: {encoded} for {end}");
            }
        }
        let middle = ColourMap::Coolwarm.colours(3)[1];
        assert!((middle - DVec3::splat(middle.x)).length() < 0.01, "{middle}");
        assert!(ColourMap::from_name("jet").unwrap_err().to_string().contains("must be one of viridis, "));
    }
}
