//! Which particles of a frame are shown: what `--filter` and `--clip` ask for, found in the particles and told.

use tyndall::Particles;
use tyndall::scene::select::{Clip, Selectable};
use tyndall::scene::{Scene, grouped};
use tyndall::structure::selection::HalfSpace;

use crate::args::Selection;
use crate::report::{Failure, Outcome, counted};

/// What is asked for, as it stands in the particles of one frame.
pub(crate) struct Found<'a> {
    asked: &'a Selection,
    quantities: Vec<Selectable>,
    clips: Vec<(Clip, Vec<HalfSpace>)>,
}

impl<'a> Found<'a> {
    /// Looks the filters' quantities up before the particles are used up. Fails if there are none of that name.
    pub(crate) fn of(asked: &'a Selection, particles: &Particles) -> Outcome<Self> {
        let quantities = asked.filters.iter().map(|it| Selectable::of(particles, it));
        let clips = asked.clips.iter().map(|it| (it.clone(), it.half_spaces(particles)));
        Ok(Self { asked, quantities: quantities.collect::<tyndall::Result<_>>()?, clips: clips.collect() })
    }

    /// Hides what is not asked for. Says what is shown; nothing if that is all because nothing was asked.
    pub(crate) fn hide_others(self, scene: &mut Scene) -> Outcome<Option<String>> {
        let Self { asked, quantities, clips } = self;
        let all = scene.structure().len();
        if (asked.filters.is_empty() && clips.is_empty()) || all == 0 {
            return Ok(None);
        }
        scene.keep(quantities);
        let half_spaces: Vec<HalfSpace> = clips.iter().flat_map(|(_, it)| it).copied().collect();
        let shown = scene.select(&asked.filters, &half_spaces)?;
        if shown == 0 {
            let why = scene.why_none_is_left(&asked.filters, &clips);
            return Err(Failure::Unseen(format!("0 of {} are shown — {why}", counted(all, "particle"))));
        }
        let words = asked.filters.iter().map(ToString::to_string);
        let words: Vec<String> = words.chain(clips.iter().map(|(clip, _)| clip.to_string())).collect();
        let share = format!("{} of {}", grouped(shown as usize), counted(all, "particle"));
        Ok(Some(format!("shown: {share} ({})", words.join("; "))))
    }
}
