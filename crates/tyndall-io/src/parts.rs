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

    /// The same, measured from elsewhere.
    pub fn measured_from(self, origin: DVec3) -> Self {
        Self { origin, ..self }
    }

    /// Some of the particles, spread evenly over all.
    pub fn sample(&self, progress: &dyn Progress) -> Result<Particles> {
        match &self.kind {
            Kind::Synthetic(synthetic) => Ok(synthetic.sample(SAMPLE, progress)?.measured_from(self.origin)),
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
            Kind::Synthetic(synthetic) => {
                synthetic.read(range, into)?;
                if self.origin != DVec3::ZERO {
                    into.iter_mut().for_each(|it| *it = (it.as_dvec3() - self.origin).as_vec3());
                }
                Ok(())
            }
            Kind::Npy(rows) => {
                into.clear();
                into.extend(range.map(|id| (rows.position(id) - self.origin).as_vec3()));
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An NPY file of rows of three numbers.
    fn npy(rows: &[[f64; 3]], shape: &str) -> tempfile::NamedTempFile {
        let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
        header += &" ".repeat(117 - header.len());
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(header.bytes().chain([b'\n']));
        bytes.extend(rows.iter().flatten().flat_map(|number| number.to_le_bytes()));
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    #[test]
    fn parts_of_an_array_are_its_rows() {
        let rows: Vec<[f64; 3]> = (0..1000).map(|k| [1e6 + 0.5 * f64::from(k), 2.0, f64::NAN]).collect();
        let file = npy(&rows, "(1000, 3)");
        let parts = Parts::of_npy(file.path()).unwrap().unwrap();
        assert_eq!(parts.len(), 1000);
        let mut read = vec![Vec3::ZERO];
        parts.read(300..700, &mut read).unwrap();
        assert_eq!(read.len(), 400);
        for (center, row) in read.iter().zip(&rows[300..]) {
            assert_eq!(f64::from(center.x) + parts.origin().x, row[0]);
            assert!(center.z.is_nan());
        }
        assert_eq!(parts.sample(&()).unwrap().dropped().position, 1000, "none of them is finite");
    }

    #[test]
    fn what_is_no_array_of_positions_has_no_parts_and_what_is_cut_short_fails() {
        let rows = [[0.0; 3]; 4];
        assert!(Parts::of_npy(npy(&rows, "(3, 4)").path()).unwrap().is_none());
        assert!(Parts::of_npy(npy(&rows, "(5, 3)").path()).is_err());
        assert!(Parts::of_npy(npy(&rows, "(1000000000000, 3)").path()).is_err());
        assert_eq!(Parts::of_npy(npy(&[], "(0, 3)").path()).unwrap().unwrap().len(), 0);
    }

    #[test]
    fn parts_of_a_procedural_source_are_its_particles() {
        let whole = tyndall::synthetic::generate("clustered?n=5000&seed=3", &()).unwrap();
        let parts = Parts::of_synthetic("clustered?n=5000&seed=3").unwrap();
        let mut read = Vec::new();
        parts.read(1000..5000, &mut read).unwrap();
        for (center, id) in read.iter().zip(1000..) {
            assert_eq!(parts.origin() + center.as_dvec3(), whole.positions().world(id));
        }
        let elsewhere = parts.measured_from(DVec3::new(0.5, -2.0, 1.0));
        let mut moved = Vec::new();
        elsewhere.read(1000..5000, &mut moved).unwrap();
        for (center, id) in moved.iter().zip(1000..) {
            let world = elsewhere.origin() + center.as_dvec3();
            assert!(world.distance(whole.positions().world(id)) < 1e-6, "{world}");
        }
        let sample = elsewhere.sample(&()).unwrap();
        assert_eq!(sample.positions().origin(), elsewhere.origin());
    }
}
