//! Which film tiles have samples enough: see [`crate::render::refine`].

use rayon::prelude::*;

use super::{FILM_EDGE, Film, FilmTile};
use crate::render::refine::{Earlier, Quality, shown};

impl FilmTile {
    /// The means of the pixels, as they are shown.
    fn shown(&self) -> Vec<[f32; 3]> {
        let scale = 1.0 / self.samples.max(1) as f32;
        self.sum.iter().map(|&[r, g, b, _]| shown([r, g, b].map(|sum| scale * sum))).collect()
    }
}

impl Film {
    /// Compares all tiles that have got samples with what they were at the last call; those that changed by less than `noise` are settled.
    /// Whether all are.
    pub(crate) fn settle(&mut self, noise: f32) -> bool {
        let window = self.window;
        if self.earlier.is_empty() {
            self.earlier.resize(self.tiles.len(), Earlier::NONE);
        }
        self.tiles.par_iter_mut().zip(&mut self.earlier).filter(|(tile, _)| !tile.settled).for_each(
            |(tile, earlier)| {
                let is_inside = |pixel: usize| {
                    let [x, y] = [pixel % FILM_EDGE, pixel / FILM_EDGE].map(|it| it as u32);
                    window.pixels_of(tile.x + x, tile.y + y, 1) == 1
                };
                tile.settled = earlier.settle(tile.shown(), noise, is_inside);
            },
        );
        self.tiles.iter().all(|tile| tile.settled)
    }

    /// What the tiles came to, after [`Self::settle`].
    pub(crate) fn quality(&self) -> Quality {
        let pixels = |tile: &FilmTile| self.window.pixels_of(tile.x, tile.y, FILM_EDGE as u32) as f32;
        let all: f32 = self.tiles.iter().map(pixels).sum();
        let errors = self.tiles.iter().zip(&self.earlier).map(|(tile, it)| it.change_sq * pixels(tile));
        let samples = self.tiles.iter().map(|tile| tile.samples);
        Quality {
            noise: (errors.sum::<f32>() / all).sqrt(),
            samples: [samples.clone().min().unwrap_or(0), samples.max().unwrap_or(0)],
        }
    }
}
