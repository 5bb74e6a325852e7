//! `docs/EXTREMES.md`: the cases, and what refuses them.

use std::collections::BTreeSet;
use std::path::Path;

use volraster::technique::Method;

use crate::extremes::catalogue::{Family, Outcome, Refusal, Results, Who};

const HEAD: &str = "\
# Numerical extremes

This catalogue lists numerical extremes and the errors that the library must stay within. `tests/device/extremes/` runs every case
with every technique that supports the data, by every route that the device offers, with every integrator. A technique may
refuse a case with an error; a wrong image fails the test. The tests generate this file:
`VOLRASTER_WRITE_EXTREMES=1 tools/test.sh --all -- the_document` writes it. Without the variable, the test fails if the
file differs.

Numbers identify rows. Rows 5.x are changes that must not change the image; c and s are clipping and surfaces, g trained splats.
`t32(N) = max(2e-6, 1.2e-7 N)` is an absolute tolerance for N blended pieces of values in [0, 1]; od is optical depth. The
source of each case derives its tolerance. The catalogue omits rows on features that the project does not have (refined
grids, shading), and pixels whose centre lies within 1/64 pixel of a cube's outline.

`splat-sheets` renders the trilinear field of a grid, as slices do. `splat-ewa` renders grids and meshes as Gaussians. That is
another field, which blurs and extends beyond a mesh, so `splat-ewa` takes part only where a closed form still predicts its
result. Rows on splats run with every order of both techniques, from points.
";

const REFUSED: &str = "\
## Refusals

These requests are refused, with the error shown. \"device\" means that another device may accept the case or refuse it with
another error; numbers are left out.

| case | refused by | device | error |
|---|---|---|---|
";

/// One refusal of one technique by one route.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Row {
    case: String,
    who: String,
    route: &'static str,
    device: bool,
    text: String,
}

fn row(case: &str, refusal: &Refusal) -> Row {
    let (who, route) = match refusal.who {
        Who::Part(part) => (part, ""),
        Who::Technique(method, route) => (method.name(), route),
    };
    let mut text = refusal.text.replace('|', "\\|");
    if refusal.device {
        // A number as one sign: it is the device's.
        let mut masked = String::new();
        for (i, word) in text.split(' ').enumerate() {
            let number = word.starts_with(|c: char| c.is_ascii_digit());
            let rest = word.trim_start_matches(|c: char| c.is_ascii_digit());
            masked.push_str(if i > 0 { " " } else { "" });
            masked.push_str(if number { "…" } else { "" });
            masked.push_str(if number { rest } else { word });
        }
        text = masked;
    }
    Row { case: case.to_string(), who: who.to_string(), route, device: refusal.device, text }
}

/// The refusals of a case, techniques and routes of the same words in one line.
fn lines(rows: &[Row], offered: &[(Method, &'static str)]) -> Vec<String> {
    let mut texts: Vec<(&str, bool)> = Vec::new();
    for row in rows.iter().filter(|row| !row.text.is_empty()) {
        if !texts.contains(&(&row.text, row.device)) {
            texts.push((&row.text, row.device));
        }
    }
    let line = |&(text, device): &(&str, bool)| {
        let same: Vec<&Row> = rows.iter().filter(|row| row.text == text && row.device == device).collect();
        let mut names: Vec<String> = Vec::new();
        for row in &same {
            let routes = offered.iter().filter(|(method, _)| method.name() == row.who);
            let all = routes
                .into_iter()
                .all(|(_, route)| same.iter().any(|r| r.who == row.who && r.route == *route));
            let name = if all || row.route.is_empty() {
                row.who.clone()
            } else {
                format!("{}/{}", row.who, row.route)
            };
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let device = if device { "device" } else { "" };
        format!("| {} | {} | {device} | {text} |", rows[0].case, names.join(", "))
    };
    texts.iter().map(line).collect()
}

fn cases(all: &[(&Family, &Results)]) -> String {
    let mut text = String::new();
    for (family, results) in all {
        text.push_str(&format!(
            "\n## {}\n\n| number | case | data | expected | tolerance |\n|---|---|---|---|---|\n",
            family.name[..1].to_uppercase() + &family.name[1..]
        ));
        for (case, outcome) in family.cases.iter().zip(&results.cases) {
            let kinds: Vec<&str> = outcome.kinds.iter().copied().collect();
            text.push_str(&format!(
                "| {} | {} | {} | {} | {} |\n",
                case.number,
                case.name,
                kinds.join(", "),
                case.expect.replace('|', "\\|"),
                case.tolerance
            ));
        }
    }
    text
}

/// Compares the document with what happened; writes it where the environment asks for it.
pub fn check(all: &[(&Family, &Results)]) {
    let offered = &all[0].1.offered;
    let outcomes = all.iter().flat_map(|(family, results)| family.cases.iter().zip(&results.cases));
    let rows_of = |number: &str, outcome: &Outcome| -> Vec<Row> {
        outcome.refusals.iter().map(|refusal| row(number, refusal)).collect()
    };
    let rows: Vec<Vec<Row>> = outcomes.map(|(case, outcome)| rows_of(case.number, outcome)).collect();
    let table = rows.iter().flat_map(|rows| lines(rows, offered)).collect::<Vec<String>>().join("\n");
    let cases = cases(all);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/EXTREMES.md");
    if std::env::var_os("VOLRASTER_WRITE_EXTREMES").is_some() {
        std::fs::write(&path, format!("{HEAD}{cases}\n{REFUSED}{table}\n")).unwrap();
        return;
    }
    let document = std::fs::read_to_string(&path).unwrap();
    let remake = "VOLRASTER_WRITE_EXTREMES=1 tools/test.sh --all -- the_document writes it";
    assert!(
        document.starts_with(&format!("{HEAD}{cases}\n{REFUSED}")),
        "docs/EXTREMES.md lists other cases; {remake}"
    );

    // Each line by each technique, and by each route of those that refuse by one alone.
    let written: Vec<[&str; 4]> = document
        .split_once(REFUSED)
        .map_or("", |parts| parts.1)
        .lines()
        .filter_map(|line| {
            line.strip_prefix("| ")?.strip_suffix(" |")?.splitn(4, " | ").collect::<Vec<_>>().try_into().ok()
        })
        .collect();
    let happened: BTreeSet<&Row> = rows.iter().flatten().collect();
    let names = |row: &Row| [row.who.clone(), format!("{}/{}", row.who, row.route)];
    for row in &happened {
        let told = written.iter().any(|[case, who, device, text]| {
            // On another device a refusal may be for another reason.
            let same =
                if row.device { *device == "device" } else { device.trim().is_empty() && *text == row.text };
            *case == row.case && same && who.split(", ").any(|who| names(row).iter().any(|name| name == who))
        });
        assert!(told, "docs/EXTREMES.md does not list {row:?}; {remake}");
    }
    for [case, who, device, text] in written {
        for who in who.split(", ").filter(|_| device.trim().is_empty()) {
            let (name, route) = who.split_once('/').unwrap_or((who, ""));
            let here = offered
                .iter()
                .filter(|(method, r)| method.name() == name && (route.is_empty() || route == *r));
            let mut routes: Vec<&str> = here.map(|(_, route)| *route).collect();
            if !Method::ALL.iter().any(|method| method.name() == name) {
                routes.push("");
            }
            for route in routes {
                let happens = happened
                    .iter()
                    .any(|row| row.case == case && row.who == name && row.route == route && row.text == text);
                assert!(
                    happens,
                    "docs/EXTREMES.md lists what does not happen: {case} {who} {text}; {remake}"
                );
            }
        }
    }
}
