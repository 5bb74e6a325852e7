//! Declarations of options. One declaration gives an option its field, default, allowed values, text and description.
//!
//! `words!` declares an enum whose values are words. `option_set!` declares a struct of options: the key of a field is its name, or
//! the one after `as`; its documentation is the effect that users read; a [`Rule`] says which values are allowed. Each set lists its
//! options as [`Entry`]s, from which parsing, printing, checks and descriptions follow.

use std::fmt;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::num;

/// The description of one option of a technique, as `volraster techniques` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct OptionInfo {
    /// Key.
    pub key: &'static str,
    /// Allowed words.
    pub words: Vec<&'static str>,
    /// Allowed numbers; `None` where only words are allowed.
    pub numbers: Option<Numbers>,
    /// Words and numbers as text.
    pub values: String,
    /// Value without the option.
    pub default: String,
    /// Effect on error and time.
    pub effect: &'static str,
}

/// The numbers that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum Numbers {
    /// Positive and finite numbers.
    Positive,
    /// Numbers from 0 to below 1.
    BelowOne,
    /// Numbers of an interval.
    Between {
        /// The lower end, which is allowed.
        least: f64,
        /// The upper end, which is allowed.
        most: f64,
    },
    /// Whole numbers of an interval.
    Whole {
        /// The lower end, which is allowed.
        least: u32,
        /// The upper end, which is allowed.
        most: u32,
    },
}

impl Numbers {
    fn contains(self, number: f64) -> bool {
        match self {
            Self::Positive => number.is_finite() && number > 0.0,
            Self::BelowOne => (0.0..1.0).contains(&number),
            Self::Between { least, most } => (least..=most).contains(&number),
            Self::Whole { least, most } => (f64::from(least)..=f64::from(most)).contains(&number),
        }
    }

    /// Returns text that reads back to a number; whole numbers have no exponent.
    fn text(self, number: f64) -> String {
        if matches!(self, Self::Whole { .. }) { number.to_string() } else { shortest(number) }
    }
}

/// Returns the shortest text that reads back to a number.
fn shortest(number: f64) -> String {
    let (plain, short) = (number.to_string(), format!("{number:e}"));
    if plain.len() <= short.len() { plain } else { short }
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Positive => write!(f, "a number that is positive and finite"),
            Self::BelowOne => write!(f, "a number from 0 to below 1"),
            Self::Between { least, most } => {
                write!(f, "a number from {} to {}", shortest(*least), shortest(*most))
            }
            Self::Whole { least, most } => write!(f, "a whole number from {least} to {most}"),
        }
    }
}

/// A type of values that options have.
pub(crate) trait Value: Copy + PartialEq + 'static {
    /// Words with their values.
    const WORDS: &'static [(&'static str, Self)] = &[];

    /// Returns the word of a value.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("?", |(word, _)| word)
    }

    /// Returns all words with their values.
    fn words() -> Vec<(&'static str, Self)> {
        Self::WORDS.to_vec()
    }

    /// Reads a number of any size.
    fn read(_text: &str) -> Option<Self> {
        None
    }

    /// Returns the value as a number; `None` if it is none.
    fn number(self) -> Option<f64> {
        None
    }

    /// Returns the value as the 32 bits that shaders read: the position of a word, a whole number, a float32; `None` if it is unset or no
    /// shader reads it.
    fn bits(self) -> Option<u32> {
        None
    }
}

impl Value for f64 {
    fn read(text: &str) -> Option<Self> {
        text.parse().ok()
    }

    fn number(self) -> Option<f64> {
        Some(self)
    }

    fn bits(self) -> Option<u32> {
        Some(num::f32_of(self).to_bits())
    }
}

impl Value for u32 {
    fn read(text: &str) -> Option<Self> {
        text.parse().ok()
    }

    fn number(self) -> Option<f64> {
        Some(self.into())
    }

    fn bits(self) -> Option<u32> {
        Some(self)
    }
}

