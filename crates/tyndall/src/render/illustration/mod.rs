//! What is drawn over a finished picture by what lies before what: contours, halos, depth cues.
//!
//! Every pixel is looked at in 4 x 4 places, whose depths and nodes are found by one ray each. Each place decides for itself how much of it is
//! covered, and the pixel takes the mean, so that what is drawn has smooth edges however few samples the picture has. It is drawn into linear light,
//! whatever device made the picture. The part of a picture is that of the whole, bit for bit: decisions look at distances between places alone.
//! Sources: Saito and Takahashi 1990, Comprehensible Rendering of 3-D Shapes (lines where depth or surface change); Felzenszwalb and Huttenlocher
//! 2012, Distance Transforms of Sampled Functions (rows, then columns).

mod contours;
mod depths;
mod fine;
mod halo;
mod nearest;

use rayon::prelude::*;

use super::{Culling, Settings};
use crate::error::{Error, Result};
use crate::film::{Image, Window};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::light::{Lighting, Paths};
use depths::Depths;
use fine::Fine;

/// Widths are those in a picture of so many rows, and grow with the picture, so that a large picture looks as a small one does.
pub const REFERENCE_ROWS: f32 = 1080.0;
/// The widest that a line or a halo can be, in such a picture.
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
    /// Pixels across, half of them on either side of the edge, in a picture of [`REFERENCE_ROWS`] rows; above 0, at most 100. Around a particle a line is no wider than a third
    /// of its radius, so that what is small is not hidden by lines.
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

/// Rims around what stands before something else, on what lies behind; the wider and the stronger the further behind. Where things touch, and on the
/// background, there are none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Halo {
    /// Pixels from what is in front to the end of a rim between the nearest and the farthest that is shown, in a picture of [`REFERENCE_ROWS`] rows; above 0, at
    /// most 100. With a part of that difference of depth it is as wide as that part's square root.
    pub width: f32,
    /// Linear RGB; none is that of the background, or transparent as it is.
    pub color: Option<[f32; 3]>,
}

impl Default for Halo {
    /// 24 pixels in the background's color.
    fn default() -> Self {
        Self { width: 24.0, color: None }
    }
}

/// What is drawn over a picture, lines uppermost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Illustration {
    /// Lines.
    pub contours: Option<Contours>,
    /// Rims, under lines.
    pub halo: Option<Halo>,
    /// How much of the farthest is background, or transparent as it is, 0 to 1; of what is nearer it is less in proportion to its depth, of the nearest none. Lines and
    /// rims fade with what they are of.
    pub depth_cue: Option<f32>,
    /// The depths of nearest and farthest, for halos and depth cues, in the length unit of the particles; if there are none, those of what the picture shows.
    pub depths: Option<[f32; 2]>,
}

/// What is drawn on a pixel, as shares of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Drawn {
    /// Under lines, and how much of that has not faded.
    line: f32,
    bright_line: f32,
    /// What is left of its own color, of what is not under lines.
    kept: f32,
    /// In the color of halos, of the same.
    halo: f32,
}

impl Drawn {
    /// Nothing.
    const NONE: Self = Self { line: 0.0, bright_line: 0.0, kept: 1.0, halo: 0.0 };
}

