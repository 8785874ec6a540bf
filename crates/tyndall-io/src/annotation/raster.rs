//! Marks as pixels: each covers a pixel by the exact area, and is laid over what is there in linear light.
//!
//! A text over data first gets a rim in the color of what is behind the data: on what is behind it nobody sees it, so it needs no
//! decision where it is needed.

use ab_glyph::Point;
use ab_glyph_rasterizer::Rasterizer;

use super::font::{Curve, Font};
use super::mark::{Block, Direction, Ink, Mark};
use super::{MIDDLE, linear, luminance};

/// A picture to be drawn on, or a band of its rows.
#[derive(Clone, Copy)]
pub(super) struct Canvas {
    /// Pixels across and rows.
    pub(super) size: [u32; 2],
    /// Rows of the picture above it.
    pub(super) first_row: u32,
    /// Of texts, sRGB.
    pub(super) text: [u8; 3],
    /// Around marks that are over something, linear.
    pub(super) rim: [f32; 3],
}

/// How far the rim reaches, in ems of the text.
const RIM: f32 = 0.13;
/// See [`Canvas::weight`]: half way to what programs do that mix encoded colors.
const DARK_WEIGHT: f32 = 1.7;
/// How much of the data the rim hides.
const OPACITY: f32 = 0.8;

/// A mark and the pixels that it covers.
pub(super) struct Drawn {
    mark: Mark,
    mask: Option<Mask>,
    /// Around it, over what is there.
    rim: Option<Mask>,
}

/// How much of some pixels is covered, 0 to 1, from the pixel `corner` on.
pub(super) struct Mask {
    corner: [i64; 2],
    width: usize,
    coverage: Vec<f32>,
}

impl Canvas {
    /// The marks of a block whose corner is at a pixel of the picture.
    pub(super) fn marks(&self, block: &Block, corner: [f32; 2], font: &Font) -> Vec<Drawn> {
        let drawn = |mark: &Mark| {
            let mark = mark.clone().moved(corner);
            let covered = mask(&mark, font);
            match (&mark, covered) {
                (Mark::Text { em, .. }, Some(covered)) => {
                    let rim = Some(covered.grown((RIM * em).max(1.0)));
                    let mask = Some(covered.weighted(self.weight()));
                    Drawn { mark, mask, rim }
                }
                (_, mask) => Drawn { mark, mask, rim: None },
            }
        };
        block.marks.iter().map(drawn).collect()
    }

    /// Draws the marks of a block.
    pub(super) fn draw(&self, marks: &[Drawn], color: &mut [[f32; 4]]) {
        for rim in marks.iter().filter_map(|mark| mark.rim.as_ref()) {
            self.blend(rim, color, |pixel, coverage| {
                // Only over what is there: a transparent picture stays so.
                let share = OPACITY * coverage;
                let [red, green, blue] = self.rim.map(|it| share * it * pixel[3]);
                let [r, g, b, alpha] = *pixel;
                [red + (1.0 - share) * r, green + (1.0 - share) * g, blue + (1.0 - share) * b, alpha]
            });
        }
        for Drawn { mark, mask, .. } in marks {
            match (mark, mask) {
                (Mark::Colors { corner, size, colors, direction }, _) => {
                    self.colors((*corner, *size), colors, *direction, color);
                }
                (Mark::Area { ink: Ink::Color(own), .. }, Some(mask)) => self.fill(mask, linear(*own), color),
                (Mark::Area { .. } | Mark::Text { .. }, Some(mask)) => {
                    self.fill(mask, linear(self.text), color)
                }
                (_, None) => {}
            }
        }
    }

    /// The power by which what dark text leaves of a pixel is less: in linear light its thin lines would look gray. Bright text needs none.
    fn weight(&self) -> f32 {
        if luminance(linear(self.text)) > MIDDLE { 1.0 } else { DARK_WEIGHT }
    }

    /// Lays a color over pixels by their coverage.
    fn fill(&self, mask: &Mask, [red, green, blue]: [f32; 3], color: &mut [[f32; 4]]) {
        self.blend(mask, color, |pixel, coverage| {
            let over = [coverage * red, coverage * green, coverage * blue, coverage];
            std::array::from_fn(|c| over[c] + (1.0 - coverage) * pixel[c])
        });
    }

    /// Lays the color of texts over pixels of the picture, but for those that `is_hidden`, which gets the middle of a pixel.
    pub(super) fn fill_behind(
        &self,
        mask: &Mask,
        color: &mut [[f32; 4]],
        is_hidden: impl Fn(f32, f32) -> bool,
    ) {
        let [width, height] = self.size.map(i64::from);
        let [x, y] = mask.corner;
        let first_row = i64::from(self.first_row);
        let mut kept = Mask { coverage: mask.coverage.clone(), ..*mask };
        for (place, coverage) in kept.coverage.iter_mut().enumerate() {
            let at = [x + (place % mask.width) as i64, y + (place / mask.width) as i64];
            let is_inside = (0..width).contains(&at[0]) && (first_row..first_row + height).contains(&at[1]);
            if *coverage > 0.0 && is_inside && is_hidden(at[0] as f32 + 0.5, at[1] as f32 + 0.5) {
                *coverage = 0.0;
            }
        }
        self.fill(&kept, linear(self.text), color);
    }

