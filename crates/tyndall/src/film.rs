//! The finished picture, as plain columns of pixels, row by row from the top left.

use crate::error::{Error, Result};

/// A picture with its layers. Every column holds `width * height` values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB (Rec. 709 primaries), premultiplied by the alpha in the fourth place.
    pub color: Vec<[f32; 4]>,
    /// Distance from the eye along the ray (orthographic: from the plane through the eye), of the sample nearest the pixel's
    /// center, in the length unit of the particles; infinity where that sample met nothing.
    pub depth: Vec<f32>,
    /// Place in the file of the particle that the same sample met; -1 where it met nothing.
    pub id: Vec<i64>,
}

/// A rectangle of a picture's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Pixels left of it.
    pub x: u32,
    /// Rows above it.
    pub y: u32,
    /// Pixels in a row of it.
    pub width: u32,
    /// Rows of it.
    pub height: u32,
}

impl Window {
    /// All of a picture of that size.
    pub fn whole(width: u32, height: u32) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Fails with [`Error::Setting`] if it is empty or reaches beyond a picture of that size.
    pub fn check(&self, width: u32, height: u32) -> Result<()> {
        let Self { x, y, width: across, height: down } = *self;
        let fits = |start: u32, length: u32, all: u32| length > 0 && start < all && length <= all - start;
        if fits(x, across, width) && fits(y, down, height) {
            return Ok(());
        }
        let allowed = format!("X,Y,WIDTH,HEIGHT within the picture, which has {width}x{height} pixels");
        Err(Error::setting("--crop", format!("{x},{y},{across},{down}"), allowed))
    }

    /// Its values of a column of a picture with rows of `width` pixels.
    ///
    /// Panics if the column has fewer rows than the window needs.
    pub fn cut<T: Copy>(&self, width: u32, column: &[T]) -> Vec<T> {
        let rows = column.chunks(width as usize).skip(self.y as usize).take(self.height as usize);
        let (start, end) = (self.x as usize, (self.x + self.width) as usize);
        rows.flat_map(|row| &row[start..end]).copied().collect()
    }

    /// How many of the pixels from `x` to `x + edge` and from `y` to `y + edge` lie in it.
    pub(crate) fn pixels_of(&self, x: u32, y: u32, edge: u32) -> u64 {
        let shared = |at: u32, start: u32, length: u32| {
            u64::from((at + edge).min(start + length).saturating_sub(at.max(start)))
        };
        shared(x, self.x, self.width) * shared(y, self.y, self.height)
    }
}

/// Where a pixel's depth lies, and how the surface there faces; both are 0 where nothing was met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// In the coordinates of the particles' file.
    pub position: [f32; 3],
    /// Of unit length, away from the particle.
    pub normal: [f32; 3],
}

impl Image {
    /// A picture without particles: linear RGB `background` if there is one, else transparent.
    pub(crate) fn empty(width: u32, height: u32, background: Option<[f32; 3]>) -> Self {
        let pixels = width as usize * height as usize;
        let color = background.map_or([0.0; 4], |[r, g, b]| [r, g, b, 1.0]);
        let (color, depth, id) = (vec![color; pixels], vec![f32::INFINITY; pixels], vec![-1; pixels]);
        Self { width, height, color, depth, id }
    }

    /// Makes room for a picture of that size; what is in it then has no meaning.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let pixels = width as usize * height as usize;
        (self.width, self.height) = (width, height);
        self.color.resize(pixels, [0.0; 4]);
        self.depth.resize(pixels, f32::INFINITY);
        self.id.resize(pixels, -1);
    }

    /// Fills this picture with another, of which each pixel becomes a block of `edge` by `edge`.
    pub(crate) fn enlarge(&mut self, coarse: &Self, edge: u32) {
        let (width, edge) = (self.width as usize, edge as usize);
        let rows =
            self.color.chunks_mut(width).zip(self.depth.chunks_mut(width)).zip(self.id.chunks_mut(width));
        for (y, ((color, depth), id)) in rows.enumerate() {
            let first = y / edge * coarse.width as usize;
            for x in 0..width {
                let from = first + x / edge;
                (color[x], depth[x], id[x]) = (coarse.color[from], coarse.depth[from], coarse.id[from]);
            }
        }
    }

    /// The part of the picture in a window that lies within it.
    pub fn part(&self, window: Window) -> Self {
        let Window { width, height, .. } = window;
        let (color, depth) = (window.cut(self.width, &self.color), window.cut(self.width, &self.depth));
        Self { width, height, color, depth, id: window.cut(self.width, &self.id) }
    }

    /// Whether no sample met a particle: no pixel has an id, and all have the same color.
    pub fn shows_nothing(&self) -> bool {
        self.id.iter().all(|&id| id < 0) && self.color.iter().all(|&color| color == self.color[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_lies_within_its_picture() {
        let window = |x, y, width, height| Window { x, y, width, height };
        for good in [window(0, 0, 7, 5), window(6, 4, 1, 1), window(2, 0, 5, 1)] {
            assert!(good.check(7, 5).is_ok(), "{good:?}");
        }
        for bad in [window(0, 0, 0, 5), window(7, 0, 1, 1), window(1, 0, 7, 1), window(0, 1, 1, u32::MAX)] {
            assert!(bad.check(7, 5).is_err(), "{bad:?}");
        }
        assert_eq!(window(30, 33, 5, 9).pixels_of(0, 32, 32), 2 * 9);
        assert_eq!(window(30, 33, 5, 9).pixels_of(64, 32, 32), 0);
    }
}
