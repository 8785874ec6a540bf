//! Light from far away all around: one radiance, or an image of the whole sphere.
//!
//! The image is equirectangular with the y axis up, as such images are published: row 0 looks up (+y), the middle of the
//! picture looks along -z, its right half along +x; [`Environment::upright`] turns it. A pixel has one radiance all over (no interpolation), so that the image is
//! sampled exactly in proportion to it: rows by their brightness times their solid angle, then columns of the row.
//! Source: M. Pharr, W. Jakob, G. Humphreys, "Physically based rendering", 3rd ed., 2016, section 14.2.4.

use std::f32::consts::{PI, TAU};

mod suns;

use glam::{Quat, Vec3};

use crate::error::{Error, Result};
pub(crate) use suns::Sun;

/// Images of which a smaller share of the light is above the mean are even.
const EVEN: f32 = 1e-5;

/// Light all around.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    radiance: Radiance,
}

#[derive(Clone, Debug, PartialEq)]
enum Radiance {
    Constant(Vec3),
    Image(Image),
}

#[derive(Clone, Debug, PartialEq)]
struct Image {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
    /// Probability of the rows up to and with each one.
    rows: Vec<f32>,
    /// For every row: probability of its columns up to and with each one.
    columns: Vec<f32>,
    /// Integral of the brightness (the mean of RGB) over the sphere.
    total: f32,
    /// Mean radiance over the sphere.
    mean: Vec3,
    /// Turns directions of the world into those of the image.
    from_world: Quat,
}

impl Environment {
    /// The same radiance from everywhere.
    pub fn constant(radiance: [f32; 3]) -> Result<Self> {
        Ok(Self { radiance: Radiance::Constant(brightness("radiance", radiance)?) })
    }

    /// An equirectangular image: `pixels` is RGB radiance row by row from the top, `width` a row.
    /// Fails with [`Error::Setting`] where the counts do not fit, or a pixel is negative or not finite.
    pub fn image(width: u32, pixels: &[[f32; 3]]) -> Result<Self> {
        let width = width as usize;
        if width == 0 || pixels.is_empty() || !pixels.len().is_multiple_of(width) {
            let given = format!("{} pixels in rows of {width}", pixels.len());
            return Err(Error::setting("environment", given, "at least one whole row of pixels"));
        }
        let pixels: Vec<Vec3> =
            pixels.iter().map(|&pixel| brightness("environment", pixel)).collect::<Result<_>>()?;
        Ok(Self { radiance: Radiance::Image(Image::new(width, pixels)) })
    }

    /// The same, turned so that the top of an image is in the direction `up`, by the shortest way. Fails with [`Error::Setting`] if
    /// `up` is no direction.
    pub fn upright(self, up: Vec3) -> Result<Self> {
        let Some(up) = up.try_normalize() else {
            return Err(Error::setting("up", up, "three finite numbers, not all zero"));
        };
        let from_world = Quat::from_rotation_arc(up, Vec3::Y);
        Ok(match self.radiance {
            Radiance::Image(image) => Self { radiance: Radiance::Image(Image { from_world, ..image }) },
            Radiance::Constant(_) => self,
        })
    }

    /// Whether every direction has the same radiance.
    pub fn is_constant(&self) -> bool {
        matches!(self.radiance, Radiance::Constant(_))
    }

    /// RGB radiance that comes from the direction `toward`, of unit length.
    #[inline]
    pub fn radiance(&self, toward: Vec3) -> Vec3 {
        match &self.radiance {
            Radiance::Constant(radiance) => *radiance,
            Radiance::Image(image) => {
                let (column, row) = image.pixel(toward);
                image.pixels[row * image.width + column]
            }
        }
    }

    /// Mean radiance over the sphere.
    pub fn mean(&self) -> Vec3 {
        match &self.radiance {
            Radiance::Constant(radiance) => *radiance,
            Radiance::Image(image) => image.mean,
        }
    }

    /// Grey light where an image is brighter than on average, by how much; none where that is nowhere. Those who find what is even by other
    /// means look for the rest by it. Source: O. Karlik et al., "MIS compensation: optimizing sampling techniques in multiple importance
    /// sampling", ACM Transactions on Graphics 38(6), 2019.
    pub fn above_mean(&self) -> Option<Self> {
        let Radiance::Image(image) = &self.radiance else { return None };
        let mean = luminance(image.mean);
        let grey = |&pixel: &Vec3| Vec3::splat((luminance(pixel) - mean).max(0.0));
        let bright = Image::new(image.width, image.pixels.iter().map(grey).collect());
        let bright = Image { from_world: image.from_world, ..bright };
        // An even image differs from its mean by rounding.
        (bright.total > EVEN * image.total).then_some(Self { radiance: Radiance::Image(bright) })
    }

    /// A direction to look in, drawn in proportion to its brightness by two random numbers in [0, 1).
    pub fn sample(&self, random: [f32; 2]) -> Vec3 {
        match &self.radiance {
            Radiance::Image(image) if image.total > 0.0 => image.sample(random),
            _ => sphere(random),
        }
    }

