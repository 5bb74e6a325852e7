//! Cases, families of cases, and what a case is run with.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::scene::{Data, Scene, View};
use volraster::technique::{Method, Renderer};
use volraster::{Error, Gpu, Image};

use crate::common::*;

/// A row of the catalogue, or one of its parameters.
pub struct Case {
    /// Row of the catalogue, and a letter where it has several parameters.
    pub number: &'static str,
    pub name: &'static str,
    /// What is right.
    pub expect: &'static str,
    /// How far from it an image may be. Derived where the case is run.
    pub tolerance: &'static str,
    pub run: fn(&mut Run<'_>),
}

/// Cases that belong together, and run one after the other.
pub struct Family {
    pub name: &'static str,
    pub cases: &'static [Case],
    results: OnceLock<Results>,
}

/// What became of a family.
pub struct Results {
    pub cases: Vec<Outcome>,
    /// Routes of each technique that the device offers.
    pub offered: Vec<(Method, &'static str)>,
    pub seconds: f64,
}

/// What became of a case.
#[derive(Default)]
pub struct Outcome {
    /// Techniques by route and integrator that drew it.
    pub drawn: BTreeSet<String>,
    /// Kinds of data that it is drawn from.
    pub kinds: BTreeSet<&'static str>,
    pub refusals: Vec<Refusal>,
    failures: Vec<String>,
}

/// An error instead of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// A technique, or the part of the library that refused before one was asked.
    pub who: Who,
    pub text: String,
    /// Whether another device may draw it, or refuse with other numbers.
    pub device: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Who {
    Part(&'static str),
    Technique(Method, &'static str),
}

impl Family {
    pub const fn new(name: &'static str, cases: &'static [Case]) -> Self {
        Self { name, cases, results: OnceLock::new() }
    }

    /// Runs the cases, or waits for who is running them.
    pub fn results(&self) -> &Results {
        self.results.get_or_init(|| {
            let start = Instant::now();
            let (mut cases, mut offered) = (Vec::new(), Vec::new());
            for (i, case) in taken(8, self.cases.iter().enumerate()) {
                let begun = Instant::now();
                let mut outcome = Outcome::default();
                // Validation messages count when the device is given back. That is after each case: cases of other
                // families wait for that when they want a device of their own.
                let device = catch_unwind(AssertUnwindSafe(|| {
                    let gpu = gpu();
                    if offered.is_empty() {
                        for method in Method::ALL {
                            offered.extend(routes_of(&gpu, method).into_iter().map(|route| (method, route)));
                        }
                    }
                    let mut run = Run { gpu: &gpu, outcome: std::mem::take(&mut outcome), turn: i };
                    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| (case.run)(&mut run))) {
                        run.outcome.failures.push(text_of(panic.as_ref()));
                    }
                    outcome = run.outcome;
                }));
                if let Err(panic) = device {
                    outcome.failures.push(text_of(panic.as_ref()));
                }
                if outcome.drawn.is_empty() && outcome.refusals.is_empty() {
                    outcome.failures.push("nothing was drawn".to_string());
                }
                println!("{:>4} {}: {:.2} s", case.number, case.name, begun.elapsed().as_secs_f64());
                cases.push(outcome);
            }
            Results { cases, offered, seconds: start.elapsed().as_secs_f64() }
        })
    }
}

fn text_of(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default()
}

impl Results {
    pub fn drawn(&self) -> usize {
        self.cases.iter().map(|case| case.drawn.len()).sum()
    }

    pub fn refused(&self) -> usize {
        self.cases.iter().map(|case| case.refusals.len()).sum()
    }

    pub fn failures(&self) -> impl Iterator<Item = String> {
        self.cases.iter().flat_map(|case| case.failures.iter().cloned())
    }

