//! Less noise in a picture of a medium, by averaging pixels that differ by noise only.
//!
//! Takes a picture in two halves of its samples; gives its pixels, filtered. How much noise there is follows from how much the halves differ.
//! A pixel is compared with those around it by the patches around both, in units of their noise; the weights that one half gives are used
//! for the other one, whose noise they do not know. A plane is fitted to the weighted pixels, over their places, transmittances and
//! depths, so that slopes are kept. Invariant: equal halves are left as they are; the same pixels give the same bits for any number of threads.
//!
//! Sources: F. Rousselle, C. Knaus, M. Zwicker, "Adaptive rendering with non-local means filtering", SIGGRAPH Asia 2012 (distances,
//! halves); B. Bitterli et al., "Nonlinearly weighted first-order regression for denoising Monte Carlo renderings", EGSR 2016 (planes).

use std::ops::{Add, Div};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::film::{EDGE, Halves, Pixel};
use crate::math::exp_minus;

/// Pixels are compared with those so far away, along each axis.
const REACH: i32 = 6;
/// Patches reach so far.
const PATCH: i32 = 2;
/// Noise is averaged over pixels so far away.
const SMOOTH: i32 = 2;
/// Differences in units of the noise that count as one: the smaller, the less is averaged.
const STRICTNESS: f32 = 1.0;
/// Share by which slopes are damped.
const DAMPING: f32 = 1e-2;

/// Pixels that count for less are left out.
const LEAST: f32 = 1e-3;
/// How far what is looked at reaches beyond a tile.
const BORDER: i32 = REACH + PATCH;

/// The pixels, `width` a row, with less noise in the light that is scattered. What comes from behind has hardly any, and is kept.
pub(super) fn denoised(halves: &Halves, width: u32) -> Vec<Pixel> {
    let share = &halves.first_share;
    let [first, last] = halves.pixels.each_ref();
    let pixels: Vec<Pixel> =
        first.iter().zip(last).zip(share).map(|((first, last), share)| mean(first, last, *share)).collect();
    if first.iter().zip(last).all(|(first, last)| first.scattered == last.scattered) {
        return pixels;
    }
    let picture = Picture::new(halves, &pixels, width as i32);
    let tiles = picture.tiles();
    let filtered: Vec<Vec<Vec3>> = tiles.par_iter().map(|tile| picture.filtered(tile)).collect();
    let mut pixels = pixels;
    for (tile, values) in tiles.iter().zip(filtered) {
        for (place, value) in picture.places(tile, 0).zip(values) {
            pixels[place].scattered = value;
        }
    }
    pixels
}

/// Of both halves, the first of which has that share of the samples; where one of them has no depth, that of the other.
fn mean(first: &Pixel, last: &Pixel, share: f32) -> Pixel {
    let of = |first: Vec3, last: Vec3| share * first + (1.0 - share) * last;
    Pixel {
        scattered: of(first.scattered, last.scattered),
        environment: of(first.environment, last.environment),
        transmittance: of(first.transmittance, last.transmittance),
        depth: match (first.depth, last.depth) {
            (first, last) if first.is_finite() && last.is_finite() => share * first + (1.0 - share) * last,
            (first, last) => first.min(last),
        },
    }
}

/// Both halves of the light that is scattered, its noise, and what tells pixels apart beside it.
struct Picture<'a> {
    width: i32,
    height: i32,
    first_share: &'a [f32],
    values: [Vec<Vec3>; 2],
    /// Variances of both halves.
    noise: [Vec<Vec3>; 2],
    /// Transmittance, and depth as a share of the greatest difference of depths.
    guides: Vec<Vec2>,
    /// Their variances.
    guide_noise: Vec<Vec2>,
}

/// A rectangle of pixels.
struct Tile {
    x: i32,
    y: i32,
    width: i32,
    height: i32,
}

