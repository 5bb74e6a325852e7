//! The window: its events, and frames of the picture with the panel beside it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{ClippedPrimitive, Color32, Event, PointerButton, Pos2, TextureId, ViewportId, epaint::Primitive};
use volraster::Gpu;
use volraster::window::{PanelCorner, Picture, Screen};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow};
use winit::window::{Window, WindowId};

use super::panel::{Panel, WIDTH};
use super::session::Session;
use crate::cli::input::is_refusal;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

/// Time between two looks at work beside the pictures, and tries to show a window that is changing.
const POLL: Duration = Duration::from_millis(30);

/// The program of the window.
pub(super) struct App {
    // Fields are dropped in this order: the window's screen before its session, the device last.
    open: Option<Open>,
    session: Session,
    panel: Panel,
    script: Script,
    failure: Option<Failure>,
    gpu: Gpu,
}

/// The window while it is open.
struct Open {
    screen: Screen,
    toolkit: egui_winit::State,
    atlas: egui::ColorImage,
    window: Arc<Window>,
    /// When to draw again, unless something happens.
    due: Option<Instant>,
}

impl App {
    pub(super) fn new(gpu: Gpu, session: Session, panel: Panel, script: Script) -> Self {
        Self { open: None, session, panel, script, failure: None, gpu }
    }

    /// Returns why the program ended, unless the user wanted it.
    pub(super) fn outcome(&mut self) -> Outcome {
        self.failure.take().map_or(Ok(()), Err)
    }

    fn open(&self, events: &ActiveEventLoop) -> Result<Open, Failure> {
        let cannot =
            |error: &dyn std::fmt::Display| Failure::Finding(format!("cannot open a window: {error}"));
        let [width, height] = self.session.view().extent();
        let attributes =
            Window::default_attributes().with_title(format!("{} - volraster", self.panel.title()));
        let window = events.create_window(attributes.with_visible(false)).map_err(|error| cannot(&error))?;
        let panel = pixels(WIDTH * scale(&window));
        let _ = window.request_inner_size(PhysicalSize::new(width + panel, height));
        window.set_visible(true);
        let window = Arc::new(window);
        let screen = Screen::new(&self.gpu, Arc::clone(&window))?;
        let context = egui::Context::default();
        context.set_visuals(egui::Visuals::dark());
        let toolkit =
            egui_winit::State::new(context, ViewportId::ROOT, &window, Some(scale(&window)), None, None);
        Ok(Open { screen, toolkit, atlas: egui::ColorImage::default(), window, due: None })
    }

    /// Draws and shows a frame.
    fn redraw(&mut self, events: &ActiveEventLoop) -> Outcome {
        let Some(open) = &mut self.open else { return Ok(()) };
        let (begin, was_busy) = (Instant::now(), self.session.is_busy());
        let mut input = open.toolkit.take_egui_input(&open.window);
        self.script.act(&self.session, &mut input.events);
        let context = open.toolkit.egui_ctx().clone();
        let mut place = egui::Rect::ZERO;
        let output = context.run_ui(input, |ui| place = self.panel.show(ui, &mut self.session));
        open.toolkit.handle_platform_output(&open.window, output.platform_output);
        let scale = output.pixels_per_point;
        let [corner, end] = [place.min, place.max].map(|at| [at.x, at.y].map(|side| pixels(side * scale)));
        let size = [0, 1].map(|axis| end[axis].saturating_sub(corner[axis]));
        let drawn = self.session.resize(size).and_then(|()| self.session.step(Instant::now()));
        let ms = match drawn {
            Ok(ms) => {
                if ms > 0.0 {
                    self.panel.message.clear();
                }
                ms
            }
            Err(error) if is_refusal(&error) => {
                self.panel.message = error.to_string();
                0.0
            }
            Err(error) => return Err(error.into()),
        };
        open.take_textures(&output.textures_delta)?;
        let triangles = triangles(context.tessellate(output.shapes, scale), scale);
        let background = self.session.background();
        let picture = self.session.picture().map(|frames| Picture { frames, corner, size, background });
        let PhysicalSize { width, height } = open.window.inner_size();
        let is_shown = open.screen.show([width, height], picture.as_ref(), &triangles)?;
        let total = milliseconds_since(begin);
        if ms > 0.0 && is_shown {
            self.session.pace.learn_rest(total - ms);
            self.panel.frame_ms = total;
        }
        if self.script.note(&mut self.session, &self.panel, total, is_shown && ms > 0.0)? {
            events.exit();
        }
        let repaint = output.viewport_output.get(&ViewportId::ROOT).map(|of| of.repaint_delay);
        let is_hidden = width == 0 || height == 0;
        let waits = [
            repaint.and_then(|delay| Instant::now().checked_add(delay)),
            // The panel tells of the picture and of work beside it from the next frame on.
            (ms > 0.0 || was_busy != self.session.is_busy()).then(Instant::now),
            // A picture that is drawn but not shown, and results of work beside.
            (!is_shown && !is_hidden || self.session.is_busy()).then(|| Instant::now() + POLL),
            self.session.due().filter(|_| !is_hidden),
            self.script.is_active().then(Instant::now),
        ];
        open.due = waits.into_iter().flatten().min();
        Ok(())
    }

    /// Ends the program with a failure.
    fn check(&mut self, events: &ActiveEventLoop, outcome: Outcome) {
        if let Err(failure) = outcome {
            self.failure.get_or_insert(failure);
            events.exit();
        }
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            let opened = self.open(events).map(|open| {
                open.window.request_redraw();
                self.open = Some(open);
            });
            self.check(events, opened);
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => events.exit(),
            WindowEvent::RedrawRequested => {
                let outcome = self.redraw(events);
                self.check(events, outcome);
            }
            event => {
                if open.toolkit.on_window_event(&open.window, &event).repaint {
                    open.window.request_redraw();
                }
            }
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        self.open = None;
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        match open.due {
            Some(due) if due <= Instant::now() => {
                open.due = None;
                open.window.request_redraw();
                events.set_control_flow(ControlFlow::Wait);
            }
            Some(due) => events.set_control_flow(ControlFlow::WaitUntil(due)),
            None => events.set_control_flow(ControlFlow::Wait),
        }
    }
}

