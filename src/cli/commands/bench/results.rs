//! The folder of results: records as they are measured, tables and plots at the end.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use volraster::{Error, Result};

use super::bounds::Peaks;
use super::charts::{Chart, charts, view_title};
use super::fronts::Fronts;
use super::record::{Record, dash, views};
use super::required_k::RequiredK;
use super::tables::{html, markdown, parts};
use crate::cli::timing::Quantiles;
use crate::cli::{output, table};

/// Headings of the table on stdout.
const HEADING: [&str; 11] =
    ["scene", "projection", "technique", "route", "options", "rmse", "max", "ms", "p10", "p90", "gpu ms"];

/// The records so far, and the folder they go to.
#[derive(Debug)]
pub(super) struct Results {
    folder: PathBuf,
    lines: File,
    peaks: Peaks,
    pub(super) records: Vec<Record>,
}

impl Results {
    /// Creates bench.jsonl, and writes peaks.json.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when it cannot be written.
    pub(super) fn begin(folder: &Path, peaks: Peaks) -> Result<Self> {
        let lines = File::create(folder.join(LINES)).map_err(|source| cannot_write(folder, source))?;
        output::write_json(&folder.join("peaks.json"), &peaks.json())?;
        Ok(Self { folder: folder.to_path_buf(), lines, peaks, records: Vec::new() })
    }

    /// Writes the records of a view with their bounds, and returns its tables as text. `view` names the view.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when they cannot be written.
    pub(super) fn add(
        &mut self,
        view: &Record,
        mut records: Vec<Record>,
        required_k: Option<&RequiredK>,
    ) -> Result<String> {
        let mut rows = vec![HEADING.map(str::to_string).to_vec()];
        for record in &mut records {
            record.bound = self.peaks.bound(record);
            rows.push(row(record));
            let line = format!("{}\n", json!(record));
            let written = self.lines.write_all(line.as_bytes()).and_then(|()| self.lines.flush());
            written.map_err(|source| cannot_write(&self.folder, source))?;
        }
        let fronts = Fronts::new(&records.iter().collect::<Vec<_>>()).table();
        self.records.extend(records);
        let cases = table::aligned(&rows, &[0, 1, 2, 3, 4, 11]);
        let required_k = required_k.map_or_else(String::new, |required| format!("\n{}\n", required.text()));
        Ok(format!("{cases}\n\nfronts of {} {}\n{fronts}\n{required_k}", view.scene, view.projection))
    }

    /// Writes table.md, report.html, fronts.json and the plots, and on demand bench.csv.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when a file cannot be written.
    pub(super) fn finish(&self, is_interrupted: bool, with_csv: bool) -> Result<()> {
        if with_csv {
            volraster::io::write_text(self.folder.join("bench.csv"), &csv(&self.records))?;
        }
        let charts = charts(&self.records);
        for Chart { name, picture, .. } in &charts {
            volraster::io::write_text(self.folder.join(format!("{name}.svg")), &picture.svg())?;
        }
        let parts = parts(&self.records, &charts, &self.peaks, is_interrupted);
        volraster::io::write_text(self.folder.join("table.md"), &markdown(&self.records, &parts))?;
        volraster::io::write_text(self.folder.join("report.html"), &html(&self.records, &parts))?;
        output::write_json(&self.folder.join("fronts.json"), &fronts_json(&self.records, &charts))
    }
}

/// Returns the records as comma-separated values, with a heading.
fn csv(records: &[Record]) -> String {
    const COLUMNS: &str = "scene,projection,width,height,data,elements,technique,route,options,rmse,max_abs,frames,median_ms,low_ms,high_ms,gpu_ms,bound,share,device_bytes,verdict,image,device,driver,version,commit,begin";
    let quoted = |text: &str| match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    };
    let row = |record: &Record| {
        let number = |number: Option<f64>| number.map_or_else(String::new, |number| number.to_string());
        let wall = |pick: fn(&Quantiles) -> f64| number(record.wall_ms.as_ref().map(pick));
        let why = record.failed.as_ref().or(record.skipped.as_ref());
        let verdict = why.map_or(if record.wrong { "wrong" } else { "ok" }, String::as_str);
        let [technique, route, options] = record.names();
        let cells = [
            record.scene.clone(),
            record.projection.clone(),
            record.size[0].to_string(),
            record.size[1].to_string(),
            record.data.clone(),
            record.elements.to_string(),
            technique,
            route,
            options,
            number(record.error("rmse")),
            number(record.error("max_abs")),
            record.frames.map_or_else(String::new, |frames| frames.to_string()),
            wall(|ms| ms.median),
            wall(|ms| ms.low),
            wall(|ms| ms.high),
            number(record.gpu_ms.as_ref().map(|ms| ms.median)),
            record.bound.as_ref().map_or_else(String::new, |bound| bound.by.clone()),
            number(record.bound.as_ref().map(|bound| bound.share)),
            record.device_bytes.map_or_else(String::new, |bytes| bytes.to_string()),
            verdict.to_string(),
            record.image.clone().unwrap_or_default(),
            record.device.clone(),
            record.driver.clone(),
            record.version.clone(),
            record.run.commit.clone().unwrap_or_default(),
            record.run.begin.clone(),
        ];
        cells.map(|cell| quoted(&cell)).join(",")
    };
    let rows = records.iter().map(row);
    std::iter::once(COLUMNS.to_string()).chain(rows).map(|line| line + "\n").collect()
}

/// Returns a row of the table on stdout.
fn row(record: &Record) -> Vec<String> {
    let mut row = vec![record.scene.clone(), record.projection.clone()];
    row.extend(record.names());
    row.extend(["rmse", "max_abs"].map(|statistic| record.error_text(statistic)));
    let ms = |spread: &Option<Quantiles>, pick: fn(&Quantiles) -> f64| {
        spread.as_ref().map_or_else(dash, |spread| format!("{:.1}", pick(spread)))
    };
    if record.failed.is_some() {
        row.push("FAILED".to_string());
    } else if record.skipped.is_some() {
        row.push("skipped".to_string());
    } else {
        let wall = |pick| ms(&record.wall_ms, pick);
        row.extend([wall(|ms| ms.median), wall(|ms| ms.p10), wall(|ms| ms.p90)]);
        row.push(ms(&record.gpu_ms, |ms| ms.median));
        row.extend(record.wrong.then(|| "wrong".to_string()));
    }
    row
}

const LINES: &str = "bench.jsonl";

fn cannot_write(folder: &Path, source: std::io::Error) -> Error {
    Error::Io { path: folder.join(LINES), action: "cannot write", source }
}

fn fronts_json(records: &[Record], charts: &[Chart]) -> Value {
    let entry = |view: &Vec<&Record>| {
        let first = view[0];
        let mut entry = json!({
            "version": first.version,
            "device": first.device,
            "driver": first.driver,
            "scene": first.scene,
            "projection": first.projection,
            "size": first.size,
            "time": "wall_ms",
            "fronts": Fronts::new(view).json(),
        });
        let title = format!("Error over time: {}", view_title(first));
        if let Some(chart) = charts.iter().find(|chart| chart.title == title) {
            entry["plot"] = json!(format!("{}.svg", chart.name));
        }
        entry
    };
    views(records).iter().map(entry).collect()
}