impl<'a> Picture<'a> {
    fn new(halves: &'a Halves, pixels: &[Pixel], width: i32) -> Self {
        let first_share = &halves.first_share[..];
        let size = [width, first_share.len() as i32 / width];
        let values = halves.pixels.each_ref().map(|it| it.iter().map(|it| it.scattered).collect::<Vec<_>>());
        let squares: Vec<Vec3> =
            values[0].iter().zip(&values[1]).map(|(a, b)| (*a - *b) * (*a - *b)).collect();
        let squares = smoothed(&squares, size, Vec3::ZERO);
        // A mean of a share of the samples has that much of the difference's variance that the others are a share of.
        let of_last = squares.iter().zip(first_share).map(|(it, first)| *first * *it).collect();
        let of_first = squares.iter().zip(first_share).map(|(it, first)| (1.0 - first) * *it).collect();

        let finite = pixels.iter().map(|it| it.depth).filter(|it| it.is_finite());
        let (near, far) =
            finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(near, far), it| (near.min(it), far.max(it)));
        let scale = 1.0 / (far - near).max(f32::MIN_POSITIVE);
        let guide = |pixel: &Pixel| {
            let depth = if pixel.depth.is_finite() { scale * (pixel.depth - near) } else { 1.0 };
            Vec2::new(pixel.transmittance.element_sum() / 3.0, depth)
        };
        let variance = |((first, last), share): ((&Pixel, &Pixel), &f32)| {
            let difference = guide(first) - guide(last);
            share * (1.0 - share) * difference * difference
        };
        let [first, last] = &halves.pixels;
        let guide_noise: Vec<Vec2> = first.iter().zip(last).zip(first_share).map(variance).collect();
        Self {
            width,
            height: size[1],
            first_share,
            values,
            noise: [of_first, of_last],
            guides: pixels.iter().map(guide).collect(),
            guide_noise: smoothed(&guide_noise, size, Vec2::ZERO),
        }
    }

    fn tiles(&self) -> Vec<Tile> {
        let edge = EDGE as i32;
        let tile = |x: i32, y: i32| Tile {
            x,
            y,
            width: edge.min(self.width - x),
            height: edge.min(self.height - y),
        };
        let rows = (0..self.height).step_by(EDGE as usize);
        rows.flat_map(|y| (0..self.width).step_by(EDGE as usize).map(move |x| tile(x, y))).collect()
    }

    /// The pixels of a tile and a border around it, each beyond the picture the nearest one in it.
    fn places(&self, tile: &Tile, border: i32) -> impl Iterator<Item = usize> + use<'_> {
        let (left, right, low, high) = (tile.x, tile.x + tile.width, tile.y, tile.y + tile.height);
        (low - border..high + border).flat_map(move |y| {
            let first = y.clamp(0, self.height - 1) * self.width;
            (left - border..right + border).map(move |x| (first + x.clamp(0, self.width - 1)) as usize)
        })
    }

    /// The light at a tile's pixels, filtered where it has noise: each half with weights by the other.
    fn filtered(&self, tile: &Tile) -> Vec<Vec3> {
        if self.places(tile, 0).all(|place| self.is_clean(place)) {
            let mean = |place: usize| {
                let share = self.first_share[place];
                share * self.values[0][place] + (1.0 - share) * self.values[1][place]
            };
            return self.places(tile, 0).map(mean).collect();
        }
        let (last, first) = (self.fitted(tile, 0), self.fitted(tile, 1));
        let pixels = self.places(tile, 0).zip(first.into_iter().zip(last));
        pixels
            .map(|(place, (first, last))| {
                let share = self.first_share[place];
                (share * first + (1.0 - share) * last).max(Vec3::ZERO)
            })
            .collect()
    }

    /// Whether the pixels around one have no noise.
    fn is_clean(&self, place: usize) -> bool {
        self.noise[0][place] == Vec3::ZERO
    }

    /// Planes through the values of one half at a tile's pixels, with weights by what the other, `compared`, is.
    fn fitted(&self, tile: &Tile, compared: usize) -> Vec<Vec3> {
        let places: Vec<usize> = self.places(tile, BORDER).collect();
        let near = |column: &[Vec3]| places.iter().map(|&place| column[place]).collect::<Vec<_>>();
        let (values, looks) = (near(&self.values[1 - compared]), near(&self.values[compared]));
        let noise = near(&self.noise[compared]);
        let guides: Vec<[Vec2; 2]> =
            places.iter().map(|&place| [self.guides[place], self.guide_noise[place]]).collect();

        let pitch = (tile.width + 2 * BORDER) as usize;
        let [width, height] = [tile.width, tile.height].map(|it| it as usize);
        let (wide, high) = (width + PATCHED - 1, height + PATCHED - 1);
        let mut planes = vec![Plane::default(); width * height];
        let mut distances = vec![0.0; wide * high];
        let mut along = vec![0.0; width * high];
        let at = |x: i32, y: i32| (y + BORDER) as usize * pitch + (x + BORDER) as usize;
        let steps = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| [dx, dy]));
        for [dx, dy] in steps {
            for (y, distances) in (-PATCH..).zip(distances.chunks_exact_mut(wide)) {
                let (one, other) = (at(-PATCH, y), at(-PATCH + dx, y + dy));
                let one = looks[one..][..wide].iter().zip(&noise[one..][..wide]);
                let other = looks[other..][..wide].iter().zip(&noise[other..][..wide]);
                for (distance, (one, other)) in distances.iter_mut().zip(one.zip(other)) {
                    *distance = distance_of(one, other);
                }
            }
            // Means over patches, along rows and then columns.
            for (sums, distances) in along.chunks_exact_mut(width).zip(distances.chunks_exact(wide)) {
                for (sum, patch) in sums.iter_mut().zip(distances.windows(PATCHED)) {
                    *sum = patch.iter().sum();
                }
            }
            let inside = |x: i32, y: i32| (0..self.width).contains(&x) && (0..self.height).contains(&y);
            for (y, planes) in (0..).zip(planes.chunks_exact_mut(width)) {
                for (x, plane) in (0..).zip(planes) {
                    let column = along[(y as usize * width + x as usize)..].iter().step_by(width);
                    let distance = column.take(PATCHED).sum::<f32>() / (PATCHED * PATCHED) as f32;
                    let weight = exp_minus(distance.max(0.0));
                    if weight < LEAST || !inside(tile.x + x + dx, tile.y + y + dy) {
                        continue;
                    }
                    let (here, there) = (at(x, y), at(x + dx, y + dy));
                    let [guide, guide_noise] = guides[there];
                    let [by_t, by_depth] = (guide - guides[here][0]).to_array();
                    let scale = 1.0 / REACH as f32;
                    let terms = [1.0, scale * dx as f32, scale * dy as f32, by_t, by_depth];
                    plane.add(weight, &terms, values[there], guide_noise);
                }
            }
        }
        planes.iter().map(Plane::value).collect()
    }
}