impl<V: Value> Value for Option<V> {
    fn words() -> Vec<(&'static str, Self)> {
        V::words().into_iter().map(|(word, value)| (word, Some(value))).collect()
    }

    fn read(text: &str) -> Option<Self> {
        V::read(text).map(Some)
    }

    fn number(self) -> Option<f64> {
        self.and_then(V::number)
    }

    fn bits(self) -> Option<u32> {
        self.and_then(V::bits)
    }
}

/// The allowed values of an option, and how it is printed.
#[derive(Clone, Debug)]
pub(crate) struct Rule<V> {
    words: Vec<(&'static str, V)>,
    numbers: Option<Numbers>,
    default: &'static str,
    quiet: bool,
}

impl<V: Value> Rule<V> {
    /// Allows the words of the type.
    pub(crate) fn words() -> Self {
        Self { words: V::words(), numbers: None, default: "", quiet: false }
    }

    /// Allows the words of some values.
    pub(crate) fn only(values: &[V]) -> Self {
        Self { words: values.iter().map(|&value| (value.word(), value)).collect(), ..Self::words() }
    }

    /// Allows positive, finite numbers and the words of the type.
    pub(crate) fn positive() -> Self {
        Self { numbers: Some(Numbers::Positive), ..Self::words() }
    }

    /// Allows numbers from 0 to below 1.
    pub(crate) fn below_one() -> Self {
        Self { numbers: Some(Numbers::BelowOne), ..Self::words() }
    }

    /// Allows numbers of an interval.
    pub(crate) fn between([least, most]: [f64; 2]) -> Self {
        Self { numbers: Some(Numbers::Between { least, most }), ..Self::words() }
    }

    /// Allows whole numbers of an interval.
    pub(crate) fn whole(least: u32, most: u32) -> Self {
        Self { numbers: Some(Numbers::Whole { least, most }), ..Self::words() }
    }

    /// Allows one more word.
    pub(crate) fn or(mut self, word: &'static str, value: V) -> Self {
        self.words.push((word, value));
        self
    }

    /// Describes the default of an option that has no value until it is set.
    pub(crate) fn unset(self, default: &'static str) -> Self {
        Self { default, ..self }
    }

    /// Prints the option only where it differs from its default.
    pub(crate) fn quiet(self) -> Self {
        Self { quiet: true, ..self }
    }

    fn allows_number(&self, value: V) -> bool {
        self.numbers.zip(value.number()).is_some_and(|(numbers, number)| numbers.contains(number))
    }

    fn read(&self, text: &str) -> Option<V> {
        let word = self.words.iter().find(|(word, _)| *word == text).map(|(_, value)| *value);
        word.or_else(|| V::read(text).filter(|&value| self.allows_number(value)))
    }
}

/// Says whether a technique lists, hides or lacks an option of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// It is an option of the technique.
    Listed,
    /// The technique accepts it, but does not list or print it.
    Hidden,
    /// The technique does not have it.
    Absent,
}

/// One option of a set.
pub(crate) struct Entry<'a> {
    pub(crate) key: &'static str,
    pub(crate) effect: &'static str,
    pub(crate) words: Vec<&'static str>,
    pub(crate) numbers: Option<Numbers>,
    /// The value as text that reads back to it; `None` where it is unset.
    pub(crate) text: Option<String>,
    /// The value as shaders read it; `None` where it is unset.
    pub(crate) bits: Option<u32>,
    /// Reads a value; returns `false` if it is not allowed.
    pub(crate) set: Box<dyn FnMut(&str) -> bool + 'a>,
    /// Text of the default where it is unset.
    default: &'static str,
    quiet: bool,
    valid: bool,
    place: Place,
}

impl Entry<'_> {
    fn values(&self, before: &str, between: &str) -> String {
        let words = (!self.words.is_empty()).then(|| format!("{before}{}", self.words.join(between)));
        let numbers = self.numbers.map(|numbers| numbers.to_string());
        words.into_iter().chain(numbers).collect::<Vec<_>>().join(", or ")
    }

    fn refuse(&self, technique: &str, text: &str) -> Error {
        refused(technique, self.key, format!("{text}: must be {}", self.values("one of ", ", ")))
    }
}