    /// Probability density of [`Environment::sample`], per steradian.
    #[inline]
    pub fn density(&self, toward: Vec3) -> f32 {
        match &self.radiance {
            Radiance::Image(image) if image.total > 0.0 => {
                let (column, row) = image.pixel(toward);
                luminance(image.pixels[row * image.width + column]) / image.total
            }
            _ => 0.25 / PI,
        }
    }
}

/// A direction uniform on the sphere, by two random numbers in [0, 1).
pub(crate) fn sphere(random: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * random[0];
    let across = (1.0 - z * z).max(0.0).sqrt();
    let (sin_around, cos_around) = (TAU * random[1]).sin_cos();
    Vec3::new(across * cos_around, across * sin_around, z)
}

/// Checks the brightness of a light.
pub(crate) fn brightness(name: &str, rgb: [f32; 3]) -> Result<Vec3> {
    if rgb.iter().all(|value| (0.0..f32::INFINITY).contains(value)) {
        return Ok(Vec3::from(rgb));
    }
    Err(Error::setting(name, format!("{rgb:?}"), "three finite numbers that are not negative"))
}

/// What is sampled by: no channel is left out.
fn luminance(rgb: Vec3) -> f32 {
    rgb.element_sum() / 3.0
}

impl Image {
    fn new(width: usize, pixels: Vec<Vec3>) -> Self {
        let height = pixels.len() / width;
        let (mut rows, mut columns) = (Vec::with_capacity(height), Vec::with_capacity(pixels.len()));
        let (mut total, mut mean) = (0.0_f64, glam::DVec3::ZERO);
        for (row, line) in pixels.chunks_exact(width).enumerate() {
            let angle = solid_angle(row, height) / width as f64;
            let mut sum = 0.0_f64;
            let first = columns.len();
            for &pixel in line {
                sum += f64::from(luminance(pixel));
                mean += angle * pixel.as_dvec3();
                columns.push(sum);
            }
            columns[first..].iter_mut().for_each(|it| *it /= if sum > 0.0 { sum } else { 1.0 });
            total += sum * angle;
            rows.push(total);
        }
        rows.iter_mut().for_each(|it| *it /= if total > 0.0 { total } else { 1.0 });
        let single = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect();
        Self {
            width,
            height,
            pixels,
            rows: single(rows),
            columns: single(columns),
            total: total as f32,
            mean: (mean / (4.0 * std::f64::consts::PI)).as_vec3(),
            from_world: Quat::IDENTITY,
        }
    }

    /// Column and row of the pixel that is seen in a direction.
    fn pixel(&self, toward: Vec3) -> (usize, usize) {
        let toward = self.from_world * toward;
        let around = (toward.x.atan2(-toward.z) / TAU + 0.5) * self.width as f32;
        let down = toward.y.clamp(-1.0, 1.0).acos() / PI * self.height as f32;
        ((around as usize).min(self.width - 1), (down as usize).min(self.height - 1))
    }

    fn sample(&self, random: [f32; 2]) -> Vec3 {
        let (row, down) = choose(&self.rows, random[0]);
        let (column, around) = choose(&self.columns[row * self.width..][..self.width], random[1]);
        // Within a row uniform in height, that is in solid angle.
        let edge = |row: usize| (PI * row as f32 / self.height as f32).cos();
        let y = edge(row) + down * (edge(row + 1) - edge(row));
        let across = (1.0 - y * y).max(0.0).sqrt();
        let (sin, cos) = (TAU * ((column as f32 + around) / self.width as f32 - 0.5)).sin_cos();
        self.from_world.inverse() * Vec3::new(across * sin, y, -across * cos)
    }
}

/// Solid angle of a whole row.
fn solid_angle(row: usize, height: usize) -> f64 {
    let edge = |row: usize| (std::f64::consts::PI * row as f64 / height as f64).cos();
    std::f64::consts::TAU * (edge(row) - edge(row + 1))
}