/// Means over the pixels around.
fn smoothed<T>(values: &[T], [width, height]: [i32; 2], zero: T) -> Vec<T>
where
    T: Copy + Send + Sync + Add<Output = T> + Div<f32, Output = T>,
{
    let along = |values: &[T], step: [i32; 2]| -> Vec<T> {
        let mean = |place: usize| {
            let (x, y) = (place as i32 % width, place as i32 / width);
            let (mut sum, mut count) = (zero, 0.0);
            for k in -SMOOTH..=SMOOTH {
                let (x, y) = (x + k * step[0], y + k * step[1]);
                if (0..width).contains(&x) && (0..height).contains(&y) {
                    (sum, count) = (sum + values[(y * width + x) as usize], count + 1.0);
                }
            }
            sum / count
        };
        (0..values.len()).into_par_iter().map(mean).collect()
    };
    along(&along(values, [1, 0]), [0, 1])
}

/// Pixels along the edge of a patch.
const PATCHED: usize = 2 * PATCH as usize + 1;

/// How different two pixels, each with its variance, are beyond their noise, in units of it: 0 on average where they are alike.
#[inline(always)]
fn distance_of((one, noise): (&Vec3, &Vec3), (other, of_other): (&Vec3, &Vec3)) -> f32 {
    let square = (one - other) * (one - other);
    let beyond = square - (noise + noise.min(*of_other));
    let scale = STRICTNESS * STRICTNESS * (noise + of_other) + 1e-20;
    (beyond / scale).element_sum() / 3.0
}

/// Places, transmittance and depth, beside the constant.
const TERMS: usize = 5;

/// Sums for the plane that is nearest to weighted pixels.
#[derive(Clone, Copy, Default)]
struct Plane {
    matrix: [[f32; TERMS]; TERMS],
    right: [Vec3; TERMS],
    /// Weighted variances of transmittance and depth.
    noise: Vec2,
}

impl Plane {
    #[inline(always)]
    fn add(&mut self, weight: f32, at: &[f32; TERMS], value: Vec3, noise: Vec2) {
        for (row, (sums, right)) in self.matrix.iter_mut().zip(&mut self.right).enumerate() {
            let weighted = weight * at[row];
            for (sum, term) in sums.iter_mut().zip(at).take(row + 1) {
                *sum += weighted * term;
            }
            *right += weighted * value;
        }
        self.noise += weight * noise;
    }

