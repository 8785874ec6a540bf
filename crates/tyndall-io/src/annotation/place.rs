//! Where annotations stand: at an edge or in a corner that is asked for, else where they cover no data, or as little as possible.

use std::mem::{Discriminant, discriminant};
use std::str::FromStr;

use rayon::prelude::*;
use tyndall::scene::color::Key;
use tyndall::{Error, Image, Result};

use super::mark::Block;
use super::{Annotations, Behind, Item, What};

/// Where in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the middle of the left edge.
    Left,
    /// In the middle of the right edge.
    Right,
    /// In the middle of the upper edge.
    Top,
    /// In the middle of the lower edge.
    Bottom,
    /// In the corner.
    TopLeft,
    /// In the corner.
    TopRight,
    /// In the corner.
    BottomLeft,
    /// In the corner.
    BottomRight,
}

/// Names of places.
const NAMES: [(&str, Place); 8] = [
    ("left", Place::Left),
    ("right", Place::Right),
    ("top", Place::Top),
    ("bottom", Place::Bottom),
    ("top-left", Place::TopLeft),
    ("top-right", Place::TopRight),
    ("bottom-left", Place::BottomLeft),
    ("bottom-right", Place::BottomRight),
];

impl FromStr for Place {
    type Err = Error;

    /// Reads `left`, `right`, `top`, `bottom`, or a corner such as `top-left`.
    fn from_str(text: &str) -> Result<Self> {
        let found = NAMES.iter().find(|(name, _)| *name == text).map(|&(_, place)| place);
        found.ok_or_else(|| {
            let names = NAMES.map(|(name, _)| name);
            let meant = tyndall::names::nearest(text, names)
                .map_or(String::new(), |it| format!("did you mean '{it}'? "));
            Error::setting("a place", text, format!("{meant}known: {}", names.join(" ")))
        })
    }
}

impl Place {
    /// The shares of the room that is left over at the left and above: 0, a half or 1.
    fn shares(self) -> [f32; 2] {
        match self {
            Self::Left => [0.0, 0.5],
            Self::Right => [1.0, 0.5],
            Self::Top => [0.5, 0.0],
            Self::Bottom => [0.5, 1.0],
            Self::TopLeft => [0.0, 0.0],
            Self::TopRight => [1.0, 0.0],
            Self::BottomLeft => [0.0, 1.0],
            Self::BottomRight => [1.0, 1.0],
        }
    }
}

/// Where the items of a picture stand; those of pictures that follow it stand there too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrangement {
    /// By kind of item.
    spots: Vec<(Discriminant<What>, Spot)>,
}

/// A place, and by how many pixels it is farther from the upper or lower edge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spot {
    place: Place,
    shift: f32,
}

/// The room between annotations and the picture's edge, beside text of that size.
pub(super) fn margin(em: f32) -> f32 {
    (0.9 * em).round()
}

/// A rectangle: left, upper, right and lower edge.
type Rectangle = [f32; 4];

/// Where a block of that size stands.
fn rectangle(size: [f32; 2], spot: Spot, picture: [u32; 2], margin: f32) -> Rectangle {
    let [share_x, share_y] = spot.place.shares();
    let [x, y] = [(0, share_x), (1, share_y)].map(|(axis, share)| {
        let room = picture[axis] as f32 - 2.0 * margin - size[axis];
        (margin + share * room).round()
    });
    let y = if share_y == 1.0 { y - spot.shift } else { y + spot.shift };
    [x, y, x + size[0], y + size[1]]
}

fn overlap(a: &Rectangle, b: &Rectangle, gap: f32) -> bool {
    a[0] < b[2] + gap && b[0] < a[2] + gap && a[1] < b[3] + gap && b[1] < a[3] + gap
}

/// Places to try, the best first.
fn candidates(what: &What) -> &'static [Place] {
    use Place::{Bottom, BottomLeft, BottomRight, Left, Right, Top, TopLeft, TopRight};
    match what {
        What::Title(_) => &[Top, TopLeft, TopRight, Bottom],
        What::Label(_) => &[TopLeft, TopRight, BottomLeft, BottomRight, Bottom],
        What::Key(legend, _) => match legend.key {
            Key::Amounts(_) => &[Right, Left, TopRight, BottomRight, TopLeft, BottomLeft, Bottom, Top],
            Key::Kinds(_) => &[TopRight, TopLeft, BottomRight, BottomLeft, Right, Left, Bottom, Top],
        },
        What::ScaleBar(_) => &[BottomRight, BottomLeft, Bottom, TopRight, TopLeft, Top],
        What::Axes(_) => &[BottomLeft, BottomRight, TopLeft, TopRight],
    }
}

/// Which is placed first: what is largest or has the fewest places.
fn rank(item: &Item) -> u32 {
    let of_kind = match item.what {
        What::Title(_) => 0,
        What::Key(..) => 1,
        What::Axes(_) => 2,
        What::ScaleBar(_) => 3,
        What::Label(_) => 4,
    };
    // What is asked for comes before what may stand elsewhere.
    if item.at.is_some() { of_kind } else { 5 + of_kind }
}

