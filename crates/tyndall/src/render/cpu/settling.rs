//! Which film tiles have samples enough: see [`crate::render::refine`].

use rayon::prelude::*;

use super::{FILM_EDGE, FILM_PIXELS, Film, FilmTile};
use crate::render::refine::Quality;

/// A film tile a round ago.
pub(super) struct Earlier {
    /// As it is shown: square roots of linear means; none before the first round.
    shown: Vec<[f32; 3]>,
    /// Mean square of the change in the last round; infinite before the second one.
    change_sq: f32,
}

impl FilmTile {
    /// The means of the pixels, as they are shown.
    fn shown(&self) -> Vec<[f32; 3]> {
        let scale = 1.0 / self.samples.max(1) as f32;
        self.sum
            .iter()
            .map(|&[r, g, b, _]| [r, g, b].map(|sum| (scale * sum).clamp(0.0, 1.0).sqrt()))
            .collect()
    }
}

impl Film {
    /// Compares all tiles that have got samples with what they were at the last call; those that changed by less than `noise` are settled.
    /// Whether all are.
    pub(crate) fn settle(&mut self, noise: f32) -> bool {
        let window = self.window;
        if self.earlier.is_empty() {
            let none = || Earlier { shown: Vec::new(), change_sq: f32::INFINITY };
            self.earlier.resize_with(self.tiles.len(), none);
        }
        self.tiles.par_iter_mut().zip(&mut self.earlier).for_each(|(tile, earlier)| {
            if tile.settled {
                return;
            }
            let shown = tile.shown();
            if earlier.shown.len() == FILM_PIXELS {
                let is_inside = |pixel: usize| {
                    let [x, y] = [pixel % FILM_EDGE, pixel / FILM_EDGE].map(|it| it as u32);
                    window.pixels_of(tile.x + x, tile.y + y, 1) == 1
                };
                let mut sum = 0.0_f32;
                let mut count = 0;
                for pixel in (0..FILM_PIXELS).filter(|&pixel| is_inside(pixel)) {
                    let [now, before] = [shown[pixel], earlier.shown[pixel]];
                    sum += now.iter().zip(before).map(|(now, before)| (now - before).powi(2)).sum::<f32>();
                    count += 3;
                }
                earlier.change_sq = sum / count.max(1) as f32;
                tile.settled = earlier.change_sq < noise * noise;
            }
            earlier.shown = shown;
        });
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
