//! The technique that a scene file asks for, with its options.

use std::fmt;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// A technique's name and options, as a scene file or a command line gives them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TechniqueChoice {
    /// The technique.
    pub name: String,
    /// Names and values of its options, in the order in which they were given.
    pub options: Vec<(String, String)>,
}

/// The limit on options of a technique.
const MAX_OPTIONS: usize = 64;

impl<'de> Deserialize<'de> for TechniqueChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Options;
        impl<'de> Visitor<'de> for Options {
            type Value = TechniqueChoice;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object with `name` and options")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<TechniqueChoice, A::Error> {
                use serde::de::Error;
                let (mut name, mut options) = (None, Vec::<(String, String)>::new());
                while let Some(key) = map.next_key::<String>()? {
                    if options.iter().any(|(other, _)| *other == key) || (key == "name" && name.is_some()) {
                        return Err(A::Error::custom(format!("duplicate field `{key}`")));
                    }
                    if key == "name" {
                        name = Some(map.next_value()?);
                    } else {
                        if options.len() == MAX_OPTIONS {
                            return Err(A::Error::custom(format!("more than {MAX_OPTIONS} options")));
                        }
                        options.push((key, map.next_value::<Plain>()?.0));
                    }
                }
                let name = name.ok_or_else(|| A::Error::missing_field("name"))?;
                Ok(TechniqueChoice { name, options })
            }
        }
        deserializer.deserialize_map(Options)
    }
}

/// A number, a string or a truth value, converted to text.
struct Plain(String);

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = Plain;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number, a string or a truth value")
            }

            fn visit_bool<E>(self, value: bool) -> Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_i64<E>(self, value: i64) -> Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_u64<E>(self, value: u64) -> Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_str<E>(self, value: &str) -> Result<Plain, E> {
                Ok(Plain(value.to_owned()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}