    pub fn summary(&self, family: &Family) -> String {
        let techniques: BTreeSet<&String> = self.cases.iter().flat_map(|case| &case.drawn).collect();
        format!(
            "{}: {} cases, drawn {} times by {} of techniques and routes, {} refusals, {:.1} s",
            family.name,
            family.cases.len(),
            self.drawn(),
            techniques.len(),
            self.refused(),
            self.seconds
        )
    }
}

/// A technique by one route, with one integrator where it has several.
#[derive(Clone, Debug)]
pub struct Spec {
    pub method: Method,
    pub route: &'static str,
    /// Empty where the technique has no choice.
    pub integrator: &'static str,
}

impl Spec {
    /// Every technique that draws such data, by every route that the device offers, with every integrator.
    pub fn all(gpu: &Gpu, data: &Data) -> Vec<Self> {
        let mut specs = Vec::new();
        for method in Method::ALL.into_iter().filter(|method| method.draws(data)) {
            for route in routes_of(gpu, method) {
                let option = method.options().iter().find(|option| option.key == "integrator");
                let words = option.map_or(&[""][..], |option| &option.words);
                // Smoke is another optical model.
                for &integrator in words.iter().filter(|word| **word != "smoke") {
                    specs.push(Self { method, route, integrator });
                }
            }
        }
        specs
    }

    pub fn has(&self, option: &str) -> bool {
        self.method.options().iter().any(|known| known.key == option)
    }

    /// Whether it draws grids and meshes through Gaussians, which are another field: blurred, and of a mesh beyond it.
    pub fn blurs(&self, data: &Data) -> bool {
        self.method == Method::SplatEwa && !matches!(data, Data::Points(_))
    }

    /// Whether a slab of trilinear interpolation is two points of each kernel.
    pub fn sheets(&self) -> bool {
        self.method == Method::SplatSheets
    }

    /// Whether it resamples an intermediate image.
    pub fn warps(&self) -> bool {
        self.method == Method::ShearWarp
    }

    /// Whether segments are taken by a sample in their middle.
    pub fn samples(&self) -> bool {
        matches!(self.integrator, "" | "midpoint")
    }

    /// As an option string; options that the technique lacks are left out.
    pub fn with(&self, options: &[(&str, &str)]) -> String {
        let mut text = format!("{}:", self.method.name());
        let mut add = |key: &str, value: &str| {
            let separator = if text.ends_with(':') { "" } else { "," };
            text.push_str(&format!("{separator}{key}={value}"));
        };
        if self.has("route") {
            add("route", self.route);
        }
        if !self.integrator.is_empty() {
            add("integrator", self.integrator);
        }
        // A small table: many are made.
        if self.integrator == "full" {
            add("table", "128");
        }
        // Lines of sight that are those of pixels, where parallel rays run along an axis.
        if self.has("intermediate") && options.iter().all(|(key, _)| *key != "intermediate") {
            add("intermediate", "pixel");
        }
        // Registers have neither a format nor a choice of operator.
        let blended =
            |key: &str| matches!(key, "target" | "order" | "dither") && (self.has("target") || self.warps());
        for (key, value) in options.iter().filter(|(key, _)| self.has(key)) {
            if self.route == "compute" && blended(key) {
                continue;
            }
            // That of footprints is not that of volumes.
            if self.method == Method::SplatEwa && *key == "filter" && matches!(*value, "exact" | "hardware") {
                continue;
            }
            add(key, value);
        }
        text
    }
}

impl std::fmt::Display for Spec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.method.name(), self.route)?;
        if self.integrator.is_empty() { Ok(()) } else { write!(f, " {}", self.integrator) }
    }
}

/// A frame, with what the technique counted.
pub struct Frame {
    pub image: Image,
    pub counters: Vec<(&'static str, u64)>,
}

impl Frame {
    pub fn counter(&self, name: &str) -> Option<u64> {
        self.counters.iter().find(|counter| counter.0 == name).map(|counter| counter.1)
    }
}

/// What a case is run with.
pub struct Run<'a> {
    pub gpu: &'a Gpu,
    outcome: Outcome,
    /// Grows from case to case and from scene to scene: `make test` takes another route of a technique each time.
    turn: usize,
}