/// Options that text can set.
pub(crate) trait OptionSet: Copy + Default {
    /// Lists the options with their values.
    fn entries(&mut self) -> Vec<Entry<'_>>;
}

/// Options as shaders read them.
pub(crate) trait OptionBits {
    /// Returns the value of an option as the 32 bits of a specialisation constant.
    fn bits(&self, technique: &str, key: &str) -> Result<u32>;
}

impl<T: OptionSet> OptionBits for T {
    fn bits(&self, technique: &str, key: &str) -> Result<u32> {
        let mut options = *self;
        let bits = options.entries().iter().find(|entry| entry.key == key).and_then(|entry| entry.bits);
        bits.ok_or_else(|| {
            refused(technique, key, "a shader reads it: it must be a declared option with a value")
        })
    }
}

/// A key and an effect.
pub(crate) type Text = [&'static str; 2];

/// How a field declares options.
pub(crate) trait Declare<T> {
    /// Appends the options of a field. `text` is its key and its documentation, which is the effect of an option.
    fn declare<'a>(self, text: Text, field: &'a mut T, entries: &mut Vec<Entry<'a>>);
}

impl<V: Value> Declare<V> for Rule<V> {
    fn declare<'a>(self, [key, effect]: Text, field: &'a mut V, entries: &mut Vec<Entry<'a>>) {
        let value = *field;
        let word_in =
            |words: &[(&'static str, V)]| words.iter().find(|(_, v)| *v == value).map(|(word, _)| *word);
        let word = word_in(&self.words);
        let number = self.numbers.zip(value.number()).map(|(numbers, number)| numbers.text(number));
        // A value that a program sets may have a word that this option does not allow.
        let text = word.or_else(|| word_in(&V::words())).map(str::to_string).or(number);
        entries.push(Entry {
            key,
            effect: effect.trim_start(),
            words: self.words.iter().map(|(word, _)| *word).collect(),
            numbers: self.numbers,
            valid: text.is_none() || word.is_some() || self.allows_number(value),
            text,
            bits: value.bits(),
            default: self.default,
            quiet: self.quiet,
            place: Place::Listed,
            set: Box::new(move |text| self.read(text).map(|value| *field = value).is_some()),
        });
    }
}

/// Declares the options of a field that is itself a set.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Group {
    /// Keys that the technique accepts, but does not list.
    pub(crate) hidden: &'static [&'static str],
    /// Keys that the technique does not have.
    pub(crate) absent: &'static [&'static str],
}

/// A set of which a technique has every option.
pub(crate) const GROUP: Group = Group { hidden: &[], absent: &[] };

impl<T: OptionSet> Declare<T> for Group {
    fn declare<'a>(self, _: Text, field: &'a mut T, entries: &mut Vec<Entry<'a>>) {
        let place = |key| match key {
            _ if self.absent.contains(&key) => Place::Absent,
            _ if self.hidden.contains(&key) => Place::Hidden,
            _ => Place::Listed,
        };
        entries.extend(field.entries().into_iter().map(|entry| Entry { place: place(entry.key), ..entry }));
    }
}

/// Declares an enum whose values are words.
macro_rules! words {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$of:meta])* $value:ident = $word:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$of])* $value,)* }

        impl $crate::technique::declare::Value for $name {
            const WORDS: &'static [(&'static str, Self)] = &[$(($word, Self::$value)),*];

            fn bits(self) -> Option<u32> {
                Some(self as u32)
            }
        }
    };
}

