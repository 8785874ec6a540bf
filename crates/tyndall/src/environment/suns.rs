//! What is small and bright in an image of the sky, as distant lights: a method that knows the sky by a few directions would smear
//! it over all of the one nearest to it.

use glam::{DVec3, Vec3};

use super::{Environment, Image, Radiance, luminance, solid_angle};

/// At most so many lights are taken out.
const MOST: usize = 8;
/// Half the angle, in radians, of what counts as one light: two degrees.
const REACH: f64 = 0.035;
/// Pixels wider than this, in radians, are no points.
const WIDEST: f64 = 0.06;
/// A light is so many times as bright as the rest on average...
const CONTRAST: f32 = 50.0;
/// ...brings this share of all light...
const SHARE: f64 = 0.01;
/// ...and ends where the image is darker than this share of its brightest pixel.
const EDGE: f32 = 0.05;

/// A distant light without extent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sun {
    /// Unit vector along which its light travels.
    pub(crate) along: Vec3,
    /// RGB irradiance on a plane across it, of finite numbers that are not negative.
    pub(crate) irradiance: Vec3,
}

impl Environment {
    /// What is small and bright, and the rest.
    pub(crate) fn without_suns(&self) -> (Vec<Sun>, Self) {
        let Radiance::Image(image) = &self.radiance else { return (Vec::new(), self.clone()) };
        let mut suns = Vec::new();
        let mut rest = image.clone();
        while let Some((sun, without)) = rest.brightest().filter(|_| suns.len() < MOST) {
            suns.push(sun);
            rest = without;
        }
        (suns, Self { radiance: Radiance::Image(rest) })
    }
}

impl Image {
    /// The brightest light and the image without it, if there is one.
    fn brightest(&self) -> Option<(Sun, Self)> {
        let (width, height) = (self.width, self.height);
        if std::f64::consts::PI / height.min(width.div_ceil(2)) as f64 > WIDEST {
            return None;
        }
        let light = |place: usize| luminance(self.pixels[place]);
        let brightest = (0..self.pixels.len()).max_by(|&a, &b| light(a).total_cmp(&light(b)))?;
        let middle = self.direction(brightest);
        let edge = EDGE * light(brightest);
        let mut pixels = self.pixels.clone();
        let (mut irradiance, mut toward, mut power) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (place, pixel) in pixels.iter_mut().enumerate() {
            if light(place) < edge {
                continue;
            }
            let direction = self.direction(place);
            if direction.dot(middle) > REACH.cos() {
                let angle = solid_angle(place / width, height) / width as f64;
                let share = angle * f64::from(light(place));
                irradiance += angle * pixel.as_dvec3();
                toward += share * direction;
                power += share;
                *pixel = Vec3::ZERO;
            }
        }
        let rest = Self { from_world: self.from_world, ..Self::new(width, pixels) };
        let is_bright = light(brightest) > CONTRAST * luminance(rest.mean);
        if !(is_bright && power > SHARE * f64::from(self.total)) {
            return None;
        }
        let along = (self.from_world.inverse() * -toward.as_vec3()).try_normalize()?;
        let irradiance = irradiance.as_vec3();
        irradiance.is_finite().then_some((Sun { along, irradiance }, rest))
    }

    /// The direction of the middle of a pixel, in the image's own axes.
    fn direction(&self, place: usize) -> DVec3 {
        let (column, row) = ((place % self.width) as f64 + 0.5, (place / self.width) as f64 + 0.5);
        let (across, y) = (std::f64::consts::PI * row / self.height as f64).sin_cos();
        let (sin, cos) = (std::f64::consts::TAU * (column / self.width as f64 - 0.5)).sin_cos();
        DVec3::new(across * sin, y, -across * cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [256, 128];

    fn sky(suns: &[(usize, f32)]) -> Environment {
        let mut pixels = vec![[0.2; 3]; SIZE[0] * SIZE[1]];
        for &(place, light) in suns {
            pixels[place] = [light, 0.5 * light, 0.0];
        }
        Environment::image(SIZE[0] as u32, &pixels).unwrap()
    }

    #[test]
    fn suns_are_taken_out_and_nothing_is_lost() {
        let places = [40 * SIZE[0] + 30, 90 * SIZE[0] + 200];
        // The first sun is two pixels wide.
        let image = sky(&[(places[0], 4e4), (places[0] + 1, 3e4), (places[1], 2e4)]);
        let upright = image.upright(Vec3::new(1.0, 2.0, -1.0)).unwrap();
        let (suns, rest) = upright.without_suns();
        assert_eq!(suns.len(), 2);
        // Irradiance of the suns, and the mean of the rest, make up the mean of the whole.
        let irradiance: Vec3 = suns.iter().map(|sun| sun.irradiance).sum();
        let whole = rest.mean() + irradiance / (4.0 * std::f32::consts::PI);
        assert!(whole.abs_diff_eq(upright.mean(), 1e-4), "{whole} {}", upright.mean());
        for sun in suns {
            assert!(upright.radiance(-sun.along).x > 1e4 && rest.radiance(-sun.along).x < 1.0);
        }
    }

    #[test]
    fn even_and_coarse_and_faint_skies_have_no_suns() {
        let faint = sky(&[(5000, 5.0)]);
        let coarse = Environment::image(4, &[[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 3]]).unwrap();
        let constant = Environment::constant([1.0; 3]).unwrap();
        for even in [sky(&[]), faint, coarse, constant] {
            let (suns, rest) = even.without_suns();
            assert!(suns.is_empty());
            assert_eq!(rest.mean(), even.mean());
        }
    }
}
