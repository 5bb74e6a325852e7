//! Names of coordinate axes by the directions that they point to.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};

macro_rules! axes {
    ($($name:ident $letters:literal)*) => {
        /// The directions that x, y and z point to, by three letters: right or left, up or down, front or back, as a
        /// viewer sees them who looks towards the front.
        ///
        /// There are 24 sets, all right-handed. Data in left-handed axes are mirrored when they are read.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Axes {
            $(#[doc = concat!("x, y and z point to ", $letters, ".")] $name,)*
        }

        impl Axes {
            /// All sets of axes.
            pub const ALL: [Self; 24] = [$(Self::$name),*];

            /// Returns the three letters, such as `rub`.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $letters,)*
                }
            }
        }
    };
}

axes! {
    Rub "rub" Rdf "rdf" Rbd "rbd" Rfu "rfu" Luf "luf" Ldb "ldb" Lbu "lbu" Lfd "lfd"
    Urf "urf" Ulb "ulb" Ubr "ubr" Ufl "ufl" Drb "drb" Dlf "dlf" Dbl "dbl" Dfr "dfr"
    Bru "bru" Bld "bld" Bul "bul" Bdr "bdr" Frd "frd" Flu "flu" Fur "fur" Fdl "fdl"
}

/// Axes that the data of a file are stored in, right-handed or left-handed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StoredAxes {
    /// Right-handed axes.
    pub axes: Axes,
    /// Whether the stored x points in the opposite direction.
    pub mirrored: bool,
}

impl StoredAxes {
    /// Returns the names of all axes, those of right-handed ones first.
    pub fn names() -> impl Iterator<Item = String> {
        let all = |mirrored: bool| Axes::ALL.into_iter().map(move |axes| Self { axes, mirrored }.name());
        all(false).chain(all(true))
    }

    /// Returns the three letters.
    #[must_use]
    pub fn name(self) -> String {
        let turned = |(i, letter)| if i == 0 && self.mirrored { opposite(letter) } else { letter };
        self.axes.name().chars().enumerate().map(turned).collect()
    }

    /// Returns the axes if they are right-handed.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if they are left-handed.
    pub fn right_handed(self) -> Result<Axes> {
        if self.mirrored {
            let why = format!("\"{}\": must be right-handed, such as {}", self.name(), self.axes.name());
            return Err(Error::invalid("axes", why));
        }
        Ok(self.axes)
    }
}

impl From<Axes> for StoredAxes {
    fn from(axes: Axes) -> Self {
        Self { axes, mirrored: false }
    }
}

/// Returns the direction of a letter, in axes that point to the right, up and back.
fn direction(letter: char) -> Option<DVec3> {
    match letter {
        'r' => Some(DVec3::X),
        'l' => Some(DVec3::NEG_X),
        'u' => Some(DVec3::Y),
        'd' => Some(DVec3::NEG_Y),
        'b' => Some(DVec3::Z),
        'f' => Some(DVec3::NEG_Z),
        _ => None,
    }
}

/// Those of PLY files.
impl Default for Axes {
    fn default() -> Self {
        Self::Rdf
    }
}

impl Axes {
    /// Returns the axes of a name of three letters in either case, which may be left-handed.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless the letters name a right or left, an up or down, and a front or back.
    pub fn named(name: &str) -> Result<StoredAxes> {
        let lower = name.to_ascii_lowercase();
        let flipped: String = lower
            .chars()
            .enumerate()
            .map(|(i, letter)| if i == 0 { opposite(letter) } else { letter })
            .collect();
        let find = |name: &str| Self::ALL.into_iter().find(|axes| axes.name() == name);
        match (find(&lower), find(&flipped)) {
            (Some(axes), _) => Ok(axes.into()),
            (None, Some(axes)) => Ok(StoredAxes { axes, mirrored: true }),
            (None, None) => {
                let rule =
                    "must be three letters for x, y and z: one of r and l, one of u and d, one of f and b";
                Err(Error::invalid("axes", format!("\"{name}\": {rule}, such as rdf")))
            }
        }
    }

    /// Returns the matrix from these axes to axes that point to the right, up and back.
    fn to_canonical(self) -> DMat3 {
        let mut columns = self.name().chars().filter_map(direction);
        let mut next = || columns.next().unwrap_or_default();
        DMat3::from_cols(next(), next(), next())
    }

    /// Returns the direction that points up.
    #[must_use]
    pub fn up(self) -> DVec3 {
        self.to_canonical().transpose() * DVec3::Y
    }

    /// Returns the viewer's right.
    #[must_use]
    pub fn right(self) -> DVec3 {
        self.to_canonical().transpose() * DVec3::X
    }

    /// Returns the direction to the viewer, who looks towards the front.
    #[must_use]
    pub fn back(self) -> DVec3 {
        self.to_canonical().transpose() * DVec3::Z
    }

    /// Returns the rotation that turns coordinates in these axes to coordinates in others.
    #[must_use]
    pub fn rotation_to(self, other: Self) -> DMat3 {
        other.to_canonical().transpose() * self.to_canonical()
    }
}

/// Returns the letter of the opposite direction.
fn opposite(letter: char) -> char {
    match letter {
        'r' => 'l',
        'l' => 'r',
        'u' => 'd',
        'd' => 'u',
        'f' => 'b',
        'b' => 'f',
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_right_handed_axes() {
        for (i, axes) in Axes::ALL.into_iter().enumerate() {
            assert_eq!(Axes::named(&axes.name().to_uppercase()).unwrap(), axes.into());
            assert_eq!(axes.right().cross(axes.up()), axes.back(), "{axes:?}");
            assert!(!Axes::ALL[..i].contains(&axes));
        }
        assert_eq!(Axes::named("ruf").unwrap(), StoredAxes { axes: Axes::Luf, mirrored: true });
        assert_eq!(Axes::named("LDF").unwrap(), StoredAxes { axes: Axes::Rdf, mirrored: true });
        for wrong in ["", "r", "rrr", "rlu", "rub ", "xyz", "rubf", "rdé"] {
            assert!(Axes::named(wrong).unwrap_err().to_string().contains("such as rdf"), "{wrong}");
        }
    }

    #[test]
    fn stored_axes_have_names() {
        let names: Vec<String> = StoredAxes::names().collect();
        assert_eq!(names.len(), 48);
        for name in &names {
            let axes = Axes::named(name).unwrap();
            assert_eq!(axes.name(), *name);
            assert_eq!(axes.right_handed().is_ok(), !axes.mirrored, "{name}");
        }
        let why = Axes::named("ruf").unwrap().right_handed().unwrap_err().to_string();
        assert!(why.contains("such as luf"), "{why}");
    }

    #[test]
    fn axes_turn_into_each_other() {
        assert_eq!(Axes::Rdf.up(), DVec3::NEG_Y);
        assert_eq!(Axes::Rfu.up(), DVec3::Z);
        assert_eq!(Axes::Rfu.back(), DVec3::NEG_Y);
        assert_eq!(Axes::Rdf.rotation_to(Axes::Rub), DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)));
        assert_eq!(Axes::Rdf.rotation_to(Axes::Luf), DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)));
        for from in Axes::ALL {
            for to in Axes::ALL {
                let rotation = from.rotation_to(to);
                assert_eq!(rotation.determinant(), 1.0);
                let pairs = [(from.up(), to.up()), (from.right(), to.right()), (from.back(), to.back())];
                assert!(pairs.into_iter().all(|(from, to)| rotation * from == to), "{from:?} {to:?}");
            }
        }
    }
}