impl Open {
    /// Keeps the atlas of glyphs as the toolkit changes it.
    fn take_textures(&mut self, changes: &egui::TexturesDelta) -> volraster::Result<()> {
        // The panel has no other texture.
        let Some(changes) = changes.set.get(&TextureId::default()) else { return Ok(()) };
        for change in changes {
            let egui::ImageData::Color(image) = &change.image;
            let Some([left, top]) = change.pos else {
                self.atlas = egui::ColorImage::clone(image);
                continue;
            };
            let [width, stride] = [image.size[0], self.atlas.size[0]];
            for (row, texels) in image.pixels.chunks_exact(width.max(1)).enumerate() {
                let first = (top + row) * stride + left;
                if let Some(place) = self.atlas.pixels.get_mut(first..first + width) {
                    place.copy_from_slice(texels);
                }
            }
        }
        let texels: Vec<[u8; 4]> = self.atlas.pixels.iter().map(Color32::to_array).collect();
        let size = self.atlas.size.map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        self.screen.set_atlas(size, &texels)
    }
}

/// Returns pixels per point of a window.
fn scale(window: &Window) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "a small number")]
    let scale = window.scale_factor() as f32;
    scale
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates at 0 and above")]
fn pixels(length: f32) -> u32 {
    length.round() as u32
}

/// Returns the corners of all triangles of a panel.
fn triangles(primitives: Vec<ClippedPrimitive>, scale: f32) -> Vec<PanelCorner> {
    let mut corners = Vec::new();
    for ClippedPrimitive { clip_rect, primitive } in primitives {
        let Primitive::Mesh(mesh) = primitive else { continue };
        let packed = |at: Pos2| pixels(at.x * scale).min(0xffff) | pixels(at.y * scale).min(0xffff) << 16;
        let clip = [packed(clip_rect.min), packed(clip_rect.max)];
        let of_mesh = mesh.indices.iter().filter_map(|&i| mesh.vertices.get(usize::try_from(i).ok()?));
        corners.extend(of_mesh.map(|vertex| PanelCorner {
            position: [vertex.pos.x * scale, vertex.pos.y * scale],
            place: [vertex.uv.x, vertex.uv.y],
            clip,
            colour: u32::from_le_bytes(vertex.color.to_array()),
            pad: 0,
        }));
    }
    corners
}

/// A user for tests: waits for the complete picture, drags the mouse, waits again, saves picture and scene, and leaves.
pub(super) struct Script {
    begin: Instant,
    drag: Option<u32>,
    save: Option<PathBuf>,
    /// Frames still to drag, and when the drag began.
    dragging: Option<(u32, Instant)>,
    is_opened: bool,
    /// The longest frame of the drag, in milliseconds.
    longest: f64,
}

impl Script {
    pub(super) fn new(begin: Instant, drag: Option<u32>, save: Option<PathBuf>) -> Self {
        Self { begin, drag, save, dragging: None, is_opened: false, longest: 0.0 }
    }

    fn is_active(&self) -> bool {
        self.drag.is_some() || self.save.is_some()
    }

    /// Adds events of the mouse.
    fn act(&mut self, session: &Session, events: &mut Vec<Event>) {
        let button = |pos: Pos2, pressed: bool| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::default(),
        };
        let start = Pos2::new(100.0, 100.0);
        match (self.dragging, self.drag) {
            (Some((0, begin)), Some(frames)) => {
                events.push(button(start, false));
                let rate = f64::from(frames) / milliseconds_since(begin) * 1e3;
                let [width, height] = session.drawn_size();
                let line = format!(
                    "dragged: {frames} frames, {rate:.1} a second, the longest {:.0} ms, the last of {width} x {height}",
                    self.longest
                );
                let _ = output::print(&line);
                (self.dragging, self.drag) = (None, None);
            }
            (Some((left, _)), _) => {
                // To and fro, not to leave the picture.
                let shift = if left / 20 % 2 == 0 { 3.0 } else { -3.0 };
                let at = start + egui::vec2(shift * f32::from(u8::try_from(left % 20).unwrap_or(0)), 20.0);
                events.push(Event::PointerMoved(at));
            }
            (None, Some(frames)) if session.is_complete() && !session.is_busy() => {
                events.extend([Event::PointerMoved(start), button(start, true)]);
                self.dragging = Some((frames, Instant::now()));
            }
            _ => {}
        }
    }

    /// Notes a frame, and returns whether everything is done.
    fn note(
        &mut self,
        session: &mut Session,
        panel: &Panel,
        ms: f64,
        is_drawn: bool,
    ) -> volraster::Result<bool> {
        if let Some((left, _)) = &mut self.dragging
            && is_drawn
        {
            *left = left.saturating_sub(1);
            self.longest = self.longest.max(ms);
        }
        let (is_tested, is_still) = (self.drag.is_some() || self.save.is_some(), session.is_complete());
        if is_tested && !self.is_opened && is_drawn {
            self.is_opened = true;
            output::print(&format!("opened: picture after {:.0} ms", milliseconds_since(self.begin)))?;
        }
        let Some(path) = self.save.take_if(|_| self.drag.is_none() && is_still && self.is_opened) else {
            return Ok(false);
        };
        session.save_picture(&path)?;
        panel.save_scene(session, &path.with_extension("json"))?;
        Ok(true)
    }
}
