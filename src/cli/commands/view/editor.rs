//! The editor of the transfer function: extinction and colour by scalar over the histogram of the samples.

use egui::{
    Color32, Mesh, Painter, PointerButton, Pos2, Rect, Response, Rgba, Sense, Shape, Stroke, Ui, pos2, vec2,
};
use volraster::Result;
use volraster::glam::DVec3;
use volraster::scene::{Knot, TransferFunction};

use super::session::Session;
use crate::cli::histogram::Histogram;
use crate::cli::numbers::number;

/// Height of the curve and of the strip of colours under it, in points.
const HEIGHT: f32 = 150.0;
const STRIP: f32 = 12.0;

/// Distance in points at which the mouse takes a knot.
const NEAR: f32 = 9.0;

/// The state of the editor.
#[derive(Debug, Default)]
pub(super) struct Editor {
    /// The knot in the mouse, or of the last click.
    knot: Option<usize>,
    /// Ends of the scalars and the largest extinction on the axes; they stay during a drag.
    axes: Option<([f64; 2], f64)>,
}

/// Scalar and extinction as a place in the panel. Heights are square roots, so that thin parts are seen.
struct Axes {
    place: Rect,
    range: [f64; 2],
    top: f64,
}

impl Axes {
    fn x(&self, s: f64) -> f32 {
        let [low, high] = self.range;
        self.place.left() + self.place.width() * single((s - low) / (high - low))
    }

    fn y(&self, tau: f64) -> f32 {
        self.place.bottom() - self.place.height() * single((tau / self.top).sqrt().min(1.0))
    }

    fn at(&self, knot: &Knot) -> Pos2 {
        pos2(self.x(knot.s), self.y(knot.tau))
    }

    /// Returns scalar and extinction at a place.
    fn values(&self, at: Pos2) -> [f64; 2] {
        let [low, high] = self.range;
        let [right, up] = [
            (at.x - self.place.left()) / self.place.width(),
            (self.place.bottom() - at.y) / self.place.height(),
        ];
        let [right, up] = [right, up].map(|share| f64::from(share.clamp(0.0, 1.0)));
        [low + (high - low) * right, self.top * up * up]
    }
}

#[expect(clippy::cast_possible_truncation, reason = "places in the panel")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Returns a linear colour for the toolkit.
fn shown(colour: DVec3) -> Color32 {
    let [r, g, b] = colour.to_array().map(single);
    Rgba::from_rgb(r.min(1.0), g.min(1.0), b.min(1.0)).into()
}

