//! What is written over a picture: title, labels, what colors mean, scale bar, axes. Sizes follow the picture's.
//!
//! An [`Item`] says what; its layout is a `Block` of marks: areas, texts and runs of colors, in pixels. [`Annotations::arrange`]
//! finds places that cover no data, [`Layout::draw`] turns marks into pixels, [`key_svg`] into SVG. Edges lie on pixels or cover them by
//! area, so that all is crisp at any size; the colors of a bar are those of the particles, to the bit.

mod axes;
mod cell;
mod font;
mod key;
mod mark;
mod place;
mod raster;
mod scale_bar;
mod svg;
mod ticks;

use tyndall::Image;
use tyndall::film::Window;
use tyndall::scene::color::Legend;
use tyndall::srgb::linear_from_encoded;

pub use axes::directions;
pub use cell::Surface;
pub use font::Font;
pub use key::title;
use mark::{Align, Block, Mark};
pub use place::{Arrangement, Place};
pub use scale_bar::{Length, ScaleBar};
pub use svg::key_svg;

/// How annotations look.
#[derive(Clone, Debug)]
pub struct Style {
    /// What texts are written with.
    pub font: Font,
    /// Of texts and lines, sRGB; `None`: black or white, whichever stands out from what is behind the data.
    pub color: Option<[u8; 3]>,
    /// Size over the usual one, above 0.
    pub scale: f32,
}

impl Default for Style {
    fn default() -> Self {
        Self { font: Font::embedded(), color: None, scale: 1.0 }
    }
}

/// What is behind the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Behind {
    /// Nothing: the picture is transparent there.
    Nothing,
    /// Linear RGB.
    Color([f32; 3]),
    /// Another picture, such as a sky.
    Picture,
}

/// A picture as a part of what a camera sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Pixels across and down of what the camera sees.
    pub seen: [u32; 2],
    /// The part that the picture is.
    pub part: Window,
}

impl Frame {
    /// All that a camera sees, in a picture of that size.
    pub fn whole([width, height]: [u32; 2]) -> Self {
        Self { seen: [width, height], part: Window::whole(width, height) }
    }

    /// Pixels across and down of the picture.
    pub fn size(&self) -> [u32; 2] {
        [self.part.width, self.part.height]
    }
}

/// Something to be written over a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What it is; of each kind there is one at most.
    pub what: What,
    /// Where it stands; `None`: where it covers no data, or as little as possible.
    pub at: Option<Place>,
}

/// See [`Item`].
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// A large line of text.
    Title(String),
    /// A line of text, such as a time.
    Label(String),
    /// What colors mean, under a heading (see [`title`]): a bar with ticks, or a list of names.
    Key(Legend, String),
    /// A length, to scale.
    ScaleBar(ScaleBar),
    /// The axes x, y and z as arrows: see [`directions`].
    Axes([[f32; 3]; 3]),
}

/// What is written over a picture.
#[derive(Clone, Debug, Default)]
pub struct Annotations {
    /// How it looks.
    pub style: Style,
    /// What there is.
    pub items: Vec<Item>,
}

/// Height of the usual text over the root of the picture's area.
const EM: f32 = 0.021;
/// No text is smaller, in pixels, unless the picture itself is small.
const LEAST_EM: f32 = 11.0;
/// Nor larger than this share of the picture's shorter side.
const MOST_EM: f32 = 0.06;
/// A title's size over that of other texts.
const TITLE: f32 = 1.35;

impl Annotations {
    /// Finds places for all items in a picture of that size, data before `behind`, and like pictures that follow it. `image` may be the same picture
    /// in a smaller size.
    pub fn arrange(&self, size: [u32; 2], image: &Image, behind: Behind) -> Arrangement {
        place::arrange(self, size, (image, behind))
    }

    /// All items at their places in a picture of that size.
    pub fn lay_out(&self, arrangement: &Arrangement, size: [u32; 2], behind: Behind) -> Layout {
        let ink = self.ink(behind);
        let canvas = raster::Canvas { size, first_row: 0, text: ink, rim: rim(behind, ink) };
        let placed = self.items.iter().filter_map(|item| place::placed(self, item, arrangement, size));
        let blocks = placed.map(|(block, corner)| canvas.marks(&block, corner, &self.style.font)).collect();
        Layout { canvas, blocks }
    }

