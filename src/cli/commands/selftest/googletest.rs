//! The protocol of googletest: its flags, its lines on stdout and its reports, for runners of tests that expect a googletest program.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use humantime::format_rfc3339_seconds;
use serde_json::{Value, json};
use volraster::Result;
use volraster::io::{check_writable, write_text};

use super::cases::{Done, Status};
use super::listener::{Listener, Place};
use crate::cli::markup::escape_xml;
use crate::cli::numbers::counted;
use crate::cli::output::{invalid, print};

/// Flags of a googletest program. Any of them, or a number of shards in the environment, selects the protocol.
#[derive(Debug, clap::Args)]
#[command(rename_all = "snake_case", next_help_heading = "The protocol of googletest")]
pub(super) struct Flags {
    /// List the tests as googletest programs do, and run none.
    #[arg(long)]
    gtest_list_tests: bool,
    /// Run tests whose names match: patterns with * and ?, separated by colons; after a minus, those to leave out.
    #[arg(long, value_name = "PATTERNS", env = "GTEST_FILTER", hide_env = true)]
    gtest_filter: Option<String>,
    /// Write a report as googletest does: json:FILE or xml:FILE.
    #[arg(long, value_name = "FORM:FILE", env = "GTEST_OUTPUT", hide_env = true)]
    gtest_output: Option<String>,
    /// Is accepted from runners; the lines have no colours.
    #[arg(long, value_name = "yes|no|auto")]
    gtest_color: Option<String>,
}

/// A form of googletest's report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Json,
    Xml,
}

impl Flags {
    /// Returns the requested run; `None` unless a flag or the environment asks for the protocol.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`](volraster::Error::Invalid) for a report of another form and for numbers of shards that make no sense.
    pub(super) fn request(&self) -> Result<Option<Request>> {
        let shard = Shard::of_environment()?;
        let is_asked = self.gtest_list_tests
            || self.gtest_filter.is_some()
            || self.gtest_output.is_some()
            || self.gtest_color.is_some();
        if !is_asked && shard.is_none() {
            return Ok(None);
        }
        let report = self.gtest_output.as_deref().map(report_of).transpose()?;
        let filter = self.gtest_filter.clone().unwrap_or_else(|| "*".to_string());
        Ok(Some(Request { list: self.gtest_list_tests, filter, shard, report }))
    }
}

/// Reads `json:FILE`, `xml:FILE`, or the form alone, with googletest's default name. A path that ends in a slash is a folder.
fn report_of(text: &str) -> Result<(Form, PathBuf)> {
    let (form, path) = text.split_once(':').unwrap_or((text, ""));
    let form = match form {
        "json" => Form::Json,
        "xml" => Form::Xml,
        _ => return Err(invalid("--gtest_output", format!("\"{text}\": must be json:FILE or xml:FILE"))),
    };
    let ending = if form == Form::Json { "json" } else { "xml" };
    let path = match path {
        "" => format!("test_detail.{ending}"),
        folder if folder.ends_with('/') => format!("{folder}volraster.{ending}"),
        file => file.to_string(),
    };
    Ok((form, path.into()))
}

/// One of several processes that share the tests.
#[derive(Clone, Copy, Debug)]
struct Shard {
    index: usize,
    total: usize,
}

impl Shard {
    /// Reads googletest's environment variables, and creates the file by which a program tells that it heeds them.
    fn of_environment() -> Result<Option<Self>> {
        if let Some(path) = std::env::var_os("GTEST_SHARD_STATUS_FILE") {
            std::fs::write(&path, "").map_err(crate::cli::output::unwritable(Path::new(&path)))?;
        }
        let [total, index] = ["GTEST_TOTAL_SHARDS", "GTEST_SHARD_INDEX"].map(|name| std::env::var(name).ok());
        if total.is_none() && index.is_none() {
            return Ok(None);
        }
        let number = |text: &Option<String>| text.as_ref().and_then(|text| text.parse::<usize>().ok());
        match (number(&total), number(&index)) {
            (Some(total), Some(index)) if index < total => Ok(Some(Self { index, total })),
            _ => {
                let [total, index] = [total, index].map(|text| text.unwrap_or_else(|| "missing".to_string()));
                let why = format!(
                    "is {total} with GTEST_SHARD_INDEX {index}: must be a number, and the index below it"
                );
                Err(invalid("GTEST_TOTAL_SHARDS", why))
            }
        }
    }
}

