//! Projections: the line integral of what particles carry, straight from their kernels, without a grid.
//!
//! Takes where particles are, how far each is spread and what it carries (mass, for a column density), gives for each pixel what is
//! there per area of the picture plane. A particle is the line integral of its kernel, a round spot; it is taken at the middles of
//! pixels, of parts of pixels where it is small, and what it gives is divided by the sum over those places. So all that a particle
//! carries is in the map, whatever the size of the pixels. Rays are parallel.
//!
//! Invariant: particles are added row by row in their order, so that the number of threads changes no bit.
//! Source: D. Price, "SPLASH: an interactive visualisation tool for smoothed particle hydrodynamics simulations", PASA 24, 2007,
//! section 4.1 (column-integrated kernels).

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::medium::Kernel;
use crate::particles::Positions;
use crate::progress::Progress;
use crate::scene::camera::View;

/// Rows that are added up together.
const BAND: usize = 16;
/// A particle's radius is looked at in at least so many places, and a pixel in at most so many parts along an edge.
const PLACES: f64 = 6.0;
const MOST_PARTS: f64 = 16.0;
/// A particle of this radius, in pixels, is smooth enough to be taken as it is, without the sum.
const SMOOTH: f64 = 64.0;
/// Steps of the table of the integrated kernel.
const STEPS: usize = 4096;

/// What is projected. All columns have a value for each particle.
pub struct Carried<'a> {
    /// Where the particles are.
    pub positions: &'a Positions,
    /// Radii of the kernels' supports; those of 0 are points.
    pub lengths: &'a [f32],
    /// What is carried; a particle of which any is not finite is left out.
    pub columns: &'a [&'a [f64]],
    /// How it is spread.
    pub kernel: Kernel,
}

/// What there is in each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Of each column, what is there per area, row by row from the top left.
    pub columns: Vec<Vec<f64>>,
    /// Particles that were left out.
    pub missing: usize,
    /// Of each column, the sum over all particles that were not.
    pub totals: Vec<f64>,
    /// Area of a pixel.
    pub pixel_area: f64,
}

impl Map {
    /// How much of a column is in the map.
    pub fn sum(&self, column: usize) -> f64 {
        self.pixel_area * self.columns[column].iter().sum::<f64>()
    }

    /// The mean of one column weighted by another: their quotient, NaN where there is no weight.
    pub fn mean(&self, column: usize, weight: usize) -> Vec<f64> {
        let quotient = |(value, weight): (&f64, &f64)| if *weight > 0.0 { value / weight } else { f64::NAN };
        self.columns[column].iter().zip(&self.columns[weight]).map(quotient).collect()
    }
}

/// Projects what particles carry along `view`, which is orthographic, onto `size` pixels. Fails with [`Error::Setting`] on a view in
/// perspective or an impossible size, and with [`Error::Interrupted`]. Panics if a column has another length.
pub fn project(carried: &Carried, view: &View, size: [u32; 2], progress: &dyn Progress) -> Result<Map> {
    let [width, height] = size;
    if !(1..=65536).contains(&width) || !(1..=65536).contains(&height) {
        return Err(Error::setting("size", format!("{width}x{height}"), "1x1 to 65536x65536 pixels"));
    }
    if view.perspective {
        let allowed = "orthographic: a line integral is along parallel rays";
        return Err(Error::setting("projection", "perspective", allowed));
    }
    let count = carried.positions.len();
    assert!(carried.lengths.len() == count && carried.columns.iter().all(|it| it.len() == count));
    let exists = |id: usize| carried.columns.iter().all(|column| column[id].is_finite());
    let table = Table::new(carried.kernel);
    let spot = |id: usize| if exists(id) { Spot::new(carried, view, &table, id) } else { Spot::NONE };
    let spots: Vec<Spot> = (0..count).into_par_iter().with_min_len(1 << 10).map(spot).collect();
    let missing = (0..count).into_par_iter().filter(|&id| !exists(id)).count();
    let total = |column: &&[f64]| -> f64 { (0..count).filter(|&id| exists(id)).map(|id| column[id]).sum() };
    let totals = carried.columns.iter().map(total).collect();

    let bands = Bands::new(&spots, size);
    progress.begin("project", Some(u64::from(height)), "rows");
    let band = |number: usize| {
        let rows = BAND.min(height as usize - number * BAND);
        let mut sums = vec![vec![0.0; width as usize * rows]; carried.columns.len()];
        for &id in bands.of(number) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let spot = &spots[id as usize];
            spot.add(&table, (width, number * BAND, rows), |place, share| {
                for (sums, column) in sums.iter_mut().zip(carried.columns) {
                    sums[place] += share * column[id as usize];
                }
            });
        }
        progress.advance(rows as u64);
        Ok(sums)
    };
    let bands: Vec<Vec<Vec<f64>>> =
        (0..(height as usize).div_ceil(BAND)).into_par_iter().map(band).collect::<Result<_>>()?;
    let pixel_area = f64::from(view.pixel).powi(2);
    let mut columns = vec![Vec::with_capacity(width as usize * height as usize); carried.columns.len()];
    for of_band in bands {
        for (column, sums) in columns.iter_mut().zip(of_band) {
            column.extend(sums.into_iter().map(|sum| sum / pixel_area));
        }
    }
    Ok(Map { width, height, columns, missing, totals, pixel_area })
}