impl Run<'_> {
    /// Every technique that draws such data, by every route with every integrator; in `make test` every second by one of them.
    pub fn specs(&mut self, data: &Data, claims: impl Fn(&Spec) -> bool) -> Vec<Spec> {
        self.turn += 1;
        let all = Spec::all(self.gpu, data).into_iter().filter(claims).collect();
        taken_from(self.turn, 2, one_of_each(self.turn, all, |spec| spec.method))
    }

    pub fn fail(&mut self, text: String) {
        // One line says what is wrong; a thousand hide it.
        if self.outcome.failures.len() < 12 {
            self.outcome.failures.push(text);
        }
    }

    pub fn check(&mut self, right: bool, text: impl FnOnce() -> String) {
        if !right {
            self.fail(text());
        }
    }

    /// Draws, or takes down that it was refused. Errors that name neither a wrong value nor a lack of the device are
    /// failures.
    pub fn frame(
        &mut self,
        scene: &Arc<GpuScene>,
        view: &View,
        spec: &Spec,
        options: &[(&str, &str)],
    ) -> Option<Frame> {
        let text = spec.with(options);
        self.outcome.kinds.insert(scene.scene().data.kind());
        let drawn = || {
            let mut frames = Renderer::new(scene, volraster::Technique::parse(&text)?).frames(view)?;
            let time = frames.draw(view)?;
            let counters = frames.plan().counters().into_iter().chain(time.counters).collect();
            Ok(Frame { image: frames.read_back()?, counters })
        };
        match drawn() {
            Ok(frame) => {
                self.outcome.drawn.insert(spec.to_string());
                Some(frame)
            }
            Err(error) => {
                self.refused(Who::Technique(spec.method, spec.route), &error);
                None
            }
        }
    }

    /// A scene by everything that draws its field.
    pub fn each(
        &mut self,
        scene: &Scene,
        view: &View,
        options: &[(&str, &str)],
        check: impl FnMut(&Spec, &Frame) -> Result<(), String>,
    ) {
        self.only(|spec| !spec.blurs(&scene.data), scene, view, options, check);
    }

    /// A scene by everything that draws it, also where that blurs.
    pub fn every(
        &mut self,
        scene: &Scene,
        view: &View,
        options: &[(&str, &str)],
        check: impl FnMut(&Spec, &Frame) -> Result<(), String>,
    ) {
        self.only(|_| true, scene, view, options, check);
    }

    /// The same technique from several views of one size, frame after frame.
    pub fn views(
        &mut self,
        scene: &Arc<GpuScene>,
        views: &[View],
        spec: &Spec,
        options: &[(&str, &str)],
    ) -> Option<Vec<Image>> {
        let text = spec.with(options);
        self.outcome.kinds.insert(scene.scene().data.kind());
        let drawn = || -> volraster::Result<Vec<Image>> {
            let renderer = Renderer::new(scene, volraster::Technique::parse(&text)?);
            let Some(first) = views.first() else { return Ok(Vec::new()) };
            let mut frames = renderer.frames(first)?;
            let one = |view| {
                frames.draw(view)?;
                frames.read_back()
            };
            views.iter().map(one).collect()
        };
        match drawn() {
            Ok(images) => {
                self.outcome.drawn.insert(spec.to_string());
                Some(images)
            }
            Err(error) => {
                self.refused(Who::Technique(spec.method, spec.route), &error);
                None
            }
        }
    }

    /// A scene by everything that draws its field, from several views of one size: a plan that is turned draws what a new
    /// one does.
    pub fn each_view(
        &mut self,
        scene: &Scene,
        views: &[View],
        options: &[(&str, &str)],
        mut check: impl FnMut(&Spec, &[Image]) -> Result<(), String>,
    ) {
        let on_gpu = GpuScene::new(self.gpu, scene.clone());
        for spec in self.specs(&scene.data, |spec| !spec.blurs(&scene.data)) {
            if let Some(images) = self.views(&on_gpu, views, &spec, options)
                && let Err(wrong) = check(&spec, &images)
            {
                self.fail(format!("{} {options:?}: {wrong}", spec.with(&[])));
            }
        }
    }

    /// A scene by those of everything that draws it that claim the case.
    pub fn only(
        &mut self,
        claims: impl Fn(&Spec) -> bool,
        scene: &Scene,
        view: &View,
        options: &[(&str, &str)],
        mut check: impl FnMut(&Spec, &Frame) -> Result<(), String>,
    ) {
        let on_gpu = GpuScene::new(self.gpu, scene.clone());
        for spec in self.specs(&scene.data, claims) {
            if let Some(frame) = self.frame(&on_gpu, view, &spec, options)
                && let Err(wrong) = check(&spec, &frame)
            {
                self.fail(format!("{} {options:?}: {wrong}", spec.with(&[])));
            }
        }
    }

    /// The same scene drawn in two ways of `options`, or two scenes of the same view, compared, by everything that draws
    /// its field.
    pub fn pairs(
        &mut self,
        scenes: [&Scene; 2],
        views: [&View; 2],
        options: [&[(&str, &str)]; 2],
        check: impl FnMut(&Spec, &Image, &Image) -> Result<(), String>,
    ) {
        self.pairs_by(|spec| !spec.blurs(&scenes[0].data), scenes, views, options, check);
    }

    /// The same by everything, also what blurs.
    pub fn every_pair(
        &mut self,
        scenes: [&Scene; 2],
        views: [&View; 2],
        options: [&[(&str, &str)]; 2],
        check: impl FnMut(&Spec, &Image, &Image) -> Result<(), String>,
    ) {
        self.pairs_by(|_| true, scenes, views, options, check);
    }

    /// The same by those that claim the case.
    pub fn pairs_by(
        &mut self,
        claims: impl Fn(&Spec) -> bool,
        scenes: [&Scene; 2],
        views: [&View; 2],
        options: [&[(&str, &str)]; 2],
        mut check: impl FnMut(&Spec, &Image, &Image) -> Result<(), String>,
    ) {
        let on_gpu = scenes.map(|scene| GpuScene::new(self.gpu, scene.clone()));
        for spec in self.specs(&scenes[0].data, claims) {
            let drawn = [0, 1].map(|i| self.frame(&on_gpu[i], views[i], &spec, options[i]));
            if let [Some(a), Some(b)] = drawn
                && let Err(wrong) = check(&spec, &a.image, &b.image)
            {
                self.fail(format!("{} {options:?}: {wrong}", spec.with(&[])));
            }
        }
    }

    /// Part of the library must refuse, in one line that holds all of `parts`.
    pub fn refuses<T>(&mut self, part: &'static str, result: volraster::Result<T>, parts: &[&str]) {
        match result {
            Ok(_) => self.fail(format!("{part} took what it must refuse: {parts:?}")),
            Err(error) => {
                let text = error.to_string();
                let told = parts.iter().all(|part| text.contains(part)) && text.lines().count() == 1;
                self.check(told, || format!("{part}: \"{text}\" does not say {parts:?}"));
                self.refused(Who::Part(part), &error);
            }
        }
    }

    /// Takes a refusal down.
    pub fn refused(&mut self, who: Who, error: &Error) {
        let device = match error {
            Error::Invalid { .. } => false,
            Error::Unsupported { .. } | Error::Memory { .. } => true,
            _ => return self.fail(format!("{who:?}: {error}")),
        };
        let refusal = Refusal { who, text: error.to_string(), device };
        if !self.outcome.refusals.contains(&refusal) {
            self.outcome.refusals.push(refusal);
        }
    }

    /// Another device, for this case alone.
    pub fn on(&mut self, options: GpuOptions, run: impl FnOnce(&mut Run<'_>)) {
        let gpu = gpu_with(options);
        let mut other = Run { gpu: &gpu, outcome: std::mem::take(&mut self.outcome), turn: self.turn };
        run(&mut other);
        self.outcome = other.outcome;
    }
}
