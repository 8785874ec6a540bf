//! Which particles of a frame are shown: what `--filter`, `--select` and `--clip` ask for, found in the particles and told.

use tyndall::Particles;
use tyndall::scene::select::{Clip, Filter, Selectable};
use tyndall::scene::subset::{self, subset};
use tyndall::scene::{Scene, grouped};
use tyndall::structure::selection::HalfSpace;

use crate::args::Selection;
use crate::report::{Failure, Outcome, counted};

/// What is asked for, as it stands in the particles of one frame.
pub(crate) struct Found {
    filters: Vec<Filter>,
    quantities: Vec<Selectable>,
    clips: Vec<(Clip, Vec<HalfSpace>)>,
}

impl Found {
    /// Looks the filters' quantities up before the particles are used up. Fails if there are none of that name.
    pub(crate) fn of(asked: &Selection, particles: &Particles) -> Outcome<Self> {
        let filters = asked.all_filters();
        let quantities =
            filters.iter().map(|it| Selectable::of(particles, it)).collect::<tyndall::Result<_>>()?;
        let clips = asked.clips.iter().map(|it| (it.clone(), it.half_spaces(particles)));
        Ok(Self { filters, quantities, clips: clips.collect() })
    }

    /// Hides what is not asked for. Says what is shown; nothing if that is all because nothing was asked.
    pub(crate) fn hide_others(self, scene: &mut Scene) -> Outcome<Option<String>> {
        let Self { filters, quantities, clips } = self;
        let all = scene.structure().len();
        if (filters.is_empty() && clips.is_empty()) || all == 0 {
            return Ok(None);
        }
        scene.keep(quantities);
        let half_spaces: Vec<HalfSpace> = clips.iter().flat_map(|(_, it)| it).copied().collect();
        let shown = scene.select(&filters, &half_spaces)?;
        if shown == 0 {
            let why = scene.why_none_is_left(&filters, &clips);
            return Err(Failure::Unseen(format!("0 of {} are shown — {why}", counted(all, "particle"))));
        }
        let share = share(shown as usize, all, &filters, clips.iter().map(|(clip, _)| clip));
        Ok(Some(format!("shown: {share}")))
    }
}

/// The particles that are asked for, and what is told of that; nothing if that is all because nothing was asked.
pub(crate) fn keep(asked: &Selection, particles: Particles) -> Outcome<(Particles, Option<String>)> {
    let all = particles.len();
    if asked.is_empty() || all == 0 {
        return Ok((particles, None));
    }
    let filters = asked.all_filters();
    let kept = subset(particles, &filters, &asked.clips)?
        .map_err(|why| Failure::Unseen(format!("0 of {} are left — {why}", counted(all, "particle"))))?;
    let told = format!("kept: {}", share(kept.len(), all, &filters, &asked.clips));
    Ok((kept, Some(told)))
}

/// Of each particle whether it is asked for, and what is told of that; nothing if that is all because nothing was asked.
pub(crate) fn shown(
    asked: &Selection,
    particles: &Particles,
) -> Outcome<(Option<Vec<bool>>, Option<String>)> {
    let all = particles.len();
    if asked.is_empty() || all == 0 {
        return Ok((None, None));
    }
    let filters = asked.all_filters();
    let shown = subset::shown(particles, &filters, &asked.clips)?
        .map_err(|why| Failure::Unseen(format!("0 of {} are shown — {why}", counted(all, "particle"))))?;
    let count = shown.iter().filter(|&&is_shown| is_shown).count();
    Ok((Some(shown), Some(format!("shown: {}", share(count, all, &filters, &asked.clips)))))
}

/// How many of all particles were asked for, and how.
fn share<'a>(
    kept: usize,
    all: usize,
    filters: &[Filter],
    clips: impl IntoIterator<Item = &'a Clip>,
) -> String {
    let words = filters.iter().map(ToString::to_string);
    let words: Vec<String> = words.chain(clips.into_iter().map(ToString::to_string)).collect();
    format!("{} of {} ({})", grouped(kept), counted(all, "particle"), words.join("; "))
}