    /// Replaces the pixels that a mask covers and the canvas has.
    fn blend(&self, mask: &Mask, color: &mut [[f32; 4]], mixed: impl Fn(&[f32; 4], f32) -> [f32; 4]) {
        let [width, height] = self.size.map(i64::from);
        for (row, coverage) in mask.coverage.chunks_exact(mask.width.max(1)).enumerate() {
            let y = mask.corner[1] + row as i64 - i64::from(self.first_row);
            if !(0..height).contains(&y) {
                continue;
            }
            for (x, &coverage) in (mask.corner[0]..).zip(coverage) {
                if coverage > 0.0 && (0..width).contains(&x) {
                    let pixel = &mut color[(y * width + x) as usize];
                    *pixel = mixed(pixel, coverage.min(1.0));
                }
            }
        }
    }

    /// Fills whole pixels, each with one of the colors.
    fn colors(
        &self,
        (corner, size): ([f32; 2], [f32; 2]),
        colors: &[[u8; 3]],
        direction: Direction,
        color: &mut [[f32; 4]],
    ) {
        let [width, height] = self.size.map(i64::from);
        let [left, top] = corner.map(|it| it.round() as i64);
        let top = top - i64::from(self.first_row);
        let [across, down] = size.map(|it| it.round() as i64);
        for y in (0..down).filter(|y| (0..height).contains(&(top + y))) {
            for x in (0..across).filter(|x| (0..width).contains(&(left + x))) {
                let (at, length) =
                    if direction == Direction::Up { (down - 1 - y, down) } else { (x, across) };
                let [red, green, blue] = linear(colors[level(at, length, colors.len())]);
                color[((top + y) * width + left + x) as usize] = [red, green, blue, 1.0];
            }
        }
    }
}

/// Which of `count` colors has pixel `at` of `length`: that at its middle.
fn level(at: i64, length: i64, count: usize) -> usize {
    ((2 * at + 1) as usize * count / (2 * length as usize)).min(count - 1)
}

/// The pixels that a mark covers; none of a run of colors, or of nothing.
pub(super) fn mask(mark: &Mark, font: &Font) -> Option<Mask> {
    let curves = match mark {
        Mark::Colors { .. } => return None,
        Mark::Text { text, at, em, align } => {
            font.outlines(text, *em, [align.start(at[0], font.width(text, *em)), at[1]])
        }
        Mark::Area { corners, .. } => {
            let next = corners.iter().cycle().skip(1);
            let point = |&[x, y]: &[f32; 2]| Point { x, y };
            corners.iter().zip(next).map(|(from, to)| Curve::Line(point(from), point(to))).collect()
        }
    };
    let points = curves.iter().flat_map(|curve| match *curve {
        Curve::Line(a, b) => vec![a, b],
        Curve::Quad(a, b, c) => vec![a, b, c],
        Curve::Cubic(a, b, c, d) => vec![a, b, c, d],
    });
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for point in points {
        for (axis, value) in [point.x, point.y].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(value), high[axis].max(value));
        }
    }
    if !(low[0] < high[0] && low[1] < high[1]) {
        return None;
    }
    let corner = low.map(|it| it.floor() - 1.0);
    let [width, height] = [0, 1].map(|axis| (high[axis].ceil() - corner[axis]) as usize + 1);
    let mut raster = Rasterizer::new(width, height);
    let place = |at: Point| Point { x: at.x - corner[0], y: at.y - corner[1] };
    for curve in curves {
        match curve {
            Curve::Line(a, b) => raster.draw_line(place(a), place(b)),
            Curve::Quad(a, b, c) => raster.draw_quad(place(a), place(b), place(c)),
            Curve::Cubic(a, b, c, d) => raster.draw_cubic(place(a), place(b), place(c), place(d)),
        }
    }
    let mut coverage = vec![0.0; width * height];
    raster.for_each_pixel(|place, value| coverage[place] = value);
    Some(Mask { corner: corner.map(|it| it as i64), width, coverage })
}

impl Mask {
    /// The same, of which less shines through.
    fn weighted(&self, power: f32) -> Self {
        let coverage = self.coverage.iter().map(|value| 1.0 - (1.0 - value.clamp(0.0, 1.0)).powf(power));
        Self { coverage: coverage.collect(), ..*self }
    }

    /// All within `radius` of what is covered.
    fn grown(&self, radius: f32) -> Self {
        let border = radius.ceil() as usize;
        let height = self.coverage.len() / self.width;
        let (width, tall) = (self.width + 2 * border, height + 2 * border);
        let mut coverage = vec![0.0_f32; width * tall];
        let reach = border as i64;
        // A pixel at the disk's edge is covered in part.
        let disk: Vec<(i64, i64, f32)> = (-reach..=reach)
            .flat_map(|y| (-reach..=reach).map(move |x| (x, y, radius + 0.5 - (x as f32).hypot(y as f32))))
            .filter(|(_, _, share)| *share > 0.0)
            .map(|(x, y, share)| (x, y, share.min(1.0)))
            .collect();
        // What lies around a pixel with covered neighbors lies around these too.
        let is_full = |place: usize| self.coverage.get(place).is_some_and(|value| *value >= 1.0);
        let is_inner = |place: usize| {
            let neighbors =
                [place.wrapping_sub(1), place + 1, place.wrapping_sub(self.width), place + self.width];
            is_full(place) && neighbors.into_iter().all(is_full)
        };
        let center = [(0, 0, 1.0)];
        for (place, &value) in self.coverage.iter().enumerate().filter(|(_, value)| **value > 0.0) {
            let (x, y) = ((place % self.width + border) as i64, (place / self.width + border) as i64);
            for &(dx, dy, share) in if is_inner(place) { &center[..] } else { &disk } {
                let grown = &mut coverage[((y + dy) * width as i64 + x + dx) as usize];
                *grown = grown.max(value * share);
            }
        }
        Self { corner: self.corner.map(|it| it - border as i64), width, coverage }
    }
}
