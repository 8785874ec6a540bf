//! Frames that can be read in parts, for when they do not fit the memory as a whole: procedural sources and NPY arrays with a particle a row.

use std::ops::Range;
use std::path::Path;

use tyndall::medium::density::Carrier;
use tyndall::particles::Positions;
use tyndall::scene::units::Units;
use tyndall::scene::wanted::Wanted;
use tyndall::synthetic::Synthetic;
use tyndall::{DVec3, Error, Particles, Progress, Result, Source, Vec3};

use crate::read::{self, npy};

/// Particles of a sample that stand for all when sizes, colors and framing are guessed.
const SAMPLE: u64 = 1 << 20;

/// A frame of which any part can be read. Centers are offsets from [`Parts::origin`].
pub struct Parts {
    kind: Kind,
    origin: DVec3,
    /// What a picture looks at, if not all.
    wanted: Option<Wanted>,
    /// What the units are, in place of what the source says.
    units: Option<Units>,
}

enum Kind {
    Synthetic(Synthetic),
    Npy(npy::Rows),
}

impl Parts {
    /// Of a procedural source. Fails if there is none of that specification.
    pub(crate) fn of_synthetic(specification: &str) -> Result<Self> {
        let kind = Kind::Synthetic(Synthetic::new(specification)?);
        Ok(Self { kind, origin: DVec3::ZERO, wanted: None, units: None })
    }

    /// Of an NPY file that has a particle a row; `None` for any other. Of attributes those that are wanted are read.
    pub(crate) fn of_npy(path: &Path, wanted: Option<Wanted>) -> Result<Option<Self>> {
        let Some(rows) = npy::Rows::over(path, read::map(path)?)? else { return Ok(None) };
        // The middle of a sample is near the middle of all.
        let mut positions = Positions::new();
        positions.extend(&sample(rows.len(), 1 << 12).map(|id| rows.position(id)).collect::<Vec<_>>());
        Ok(Some(Self { kind: Kind::Npy(rows), origin: positions.origin(), wanted, units: None }))
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
        let particles = match &self.kind {
            Kind::Synthetic(synthetic) => synthetic.sample(SAMPLE, progress)?,
            Kind::Npy(rows) => {
                let step = rows.len().div_ceil(SAMPLE).max(1) as usize;
                rows.every(step, self.wanted.as_ref())?
            }
        };
        Ok(self.told(particles).measured_from(self.origin))
    }

    /// The same in these units.
    pub(crate) fn in_units(self, units: Option<Units>) -> Self {
        Self { units, ..self }
    }

