//! What is chosen from: techniques with their knobs, from coarse to fine.

use crate::error::Result;
use crate::scene::Data;
use crate::technique::Technique;

/// Settings of one technique that differ in one knob: errors fall and times rise along it.
#[derive(Clone, Copy, Debug)]
struct Family {
    /// As [`Technique::parse`] reads it; the knob's value goes to the end.
    spec: &'static str,
    values: &'static [&'static str],
    /// Whether it may end a line where little more is to come.
    stops: bool,
}

/// A setting that may be chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// As [`Technique::parse`] reads it.
    pub(crate) spec: String,
    /// Which family it belongs to, and its place there.
    pub(crate) family: usize,
    pub(crate) place: usize,
    stops: bool,
}

const STEPS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125", "0.0625"];
const FINE: &[&str] = &["1", "0.5", "0.25", "0.125", "0.0625"];
const ONE: &[&str] = &[""];

const GRIDS: &[Family] = &[
    Family { spec: "slices-3d:step=", values: STEPS, stops: true },
    Family { spec: "raycast:step=", values: STEPS, stops: true },
    Family { spec: "slabs:step=", values: STEPS, stops: true },
    Family { spec: "slabs:integrator=exact,step=", values: STEPS, stops: true },
    Family { spec: "slabs:integrator=exact,filter=exact,step=", values: FINE, stops: true },
    Family { spec: "slices-2d", values: ONE, stops: true },
];

const MESHES: &[Family] = &[
    Family { spec: "havs", values: ONE, stops: true },
    Family { spec: "havs:integrator=integral", values: ONE, stops: true },
    Family { spec: "projected-tets:route=raster,shade=vertex", values: ONE, stops: false },
    Family { spec: "projected-tets:route=raster", values: ONE, stops: false },
    Family { spec: "projected-tets:rank=centroid", values: ONE, stops: true },
    Family { spec: "abuffer", values: ONE, stops: true },
];

impl Candidate {
    /// The technique; a line may end where at most `stop` of colour is to come.
    pub(crate) fn technique(&self, stop: f64) -> Result<Technique> {
        if !self.stops || stop == 0.0 {
            return Technique::parse(&self.spec);
        }
        let joint = if self.spec.contains(':') { ',' } else { ':' };
        Technique::parse(&format!("{}{joint}stop={stop}", self.spec))
    }
}

/// What draws a kind of data.
pub(crate) fn candidates(data: &Data) -> Vec<Candidate> {
    match data {
        Data::Grid(_) => all(GRIDS),
        Data::Mesh(_) => all(MESHES),
        Data::Points(_) => Vec::new(),
    }
}

/// Candidates for every kind of data.
pub(crate) fn every() -> Vec<Candidate> {
    [GRIDS, MESHES].into_iter().flat_map(all).collect()
}

fn all(families: &[Family]) -> Vec<Candidate> {
    let of = |(family, &Family { spec, values, stops }): (usize, &Family)| {
        let one = move |(place, value): (usize, &&str)| Candidate {
            spec: format!("{spec}{value}"),
            family,
            place,
            stops,
        };
        values.iter().enumerate().map(one).collect::<Vec<_>>()
    };
    families.iter().enumerate().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_candidate_is_a_technique_of_its_own() {
        let mut specs: Vec<String> = every().into_iter().map(|candidate| candidate.spec).collect();
        assert!(specs.len() > 40);
        for spec in &specs {
            Technique::parse(spec).unwrap();
        }
        for candidate in every() {
            candidate.technique(1e-3).unwrap();
        }
        let count = specs.len();
        specs.sort_unstable();
        specs.dedup();
        assert_eq!(specs.len(), count);
    }
}
