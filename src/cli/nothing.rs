//! Pictures of nothing: whether an image shows nothing, and why.

use volraster::Image;
use volraster::scene::{Scene, TransferFunction, View};

use super::numbers::number;

/// Returns the reason why an image shows nothing; `None` where it shows something.
pub(crate) fn why_nothing(image: &Image, scene: &Scene, view: &View) -> Option<String> {
    let is_empty = image.pixels().iter().all(|pixel| pixel.iter().all(|channel| *channel == 0.0));
    is_empty.then(|| {
        let [low, high] = scene.data.range();
        if is_outside(scene, view) {
            "the data lies outside of the camera's view".to_string()
        } else if most_extinction(&scene.transfer, [low, high]) <= 0.0 {
            let range = [low, high].map(number).join(" to ");
            format!("the transfer function has no extinction at the data's scalars, {range}")
        } else if !view.clip().is_none() {
            "clip planes or the crop box may have cut away what has extinction".to_string()
        } else {
            "no ray of a pixel meets anything that has extinction".to_string()
        }
    })
}

/// Returns whether the box of the data lies behind the eye, or beyond one side of what the camera sees.
fn is_outside(scene: &Scene, view: &View) -> bool {
    let [half_width, half_height] = view.extent().map(|side| 0.5 * f64::from(side) * view.pixel_size());
    let corners = scene.data.corners().map(|corner| {
        let relative = corner - view.camera().eye;
        let depth = relative.dot(view.forward());
        // The view of an eye widens with depth.
        let wide = if view.is_perspective() { depth } else { 1.0 };
        // Rays of a parallel view begin before everything.
        let behind = if view.is_perspective() { -depth } else { -1.0 };
        let [x, y] = [relative.dot(view.right()), relative.dot(view.up())];
        [
            x - half_width * wide,
            -x - half_width * wide,
            y - half_height * wide,
            -y - half_height * wide,
            behind,
        ]
    });
    (0..5).any(|side| corners.iter().all(|beyond| beyond[side] > 0.0))
}

/// Returns the greatest extinction of scalars in a range.
fn most_extinction(transfer: &TransferFunction, [low, high]: [f64; 2]) -> f64 {
    let knots = transfer.knots().iter().filter(|knot| (low..=high).contains(&knot.s)).map(|knot| knot.tau);
    knots.chain([low, high].map(|s| transfer.at(s).1)).fold(0.0, f64::max)
}
