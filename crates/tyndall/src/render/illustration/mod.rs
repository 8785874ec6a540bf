//! What is drawn over a finished picture by what lies before what: contours.
//!
//! Every pixel is looked at in 4 x 4 places, whose depths and nodes are found by one ray each. Each place decides for itself how much of it is
//! covered, and the pixel takes the mean, so that what is drawn has smooth edges however few samples the picture has. It is drawn into linear light,
//! whatever device made the picture. The part of a picture is that of the whole, bit for bit: decisions look at distances between places alone.
//! Sources: Saito and Takahashi 1990, Comprehensible Rendering of 3-D Shapes (lines where depth or surface change); Felzenszwalb and Huttenlocher
//! 2012, Distance Transforms of Sampled Functions (rows, then columns).

mod contours;
mod fine;
mod nearest;

use rayon::prelude::*;

use super::{Culling, Settings};
use crate::error::{Error, Result};
use crate::film::{Image, Window};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::light::{Lighting, Paths};
use fine::Fine;

/// Widths are those in a picture of so many rows, and grow with the picture, so that a large picture looks as a small one does.
pub const REFERENCE_ROWS: f32 = 1080.0;
/// The widest that a line can be, in such a picture.
const WIDEST: f32 = 100.0;
/// Places along the edge of a pixel.
const PLACES: u32 = 4;
/// The most places along the edge of a picture; larger pictures have fewer a pixel.
const MOST_PLACES: u32 = 1 << 16;
/// Pixels along the edge of what is drawn at one time.
const BLOCK: u32 = 256;

/// Lines where a surface ends in front of another one or of nothing, and where surfaces cut each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contours {
    /// Pixels across, half of them on either side of the edge, in a picture of [`REFERENCE_ROWS`] rows; above 0, at most 100.
    pub width: f32,
    /// Linear RGB.
    pub color: [f32; 3],
    /// How far what lies behind lies behind at least, as seen against the line's width: a line of 2 pixels with a jump of 3 stands before what is 6 pixels
    /// further away. Where surfaces cut each other, their radii are larger than that. So there are no lines around what is smaller than they are. At least 0.
    pub jump: f32,
}

impl Default for Contours {
    /// Black, 2 pixels.
    fn default() -> Self {
        Self { width: 2.0, color: [0.0; 3], jump: 2.0 }
    }
}

/// What is drawn over a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Illustration {
    /// Lines.
    pub contours: Option<Contours>,
}

/// What is drawn on a pixel, as shares of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Drawn {
    /// Under a line.
    line: f32,
}

impl Illustration {
    /// Whether pictures stay as they are.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Fails with [`Error::Setting`] if a number is out of range.
    pub fn check(&self) -> Result<()> {
        if let Some(Contours { width, jump, .. }) = self.contours {
            if !(width > 0.0 && width <= WIDEST) {
                let allowed = "above 0 and at most 100 pixels, of a picture of 1080 rows";
                return Err(Error::setting("--outline", width, allowed));
            }
            if !(jump >= 0.0 && jump.is_finite()) {
                return Err(Error::setting("--outline-jump", jump, "0 or more, in the line's widths"));
            }
        }
        Ok(())
    }

