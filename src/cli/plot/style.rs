//! Colours, marks, sizes of text and headings that charts share.

use super::picture::{Anchor, Colour, Mark, Picture};

/// Eight colours that colour-blind readers can tell apart (Okabe and Ito; the last two are darker than theirs).
pub(super) const COLOURS: [[u8; 3]; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [60, 60, 60],
    [136, 84, 24],
];

/// Marks: curves also differ in shape, for readers who see no colours.
const MARKS: [Mark; 6] = [Mark::Disc, Mark::Square, Mark::Up, Mark::Diamond, Mark::Cross, Mark::Down];

pub(super) const INK: Colour = ([34, 34, 34], 1.0);

pub(super) const GREY: Colour = ([110, 110, 110], 1.0);

pub(super) const GRID: Colour = ([228, 228, 228], 1.0);

pub(super) const FRAME: Colour = ([150, 150, 150], 1.0);

const TITLE: f64 = 17.0;

pub(super) const TEXT: f64 = 12.5;

/// Distance between lines of text.
pub(super) const LINE: f64 = 19.0;

/// Title, note and axis names of a chart.
#[derive(Clone, Debug)]
pub(crate) struct Titles {
    pub(crate) title: String,
    /// A smaller line below the title.
    pub(crate) note: String,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
}

pub(super) fn heading(picture: &mut Picture, titles: &Titles) {
    picture.text(&titles.title, [16.0, 28.0], TITLE, Anchor::Start, INK);
    picture.text(&titles.note, [16.0, 48.0], TEXT, Anchor::Start, GREY);
}

pub(super) fn colour(style: usize) -> [u8; 3] {
    COLOURS[style % COLOURS.len()]
}

pub(super) fn mark(style: usize) -> Mark {
    MARKS[style % MARKS.len()]
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(super) fn whole(length: f64) -> u32 {
    length.ceil() as u32
}