    /// The color of texts and lines: sRGB.
    pub fn ink(&self, behind: Behind) -> [u8; 3] {
        self.style.color.unwrap_or(match behind {
            // Dark on a page, which is what transparent pictures are for.
            Behind::Nothing => [0; 3],
            Behind::Color(color) if luminance(color) > MIDDLE => [0; 3],
            Behind::Color(_) | Behind::Picture => [255; 3],
        })
    }

    /// A character of some text that the font has not, if there is one.
    pub fn missing_character(&self) -> Option<char> {
        self.items.iter().find_map(|item| match &item.what {
            What::Title(text) | What::Label(text) => self.style.font.missing(text),
            What::Key(legend, title) => {
                let names = key::names(legend).find_map(|name| self.style.font.missing(name));
                names.or_else(|| self.style.font.missing(title))
            }
            What::ScaleBar(bar) => self.style.font.missing(&bar.label),
            What::Axes(_) => None,
        })
    }

    /// The height of the usual text in a picture of that size, in pixels.
    fn em(&self, [width, height]: [u32; 2]) -> f32 {
        let usual = EM * (width as f32 * height as f32).sqrt();
        (usual.max(LEAST_EM) * self.style.scale)
            .min(MOST_EM * width.min(height) as f32 * self.style.scale.max(1.0))
    }

    /// An item at a place of a picture of that size.
    fn block(&self, item: &Item, place: Place, size: [u32; 2]) -> Block {
        let em = self.em(size);
        let font = &self.style.font;
        match &item.what {
            What::Title(text) => line(text, TITLE * em, font, size),
            What::Label(text) => line(text, em, font, size),
            What::Key(legend, title) => {
                key::block(legend, title, &key::Room { em, font, size, place: Some(place) })
            }
            What::ScaleBar(bar) => bar.block(em, font),
            What::Axes(directions) => axes::block(directions, em),
        }
    }
}

/// What is written over a picture, in pixels.
pub struct Layout {
    canvas: raster::Canvas,
    blocks: Vec<Vec<raster::Drawn>>,
}

impl Layout {
    /// Draws all over `color`, rows of the picture from `first_row` on: linear RGB, premultiplied by the alpha in the fourth place.
    ///
    /// Where they are over data, texts have a rim in the color of what is behind it. With all pixels transparent this gives a layer of
    /// its own. Panics if `color` has not whole rows.
    pub fn draw(&self, first_row: u32, color: &mut [[f32; 4]]) {
        let [width, _] = self.canvas.size;
        let rows = color.len() / width as usize;
        assert_eq!(color.len(), width as usize * rows, "whole rows of the picture");
        let canvas = raster::Canvas { size: [width, rows as u32], first_row, ..self.canvas };
        self.blocks.iter().for_each(|marks| canvas.draw(marks, color));
    }
}

/// A luminance that looks as far from black as from white.
const MIDDLE: f32 = 0.18;

/// The luminance of linear RGB.
fn luminance([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The color around texts over data: that behind the data, or the opposite of the text's. Linear RGB.
fn rim(behind: Behind, ink: [u8; 3]) -> [f32; 3] {
    match behind {
        Behind::Color(color) => color,
        _ if luminance(linear(ink)) > MIDDLE => [0.0; 3],
        _ => [1.0; 3],
    }
}

/// The linear color of sRGB bytes.
fn linear(color: [u8; 3]) -> [f32; 3] {
    color.map(|byte| linear_from_encoded(f32::from(byte) / 255.0))
}

/// A line of text, smaller where the picture is narrower.
fn line(text: &str, em: f32, font: &Font, [width, _]: [u32; 2]) -> Block {
    let room = width as f32 - 2.0 * place::margin(em);
    let em = em * (room / font.width(text, em).max(1e-3)).min(1.0);
    let at = [0.0, font.ascent(em)];
    let marks = vec![Mark::Text { text: text.into(), at, em, align: Align::Left }];
    Block { size: [font.width(text, em), font.ascent(em) + font.descent(em)], marks }
}

#[cfg(test)]
mod tests;
