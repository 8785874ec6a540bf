//! Particles of several sources in one picture: in one set of columns, one source after the other.
//!
//! So structures, lights, culling and devices see particles as they always do. What is left of a source is its place among the ids.

use glam::DVec3;
use rayon::prelude::*;

use super::Scene;
use super::color::ParticleColors;
use super::select::{Filter, Selectable};
use crate::error::Result;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::structure::shapes::Segment;

/// The attribute that has each particle's radius.
const RADIUS: &str = "radius";
/// The attribute that is 1 where a particle is shown.
const SHOWN: &str = "shown";

/// One source: its particles, and how they are seen.
pub struct Part {
    /// The particles.
    pub particles: Particles,
    /// Their radii.
    pub radii: Radii,
    /// What the radii are multiplied with.
    pub radius_scale: f32,
    /// Their colors.
    pub colors: ParticleColors,
    /// RGB radiance that each gives off; none where there is nothing.
    pub glow: Option<Vec<[f32; 3]>>,
    /// Which of them are shown; all where there is nothing.
    pub shown: Option<Vec<bool>>,
}

/// All sources as one.
pub struct Joined {
    /// The particles: positions and nothing else that the sources had but the first one's cell, time and units. Places go
    /// on from file to file.
    pub particles: Particles,
    /// Their radii, scaled.
    pub radii: Radii,
    /// Their colors, of the kinds and numbers of the first source that has any.
    pub colors: ParticleColors,
    /// Of each source its id 0, and by how much what was measured from its origin has moved.
    pub starts: Vec<Start>,
    /// RGB radiance that each gives off, if any does.
    pub glow: Option<Vec<[f32; 3]>>,
    /// Which are not shown.
    pub hidden: Hidden,
}

/// Where a source's particles are among all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// The id of the first.
    pub id: u32,
    /// What is added to offsets from the source's origin.
    pub shift: DVec3,
}

impl Start {
    /// Bonds of the source, between the same particles among all.
    pub fn segments(&self, segments: &[Segment]) -> Vec<Segment> {
        let shift = self.shift.as_vec3();
        let moved = |it: &Segment| Segment {
            from: it.from + shift,
            to: it.to + shift,
            ends: it.ends.map(|id| id + self.id),
        };
        segments.iter().map(moved).collect()
    }
}

/// Joins sources; positions are measured from `origin`.
///
/// Fails with [`Error::Setting`](crate::Error::Setting) if there are 2^32 - 1 particles or more in all.
pub fn join(parts: Vec<Part>, origin: DVec3) -> Result<Joined> {
    let count = parts.iter().map(|part| part.particles.len()).sum();
    let mut offsets = [(); 3].map(|()| Vec::with_capacity(count));
    let mut radii: Vec<f32> = Vec::with_capacity(count);
    let hides = parts.iter().any(|part| part.shown.is_some());
    let mut shown: Vec<u8> = Vec::with_capacity(if hides { count } else { 0 });
    let (mut places, mut first_place) = (Vec::with_capacity(count), 0);
    let mut starts = Vec::new();
    let mut columns = Columns::default();
    if let Some(first) = parts.first().map(|part| &part.particles) {
        columns.cell = first.cell().copied();
        columns.time = first.time();
        columns.time_unit = first.time_unit().map(String::from);
        columns.length_unit = first.length_unit().map(String::from);
    }
    let mut colors = Vec::new();
    let glows = parts.iter().any(|part| part.glow.is_some());
    let mut glow: Vec<[f32; 3]> = Vec::with_capacity(if glows { count } else { 0 });
    for Part { particles, radii: of_part, radius_scale, colors: color, glow: of_glow, shown: flags } in parts
    {
        let shift = particles.positions().origin() - origin;
        starts.push(Start { id: radii.len() as u32, shift });
        for (axis, (column, added)) in offsets.iter_mut().zip(particles.positions().offsets()).enumerate() {
            match shift[axis] {
                0.0 => column.extend_from_slice(added),
                shift => {
                    column.par_extend(added.par_iter().map(|&offset| (f64::from(offset) + shift) as f32));
                }
            }
        }
        let ids = (0..particles.len()).into_par_iter();
        radii.par_extend(ids.map(|id| radius_scale * particles.radius(&of_part, id)));
        let ids = 0..particles.len();
        places.extend(ids.map(|id| first_place + particles.place(id)));
        first_place += particles.len() as u64 + particles.dropped().total();
        if hides {
            let flags = flags.unwrap_or_else(|| vec![true; particles.len()]);
            shown.extend(flags.into_iter().map(u8::from));
        }
        if glows {
            glow.extend(of_glow.unwrap_or_else(|| vec![[0.0; 3]; particles.len()]));
        }
        colors.push((color, particles.len()));
    }
    columns.positions = Positions::from_offsets(origin, offsets);
    columns.attributes.push(Attribute::new(RADIUS, 1, Values::F32(radii)));
    let radii = Radii::PerParticle { attribute: 0, scale: 1.0 };
    columns.radii = Some(radii.clone());
    if hides {
        columns.attributes.push(Attribute::new(SHOWN, 1, Values::U8(shown)));
    }
    let mut particles = Particles::new(columns)?;
    if first_place > count as u64 {
        particles = particles.with_places(places);
    }
    let mut hidden = Hidden::default();
    if hides {
        let filter: Filter = format!("{SHOWN}=1").parse()?;
        let quantity = Selectable::of(&particles, &filter)?;
        hidden = Hidden(Some((filter, quantity)));
    }
    let glow = glows.then_some(glow);
    Ok(Joined { particles, radii, colors: ParticleColors::joined(&colors), starts, glow, hidden })
}