/// A run that speaks the protocol.
#[derive(Debug)]
pub(super) struct Request {
    list: bool,
    filter: String,
    shard: Option<Shard>,
    report: Option<(Form, PathBuf)>,
}

impl Request {
    /// Returns whether tests are listed only.
    pub(super) fn lists(&self) -> bool {
        self.list
    }

    /// Selects cases by name, in their order: those that the filter takes, and of these the shard's.
    pub(super) fn select<'a>(&self, names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
        let taken = names.filter(|name| matches_filter(&self.filter, &test_name(name)));
        let here = |place: usize| self.shard.is_none_or(|shard| place % shard.total == shard.index);
        taken.enumerate().filter(|(place, _)| here(*place)).map(|(_, name)| name).collect()
    }

    /// Checks that the report can be written, and begins the protocol of a run.
    pub(super) fn begin(self, selected: &[&str]) -> Result<Protocol> {
        if let Some((_, path)) = &self.report {
            check_writable(path)?;
        }
        let suites = suites(selected).into_iter().map(|(suite, tests)| (suite, tests.len())).collect();
        let protocol =
            Protocol { request: self, suites, told: Vec::new(), begin: (Instant::now(), SystemTime::now()) };
        if protocol.request.filter != "*" {
            print(&format!("Note: Google Test filter = {}", protocol.request.filter))?;
        }
        if let Some(Shard { index, total }) = protocol.request.shard {
            print(&format!("Note: This is test shard {} of {total}.", index + 1))?;
        }
        print(&format!("[==========] Running {}.", protocol.counts()))?;
        print("[----------] Global test environment set-up.")?;
        Ok(protocol)
    }
}

/// Prints the names as `--gtest_list_tests` does.
pub(super) fn list(selected: &[&str]) -> Result<()> {
    for (suite, tests) in suites(selected) {
        print(&format!("{suite}."))?;
        for test in tests {
            print(&format!("  {test}"))?;
        }
    }
    Ok(())
}

/// Returns the name of a case as a test: `draw/slabs:route=compute,step=0.5` is `draw.slabs/route_compute/step_0_5`. Filters and lists
/// of runners give a meaning to dots, colons, commas and minus signs.
fn test_name(case: &str) -> String {
    let is_limit = case.starts_with("limits/");
    let (suite, test) =
        if is_limit { case.rsplit_once('/') } else { case.split_once('/') }.unwrap_or(("", case));
    let plain = |text: &str, of_slash: char| -> String {
        text.chars()
            .map(|c| match c {
                '/' => of_slash,
                ':' | ',' | '@' => '/',
                c if c.is_ascii_alphanumeric() => c,
                _ => '_',
            })
            .collect()
    };
    format!("{}.{}", plain(suite, '_'), plain(test, '/'))
}

/// Groups the tests of cases by suite, in their order.
fn suites(cases: &[&str]) -> Vec<(String, Vec<String>)> {
    let mut suites: Vec<(String, Vec<String>)> = Vec::new();
    for case in cases {
        let name = test_name(case);
        let (suite, test) = name.split_once('.').unwrap_or(("", &name));
        match suites.last_mut() {
            Some((last, tests)) if last == suite => tests.push(test.to_string()),
            _ => suites.push((suite.to_string(), vec![test.to_string()])),
        }
    }
    suites
}

