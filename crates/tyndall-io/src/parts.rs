//! Frames that can be read in parts, for when they do not fit the memory as a whole: procedural sources and NPY arrays of positions.

use std::ops::Range;
use std::path::Path;

use tyndall::particles::{Columns, Positions};
use tyndall::synthetic::Synthetic;
use tyndall::{DVec3, Particles, Progress, Result, Source, Vec3};

use crate::read::{self, npy};

/// Particles of a sample that stand for all when sizes, colors and framing are guessed.
const SAMPLE: u64 = 1 << 20;

/// A frame of which any part can be read. Centers are offsets from [`Parts::origin`].
pub struct Parts {
    kind: Kind,
    origin: DVec3,
}

enum Kind {
    Synthetic(Synthetic),
    Npy(npy::Rows),
}

impl Parts {
    /// Of a procedural source. Fails if there is none of that specification.
    pub(crate) fn of_synthetic(specification: &str) -> Result<Self> {
        Ok(Self { kind: Kind::Synthetic(Synthetic::new(specification)?), origin: DVec3::ZERO })
    }

    /// Of an NPY file that holds positions and nothing else; `None` for any other.
    pub(crate) fn of_npy(path: &Path) -> Result<Option<Self>> {
        let Some(rows) = npy::Rows::over(path, read::map(path)?)? else { return Ok(None) };
        // The middle of a sample is near the middle of all.
        let mut positions = Positions::new();
        positions.extend(&sample(rows.len(), 1 << 12).map(|id| rows.position(id)).collect::<Vec<_>>());
        Ok(Some(Self { kind: Kind::Npy(rows), origin: positions.origin() }))
    }

    /// The point from which centers are measured.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Some of the particles, spread evenly over all.
    pub fn sample(&self, progress: &dyn Progress) -> Result<Particles> {
        match &self.kind {
            Kind::Synthetic(synthetic) => synthetic.sample(SAMPLE, progress),
            Kind::Npy(rows) => {
                let mut positions = Positions::around(self.origin);
                for id in sample(rows.len(), SAMPLE) {
                    positions.extend(&[rows.position(id)]);
                }
                Particles::new(Columns { positions, ..Columns::default() })
            }
        }
    }
}

/// At most `most` of the numbers below `count`, at even distances.
fn sample(count: u64, most: u64) -> impl Iterator<Item = u64> {
    (0..count).step_by(count.div_ceil(most).max(1) as usize)
}

impl Source for Parts {
    fn len(&self) -> u64 {
        match &self.kind {
            Kind::Synthetic(synthetic) => synthetic.len(),
            Kind::Npy(rows) => rows.len(),
        }
    }

    fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()> {
        match &self.kind {
            Kind::Synthetic(synthetic) => synthetic.read(range, into),
            Kind::Npy(rows) => {
                into.clear();
                into.extend(range.map(|id| (rows.position(id) - self.origin).as_vec3()));
                Ok(())
            }
        }
    }
}