    /// Particles of the source, in the units that are said.
    fn told(&self, particles: Particles) -> Particles {
        match &self.units {
            Some(units) => units.name(particles).0,
            None => particles,
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

impl Carrier for Parts {
    fn part(&self, range: Range<u64>) -> Result<(Vec<Vec3>, Particles)> {
        let mut centers = Vec::new();
        self.read(range.clone(), &mut centers)?;
        let particles = self.told(match &self.kind {
            Kind::Synthetic(synthetic) => synthetic.part(range.clone())?,
            Kind::Npy(rows) => {
                rows.particles(range.clone(), self.wanted.as_ref())?.numbered_from(range.start)
            }
        });
        let lost = particles.dropped().radius;
        if lost > 0 {
            let found = format!("negative or not finite for {lost} of the particles from {} on", range.start);
            return Err(Error::setting("radius", found, "at least 0 where particles are read in parts"));
        }
        let of_each = |id: usize| centers[(particles.place(id) - range.start) as usize];
        Ok(((0..particles.len()).map(of_each).collect(), particles))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::particles::{Attribute, Values};

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
        let parts = Parts::of_npy(file.path(), None).unwrap().unwrap();
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
    fn parts_are_in_the_units_that_are_said() {
        let parts = Parts::of_synthetic("fluid?n=50").unwrap().in_units(Some("nm".parse().unwrap()));
        let particles = [parts.sample(&()).unwrap(), parts.part(0..9).unwrap().1];
        assert!(particles.iter().all(|it| it.length_unit() == Some("nm")));
    }

    #[test]
    fn three_rows_of_a_table_are_three_particles() {
        let rows: Vec<[f64; 3]> = (0..20).map(|k| [f64::from(k), 0.5, -1.0]).collect();
        let parts = Parts::of_npy(npy(&rows, "(12, 5)").path(), None).unwrap().unwrap();
        let (centers, particles) = parts.part(2..5).unwrap();
        let place = |id: u64| parts.origin() + centers[id as usize].as_dvec3();
        assert_eq!(
            [0, 1, 2].map(place),
            [[0.5, -1.0, 4.0], [5.0, 0.5, -1.0], [-1.0, 7.0, 0.5]].map(DVec3::from)
        );
        let last = particles.attribute("column 4").unwrap();
        assert_eq!(
            [0, 1, 2].map(|id| (last.number(id, 0), particles.place(id))),
            [(-1.0, 2), (0.5, 3), (8.0, 4)]
        );
        assert_eq!(parts.part(0..0).unwrap().1.len(), 0);
    }

    #[test]
    fn parts_of_structures_carry_what_the_whole_does() {
        let mut header =
            "{'descr': [('m', '<f4'), ('pos', '<f8', (3,)), ('kind', '|S2'), ('flow', '>f4', (2,))], \
                          'fortran_order': False, 'shape': (500,), }"
                .to_string();
        header += &" ".repeat(245 - header.len());
        let mut bytes = b"\x93NUMPY\x01\x00\xf6\x00".to_vec();
        bytes.extend(header.bytes().chain([b'\n']));
        for k in 0..500_u32 {
            bytes.extend((0.5 * k as f32).to_le_bytes());
            let x = if k % 50 == 7 { f64::NAN } else { 100.0 + f64::from(k) };
            [x, 2.0, -1.0].iter().for_each(|it| bytes.extend(it.to_le_bytes()));
            bytes.extend(if k % 3 == 0 { *b"ab" } else { *b"c\0" });
            [k as f32, 1.5].iter().for_each(|it| bytes.extend(it.to_be_bytes()));
        }
        let file = tempfile::Builder::new().suffix(".npy").tempfile().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        let whole =
            crate::read::npy::read(file.path(), &std::fs::read(file.path()).unwrap(), None, &()).unwrap();
        let whole = whole.particles;
        let parts = Parts::of_npy(file.path(), None).unwrap().unwrap();
        let mut id = 0;
        for range in [0..100, 100..107, 107..500] {
            let (centers, particles) = parts.part(range).unwrap();
            assert_eq!(centers.len(), particles.len());
            for (own, center) in centers.iter().enumerate() {
                assert_eq!(center.as_dvec3() + parts.origin(), whole.positions().world(id));
                assert_eq!(particles.place(own), whole.place(id));
                for attribute in whole.attributes() {
                    let other = particles.attribute(&attribute.name).unwrap();
                    let word = |it: &Attribute, id: usize| match &it.values {
                        Values::Text { codes, names } => names[codes[id] as usize].clone(),
                        _ => format!("{} {}", it.number(id, 0), it.number(id, it.components - 1)),
                    };
                    assert_eq!(word(other, own), word(attribute, id), "{}", attribute.name);
                }
                id += 1;
            }
        }
        assert_eq!((id, whole.len(), parts.sample(&()).unwrap().len()), (490, 490, 490));
        let wanted = Wanted { quantities: vec!["m".into()], ..Wanted::default() };
        let few = Parts::of_npy(file.path(), Some(wanted)).unwrap().unwrap().part(0..3).unwrap().1;
        assert!(few.attribute("m").is_some() && few.attribute("flow").is_none());
    }

    #[test]
    fn what_is_no_array_of_positions_has_no_parts_and_what_is_cut_short_fails() {
        let rows = [[0.0; 3]; 4];
        let parts = |file: tempfile::NamedTempFile| Parts::of_npy(file.path(), None);
        assert!(parts(npy(&rows, "(12,)")).unwrap().is_none());
        assert!(parts(npy(&[[0.0; 3]; 5], "(3, 5)")).unwrap().is_none());
        assert!(parts(npy(&rows, "(5, 3)")).is_err());
        assert!(parts(npy(&rows, "(1000000000000, 3)")).is_err());
        assert_eq!(parts(npy(&[], "(0, 3)")).unwrap().unwrap().len(), 0);
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
