//! The panel beside the picture, and the mouse on the picture.

use std::path::{Path, PathBuf};

use egui::{ComboBox, DragValue, Grid, PointerButton, Rect, Sense, Ui};
use volraster::choice::Goal;
use volraster::io::scene_file::PRESETS;
use volraster::scene::{ColourMap, Mode, Scene};
use volraster::technique::Method;
use volraster::{Result, Technique};

use super::editor::Editor;
use super::session::Session;
use crate::cli::input::{ArraysArgs, with_options};

/// Width of the panel, in points.
pub(super) const WIDTH: f32 = 300.0;

/// Degrees that the camera turns as the mouse moves by one point.
const TURN: f64 = 0.4;

/// Factor of extinction of one press on a button.
const THICKER: f64 = 1.25;

/// How technique and options are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Choice {
    Fixed,
    Error,
    Time,
}

/// The state of the panel.
#[derive(Debug)]
pub(super) struct Panel {
    input: PathBuf,
    arrays: ArraysArgs,
    choice: Choice,
    max_error: f64,
    budget: f64,
    editor: Editor,
    picture: String,
    scene: String,
    /// The last error, or what was saved.
    pub(super) message: String,
    /// Milliseconds of the last frame with a picture.
    pub(super) frame_ms: f64,
}

impl Panel {
    pub(super) fn new(input: &Path, arrays: &ArraysArgs, goal: Option<Goal>) -> Self {
        let stem = input.file_name().unwrap_or_default().to_string_lossy();
        let stem = stem.split('.').next().unwrap_or_default().to_string();
        let (mut choice, mut max_error, mut budget) = (Choice::Fixed, 1e-3, 50.0);
        match goal {
            Some(Goal::MaxError(error)) => (choice, max_error) = (Choice::Error, error),
            Some(Goal::Budget(ms)) => (choice, budget) = (Choice::Time, ms),
            None => {}
        }
        Self {
            input: input.to_path_buf(),
            arrays: arrays.clone(),
            choice,
            max_error,
            budget,
            editor: Editor::default(),
            picture: format!("{stem}-view.png"),
            scene: format!("{stem}-view.json"),
            message: String::new(),
            frame_ms: 0.0,
        }
    }

    /// Returns the name of the file that is shown.
    pub(super) fn title(&self) -> String {
        self.input.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Shows the panel, and applies what the user does. Returns the place of the picture.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &mut Session) -> Rect {
        let panel = egui::Panel::right("panel").exact_size(WIDTH).resizable(false);
        panel.show(ui, |ui| egui::ScrollArea::vertical().show(ui, |ui| self.contents(ui, session)));
        let place = ui.available_rect_before_wrap();
        mouse(ui, place, session);
        place
    }

    fn contents(&mut self, ui: &mut Ui, session: &mut Session) {
        ui.add_space(4.0);
        let outcomes = [
            self.facts(ui, session),
            self.technique(ui, session),
            self.look(ui, session),
            self.editor.show(ui, session),
            self.files(ui, session),
        ];
        for error in outcomes.into_iter().filter_map(Result::err) {
            self.message = error.to_string();
        }
        ui.label(&self.message);
    }

    /// Shows size, time and error of the picture.
    fn facts(&self, ui: &mut Ui, session: &Session) -> Result<()> {
        let [width, height] = session.view().extent();
        let drawn = session.drawn_size();
        let size = if drawn == [width, height] {
            format!("{width} x {height}")
        } else {
            format!("{} x {} of {width} x {height}", drawn[0], drawn[1])
        };
        let error = match session.error {
            Some(error) => format!("{:.1e}, below {:.1e}", error.rmse, error.bound),
            None if session.is_complete() => "being estimated".to_string(),
            None => session
                .part()
                .map_or("-".to_string(), |bound| format!("of the part so far at most {:.1e}", bound.rmse)),
        };
        Grid::new("facts").num_columns(2).show(ui, |ui| {
            for (name, value) in [
                ("picture", size),
                ("time", format!("{:.0} ms, with panel {:.0} ms", session.ms, self.frame_ms)),
                ("error", error),
            ] {
                ui.label(name);
                ui.label(value)
                    .on_hover_text("error: RMSE of linear colour, and its bound with 95 % confidence");
                ui.end_row();
            }
        });
        ui.separator();
        Ok(())
    }

    /// Shows technique and step, and how they are chosen.
    fn technique(&mut self, ui: &mut Ui, session: &mut Session) -> Result<()> {
        let present = *session.technique();
        let methods: Vec<Method> = session.methods().collect();
        let mut method = present.method();
        let mut wanted = None;
        ui.horizontal(|ui| {
            ComboBox::from_id_salt("technique").selected_text(method.name()).width(150.0).show_ui(ui, |ui| {
                for each in methods {
                    ui.selectable_value(&mut method, each, each.name()).on_hover_text(each.summary());
                }
            });
            if method != present.method() {
                wanted = Some(Technique::new(method, &[]));
            }
            let step = present.option_pairs().into_iter().find(|(key, _)| *key == "step");
            let Some(mut step) = step.and_then(|(_, step)| step.parse::<f64>().ok()) else { return };
            ui.label("step");
            let drag = DragValue::new(&mut step).speed(0.01).range(0.05..=16.0).max_decimals(3);
            if ui.add(drag).on_hover_text("Distance of samples, in voxels").changed() {
                let all: Vec<(String, String)> =
                    present.option_pairs().into_iter().map(|(key, value)| (key.to_string(), value)).collect();
                wanted = Some(with_options(present.method(), &all, &[("step", &step.to_string())]));
            }
        });
        if let Some(technique) = wanted {
            self.choice = Choice::Fixed;
            session.set_technique(technique?);
        }
        ui.horizontal(|ui| {
            ui.label("choose by");
            ui.radio_value(&mut self.choice, Choice::Fixed, "hand");
            ui.radio_value(&mut self.choice, Choice::Error, "error");
            ui.radio_value(&mut self.choice, Choice::Time, "time");
        });
        let goal = match self.choice {
            Choice::Fixed => return Ok(()),
            Choice::Error => Goal::MaxError(self.max_error),
            Choice::Time => Goal::Budget(self.budget),
        };
        ui.horizontal(|ui| {
            let drag = match self.choice {
                Choice::Error => DragValue::new(&mut self.max_error)
                    .speed(1e-4)
                    .range(1e-6..=1.0)
                    .custom_formatter(|error, _| format!("{error:.1e}"))
                    .prefix("at most "),
                _ => DragValue::new(&mut self.budget).range(1.0..=60_000.0).suffix(" ms").prefix("at most "),
            };
            ui.add(drag);
            let text = if session.is_searching { "searching ..." } else { "search" };
            if ui.add_enabled(!session.is_searching, egui::Button::new(text)).clicked() {
                session.search(goal);
            }
        });
        Ok(())
    }