/// The integrated kernel by the square of the distance, in radii.
struct Table(Vec<f64>);

impl Table {
    fn new(kernel: Kernel) -> Self {
        let value = |step: usize| kernel.column((step as f64 / STEPS as f64).sqrt());
        Self((0..=STEPS + 1).into_par_iter().map(value).collect())
    }

    #[inline(always)]
    fn value(&self, q_sq: f64) -> f64 {
        let place = q_sq * STEPS as f64;
        let first = (place as usize).min(STEPS);
        self.0[first] + (place - first as f64) * (self.0[first + 1] - self.0[first])
    }
}

/// A particle in the picture, in pixels.
#[derive(Clone, Copy)]
struct Spot {
    x: f64,
    y: f64,
    /// 0 for a point, below 0 for none.
    radius: f64,
    /// Parts of a pixel along an edge.
    parts: f64,
    /// What the kernel is multiplied with, so that it sums to 1.
    scale: f64,
}

impl Spot {
    const NONE: Self = Self { x: 0.0, y: 0.0, radius: -1.0, parts: 1.0, scale: 0.0 };

    fn new(carried: &Carried, view: &View, table: &Table, id: usize) -> Self {
        let offset = (carried.positions.offset(id) - view.eye).as_dvec3();
        let pixel = f64::from(view.pixel);
        let x = (offset.dot(view.right.as_dvec3()) - f64::from(view.left)) / pixel;
        let y = (f64::from(view.top) - offset.dot(view.up.as_dvec3())) / pixel;
        let radius = f64::from(carried.lengths[id].max(0.0)) / pixel;
        let parts = (PLACES / radius).ceil().clamp(1.0, MOST_PARTS);
        let mut spot = Self { x, y, radius, parts, scale: 1.0 / (radius * radius) };
        if radius < SMOOTH {
            let mut sum = 0.0;
            for row in spot.range(spot.y) {
                for column in spot.range(spot.x) {
                    sum += spot.value(table, column, row);
                }
            }
            if sum > 0.0 {
                spot.scale = 1.0 / sum;
            } else {
                spot.radius = 0.0;
            }
        }
        spot
    }

    /// The parts along an axis that a particle at `middle` may reach.
    #[inline(always)]
    fn range(&self, middle: f64) -> std::ops::Range<i64> {
        let low = ((middle - self.radius) * self.parts - 0.5).ceil();
        let high = ((middle + self.radius) * self.parts - 0.5).floor();
        low as i64..high as i64 + 1
    }

    /// The kernel in the middle of a part.
    #[inline(always)]
    fn value(&self, table: &Table, column: i64, row: i64) -> f64 {
        let x = (column as f64 + 0.5) / self.parts - self.x;
        let y = (row as f64 + 0.5) / self.parts - self.y;
        let q_sq = (x * x + y * y) / (self.radius * self.radius);
        if q_sq < 1.0 { table.value(q_sq) } else { 0.0 }
    }