impl Editor {
    /// Shows the editor, and applies what the user does.
    pub(super) fn show(&mut self, ui: &mut Ui, session: &mut Session) -> Result<()> {
        let transfer = session.scene().transfer.clone();
        let all = session.scene().data.range();
        let size = vec2(ui.available_width(), HEIGHT + STRIP);
        let (place, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        let [low, high] = transfer.domain();
        let (range, top) = *self.axes.get_or_insert_with(|| {
            let (low, high) = (low.min(all[0]), high.max(all[1]));
            let range = if low < high { [low, high] } else { [low - 0.5, low + 0.5] };
            (range, 1.2 * transfer.max_tau().max(1e-30))
        });
        // Knots at the ends can be taken too.
        let inner = Rect::from_min_size(place.min + vec2(5.0, 5.0), vec2(size.x - 10.0, HEIGHT - 5.0));
        let axes = Axes { place: inner, range, top };
        draw(&ui.painter_at(place), &axes, &transfer, session.histogram.as_ref(), self.knot);
        let mut changed = self.edit(&response, &axes, transfer.knots());
        if !response.dragged() {
            self.axes = None;
        }
        ui.horizontal(|ui| {
            let Some(knot) = self.knot.and_then(|i| transfer.knots().get(i)) else {
                ui.label("double click: add a point, right: remove it");
                return;
            };
            let mut rgb = knot.colour.to_array().map(single);
            if ui.color_edit_button_rgb(&mut rgb).changed() {
                let mut knots = transfer.knots().to_vec();
                if let Some(knot) = self.knot.and_then(|i| knots.get_mut(i)) {
                    knot.colour = DVec3::from_array(rgb.map(f64::from));
                }
                changed = Some(knots);
            }
            ui.label(format!("at {}: extinction {}", number(knot.s), number(knot.tau)));
        });
        if let Some(knots) = changed {
            session.set_transfer(TransferFunction::new(knots)?);
        }
        Ok(())
    }

    /// Returns the knots after what the mouse does, if it changes any.
    fn edit(&mut self, response: &Response, axes: &Axes, knots: &[Knot]) -> Option<Vec<Knot>> {
        let mouse = response.interact_pointer_pos()?;
        let nearest = |mouse: Pos2| {
            let distance = |knot: &Knot| axes.at(knot).distance(mouse);
            let by_distance = |a: &usize, b: &usize| distance(&knots[*a]).total_cmp(&distance(&knots[*b]));
            (0..knots.len()).min_by(by_distance).filter(|&i| distance(&knots[i]) <= NEAR)
        };
        let [s, tau] = axes.values(mouse);
        if response.secondary_clicked() {
            self.knot = None;
            let removed = nearest(mouse).filter(|_| knots.len() > 1)?;
            return Some(
                knots.iter().enumerate().filter(|(i, _)| *i != removed).map(|(_, knot)| *knot).collect(),
            );
        }
        if response.double_clicked() && nearest(mouse).is_none() {
            let place = knots.partition_point(|knot| knot.s <= s);
            let colour = TransferFunction::new(knots.to_vec()).ok()?.at(s).0;
            let mut knots = knots.to_vec();
            knots.insert(place, Knot { s, colour, tau });
            self.knot = Some(place);
            return Some(knots);
        }
        if response.drag_started_by(PointerButton::Primary) || response.clicked() {
            // A drag is one only after some way.
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            self.knot = nearest(pressed.unwrap_or(mouse));
        }
        let held = self.knot.filter(|_| response.dragged_by(PointerButton::Primary))?;
        let mut moved = knots.to_vec();
        let below = held.checked_sub(1).map_or(axes.range[0], |i| knots[i].s);
        let above = knots.get(held + 1).map_or(axes.range[1], |knot| knot.s);
        *moved.get_mut(held)? = Knot { s: s.clamp(below, above.max(below)), tau, ..*knots.get(held)? };
        (moved != knots).then_some(moved)
    }
}

/// Draws histogram, curve, knots and colours.
fn draw(
    painter: &Painter,
    axes: &Axes,
    transfer: &TransferFunction,
    histogram: Option<&Histogram>,
    selected: Option<usize>,
) {
    let place = axes.place;
    painter.rect_filled(place.expand(5.0), 2.0, Color32::from_gray(16));
    if let Some(histogram) = histogram {
        let mut first = histogram.first;
        for height in histogram.heights() {
            let top = place.bottom() - place.height() * single(height);
            let bar =
                Rect::from_x_y_ranges(axes.x(first)..=axes.x(first + histogram.width), top..=place.bottom());
            painter.rect_filled(bar, 0.0, Color32::from_gray(62));
            first += histogram.width;
        }
    }
    // Columns of one point: between knots the curve bends, and colours mix in linear light.
    let mut strip = Mesh::default();
    let mut curve = Vec::new();
    let mut x = place.left();
    while x <= place.right() {
        let (colour, tau) = transfer.at(axes.values(pos2(x, 0.0))[0]);
        curve.push(pos2(x, axes.y(tau)));
        let column = Rect::from_x_y_ranges(x..=x + 1.0, place.bottom() + 3.0..=place.bottom() + STRIP);
        strip.add_colored_rect(column, shown(colour));
        x += 1.0;
    }
    painter.add(strip);
    painter.add(Shape::line(curve, Stroke::new(1.5, Color32::from_gray(220))));
    let knots = transfer.knots();
    let radius = if knots.len() > 24 { 2.5 } else { 4.0 };
    for (i, knot) in knots.iter().enumerate() {
        let rim = if selected == Some(i) { Color32::WHITE } else { Color32::from_gray(150) };
        painter.circle(axes.at(knot), radius, shown(knot.colour), Stroke::new(1.5, rim));
    }
}
