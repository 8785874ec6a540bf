//! Some of the particles, for whoever takes all that there are: a density, a file.

use rayon::prelude::*;

use super::select::{Clip, Filter, Selectable, present};
use crate::error::Result;
use crate::particles::Particles;
use crate::structure::selection::HalfSpace;

/// The particles that pass all filters and lie in all clips, or, if that is none of them, why.
///
/// Fails as [`Selectable::of`] does.
pub fn subset(
    particles: Particles,
    filters: &[Filter],
    clips: &[Clip],
) -> Result<std::result::Result<Particles, String>> {
    Ok(shown(&particles, filters, clips)?.map(|shown| particles.retained(&shown)))
}

/// Of each particle whether it passes all filters and lies in all clips; if none does, why.
///
/// Fails as [`Selectable::of`] does.
pub fn shown(
    particles: &Particles,
    filters: &[Filter],
    clips: &[Clip],
) -> Result<std::result::Result<Vec<bool>, String>> {
    let passed = filters.iter().map(|it| passed(particles, it)).collect::<Result<Vec<_>>>()?;
    let inside: Vec<Vec<bool>> = clips.iter().map(|it| inside(particles, it)).collect();
    let all: Vec<&Vec<bool>> = passed.iter().chain(&inside).collect();
    let is_shown = |id: usize| all.iter().all(|flags| flags[id]);
    let shown: Vec<bool> = (0..particles.len()).into_par_iter().map(is_shown).collect();
    if shown.contains(&true) || particles.is_empty() {
        return Ok(Ok(shown));
    }
    let is_empty = |flags: &Vec<bool>| !flags.contains(&true);
    let filter = passed.iter().position(is_empty).map(|place| &filters[place]);
    let clip = inside.iter().position(is_empty).map(|place| &clips[place]);
    Ok(Err(match (filter, clip) {
        (Some(filter), _) => {
            format!("{} keeps none ({})", filter.named(), present(particles, filter.quantity()))
        }
        (None, Some(clip)) => format!("the clip '{clip}' keeps none"),
        (None, None) => "each filter and clip keeps some particles, but together they keep none".into(),
    }))
}

/// Which particles a filter keeps.
fn passed(particles: &Particles, filter: &Filter) -> Result<Vec<bool>> {
    Selectable::of(particles, filter)?.flags(filter)
}

/// Which particles a clip keeps.
fn inside(particles: &Particles, clip: &Clip) -> Vec<bool> {
    let half_spaces = clip.half_spaces(particles);
    let is_inside = |id| {
        let center = particles.positions().world(id);
        half_spaces.iter().all(|HalfSpace { normal, distance }| normal.dot(center) <= *distance)
    };
    (0..particles.len()).into_par_iter().map(is_inside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Attribute, Columns, Radii, Values};
    use glam::DVec3;

    fn particles() -> Particles {
        let mut columns = Columns::default();
        let at = |k: usize| DVec3::new(if k == 3 { f64::NAN } else { k as f64 }, 0.0, 0.0);
        columns.positions.extend(&(0..10).map(at).collect::<Vec<_>>());
        let words = Values::Text {
            codes: (0..10).map(|k| k % 3).collect(),
            names: ["C", "O", "H"].map(String::from).into(),
        };
        columns.attributes = vec![
            Attribute::new("element", 1, words),
            Attribute::new("v", 3, Values::F32((0..30).map(|k| k as f32).collect())),
            Attribute::new("radius", 1, Values::F32(vec![0.5; 10])),
        ];
        Particles::new(columns).unwrap()
    }

    /// The places in the file of what is left, or why nothing is.
    fn left(selects: &[&str], clips: &[&str]) -> std::result::Result<Vec<u64>, String> {
        let filters: Vec<Filter> = selects.iter().map(|it| Filter::condition(it).unwrap()).collect();
        let clips: Vec<Clip> = clips.iter().map(|it| it.parse().unwrap()).collect();
        let left = subset(particles(), &filters, &clips).unwrap()?;
        assert!(matches!(left.radii(), Some(Radii::PerParticle { attribute: 2, .. })));
        for id in 0..left.len() {
            let place = left.place(id) as f64;
            assert_eq!(
                (left.positions().world(id).x, left.attribute("v").unwrap().number(id, 1)),
                (place, 3.0 * place + 1.0)
            );
        }
        assert_eq!(left.dropped().position, 1);
        Ok((0..left.len()).map(|id| left.place(id)).collect())
    }

    #[test]
    fn what_is_kept_keeps_all_that_is_known_of_it() {
        assert_eq!(left(&[], &[]), Ok(vec![0, 1, 2, 4, 5, 6, 7, 8, 9]));
        assert_eq!(left(&["element C or x == 8"], &["x<8"]), Ok(vec![0, 6, 8]));
        assert_eq!(left(&["index 4:6", "v.x > 12"], &[]), Ok(vec![5, 6]));
    }

    #[test]
    fn nothing_left_is_explained() {
        let why = left(&["x > 3", "x == 2.5"], &[]).unwrap_err();
        assert_eq!(why, "the selection 'x == 2.5' keeps none (x has 0, 1, 2, 4, 5, 6, 7, 8, 9)");
        assert_eq!(left(&["x > 3"], &["y>1"]).unwrap_err(), "the clip 'y>1' keeps none");
        assert!(left(&["x > 3"], &["x<1"]).unwrap_err().contains("together they keep none"));
    }
}
