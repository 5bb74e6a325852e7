//! The folder of results: records as they are measured, tables and plots at the end.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use volraster::{Error, GpuScene, Result};

use super::case::{Case, HEADING, ViewInfo};
use super::charts::{Chart, charts, view_title};
use super::fronts::Fronts;
use super::record::{Record, views};
use super::required_k::RequiredK;
use super::tables::markdown;
use crate::cli::{output, table};

/// The records so far, and the folder they go to.
#[derive(Debug)]
pub(crate) struct Results {
    folder: PathBuf,
    quiet: bool,
    lines: File,
    records: Vec<Record>,
    failed: usize,
}

impl Results {
    /// Creates bench.jsonl.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when it cannot be written.
    pub(crate) fn begin(folder: &Path, quiet: bool) -> Result<Self> {
        let lines = File::create(folder.join(LINES)).map_err(|source| cannot_write(folder, source))?;
        Ok(Self { folder: folder.to_path_buf(), quiet, lines, records: Vec::new(), failed: 0 })
    }

    /// Returns whether nothing is printed.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Returns the number of cases with a wrong image.
    pub(crate) fn failed(&self) -> usize {
        self.failed
    }

    /// Returns the number of cases.
    pub(crate) fn cases(&self) -> usize {
        self.records.len()
    }

    /// Writes the records of a view, and returns its tables as text.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when they cannot be written.
    pub(crate) fn add(
        &mut self,
        scene: &GpuScene,
        info: &ViewInfo,
        cases: &[Case],
        required_k: Option<&RequiredK>,
    ) -> Result<String> {
        let mut rows = vec![HEADING.map(str::to_string).to_vec()];
        let first = self.records.len();
        for case in cases {
            let record = case.record(scene, info, required_k);
            self.failed += usize::from(case.has_failed());
            rows.push(case.row(info));
            let line = format!("{}\n", json!(record));
            let written = self.lines.write_all(line.as_bytes()).and_then(|()| self.lines.flush());
            written.map_err(|source| cannot_write(&self.folder, source))?;
            self.records.push(record);
        }
        let fronts = Fronts::new(&self.records[first..].iter().collect::<Vec<_>>()).table();
        let cases = table::aligned(&rows, &[0, 1, 2, 3, 4, 11]);
        let required_k = required_k.map_or_else(String::new, |required| format!("\n{}\n", required.text()));
        Ok(format!("{cases}\n\nfronts of {} {}\n{fronts}\n{required_k}", info.scene, info.projection))
    }

    /// Writes table.md, fronts.json and the plots.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when a file cannot be written.
    pub(crate) fn finish(&self, is_interrupted: bool) -> Result<()> {
        let charts = charts(&self.records);
        for Chart { name, picture, .. } in &charts {
            volraster::io::write_text(self.folder.join(format!("{name}.svg")), &picture.svg())?;
        }
        let text = markdown(&self.records, &charts, is_interrupted);
        volraster::io::write_text(self.folder.join("table.md"), &text)?;
        output::write_json(&self.folder.join("fronts.json"), &fronts_json(&self.records, &charts))
    }
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
