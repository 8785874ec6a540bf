//! A noise that goes with the particles of a sequence, in place of standing in space while they stream through it.
//!
//! Where a noise is looked up is where matter came from since a frame in which it rested. Matter is stirred, so that a noise which went with it for
//! ever would be stretched to threads. So there are three phases. The first rests in the first frame, and counts where the noise is hardly
//! distorted since: what rests, moves or turns as a whole keeps its noise for ever. Elsewhere two others take turns, each of which rests in a
//! later frame than the one before, comes in, and goes before it is stretched too far. Phases are independent noises; a mean of such
//! has less contrast, and is divided by the root of the sum of the squared weights (variance-preserving blending).
//!
//! What a frame looks like depends on it and the frames in which phases rest, never on the pictures before. Sources: N. Max, B. Becker, "Flow
//! visualization using moving textures", 1995; F. Neyret, "Advected textures", SCA 2003 (weights by local distortion).

use glam::{Vec3, Vec4};

use super::flow::{Field, Flow, Node, streamed};
use super::moved::Moved;
use super::table::CELLS;
use crate::error::{Error, Result};
use crate::particles::Positions;
use crate::random::{hash4, unit_f32};

/// Phases that a frame has.
pub const PHASES: usize = 3;
/// Where it is not known what has moved, those that take turns still count a little, so that there is always a noise.
const LEAST: f32 = 0.02;

/// When phases begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    half: usize,
}

/// A phase, as a frame sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// The frame in which its noise rests.
    pub rest: usize,
    /// Its share among those that take turns, 0 to 1; of the first phase 0.
    pub share: f32,
    /// Noises of different numbers are independent. That of the first phase, which has number 0, is the noise without motion.
    pub number: u32,
}

impl Schedule {
    /// Phases that take turns live for `life` frames; an odd number counts as the next even one. Fails with [`Error::Setting`] if that is
    /// below 2 or above 10,000.
    pub fn new(life: usize) -> Result<Self> {
        match life {
            2..=10_000 => Ok(Self { half: life.div_ceil(2) }),
            _ => Err(Error::setting("--noise-life", life, "2 to 10,000 frames")),
        }
    }

    /// Those of a frame; the first one is the first.
    pub fn phases(&self, frame: usize) -> [Phase; PHASES] {
        let turn = frame / self.half;
        let share = (frame % self.half) as f32 / self.half as f32;
        let first = Phase { rest: 0, share: 0.0, number: 0 };
        let older =
            Phase { rest: turn.saturating_sub(1) * self.half, share: 1.0 - share, number: turn as u32 + 1 };
        let younger = Phase { rest: turn * self.half, share, number: turn as u32 + 2 };
        [first, older, younger]
    }
}

/// Where the noise of a frame is looked up.
#[derive(Clone, Debug)]
pub struct Advection {
    fields: [Field<Node>; PHASES],
    phases: [Phase; PHASES],
}

impl Advection {
    /// By what each particle has moved since the frames in which the phases rest; `spacing` is the least distance of the lattice's nodes, a length.
    ///
    /// Fails with [`Error::Setting`] if the spacing is not above 0, there is no particle, or a number of motions is not that of the particles.
    pub fn by_ways(
        positions: &Positions,
        spacing: f32,
        phases: [Phase; PHASES],
        moved: [Vec<Moved>; PHASES],
    ) -> Result<Self> {
        check(positions, spacing, moved.iter().map(Vec::len))?;
        let flow = Flow::new(positions, spacing);
        Ok(Self { fields: moved.map(|moved| flow.field(&moved)), phases })
    }

    /// By the particles' velocities, in lengths a unit of time, as if the flow had been this one since those frames: `ages` ago, in that
    /// unit of time. That is exact in a steady flow.
    ///
    /// Fails as [`Advection::by_ways`] does, and if an age is not finite.
    pub fn by_velocities(
        positions: &Positions,
        spacing: f32,
        phases: [Phase; PHASES],
        velocities: &[Vec3],
        ages: [f32; PHASES],
    ) -> Result<Self> {
        check(positions, spacing, std::iter::once(velocities.len()))?;
        if !ages.iter().all(|age| age.is_finite()) {
            return Err(Error::setting("--noise-frame-time", format!("{ages:?}"), "finite ages"));
        }
        let known = |&by: &Vec3| if by.is_finite() { Moved { by, trust: 1.0 } } else { Moved::UNKNOWN };
        let velocities: Vec<Moved> = velocities.iter().map(known).collect();
        let velocity = Flow::new(positions, spacing).velocity(&velocities);
        Ok(Self { fields: ages.map(|age| streamed(&velocity, age)), phases })
    }

    /// By how many of its cells the noise of each phase is shifted.
    pub(super) fn shifts(&self, seed: u32) -> [Vec3; PHASES] {
        self.phases.map(|phase| shift(phase.number, seed))
    }

    /// The noise at a place that is `noise(place, shift)` where nothing moves: at an offset from the particles' origin, shifted by so many of its
    /// cells.
    #[inline]
    pub(super) fn value(
        &self,
        at: Vec3,
        shifts: &[Vec3; PHASES],
        noise: impl Fn(Vec3, Vec3) -> Vec4,
    ) -> Vec4 {
        let most = Vec4::splat(2.0);
        let looked_up = |node: Node, shift: Vec3| {
            let value = noise(at - node.moved(), shift);
            (node.turned() * value.truncate()).extend(value.w).clamp(-most, most)
        };
        let node = self.fields[0].at(at);
        let stays = node.stays();
        if stays >= 1.0 {
            return looked_up(node, shifts[0]);
        }
        let turns = [1, 2].map(|number| {
            let node = self.fields[number].at(at);
            (node, self.phases[number].share * (node.known() + LEAST), shifts[number])
        });
        let all = turns[0].1 + turns[1].1;
        let turns = turns.map(|(node, share, shift)| (node, (1.0 - stays) * share / all, shift));
        let (mut value, mut power) = (Vec4::ZERO, 0.0);
        for (node, weight, shift) in std::iter::once((node, stays, shifts[0])).chain(turns) {
            if weight > 0.0 {
                value += weight * looked_up(node, shift);
                power += weight * weight;
            }
        }
        // Of several noises the sum may, if seldom, be more than one can be.
        (value / power.sqrt()).clamp(-most, most)
    }
}

fn check(positions: &Positions, spacing: f32, mut counts: impl Iterator<Item = usize>) -> Result<()> {
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(Error::setting("noise-scale", spacing, "a length above 0"));
    }
    let count = positions.len();
    if count == 0 {
        return Err(Error::setting("--noise-motion", "no particles", "at least one particle that moves"));
    }
    let motion =
        |other| Error::setting("--noise-motion", other, format!("one motion for each of {count} particles"));
    counts.find(|&it| it != count).map_or(Ok(()), |other| Err(motion(other)))
}

/// By how many cells the noise of that number is shifted: not at all that of number 0.
fn shift(number: u32, seed: u32) -> Vec3 {
    if number == 0 {
        return Vec3::ZERO;
    }
    let [x, y, z, _] = hash4([number, seed, 0, 0]);
    CELLS as f32 * Vec3::new(unit_f32(x), unit_f32(y), unit_f32(z))
}

#[cfg(test)]
mod tests;
