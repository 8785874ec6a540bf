//! The CPU as a device that keeps the pictures of a scene: the scene is where it is, so that there is nothing to take over.

use fearless_simd::Level;

use super::{Film, for_each_tile};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::progress::Progress;
use crate::render::interactive::{Backend, Changes, Shot};
use crate::scene::Scene;

/// A film for each picture that was asked for.
pub(crate) struct Films {
    films: Vec<Option<Film>>,
    level: Level,
}

impl Films {
    /// None yet.
    pub(crate) fn new() -> Self {
        Self { films: Vec::new(), level: Level::new() }
    }
}

impl Backend for Films {
    fn load(&mut self, _: &Scene, _: Changes) -> Result<()> {
        self.films.iter_mut().flatten().for_each(Film::clear);
        Ok(())
    }

    fn pass(&mut self, scene: &Scene, shot: &Shot, progress: &dyn Progress) -> Result<()> {
        let &Shot { picture, view, size: [width, height], added, certified } = shot;
        if self.films.len() <= picture {
            self.films.resize_with(picture + 1, || None);
        }
        let film = self.films[picture].take().filter(|film| (film.width, film.height) == (width, height));
        let film = self.films[picture].insert(film.unwrap_or_else(|| Film::new(width, height)));
        let pass = film.pass(scene, view, added, certified);
        for_each_tile(film, &[pass], None, self.level, progress);
        if film.has(added.first + added.count) { Ok(()) } else { Err(Error::Interrupted) }
    }

    fn film(&mut self, scene: &Scene, picture: usize, image: &mut Image) -> Result<()> {
        let film = self.films.get(picture).and_then(Option::as_ref);
        if let Some(film) = film.filter(|film| (film.width, film.height) == (image.width, image.height)) {
            film.draw_over(scene, image);
        }
        Ok(())
    }
}
