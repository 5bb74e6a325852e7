//! The frame of a report: an HTML page that is a single file, works offline, and needs a script only for sorting tables.

use std::fmt::Write as _;

use super::markup::escape_xml;

const STYLE: &str = include_str!("report.css");

const SCRIPT: &str = include_str!("report.js");

/// Returns a page with a title, names and values at its head, and a body of HTML.
pub(crate) fn page(title: &str, facts: &[(&'static str, String)], body: &str) -> String {
    let mut out = String::new();
    let title = escape_xml(title);
    // Writing into a string cannot fail.
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n<style>{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<dl class=\"facts\">\n"
    );
    for (name, value) in facts {
        let _ = writeln!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escape_xml(name), escape_xml(value));
    }
    let _ =
        write!(out, "</dl>\n</header>\n<main>\n{body}</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n");
    out
}