    /// The height of the plane at its middle. What is noise in transmittance and depth damps their slopes.
    fn value(&self) -> Vec3 {
        let mut lower = self.matrix;
        let noise = [0.0, 0.0, 0.0, self.noise.x, self.noise.y];
        for (term, noise) in noise.into_iter().enumerate().skip(1) {
            lower[term][term] += DAMPING * lower[term][term] + 4.0 * noise + 1e-6 * self.matrix[0][0];
        }
        // Cholesky's factor, in place.
        let mut right = self.right;
        for row in 0..TERMS {
            for column in 0..=row {
                let dot: f32 = (0..column).map(|k| lower[row][k] * lower[column][k]).sum();
                let rest = lower[row][column] - dot;
                lower[row][column] =
                    if row == column { rest.max(1e-12).sqrt() } else { rest / lower[column][column] };
            }
            let known: Vec3 = (0..row).map(|k| lower[row][k] * right[k]).sum();
            right[row] = (right[row] - known) / lower[row][row];
        }
        for row in (0..TERMS).rev() {
            let known: Vec3 = (row + 1..TERMS).map(|k| lower[k][row] * right[k]).sum();
            right[row] = (right[row] - known) / lower[row][row];
        }
        right[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const WIDTH: usize = 48;

    /// A picture of those values in two halves, each with noise of that deviation.
    fn noisy(value: impl Fn(usize, usize) -> f32, deviation: f32) -> (Vec<f32>, Halves) {
        let mut stream = Stream::new(5, 0);
        let wanted: Vec<f32> = (0..WIDTH * 40).map(|place| value(place % WIDTH, place / WIDTH)).collect();
        let half = |stream: &mut Stream| {
            let pixel = |wanted: &f32| {
                // A sum of twelve is nearly normal.
                let noise = (0..12).map(|_| stream.unit()).sum::<f32>() - 6.0;
                let scattered = Vec3::splat(wanted + deviation * noise);
                Pixel { scattered, transmittance: Vec3::splat(0.5), ..Pixel::default() }
            };
            wanted.iter().map(pixel).collect::<Vec<_>>()
        };
        let pixels = [half(&mut stream), half(&mut stream)];
        let first_share = vec![0.5; wanted.len()];
        (wanted, Halves { pixels, first_share })
    }

    /// Mean square errors before and after, and by how much the mean changes.
    fn errors(wanted: &[f32], halves: &Halves) -> [f64; 3] {
        let found = denoised(halves, WIDTH as u32);
        let [first, last] = &halves.pixels;
        let mean = |of: &dyn Fn(usize) -> f32| {
            (0..wanted.len()).map(|it| f64::from(of(it))).sum::<f64>() / wanted.len() as f64
        };
        let before = |at: usize| {
            let share = halves.first_share[at];
            share * first[at].scattered.x + (1.0 - share) * last[at].scattered.x - wanted[at]
        };
        let after = |at: usize| found[at].scattered.x - wanted[at];
        [mean(&|at| before(at).powi(2)), mean(&|at| after(at).powi(2)), mean(&|at| after(at) - before(at))]
    }

    #[test]
    fn noise_goes_and_slopes_and_edges_stay() {
        let slope = |x: usize, y: usize| 1.0 + 0.05 * x as f32 + 0.02 * y as f32;
        let edge = |x: usize, y: usize| if 3 * x > 2 * y + 30 { 2.0 } else { 1.0 };
        let wave = |x: usize, y: usize| 2.0 + (0.2 * x as f32).sin() * (0.25 * y as f32).cos();
        for (name, value, least) in [
            ("slope", &slope as &dyn Fn(usize, usize) -> f32, 15.0),
            ("edge", &edge, 10.0),
            ("wave", &wave, 2.0),
        ] {
            let (wanted, halves) = noisy(value, 0.1);
            let [before, after, bias] = errors(&wanted, &halves);
            println!("{name}: {before:.2e} {after:.2e} {bias:.2e}");
            assert!(before > least * after, "{name}: {before} {after}");
            assert!(bias.abs() < 2e-3, "{name}: {bias}");
        }
    }

    #[test]
    fn what_has_no_noise_is_left() {
        let wave = |x: usize, y: usize| (0.3 * x as f32).sin() + 0.1 * y as f32;
        let (_, halves) = noisy(wave, 0.0);
        assert_eq!(denoised(&halves, WIDTH as u32), halves.pixels[0]);
    }

    #[test]
    fn halves_weigh_by_their_samples() {
        let (wanted, mut halves) = noisy(|_, _| 1.0, 0.0);
        // Three quarters of the samples are in the first half, which has less noise.
        let mut stream = Stream::new(9, 0);
        for (half, deviation) in halves.pixels.iter_mut().zip([0.1, 0.1 * 3.0_f32.sqrt()]) {
            let noise = |stream: &mut Stream| deviation * ((0..12).map(|_| stream.unit()).sum::<f32>() - 6.0);
            half.iter_mut().for_each(|pixel| pixel.scattered = Vec3::splat(1.0 + noise(&mut stream)));
        }
        halves.first_share.fill(0.75);
        let [_, after, bias] = errors(&wanted, &halves);
        assert!(after < 0.75 * 0.01 / 15.0 && bias.abs() < 2e-3, "{after} {bias}");
    }
}