/// Which of joined particles are not shown.
#[derive(Default)]
pub struct Hidden(Option<(Filter, Selectable)>);

impl Hidden {
    /// Hides them in the scene of those particles. Fails as [`Scene::select`] does.
    pub fn apply(self, scene: &mut Scene) -> Result<()> {
        let Some((filter, quantity)) = self.0 else { return Ok(()) };
        scene.keep(vec![quantity]);
        scene.select(&[filter], &[]).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::light::Lighting;
    use crate::structure::{Kind, Structure};
    use glam::Vec3;

    fn part(points: &[[f64; 3]], color: ParticleColors, radius: f32) -> Part {
        let mut columns = Columns::default();
        columns.positions.extend(&points.iter().copied().map(DVec3::from).collect::<Vec<_>>());
        let particles = Particles::new(columns).unwrap();
        Part {
            particles,
            radii: Radii::Uniform(radius),
            radius_scale: 2.0,
            colors: color,
            glow: None,
            shown: None,
        }
    }

    #[test]
    fn each_source_keeps_places_radii_and_colors() {
        let red = ParticleColors::constant([1.0, 0.0, 0.0]);
        let blue = ParticleColors::constant([0.0, 0.0, 1.0]);
        let a = part(&[[1e6, 0.0, 0.0], [1e6 + 2.0, 0.0, 0.0]], red, 0.5);
        let b =
            Part { shown: Some(vec![false, true, true]), ..part(&[[1e6 + 5.0, 1.0, 2.0]; 3], blue, 0.25) };
        let origin = a.particles.positions().origin();
        let joined = join(vec![a, b], origin).unwrap();
        assert_eq!(joined.starts[1], Start { id: 2, shift: DVec3::new(4.0, 1.0, 2.0) });
        assert_eq!(joined.particles.positions().world(1), DVec3::new(1e6 + 2.0, 0.0, 0.0));
        assert_eq!(joined.particles.positions().world(3), DVec3::new(1e6 + 5.0, 1.0, 2.0));
        assert_eq!([0, 4].map(|id| joined.particles.radius(&joined.radii, id)), [1.0, 0.5]);
        assert_eq!([1, 2].map(|id| joined.colors.color(id)), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);

        let segment = Segment { from: Vec3::ZERO, to: Vec3::X, ends: [0, 2] };
        let moved = joined.starts[1].segments(&[segment])[0];
        assert_eq!((moved.from, moved.ends), (Vec3::new(4.0, 1.0, 2.0), [2, 4]));
        let structure = Structure::build(Kind::default(), joined.particles, &joined.radii, 1.0, &());
        let mut scene = Scene::new(structure.unwrap(), joined.colors, Lighting::Flat, None);
        joined.hidden.apply(&mut scene).unwrap();
        let shown = (0..5).filter(|&node| scene.structure().shows(node)).count();
        assert_eq!(shown, 4);
    }

    #[test]
    fn many_colors_stay_what_they_are() {
        let colors: Vec<[u8; 3]> = (0..=255).map(|it| [it, 255 - it, 7]).collect();
        let places: Vec<u8> = (0..=255).collect();
        let many = || ParticleColors::palette(colors.clone(), places.clone(), "many".into());
        let few = ParticleColors::constant([1.0, 0.5, 0.25]);
        let joined = ParticleColors::joined(&[(many(), 256), (few, 3), (many(), 256)]);
        for id in 0..256 {
            assert_eq!(joined.color(id), many().color(id));
            assert_eq!(joined.color(259 + id), many().color(id));
        }
        let [r, g, b] = joined.color(257);
        assert!((r - 1.0).abs() < 1e-6 && (g - 0.5).abs() < 0.005 && (b - 0.25).abs() < 0.005);
        let nothing = ParticleColors::joined(&[]);
        assert!(nothing.is_constant());
    }

    #[test]
    fn nothing_joins_to_nothing() {
        let joined = join(vec![], DVec3::ZERO).unwrap();
        assert!(joined.particles.is_empty() && joined.starts.is_empty());
    }
}