/// Returns whether a filter takes a name: one of its patterns matches, and none of those after the first minus does.
fn matches_filter(filter: &str, name: &str) -> bool {
    let (taken, left_out) = filter.split_once('-').unwrap_or((filter, ""));
    let any = |patterns: &str| {
        patterns.split(':').any(|pattern| matches_pattern(pattern.as_bytes(), name.as_bytes()))
    };
    (taken.is_empty() || any(taken)) && !any(left_out)
}

/// Matches a pattern with `*` and `?` and the whole of a name. Every star first takes nothing; where the rest fails, the last star takes
/// one more character.
fn matches_pattern(pattern: &[u8], name: &[u8]) -> bool {
    let (mut p, mut n, mut star) = (0, 0, None);
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == b'?' || c == name[n] => (p, n) = (p + 1, n + 1),
            _ => match star {
                Some((at, taken)) => {
                    star = Some((at, taken + 1));
                    (p, n) = (at + 1, taken + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == b'*')
}

/// A run in progress: prints googletest's lines, and writes its report at the end.
#[derive(Debug)]
pub(super) struct Protocol {
    request: Request,
    /// The suites and the numbers of their selected tests.
    suites: Vec<(String, usize)>,
    /// What ended, with suite and test.
    told: Vec<Told>,
    begin: (Instant, SystemTime),
}

#[derive(Debug)]
struct Told {
    suite: String,
    test: String,
    status: Status,
    ms: f64,
    end: SystemTime,
    text: String,
}

impl Told {
    fn name(&self) -> String {
        format!("{}.{}", self.suite, self.test)
    }

    fn timestamp(&self) -> String {
        timestamp(self.end.checked_sub(Duration::from_secs_f64(self.ms / 1e3)).unwrap_or(self.end))
    }
}

impl Listener for Protocol {
    fn place(&mut self, place: &Place<'_>) -> Result<()> {
        place.lines().iter().try_for_each(|line| print(line))
    }

    fn begins(&mut self, case: &str) -> Result<()> {
        let name = test_name(case);
        let suite = name.split('.').next().unwrap_or_default();
        if self.told.last().is_none_or(|told| told.suite != suite) {
            self.end_suite()?;
            let count = self.suites.iter().find(|(known, _)| known == suite).map_or(1, |(_, count)| *count);
            print(&format!("[----------] {} from {suite}", counted(count, "test")))?;
        }
        print(&format!("[ RUN      ] {name}"))
    }

    fn ends(&mut self, done: &Done) -> Result<()> {
        let name = test_name(&done.name);
        let (suite, test) = name.split_once('.').unwrap_or(("", &name));
        let text = std::iter::once(&done.detail).chain(&done.messages).map(|line| line.trim_end());
        let text = text.collect::<Vec<_>>().join("\n");
        let status = match done.status {
            Status::Ok => "[       OK ]",
            Status::Fail => "[  FAILED  ]",
            Status::Skip => "[  SKIPPED ]",
        };
        if done.status != Status::Ok {
            // Runners take a word in brackets for the result.
            print(&text.replace('[', "(").replace(']', ")"))?;
        }
        print(&format!("{status} {name} ({:.0} ms)", done.ms))?;
        let (suite, test) = (suite.to_string(), test.to_string());
        self.told.push(Told { suite, test, status: done.status, ms: done.ms, end: SystemTime::now(), text });
        Ok(())
    }
}

impl Protocol {
    /// Prints the line that ends a suite.
    fn end_suite(&self) -> Result<()> {
        let Some(last) = self.told.last() else { return Ok(()) };
        let of_suite = || self.told.iter().filter(|told| told.suite == last.suite);
        let ms: f64 = of_suite().map(|told| told.ms).sum();
        print(&format!(
            "[----------] {} from {} ({ms:.0} ms total)\n",
            counted(of_suite().count(), "test"),
            last.suite
        ))
    }

    /// Prints the results and writes the report.
    pub(super) fn end(self) -> Result<()> {
        self.end_suite()?;
        let ms = self.begin.0.elapsed().as_millis();
        print("[----------] Global test environment tear-down")?;
        print(&format!("[==========] {} ran. ({ms} ms total)", self.counts()))?;
        let of = |status: Status| self.told.iter().filter(move |told| told.status == status);
        print(&format!("[  PASSED  ] {}.", counted(of(Status::Ok).count(), "test")))?;
        for (status, word) in [(Status::Skip, "[  SKIPPED ]"), (Status::Fail, "[  FAILED  ]")] {
            if of(status).count() > 0 {
                print(&format!("{word} {}, listed below:", counted(of(status).count(), "test")))?;
                of(status).try_for_each(|told| print(&format!("{word} {}", told.name())))?;
            }
        }
        match &self.request.report {
            Some((Form::Json, path)) => write_text(path, &format!("{:#}\n", self.json())),
            Some((Form::Xml, path)) => write_text(path, &self.xml()),
            None => Ok(()),
        }
    }

    fn counts(&self) -> String {
        let count: usize = self.suites.iter().map(|(_, count)| count).sum();
        format!("{} from {}", counted(count, "test"), counted(self.suites.len(), "test suite"))
    }

    /// Returns the results by suite, in the order in which suites began.
    fn by_suite(&self) -> Vec<(&str, Vec<&Told>)> {
        let mut known = BTreeSet::new();
        let names = self.told.iter().map(|told| told.suite.as_str()).filter(|suite| known.insert(*suite));
        names.map(|suite| (suite, self.told.iter().filter(|told| told.suite == suite).collect())).collect()
    }

    fn json(&self) -> Value {
        let test = |told: &&Told| {
            let result = if told.status == Status::Skip { "SKIPPED" } else { "COMPLETED" };
            let mut value = json!({
                "name": told.test, "status": "RUN", "result": result, "timestamp": told.timestamp(), "time": seconds(told.ms) + "s",
                "classname": told.suite,
            });
            match told.status {
                Status::Ok => {}
                Status::Skip => value["skipped"] = json!([{ "message": told.text }]),
                Status::Fail => value["failures"] = json!([{ "failure": told.text, "type": "" }]),
            }
            value
        };
        let head = |told: &[&Told], time: f64, begin: String| {
            json!({
                "tests": told.len(), "failures": failures(told), "disabled": 0, "errors": 0, "timestamp": begin,
                "time": seconds(time) + "s",
            })
        };
        let suite = |(name, told): (&str, Vec<&Told>)| {
            let begin = told.first().map_or_else(String::new, |first| first.timestamp());
            let mut value = json!({ "name": name });
            merge(&mut value, head(&told, told.iter().map(|told| told.ms).sum(), begin));
            value["testsuite"] = told.iter().map(test).collect();
            value
        };
        let all: Vec<&Told> = self.told.iter().collect();
        let mut value = head(&all, self.begin.0.elapsed().as_secs_f64() * 1e3, timestamp(self.begin.1));
        value["name"] = json!("AllTests");
        value["testsuites"] = self.by_suite().into_iter().map(suite).collect();
        value
    }

    fn xml(&self) -> String {
        let mut lines = vec![r#"<?xml version="1.0" encoding="UTF-8"?>"#.to_string()];
        let all: Vec<&Told> = self.told.iter().collect();
        lines.push(format!(
            r#"<testsuites tests="{}" failures="{}" disabled="0" errors="0" time="{}" timestamp="{}" name="AllTests">"#,
            all.len(),
            failures(&all),
            seconds(self.begin.0.elapsed().as_secs_f64() * 1e3),
            timestamp(self.begin.1)
        ));
        for (suite, told) in self.by_suite() {
            lines.push(format!(
                r#"  <testsuite name="{suite}" tests="{}" failures="{}" disabled="0" skipped="{}" errors="0" time="{}" timestamp="{}">"#,
                told.len(),
                failures(&told),
                told.iter().filter(|told| told.status == Status::Skip).count(),
                seconds(told.iter().map(|told| told.ms).sum()),
                told.first().map_or_else(String::new, |first| first.timestamp())
            ));
            for told in told {
                let result = if told.status == Status::Skip { "skipped" } else { "completed" };
                let text = escape_xml(&told.text).replace('\n', "&#10;");
                let inside = match told.status {
                    Status::Ok => "/>".to_string(),
                    Status::Skip => format!(">\n      <skipped message=\"{text}\"/>\n    </testcase>"),
                    Status::Fail => {
                        format!(">\n      <failure message=\"{text}\" type=\"\"/>\n    </testcase>")
                    }
                };
                lines.push(format!(
                    r#"    <testcase name="{}" status="run" result="{result}" time="{}" timestamp="{}" classname="{suite}"{inside}"#,
                    told.test,
                    seconds(told.ms),
                    told.timestamp()
                ));
            }
            lines.push("  </testsuite>".to_string());
        }
        lines.push("</testsuites>\n".to_string());
        lines.join("\n")
    }
}

/// Adds the members of one object to another.
fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}

fn failures(told: &[&Told]) -> usize {
    told.iter().filter(|told| told.status == Status::Fail).count()
}

fn seconds(ms: f64) -> String {
    format!("{:.3}", ms / 1e3)
}

fn timestamp(time: SystemTime) -> String {
    format_rfc3339_seconds(time).to_string()
}

#[cfg(test)]
mod tests {
    use super::super::catalogue::names;
    use super::*;

    #[test]
    fn filters_are_those_of_googletest() {
        let takes = |filter: &str| matches_filter(filter, "draw.slabs/step_0_5");
        for filter in ["*", "draw.*", "*.slabs*", "d?aw.*5", "x.y:draw.*", "-x.*", "draw.*-*raster", "**5"] {
            assert!(takes(filter), "{filter}");
        }
        for filter in ["", "draw", "draw.slabs", "x.*", "*-draw.*", "-*0_5", "draw.*-x:*slabs*", "?", "*-"] {
            assert_eq!(takes(filter), matches!(filter, "" | "*-"), "{filter}");
        }
    }

    #[test]
    fn tests_have_names_that_runners_can_take() {
        assert_eq!(test_name("draw/slabs:route=compute,step=0.5@u8"), "draw.slabs/route_compute/step_0_5/u8");
        assert_eq!(test_name("limits/loop/havs:route=raster"), "limits_loop.havs/route_raster");
        assert_eq!(test_name("validation/gpu-assisted"), "validation.gpu_assisted");
        let names = names().unwrap();
        let tests: BTreeSet<String> = names.iter().map(|name| test_name(name)).collect();
        assert_eq!(tests.len(), names.len(), "two cases have one name");
        for test in tests {
            let (suite, name) = test.split_once('.').unwrap();
            assert!(
                !suite.is_empty() && !name.is_empty() && !name.contains(['.', ':', ',', '-', '*', ' ']),
                "{test}"
            );
        }
    }

    #[test]
    fn shards_share_the_tests() {
        let names = names().unwrap();
        let request = |shard| Request {
            list: false,
            filter: "draw.*:limits*-*raster*".to_string(),
            shard,
            report: None,
        };
        let names = || names.iter().map(String::as_str);
        let whole = request(None).select(names());
        let mut shared: Vec<&str> =
            (0..8).flat_map(|index| request(Some(Shard { index, total: 8 })).select(names())).collect();
        assert_eq!(shared.len(), whole.len());
        shared.sort_unstable();
        shared.dedup();
        assert_eq!(shared.len(), whole.len(), "a test is in two shards");
    }

    #[test]
    fn reports_are_named_as_googletest_names_them() {
        assert_eq!(report_of("json:a/b.json").unwrap(), (Form::Json, "a/b.json".into()));
        assert_eq!(report_of("xml").unwrap(), (Form::Xml, "test_detail.xml".into()));
        assert_eq!(report_of("xml:out/").unwrap(), (Form::Xml, "out/volraster.xml".into()));
        assert!(report_of("csv:x").unwrap_err().to_string().contains("must be json:FILE or xml:FILE"));
    }
}
