//! Finer samples, where lengths are too short for the lattice: bricks that are parted into those of half its spacing, a quarter, an eighth.
//!
//! Takes what fills a block of such samples, gives those of a brick, from its first one to the first one of the next brick.

use glam::Vec3;

use super::Settings;
use super::gather::Found;
use super::volume::Blocks;
use super::{Resolution, Smoothing};
use crate::error::{Error, Result};
use crate::medium::grid::{BRICK, Fine, Lattice, MOST_LEVELS};

/// Memory that finer bricks may take where nobody says how much there is, and a share of it where somebody does.
const ROOM_BYTES: u64 = 1 << 30;
const ROOM_SHARE: u64 = 4;

/// A brick that is to be parted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parted {
    pub(super) brick: usize,
    /// How often its spacing is halved.
    pub(super) level: u32,
}

impl Parted {
    /// Memory that it takes while it is made: its samples, and its parts with their aprons.
    pub(super) fn bytes(&self) -> u64 {
        let (along, parts) = (Fine::along(self.level) as u64, 1_u64 << (3 * self.level));
        4 * (along.pow(3) + parts * u64::from(BRICK + 1).pow(3))
    }

    /// Its samples, column by column: see [`Fine::samples`].
    pub(super) fn samples(
        &self,
        blocks: &impl Blocks,
        lattice: &Lattice,
        found: &mut Found,
    ) -> Vec<Vec<f32>> {
        let along = Fine::along(self.level);
        let spacing = lattice.spacing / (1 << self.level) as f32;
        let first = lattice.position(lattice.brick(self.brick).map(|it| it * BRICK));
        let mut columns = vec![vec![0.0; along.pow(3)]; blocks.columns()];
        let edge = along.div_ceil(4);
        for block in 0..edge.pow(3) {
            let corner = [block % edge, block / edge % edge, block / (edge * edge)].map(|it| 4 * it);
            let aside = Vec3::from(corner.map(|it| it as f32 + 1.5));
            if !blocks.fill(first + spacing * aside, found) {
                continue;
            }
            for sample in 0..64 {
                let place: [usize; 3] = std::array::from_fn(|axis| corner[axis] + (sample >> (2 * axis) & 3));
                if place.iter().any(|&it| it >= along) {
                    continue;
                }
                for (column, sums) in columns.iter_mut().zip(&found.sums) {
                    column[(place[2] * along + place[1]) * along + place[0]] = sums.as_flattened()[sample];
                }
            }
        }
        columns
    }
}

/// How often bricks may be parted, and in how much memory.
pub(super) fn most(settings: &Settings) -> (u32, u64) {
    let room = settings.memory_bytes.map_or(ROOM_BYTES, |bytes| (bytes / ROOM_SHARE).min(ROOM_BYTES));
    let levels = match (settings.finer, settings.resolution, settings.smoothing) {
        (_, _, Smoothing::Scatter) => 0,
        (Some(levels), ..) => levels,
        (None, Resolution::Automatic, _) => MOST_LEVELS,
        (None, ..) => 0,
    };
    (levels, room)
}

/// Refuses more levels than there are, and any for the scatter.
pub(super) fn check(settings: &Settings) -> Result<()> {
    let levels = settings.finer.unwrap_or(0);
    if levels > MOST_LEVELS {
        let allowed = format!("from 0 to {MOST_LEVELS}: each halves the spacing");
        return Err(Error::setting("finer", levels, allowed));
    }
    if levels > 0 && settings.smoothing == Smoothing::Scatter {
        let allowed =
            "0 with the scatter, which spreads mass over one lattice: take a gather, such as three-pass";
        return Err(Error::setting("finer", levels, allowed));
    }
    Ok(())
}

/// What is told of the bricks that are parted; nothing of none.
pub(super) fn note(parted: &[Parted]) -> Option<String> {
    let of_level = |level: u32| match parted.iter().filter(|it| it.level == level).count() {
        0 => None,
        count => Some(format!("{count} of 1/{} of the spacing", 1 << level)),
    };
    let told: Vec<String> = (1..=MOST_LEVELS).filter_map(of_level).collect();
    (!told.is_empty()).then(|| format!("finer bricks: {}", told.join(", ")))
}