    /// The first and last row of the picture that it may reach, if any.
    fn rows(&self, [width, height]: [u32; 2]) -> Option<[usize; 2]> {
        let reaches = |at: f64, edge: u32| at + self.radius >= 0.0 && at - self.radius < f64::from(edge);
        if self.radius < 0.0 || !reaches(self.x, width) || !reaches(self.y, height) {
            return None;
        }
        let row = |at: f64| at.floor().clamp(0.0, f64::from(height - 1)) as usize;
        Some([row(self.y - self.radius), row(self.y + self.radius)])
    }

    /// Adds its shares to the pixels of a band: rows of `width` pixels, from row `first` on.
    #[inline(always)]
    fn add(&self, table: &Table, (width, first, rows): (u32, usize, usize), mut add: impl FnMut(usize, f64)) {
        let inside = |row: i64, column: i64| {
            let row = row - first as i64;
            ((0..rows as i64).contains(&row) && (0..i64::from(width)).contains(&column))
                .then(|| row as usize * width as usize + column as usize)
        };
        if self.radius == 0.0 {
            if let Some(place) = inside(self.y.floor() as i64, self.x.floor() as i64) {
                add(place, 1.0);
            }
            return;
        }
        let parts = self.parts as i64;
        let clip = |range: std::ops::Range<i64>, low: usize, high: usize| {
            range.start.max(low as i64 * parts)..range.end.min(high as i64 * parts)
        };
        let columns = clip(self.range(self.x), 0, width as usize);
        for row in clip(self.range(self.y), first, first + rows) {
            for column in columns.clone() {
                let value = self.value(table, column, row);
                if value > 0.0 {
                    let place = (row / parts - first as i64) * i64::from(width) + column / parts;
                    add(place as usize, self.scale * value);
                }
            }
        }
    }
}

/// Which particles reach which band of rows, in their order.
struct Bands {
    starts: Vec<usize>,
    ids: Vec<u32>,
}

impl Bands {
    fn new(spots: &[Spot], size: [u32; 2]) -> Self {
        let count = (size[1] as usize).div_ceil(BAND);
        let reached = |spot: &Spot| spot.rows(size).map(|[low, high]| low / BAND..=high / BAND);
        let mut starts = vec![0; count + 1];
        for spot in spots {
            reached(spot).into_iter().flatten().for_each(|band| starts[band + 1] += 1);
        }
        for band in 0..count {
            starts[band + 1] += starts[band];
        }
        let mut next = starts.clone();
        let mut ids = vec![0; starts[count]];
        for (id, spot) in (0..).zip(spots) {
            for band in reached(spot).into_iter().flatten() {
                ids[next[band]] = id;
                next[band] += 1;
            }
        }
        Self { starts, ids }
    }