/// Declares a struct of options: `field as "key": type = default => rule`. The key is the name of the field unless given; the rule is
/// the words of the type unless given.
macro_rules! option_set {
    ($(#[$meta:meta])* pub struct $name:ident { $(
        $(#[doc = $doc:literal])* pub $field:ident $(as $key:literal)?: $type:ty = $default:expr $(=> $rule:expr)?,
    )* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::technique::declare::OptionSet for $name {
            fn entries(&mut self) -> Vec<$crate::technique::declare::Entry<'_>> {
                #[allow(unused_imports, reason = "a set may use few of the kinds of rules")]
                use $crate::technique::declare::{Declare as _, GROUP, Group, Rule};
                let mut entries = Vec::new();
                $(
                    let key = $crate::technique::declare::option_set!(@key $field $($key)?);
                    let rule = $crate::technique::declare::option_set!(@rule $($rule)?);
                    rule.declare([key, concat!($($doc),*)], &mut self.$field, &mut entries);
                )*
                entries
            }
        }
    };
    (@key $field:ident) => { stringify!($field) };
    (@key $field:ident $key:literal) => { $key };
    (@rule) => { $crate::technique::declare::Rule::words() };
    (@rule $rule:expr) => { $rule };
}

pub(crate) use {option_set, words};

/// Makes the error of a value.
pub(crate) fn refused(technique: &str, key: &str, why: impl Into<String>) -> Error {
    Error::invalid(format!("{technique} option {key}"), why)
}

/// Describes the options that the technique lists.
pub(crate) fn infos<T: OptionSet>() -> Vec<OptionInfo> {
    described::<T>(|place| place == Place::Listed)
}

/// Describes the options that text can set, also those that the technique does not list.
#[cfg(feature = "io")]
pub(crate) fn accepted<T: OptionSet>() -> Vec<OptionInfo> {
    described::<T>(|place| place != Place::Absent)
}

fn described<T: OptionSet>(is_wanted: impl Fn(Place) -> bool) -> Vec<OptionInfo> {
    let mut options = T::default();
    let listed = options.entries().into_iter().filter(|entry| is_wanted(entry.place));
    let info = |entry: Entry<'_>| OptionInfo {
        key: entry.key,
        values: entry.values("", "|"),
        default: entry.text.unwrap_or_else(|| entry.default.to_string()),
        effect: entry.effect,
        words: entry.words,
        numbers: entry.numbers,
    };
    listed.map(info).collect()
}

/// Returns the options as text that [`set`] reads back to them.
pub(crate) fn pairs<T: OptionSet>(options: &T) -> Vec<(&'static str, String)> {
    let (mut options, mut usual) = (*options, T::default());
    let entries = options.entries().into_iter().zip(usual.entries());
    let printed = entries
        .filter(|(entry, usual)| entry.place == Place::Listed && !(entry.quiet && entry.text == usual.text));
    printed.filter_map(|(entry, _)| Some((entry.key, entry.text?))).collect()
}

/// Sets one option from text.
pub(crate) fn set<T: OptionSet>(options: &mut T, technique: &str, key: &str, text: &str) -> Result<()> {
    let mut entries = options.entries();
    let known = |entry: &&mut Entry<'_>| entry.key == key && entry.place != Place::Absent;
    let Some(entry) = entries.iter_mut().find(known) else {
        let listed = entries.iter().filter(|entry| entry.place == Place::Listed);
        let keys = listed.map(|entry| entry.key).collect::<Vec<_>>().join(", ");
        return Err(Error::invalid(
            format!("{technique} option \"{key}\""),
            format!("must be one of {keys}"),
        ));
    };
    if (entry.set)(text) { Ok(()) } else { Err(entry.refuse(technique, &format!("\"{text}\""))) }
}

/// Checks each value, which a program may have set.
pub(crate) fn check<T: OptionSet>(options: &T, technique: &str) -> Result<()> {
    let (mut options, mut usual) = (*options, T::default());
    for (entry, usual) in options.entries().into_iter().zip(usual.entries()) {
        if entry.place == Place::Absent && entry.text != usual.text {
            return Err(refused(technique, entry.key, format!("{technique} has no such option")));
        }
        if let (false, Some(text)) = (entry.valid, &entry.text) {
            return Err(entry.refuse(technique, text));
        }
    }
    Ok(())
}