    /// Draws over `image`, which is the part in `window` of a picture of `size` pixels of that scene. Depths and ids stay as they are.
    ///
    /// Fails as [`Self::check`] does, if camera or window are out of range, if the image has another size than the window, if the light has a lens,
    /// behind which edges are blurred, and when interrupted.
    pub fn draw(
        &self,
        (scene, camera): (&Scene, &Camera),
        size: [u32; 2],
        window: Window,
        image: &mut Image,
        progress: &dyn Progress,
    ) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        self.check()?;
        if matches!(scene.lighting, Lighting::Paths(Paths { lens: Some(_), .. })) {
            return Err(Error::setting(
                "--outline",
                "given",
                "left out with a lens, behind which edges are blurred",
            ));
        }
        let [width, height] = size;
        window.check(width, height)?;
        if [image.width, image.height] != [window.width, window.height] {
            let found = format!("{}x{}", image.width, image.height);
            return Err(Error::setting("image", found, format!("{}x{} pixels", window.width, window.height)));
        }
        let places = (MOST_PLACES / width.max(height)).clamp(1, PLACES);
        let settings = Settings {
            width: width * places,
            height: height * places,
            samples: 1,
            seed: 0,
            culling: Culling::Off,
        };
        progress.begin("draw", Some(u64::from(window.width) * u64::from(window.height)), "pixels");
        for block in blocks(window) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let around = self.reach(&settings);
            let fine = Fine::of((scene, camera), &settings, grown(block, places, around, &settings))?;
            self.draw_block(&fine, (block, places), &settings, (window, image));
            progress.advance(u64::from(block.width) * u64::from(block.height));
        }
        Ok(())
    }

    /// How far places are looked at around one, in places.
    fn reach(&self, fine: &Settings) -> u32 {
        self.contours.map_or(0, |it| contours::reach(it.width * scale(fine)) as u32 + 1)
    }

    /// Draws over the pixels in `block` of the picture, each of `places` x `places` places.
    fn draw_block(
        &self,
        fine: &Fine,
        (block, places): (Window, u32),
        settings: &Settings,
        (window, image): (Window, &mut Image),
    ) {
        let lines =
            self.contours.map(|it| (it, contours::coverage(fine, it.width * scale(settings), it.jump)));
        let inverse = 1.0 / (places * places) as f32;
        let rows = image.color.par_chunks_mut(window.width as usize);
        let rows = rows.skip((block.y - window.y) as usize).take(block.height as usize);
        rows.enumerate().for_each(|(row, colors)| {
            let first = (block.x - window.x) as usize;
            for (column, color) in colors[first..first + block.width as usize].iter_mut().enumerate() {
                let mut drawn = Drawn::default();
                for at in fine.places_of([block.x + column as u32, block.y + row as u32], places) {
                    drawn.line += lines.as_ref().map_or(0.0, |(_, covered)| covered[at]);
                }
                drawn.line *= inverse;
                *color = self.over(*color, drawn);
            }
        });
    }

    /// What is drawn, over a color of an image.
    fn over(&self, color: [f32; 4], drawn: Drawn) -> [f32; 4] {
        let Some(contours) = self.contours.filter(|_| drawn.line > 0.0) else { return color };
        let [r, g, b] = contours.color;
        let mut mixed = color;
        for (channel, line) in mixed.iter_mut().zip([r, g, b, 1.0]) {
            *channel += drawn.line * (line - *channel);
        }
        mixed
    }
}

/// Places along what is a pixel in a picture of [`REFERENCE_ROWS`] rows.
fn scale(fine: &Settings) -> f32 {
    fine.height as f32 / REFERENCE_ROWS
}

/// The parts of a window that are drawn at one time.
fn blocks(window: Window) -> impl Iterator<Item = Window> {
    let Window { x, y, width, height } = window;
    let parts = move |start: u32, length: u32| {
        (start / BLOCK..(start + length).div_ceil(BLOCK)).map(move |part| {
            let from = (part * BLOCK).max(start);
            (from, ((part + 1) * BLOCK).min(start + length) - from)
        })
    };
    parts(y, height)
        .flat_map(move |(y, height)| parts(x, width).map(move |(x, width)| Window { x, y, width, height }))
}

/// The places of a block of pixels, and those up to `around` places away that are in the picture.
fn grown(block: Window, places: u32, around: u32, fine: &Settings) -> Window {
    let grow = |start: u32, length: u32, all: u32| {
        let from = (start * places).saturating_sub(around);
        (from, ((start + length) * places + around).min(all) - from)
    };
    let ((x, width), (y, height)) =
        (grow(block.x, block.width, fine.width), grow(block.y, block.height, fine.height));
    Window { x, y, width, height }
}
