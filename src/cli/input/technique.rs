//! Techniques and their options as the command line names them, and as text and JSON.

use serde_json::{Map, Value};
use volraster::scene::Data;
use volraster::technique::Method;
use volraster::{Error, Result, Technique};

/// An entry of a list of techniques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    /// `all`: every technique by every route.
    All,
    /// One technique.
    One(Request),
}

/// A technique as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request {
    /// The technique, with defaults for options that are not given.
    pub(crate) technique: Technique,
    /// Whether no option is given.
    pub(crate) bare: bool,
}

impl Request {
    /// Parses `NAME[:key=value,...]`.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        let technique = Technique::parse(text)?;
        let options = text.split_once(':').map_or("", |(_, options)| options);
        let keys: Vec<&str> =
            options.split(',').filter_map(|pair| Some(pair.split_once('=')?.0.trim())).collect();
        if let Some((_, key)) = keys.iter().enumerate().find(|(i, key)| keys[..*i].contains(key)) {
            let what = format!("{} option {key}", technique.method().name());
            return Err(Error::Invalid { what, why: "given twice".to_string() });
        }
        Ok(Self { technique, bare: !text.contains(':') })
    }
}

impl Wanted {
    /// Parses a list separated by `;` or `,`. A part with `=` and without `:` is an option of the technique before
    /// it.
    pub(crate) fn parse_list(text: &str) -> Result<Vec<Self>> {
        let mut words: Vec<String> = Vec::new();
        for part in text.split(';') {
            let first = words.len();
            for word in part.split(',').map(str::trim).filter(|word| !word.is_empty()) {
                match words.get_mut(first..).and_then(<[String]>::last_mut) {
                    Some(last) if word.contains('=') && !word.contains(':') => {
                        last.push(if last.contains(':') { ',' } else { ':' });
                        last.push_str(word);
                    }
                    _ => words.push(word.to_string()),
                }
            }
        }
        if words.is_empty() {
            let why = format!("\"{text}\": must name at least one technique");
            return Err(Error::Invalid { what: "techniques".to_string(), why });
        }
        let read =
            |word: &String| if word == "all" { Ok(Self::All) } else { Request::parse(word).map(Self::One) };
        words.iter().map(read).collect()
    }
}

/// Returns a technique with options `given`, of which `more` are replaced or added.
pub(crate) fn with_options(
    method: Method,
    given: &[(String, String)],
    more: &[(&str, &str)],
) -> Result<Technique> {
    let mut options: Vec<(String, String)> =
        given.iter().filter(|(key, _)| !more.iter().any(|(k, _)| k == key)).cloned().collect();
    options.extend(more.iter().map(|(key, value)| ((*key).to_string(), (*value).to_string())));
    Technique::new(method, &options)
}

/// Returns a technique with a route and options as [`with_options`]. Techniques with a single route may lack the
/// option `route`.
pub(crate) fn by_route(
    method: Method,
    route: &str,
    given: &[(String, String)],
    more: &[(&str, &str)],
) -> Result<Technique> {
    let named = method.options().iter().any(|info| info.key == "route");
    let route = named.then_some(("route", route));
    with_options(method, given, &more.iter().copied().chain(route).collect::<Vec<_>>())
}

/// Returns the options as JSON; numbers and booleans keep their type.
pub(crate) fn options_json(technique: &Technique) -> Value {
    let typed = |text: String| match serde_json::from_str(&text) {
        Ok(value @ (Value::Number(_) | Value::Bool(_))) => value,
        _ => Value::String(text),
    };
    let pairs = technique.option_pairs().into_iter();
    Value::Object(pairs.map(|(key, text)| (key.to_string(), typed(text))).collect::<Map<_, _>>())
}

/// Returns the options that differ from their defaults, as `key=value,...`, without `route`, which tables show in a
/// column of its own.
pub(crate) fn options_text(technique: &Technique) -> String {
    let shown = technique.changed().into_iter().filter(|(key, _)| *key != "route");
    shown.map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(",")
}

/// Maximum number of samples that `all` and the suites draw by splatting if the scene has no kernels. Other
/// techniques draw the same field in a hundredth of the time.
const MAX_SPLATS: u64 = 1 << 18;

/// Returns why a technique is skipped for data without kernels: splatting would take too long.
pub(crate) fn too_many_splats(method: Method, data: &Data) -> Option<String> {
    let Data::Grid(grid) = data else { return None };
    let count: u64 = grid.dims().into_iter().map(u64::from).product();
    (method == Method::SplatSheets && count > MAX_SPLATS).then(|| {
        format!("{count} samples without kernels: by default splatted only up to {MAX_SPLATS} samples")
    })
}

/// Returns whether an error only means that a technique does not support this device or scene.
pub(crate) fn is_refusal(error: &Error) -> bool {
    matches!(error, Error::Invalid { .. } | Error::Unsupported { .. } | Error::Memory { .. })
}

/// Lists every technique with each of its routes.
pub(crate) fn all_routes() -> impl Iterator<Item = (Method, &'static str)> {
    Method::ALL.into_iter().flat_map(|method| method.routes().iter().map(move |&route| (method, route)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_techniques_split_at_semicolons_and_names() {
        let text = |wanted: &Wanted| match wanted {
            Wanted::All => "all".to_string(),
            Wanted::One(request) => format!("{}{}", request.bare, options_text(&request.technique)),
        };
        let texts =
            |list: &str| -> Vec<String> { Wanted::parse_list(list).unwrap().iter().map(text).collect() };
        assert_eq!(texts("all, slices-3d:step=2"), ["all", "falsestep=2"]);
        assert_eq!(texts("slices-3d"), ["true"]);
        assert_eq!(
            texts("slices-3d,slices-3d:step=0.5,filter=exact,slices-3d"),
            ["true", "falsestep=0.5,filter=exact", "true"]
        );
        assert_eq!(texts("slices-3d:step=2;slices-3d"), ["falsestep=2", "true"]);
        let why = |list: &str| Wanted::parse_list(list).unwrap_err().to_string();
        assert!(why(";,").contains("at least one"));
        assert!(why("step=1").contains("step=1"));
        assert!(why("slices-3d;step=1").contains("step=1"));
    }

    #[test]
    fn options_keep_their_types() {
        let technique = Technique::parse("slices-3d:step=0.5").unwrap();
        let json = options_json(&technique);
        assert_eq!(json["step"], 0.5);
        assert_eq!(json["filter"], "hardware");
        let changed =
            with_options(technique.method(), &[("step".into(), "4".into())], &[("step", "2")]).unwrap();
        assert_eq!(options_json(&changed)["step"], 2.0);
    }
}