/// See [`Annotations::arrange`].
pub(super) fn arrange(
    annotations: &Annotations,
    size: [u32; 2],
    (image, behind): (&Image, Behind),
) -> Arrangement {
    let em = annotations.em(size);
    let (margin, gap) = (margin(em), 0.6 * em);
    let data = Coverage::of(image, behind);
    // Pixels of the image for one of the picture.
    let scale = [image.width as f32 / size[0] as f32, image.height as f32 / size[1] as f32];
    let mut items: Vec<&Item> = annotations.items.iter().collect();
    items.sort_by_key(|item| rank(item));
    let mut taken: Vec<Rectangle> = Vec::new();
    let mut arrangement = Arrangement::default();
    for item in items {
        let asked = item.at.map(|place| [place]);
        let places = asked.as_ref().map_or(candidates(&item.what), |place| &place[..]);
        let mut best: Option<(f32, Spot, Rectangle)> = None;
        for &place in places {
            let block = annotations.block(item, place, size);
            let Some((spot, found)) = free(&block, place, (size, margin, gap), &taken) else { continue };
            let [left, top, right, bottom] = found;
            let covered = data.share(&[scale[0] * left, scale[1] * top, scale[0] * right, scale[1] * bottom]);
            // A later place has to be clearly better.
            if best.as_ref().is_none_or(|(least, ..)| covered < 0.8 * least - 1e-3) {
                best = Some((covered, spot, found));
            }
            if covered == 0.0 {
                break;
            }
        }
        // Where nothing is free, the first place is as bad as any.
        let (spot, found) = best.map_or_else(
            || {
                let spot = Spot { place: places[0], shift: 0.0 };
                let block = annotations.block(item, spot.place, size);
                (spot, rectangle(block.size, spot, size, margin))
            },
            |(_, spot, found)| (spot, found),
        );
        taken.push(found);
        arrangement.spots.push((discriminant(&item.what), spot));
    }
    arrangement
}

/// Where at a place a block touches no other: there, or behind those that stand there.
fn free(
    block: &Block,
    place: Place,
    (size, margin, gap): ([u32; 2], f32, f32),
    taken: &[Rectangle],
) -> Option<(Spot, Rectangle)> {
    let mut spot = Spot { place, shift: 0.0 };
    for _ in 0..=taken.len() {
        let found = rectangle(block.size, spot, size, margin);
        let Some(other) = taken.iter().find(|it| overlap(it, &found, gap)) else {
            let is_inside = found[0] >= 0.0
                && found[1] >= 0.0
                && found[2] <= size[0] as f32
                && found[3] <= size[1] as f32;
            return is_inside.then_some((spot, found));
        };
        let is_low = place.shares()[1] == 1.0;
        spot.shift += (if is_low { found[3] - other[1] } else { other[3] - found[1] } + gap).ceil();
    }
    None
}

/// An item as it is laid out in a picture of that size, and where its corner stands, in whole pixels.
pub(super) fn placed(
    annotations: &Annotations,
    item: &Item,
    arrangement: &Arrangement,
    size: [u32; 2],
) -> Option<(Block, [f32; 2])> {
    let kind = discriminant(&item.what);
    let spot = arrangement.spots.iter().find(|(other, _)| *other == kind)?.1;
    let block = annotations.block(item, spot.place, size);
    let [x, y, ..] = rectangle(block.size, spot, size, margin(annotations.em(size)));
    Some((block, [x, y]))
}

/// Cells of the coverage along the longer side of the picture.
const CELLS: u32 = 160;
/// The most that a linear channel of a pixel without data differs from what is behind.
const DIFFERENCE: f32 = 1e-3;

/// How many pixels of each cell of a picture show data.
struct Coverage {
    /// Edge of a cell, in pixels.
    edge: u32,
    across: usize,
    counts: Vec<u32>,
}

impl Coverage {
    fn of(image: &Image, behind: Behind) -> Self {
        let edge = image.width.max(image.height).div_ceil(CELLS).max(1);
        let (across, down) = (image.width.div_ceil(edge) as usize, image.height.div_ceil(edge) as usize);
        let is_data = |pixel: usize| {
            let color = image.color[pixel];
            image.id[pixel] >= 0
                || match behind {
                    Behind::Nothing => color[3] > DIFFERENCE,
                    Behind::Color(plain) => (0..3).any(|c| (color[c] - plain[c]).abs() > DIFFERENCE),
                    Behind::Picture => false,
                }
        };
        let cell = |cell: usize| {
            let [left, top] = [cell % across, cell / across].map(|it| it as u32 * edge);
            let rows = top..(top + edge).min(image.height);
            let pixels = rows.flat_map(|y| {
                (left..(left + edge).min(image.width))
                    .map(move |x| y as usize * image.width as usize + x as usize)
            });
            pixels.filter(|&pixel| is_data(pixel)).count() as u32
        };
        Self { edge, across, counts: (0..across * down).into_par_iter().map(cell).collect() }
    }

    /// The share of a rectangle's pixels that show data; cells that it touches count whole.
    fn share(&self, [left, top, right, bottom]: &Rectangle) -> f32 {
        let edge = self.edge as f32;
        let down = self.counts.len() / self.across;
        let range = |low: f32, high: f32, count: usize| {
            (low / edge).floor().max(0.0) as usize..((high / edge).ceil().max(0.0) as usize).min(count)
        };
        let columns = range(*left, *right, self.across);
        let rows = range(*top, *bottom, down);
        let pixels = (rows.len() * columns.len()) as f32 * edge * edge;
        let covered: u64 = rows
            .flat_map(|row| columns.clone().map(move |column| row * self.across + column))
            .map(|cell| u64::from(self.counts[cell]))
            .sum();
        covered as f32 / pixels.max(1.0)
    }
}
