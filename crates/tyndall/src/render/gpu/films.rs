//! The card as a device that keeps the pictures of a scene: the scene stays there, and what changes in it is sent alone.

use super::shader::Walk;
use super::{Gpu, Pace, Picture, Resident, Seen};
use crate::error::Result;
use crate::film::Image;
use crate::progress::Progress;
use crate::render::interactive::{Backend, Changes, Shot};
use crate::scene::Scene;

/// A picture for each that was asked for.
pub(in crate::render) struct Films {
    resident: Resident,
    pictures: Vec<Option<Picture>>,
}

impl Films {
    /// None yet, of a scene that is sent to the card. Fails as [`Resident::load`] does.
    pub(in crate::render) fn load(gpu: &Gpu, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        Ok(Self { resident: Resident::load(gpu, scene, progress)?, pictures: Vec::new() })
    }
}

impl Backend for Films {
    fn load(&mut self, scene: &Scene, changes: Changes) -> Result<()> {
        let is_rearranged = self.resident.update(scene, changes)?;
        for picture in self.pictures.iter_mut().flatten() {
            picture.clear();
            if is_rearranged {
                picture.made.clear();
            }
        }
        Ok(())
    }

    fn pass(&mut self, scene: &Scene, shot: &Shot, progress: &dyn Progress) -> Result<()> {
        super::check_flat(&shot.view)?;
        let Self { resident, pictures } = self;
        if pictures.len() <= shot.picture {
            pictures.resize_with(shot.picture + 1, || None);
        }
        let slot = &mut pictures[shot.picture];
        let picture = match slot.take_if(|picture| picture.size == shot.size) {
            Some(picture) => slot.insert(picture),
            None => {
                // The old one makes room for the new one.
                *slot = None;
                slot.insert(Picture::new(resident, shot.size, Pace::Prompt)?)
            }
        };
        picture.pass(&Seen { resident, scene, view: shot.view }, &shot.added, Walk::First, progress)
    }

    fn film(&mut self, scene: &Scene, picture: usize, image: &mut Image) -> Result<()> {
        match self.pictures.get(picture) {
            Some(Some(picture)) if picture.size == [image.width, image.height] => {
                picture.draw_over(self.resident.gpu(), scene, image)
            }
            _ => Ok(()),
        }
    }
}