/// What is drawn at the places of a block.
struct Layers {
    /// Shares under lines, and the depths of what these are of.
    lines: Option<Vec<[f32; 2]>>,
    halo: Option<Vec<f32>>,
    depths: Option<Depths>,
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
        if let Some(Halo { width, .. }) = self.halo
            && !(width > 0.0 && width <= WIDEST)
        {
            let allowed = "above 0 and at most 100 pixels, of a picture of 1080 rows";
            return Err(Error::setting("--halo", width, allowed));
        }
        if let Some(amount) = self.depth_cue
            && !(0.0..=1.0).contains(&amount)
        {
            return Err(Error::setting("--depth-cue", amount, "0 (none) to 1 (the farthest is background)"));
        }
        match self.depths {
            Some([near, far]) if !(near >= 0.0 && near < far && far.is_finite()) => {
                let allowed = "NEAR:FAR, distances from the eye of which the first is smaller";
                Err(Error::setting("--depth-range", format!("{near}:{far}"), allowed))
            }
            _ => Ok(()),
        }
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
        scene.check_same("with --outline, --halo and --depth-cue, which know one depth of each place")?;
        if matches!(scene.lighting, Lighting::Paths(Paths { lens: Some(_), .. })) {
            let allowed = "left out where something is drawn over the picture: a lens blurs edges";
            return Err(Error::setting("--aperture", "given", allowed));
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
        let depths = match (self.halo, self.depth_cue) {
            (None, None) => None,
            _ => Some(Depths::of(self.depths, (scene, camera), size)?),
        };
        progress.begin("draw", Some(u64::from(window.width) * u64::from(window.height)), "pixels");
        for block in blocks(window) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let around = self.reach(&settings).max(places);
            let fine = Fine::of((scene, camera), &settings, grown(block, places, around, &settings))?;
            let layers = self.layers(&fine, scale(&settings), depths);
            let rows = image.color.par_chunks_mut(window.width as usize);
            let rows = rows.skip((block.y - window.y) as usize).take(block.height as usize);
            rows.enumerate().for_each(|(row, colors)| {
                let first = (block.x - window.x) as usize;
                for (column, color) in colors[first..first + block.width as usize].iter_mut().enumerate() {
                    let pixel = [block.x + column as u32, block.y + row as u32];
                    let drawn = self.drawn(&fine, &layers, pixel, places);
                    *color = self.over(*color, drawn, scene.background);
                }
            });
            progress.advance(u64::from(block.width) * u64::from(block.height));
        }
        Ok(())
    }

    /// How far places are looked at around one, in places.
    fn reach(&self, fine: &Settings) -> u32 {
        let lines = self.contours.map_or(0, |it| contours::reach(it.width * scale(fine)));
        let halo = self.halo.map_or(0, |it| halo::reach(it.width * scale(fine)));
        lines.max(halo) as u32 + 1
    }

    fn layers(&self, fine: &Fine, scale: f32, depths: Option<Depths>) -> Layers {
        let lines = self.contours.map(|it| contours::coverage(fine, it.width * scale, it.jump));
        let halo = self.halo.zip(depths);
        let halo = halo.map(|(it, depths)| halo::strength(fine, it.width * scale, &depths));
        Layers { lines, halo, depths }
    }

    /// What is drawn on a pixel of `places` x `places` places.
    fn drawn(&self, fine: &Fine, layers: &Layers, pixel: [u32; 2], places: u32) -> Drawn {
        let count = (places * places) as f32;
        let mut sum = Drawn { kept: 1.0, ..Drawn::NONE };
        for at in fine.places_of(pixel, places, 0) {
            if let Some(lines) = &layers.lines {
                let [share, depth] = lines[at];
                sum.line += share / count;
                sum.bright_line += share * self.brightness(layers, depth) / count;
            }
            if let Some(halo) = layers.halo.as_ref().filter(|_| fine.depth[at] < f32::INFINITY) {
                sum.halo += halo[at] * self.brightness(layers, fine.depth[at]) / count;
            }
        }
        if layers.depths.is_some() {
            // The picture's samples may meet what no place of the pixel does: it is as far away as what is around.
            let kept = |around| self.kept(fine, layers, fine.places_of(pixel, places, around));
            sum.kept = kept(0).or_else(|| kept(places)).unwrap_or(1.0);
        }
        sum
    }

    /// How much is left of the color of what these places show; none if they show nothing.
    fn kept(&self, fine: &Fine, layers: &Layers, places: impl Iterator<Item = usize>) -> Option<f32> {
        let (mut kept, mut met) = (0.0, 0.0);
        for at in places.filter(|at| fine.depth[*at] < f32::INFINITY) {
            let halo = layers.halo.as_ref().map_or(0.0, |halo| halo[at]);
            kept += (1.0 - halo) * self.brightness(layers, fine.depth[at]);
            met += 1.0;
        }
        (met > 0.0).then_some(kept / met)
    }

    /// How much of what is at a depth has not faded.
    fn brightness(&self, layers: &Layers, depth: f32) -> f32 {
        match (self.depth_cue, layers.depths) {
            (Some(amount), Some(depths)) => 1.0 - amount * depths.share(depth),
            _ => 1.0,
        }
    }

    /// What is drawn, over a color of an image that has that background.
    fn over(&self, color: [f32; 4], drawn: Drawn, background: Option<[f32; 3]>) -> [f32; 4] {
        if drawn == Drawn::NONE {
            return color;
        }
        let solid = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
        let behind = background.map_or([0.0; 4], solid);
        let halo = self.halo.and_then(|it| it.color).map_or(behind, solid);
        let line = self.contours.map_or(behind, |it| solid(it.color));
        let Drawn { line: under, bright_line, kept, halo: rim } = drawn;
        let mut over: [f32; 4] = std::array::from_fn(|channel| {
            let below = kept * color[channel] + rim * halo[channel] + (1.0 - kept - rim) * behind[channel];
            (1.0 - under) * below + bright_line * line[channel] + (under - bright_line) * behind[channel]
        });
        // Shares sum to 1 up to rounding, which makes nothing transparent.
        over[3] = if background.is_some() { 1.0 } else { over[3].min(1.0) };
        over
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