/// The first place whose sum exceeds `random`, and where in its share `random` lies.
fn choose(sums: &[f32], random: f32) -> (usize, f32) {
    let place = sums.partition_point(|&sum| sum <= random);
    // Rounding may leave the last sum below 1: then the last place that has a share.
    let place =
        if place < sums.len() { place } else { sums.partition_point(|&sum| sum < sums[sums.len() - 1]) };
    let before = if place > 0 { sums[place - 1] } else { 0.0 };
    let share = sums[place] - before;
    (place, if share > 0.0 { ((random - before) / share).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A dark sky with a gradient and two bright pixels.
    fn sky() -> Environment {
        let mut pixels: Vec<[f32; 3]> = (0..16 * 8).map(|k| [0.01 * (k % 16) as f32, 0.1, 0.2]).collect();
        pixels[16 * 2 + 5] = [40.0, 30.0, 20.0];
        pixels[16 * 6 + 15] = [0.0, 25.0, 0.0];
        Environment::image(16, &pixels).unwrap()
    }

    #[test]
    fn samples_estimate_the_integral_with_little_noise() {
        let sky = sky();
        let mut stream = Stream::new(41, 0);
        let count = 20_000;
        let mut sum = Vec3::ZERO;
        for _ in 0..count {
            let toward = sky.sample([stream.unit(), stream.unit()]);
            assert!((toward.length() - 1.0).abs() < 1e-5 && sky.density(toward) > 0.0);
            sum += sky.radiance(toward) / sky.density(toward);
        }
        let estimate = sum / (4.0 * PI * count as f32);
        assert!((luminance(estimate) / luminance(sky.mean()) - 1.0).abs() < 2e-3, "{estimate}");
        assert!(estimate.abs_diff_eq(sky.mean(), 0.02 * sky.mean().max_element()), "{estimate}");
    }

    #[test]
    fn the_density_integrates_to_one_and_the_mean_is_that_of_uniform_directions() {
        let sky = sky();
        let mut stream = Stream::new(42, 0);
        let count = 400_000;
        let (mut density, mut radiance) = (0.0_f64, 0.0_f64);
        for _ in 0..count {
            let toward = stream.direction();
            density += f64::from(sky.density(toward));
            radiance += f64::from(luminance(sky.radiance(toward)));
        }
        let scale = 4.0 * std::f64::consts::PI / f64::from(count);
        assert!((density * scale - 1.0).abs() < 0.05, "{}", density * scale);
        let mean = f64::from(luminance(sky.mean()));
        assert!((radiance / f64::from(count) / mean - 1.0).abs() < 0.05);
    }

    #[test]
    fn what_is_above_the_mean_is_drawn_alone() {
        let sky = sky().upright(Vec3::new(0.3, -0.2, 0.9)).unwrap();
        let bright = sky.above_mean().unwrap();
        let mean = luminance(sky.mean());
        let mut stream = Stream::new(44, 0);
        for _ in 0..2000 {
            let toward = stream.direction();
            let expected = (luminance(sky.radiance(toward)) - mean).max(0.0);
            assert_eq!(bright.radiance(toward), Vec3::splat(expected));
            assert_eq!(bright.density(toward) > 0.0, expected > 0.0);
        }
        let even = Environment::image(7, &[[0.7, 0.3, 0.1]; 7 * 5]).unwrap();
        let black = Environment::image(2, &[[0.0; 3]; 4]).unwrap();
        let constant = Environment::constant([1.0; 3]).unwrap();
        assert!([even, black, constant].iter().all(|it| it.above_mean().is_none()));
    }

    #[test]
    fn the_image_stands_upright() {
        // Two rows, four columns: which pixel is up, ahead, to the right.
        let pixels: Vec<[f32; 3]> = (0..8).map(|k| [k as f32, 0.0, 0.0]).collect();
        let sky = Environment::image(4, &pixels).unwrap();
        let seen = |x: f32, y: f32, z: f32| sky.radiance(Vec3::new(x, y, z).normalize()).x;
        assert!(seen(0.1, 1.0, -1.0) < 4.0 && seen(0.1, -1.0, -1.0) >= 4.0);
        assert_eq!(seen(0.1, 0.5, -1.0), 2.0);
        assert_eq!(seen(-0.1, 0.5, -1.0), 1.0);
        assert_eq!(seen(1.0, 0.5, 0.1), 3.0);
    }

    #[test]
    fn the_top_of_an_image_is_where_up_is() {
        let pixels: Vec<[f32; 3]> = (0..8).map(|k| [k as f32, 0.0, 0.0]).collect();
        let sky = Environment::image(4, &pixels).unwrap().upright(2.0 * Vec3::Z).unwrap();
        let seen = |x: f32, y: f32, z: f32| sky.radiance(Vec3::new(x, y, z).normalize()).x;
        // The middle, -z in the image, is +y now; right stays right.
        assert_eq!((seen(0.1, 1.0, 0.5), seen(-0.1, 1.0, 0.5), seen(1.0, -0.1, 0.5)), (2.0, 1.0, 3.0));
        assert_eq!(seen(0.1, 1.0, -0.5), 6.0);
        let mut stream = Stream::new(43, 0);
        for _ in 0..1000 {
            let toward = sky.sample([stream.unit(), stream.unit()]);
            assert!(toward.is_normalized() && sky.density(toward) > 0.0);
        }
        assert!(sky.upright(Vec3::ZERO).is_err());
    }

    #[test]
    fn black_and_broken_images_are_defined() {
        let black = Environment::image(2, &[[0.0; 3]; 4]).unwrap();
        assert_eq!(black.mean(), Vec3::ZERO);
        assert!(black.density(Vec3::Y) > 0.0 && black.sample([0.3, 0.7]).is_normalized());
        assert!(Environment::image(0, &[]).is_err());
        assert!(Environment::image(3, &[[0.0; 3]; 4]).is_err());
        assert!(Environment::image(1, &[[f32::NAN, 0.0, 0.0]]).is_err());
        assert!(Environment::constant([0.0, -1.0, 0.0]).is_err());
    }
}