    fn of(&self, band: usize) -> &[u32] {
        &self.ids[self.starts[band]..self.starts[band + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::scene::camera::{Camera, Projection};
    use glam::{DVec3, Vec3};

    /// A picture of 4 x 4 around the origin, along -z.
    fn view(size: [u32; 2]) -> View {
        let projection = Projection::Orthographic { height: 4.0 };
        let camera = Camera { eye: DVec3::Z * 5.0, look_at: DVec3::ZERO, up: DVec3::Y, projection };
        camera.view(DVec3::ZERO, size[0], size[1]).unwrap()
    }

    fn positions(places: &[Vec3]) -> Positions {
        let offsets = [0, 1, 2].map(|axis| places.iter().map(|it| it[axis]).collect());
        Positions::from_offsets(DVec3::ZERO, offsets)
    }

    fn map(places: &[Vec3], lengths: &[f32], columns: &[&[f64]], size: [u32; 2]) -> Map {
        let positions = positions(places);
        let carried = Carried { positions: &positions, lengths, columns, kernel: Kernel::CubicSpline };
        project(&carried, &view(size), size, &()).unwrap()
    }

    #[test]
    fn a_particle_is_the_line_integral_of_its_kernel() {
        let (center, length, mass) = (Vec3::new(0.31, -0.22, 1.7), 1.3, 3.0);
        for size in [40, 400] {
            let found = map(&[center], &[length], &[&[mass]], [size; 2]);
            for place in (0..found.columns[0].len()).step_by(7) {
                let pixel = 4.0 / f64::from(size);
                let x = -2.0 + (place as u32 % size) as f64 * pixel + 0.5 * pixel - f64::from(center.x);
                let y = 2.0 - (place as u32 / size) as f64 * pixel - 0.5 * pixel - f64::from(center.y);
                let q = x.hypot(y) / f64::from(length);
                let wanted = mass * Kernel::CubicSpline.column(q.min(1.0)) / f64::from(length * length);
                let error = (found.columns[0][place] - wanted).abs();
                assert!(error < 2e-3 * mass, "{size} {place}: {} {wanted}", found.columns[0][place]);
            }
            assert!((found.sum(0) / mass - 1.0).abs() < 1e-4, "{}", found.sum(0));
        }
    }

    #[test]
    fn mass_is_conserved_for_kernels_of_any_size() {
        let mut stream = Stream::new(61, 0);
        for exponent in [-6.0, -3.0, -2.0, -1.0, -0.5, -0.1] {
            let places: Vec<Vec3> = (0..50).map(|_| stream.cube()).collect();
            let lengths: Vec<f32> = (0..50).map(|_| 10f32.powf(exponent) * stream.range(0.5, 1.0)).collect();
            let masses: Vec<f64> = (0..50).map(|_| f64::from(stream.unit())).collect();
            let found = map(&places, &lengths, &[&masses], [64, 64]);
            let total: f64 = masses.iter().sum();
            assert!((found.sum(0) / total - 1.0).abs() < 1e-9, "{exponent}: {}", found.sum(0));
            assert_eq!((found.totals[0], found.missing), (total, 0));
        }
        // Only what is in the picture is in the map.
        let half = map(&[Vec3::new(2.0, 0.0, 0.0)], &[0.5], &[&[1.0]], [64, 64]);
        assert!((half.sum(0) - 0.5).abs() < 1e-3, "{}", half.sum(0));
    }

    #[test]
    fn the_mean_of_a_constant_is_that_constant() {
        let mut stream = Stream::new(62, 0);
        let places: Vec<Vec3> = (0..200).map(|_| stream.cube()).collect();
        let lengths: Vec<f32> = (0..200).map(|_| stream.range(0.001, 0.6)).collect();
        let masses: Vec<f64> = (0..200).map(|_| f64::from(stream.unit())).collect();
        let products: Vec<f64> = masses.iter().map(|it| 7.5 * it).collect();
        let found = map(&places, &lengths, &[&products, &masses], [50, 50]);
        let means = found.mean(0, 1);
        assert!(means.iter().all(|it| it.is_nan() || (it - 7.5).abs() < 1e-12));
        assert!(means[0].is_nan() && means[25 * 50 + 25].is_finite());
    }

    #[test]
    fn threads_change_no_bit_and_missing_values_are_counted() {
        let mut stream = Stream::new(63, 0);
        let places: Vec<Vec3> = (0..500).map(|_| 2.0 * stream.cube()).collect();
        let lengths: Vec<f32> = (0..500).map(|_| stream.unit().powi(4)).collect();
        let mut masses: Vec<f64> = (0..500).map(|_| f64::from(stream.unit())).collect();
        masses[17] = f64::NAN;
        let maps = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| map(&places, &lengths, &[&masses], [33, 70]))
        });
        assert!(maps[0] == maps[1]);
        assert_eq!(maps[0].missing, 1);
    }

    #[test]
    fn perspective_is_refused() {
        let projection = Projection::Perspective { vertical_angle: 0.6 };
        let camera = Camera { eye: DVec3::Z * 5.0, look_at: DVec3::ZERO, up: DVec3::Y, projection };
        let view = camera.view(DVec3::ZERO, 8, 8).unwrap();
        let none = positions(&[]);
        let carried = Carried { positions: &none, lengths: &[], columns: &[], kernel: Kernel::Poly6 };
        assert_eq!(project(&carried, &view, [8, 8], &()).unwrap_err().code(), "setting");
    }
}