    /// Shows mode, preset, colours and range.
    fn look(&mut self, ui: &mut Ui, session: &mut Session) -> Result<()> {
        ui.separator();
        let Scene { data, kernels, transfer, mode, .. } = session.scene().clone();
        let kernels = kernels.as_ref();
        let (mut name, mut preset, mut map, mut changed) = (mode.name(), None, None, None);
        ui.horizontal(|ui| {
            ComboBox::from_id_salt("mode").selected_text(name).width(75.0).show_ui(ui, |ui| {
                for each in ["emission", "lit", "maximum"] {
                    ui.selectable_value(&mut name, each, each);
                }
            });
            ComboBox::from_id_salt("preset").selected_text("preset").width(75.0).show_ui(ui, |ui| {
                for each in PRESETS {
                    if ui.selectable_label(false, each.name).on_hover_text(each.purpose).clicked() {
                        preset = Some(each);
                    }
                }
            });
            ComboBox::from_id_salt("colours").selected_text("colours").width(75.0).show_ui(ui, |ui| {
                for (name, each) in ColourMap::NAMED {
                    if ui.selectable_label(false, name).clicked() {
                        map = Some(each);
                    }
                }
            });
        });
        ui.horizontal(|ui| {
            let [mut low, mut high] = transfer.domain();
            let all = data.range();
            let speed = (all[1] - all[0]).abs().max(1e-30) / 500.0;
            ui.label("range");
            let is_moved = ui.add(DragValue::new(&mut low).speed(speed)).changed()
                | ui.add(DragValue::new(&mut high).speed(speed)).changed();
            if is_moved && low < high {
                changed = Some(transfer.stretched([low, high]));
            }
            ui.label("density");
            for (text, factor) in [("-", 1.0 / THICKER), ("+", THICKER)] {
                if ui.button(text).clicked() {
                    changed = Some(transfer.thickened(factor));
                }
            }
        });
        if name != mode.name() {
            session.set_mode(Mode::from_name(name)?)?;
        }
        if let Some(preset) = preset {
            let transfer = preset.transfer(&data, kernels, None, None)?;
            // First, since a mode changes an automatic one.
            session.set_transfer(transfer);
            session.set_mode(preset.mode(&data, kernels))?;
        }
        if let Some(map) = map {
            session.set_transfer(transfer.coloured(map));
        }
        if let Some(transfer) = changed {
            session.set_transfer(transfer?);
        }
        Ok(())
    }

    /// Writes the scene file of a session.
    pub(super) fn save_scene(&self, session: &Session, path: &Path) -> Result<()> {
        session.save_scene(path, &self.input, &self.arrays)
    }

    /// Shows what saves picture and scene, and what resets the camera.
    fn files(&mut self, ui: &mut Ui, session: &mut Session) -> Result<()> {
        ui.separator();
        let (mut saves_picture, mut saves_scene) = (false, false);
        Grid::new("files").num_columns(2).show(ui, |ui| {
            saves_picture = ui.button("save picture").clicked();
            ui.text_edit_singleline(&mut self.picture);
            ui.end_row();
            saves_scene = ui.button("save scene").clicked();
            ui.text_edit_singleline(&mut self.scene);
            ui.end_row();
        });
        if ui.button("reset camera").clicked() {
            session.go_home();
        }
        ui.label("drag: turn, right: pan, wheel: zoom");
        if saves_picture {
            session.save_picture(Path::new(&self.picture))?;
            self.message = format!("saved {}", self.picture);
        }
        if saves_scene {
            self.save_scene(session, Path::new(&self.scene))?;
            self.message = format!("saved {}", self.scene);
        }
        Ok(())
    }
}

/// Turns, pans and zooms.
fn mouse(ui: &Ui, place: Rect, session: &mut Session) {
    let response = ui.interact(place, ui.scope_id().with("picture"), Sense::click_and_drag());
    let moved = response.drag_delta();
    let [x, y] = [moved.x, moved.y].map(f64::from);
    if [x, y] != [0.0, 0.0] {
        if response.dragged_by(PointerButton::Primary) {
            session.turn([-TURN * x, TURN * y]);
        } else {
            let scale = f64::from(ui.pixels_per_point());
            session.pan([scale * x, scale * y]);
        }
    }
    let wheel =
        if response.contains_pointer() { ui.input(|input| input.smooth_scroll_delta().y) } else { 0.0 };
    if wheel != 0.0 {
        session.zoom((f64::from(wheel) / 400.0).exp());
    }
}
