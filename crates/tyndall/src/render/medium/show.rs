//! Pictures of what a medium is made of, instead of how it looks: its photons, and how much of it lies behind a pixel.

use glam::Vec3;
use rayon::prelude::*;

use super::free_path::Tracker;
use super::march::Pixel;
use super::photons::Photon;
use crate::medium::Medium;
use crate::scene::camera::View;

/// Radiance of a pixel in which one photon of mean power is seen; more approach 1.
const ONE_PHOTON: f32 = 0.25;

/// Stored photons as points, in the color of their power. The more lie in a pixel, the brighter it is: 1 - exp(-0.29 n).
pub fn photons(photons: &[Photon], view: &View, width: u32, height: u32) -> Vec<Pixel> {
    let mut sums = vec![Vec3::ZERO; width as usize * height as usize];
    let mut nearest = vec![f32::INFINITY; sums.len()];
    let total: Vec3 = photons.iter().map(|photon| photon.power).sum();
    let scale = photons.len() as f32 / total.element_sum().max(f32::MIN_POSITIVE) * 3.0;
    for photon in photons {
        let offset = photon.position - view.eye;
        let depth = offset.dot(view.forward);
        let Some([x, y]) = view.pixel_of(photon.position) else { continue };
        if (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y) {
            let place = y as usize * width as usize + x as usize;
            sums[place] += scale * photon.power;
            nearest[place] = nearest[place].min(if view.perspective { offset.length() } else { depth });
        }
    }
    let rate = -(1.0 - ONE_PHOTON).ln();
    let pixel = |(sum, depth): (Vec3, f32)| {
        let hidden = sum.map(|it| (-rate * it).exp());
        Pixel { scattered: 1.0 - hidden, transmittance: hidden, depth, ..Pixel::default() }
    };
    sums.into_iter().zip(nearest).map(pixel).collect()
}

/// The integral of the density along the ray through the middle of each pixel, over the greatest of them.
pub fn density(medium: &Medium, view: &View, width: u32, height: u32) -> Vec<Pixel> {
    let tracker = Tracker::new(medium);
    let column = |place: usize| {
        let (x, y) = (place % width as usize, place / width as usize);
        tracker.column(&view.ray(x as f32 + 0.5, y as f32 + 0.5))
    };
    let columns: Vec<f32> = (0..width as usize * height as usize).into_par_iter().map(column).collect();
    let most = columns.iter().fold(f32::MIN_POSITIVE, |most, &it| most.max(it));
    let pixel = |column: f32| Pixel {
        scattered: Vec3::splat(column / most),
        transmittance: Vec3::splat(1.0 - column / most),
        depth: f32::INFINITY,
        ..Pixel::default()
    };
    columns.into_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::{Grid, Optics, Phase};
    use crate::scene::camera::{Camera, Projection};
    use glam::DVec3;

    fn view() -> View {
        let projection = Projection::Orthographic { height: 4.0 };
        let camera =
            Camera { eye: DVec3::new(0.0, 0.0, 9.0), look_at: DVec3::ZERO, up: DVec3::Y, projection };
        camera.view(DVec3::ZERO, 8, 8).unwrap()
    }

    #[test]
    fn photons_are_seen_where_they_are() {
        let photon = |x, y| Photon { position: Vec3::new(x, y, 1.0), power: Vec3::ONE, ..Photon::default() };
        let pixels = photons(&[photon(-1.9, 1.9), photon(0.1, 0.1), photon(9.0, 0.0)], &view(), 8, 8);
        let seen: Vec<usize> = (0..64).filter(|&place| pixels[place].scattered.x > 0.0).collect();
        assert_eq!(seen, [0, 3 * 8 + 4]);
        assert!((pixels[0].depth - 8.0).abs() < 1e-5 && pixels[1].depth.is_infinite());
        assert!((pixels[0].scattered.x - ONE_PHOTON).abs() < 1e-5);
    }

    #[test]
    fn columns_are_relative_to_the_thickest() {
        let grid = Grid::from_dense(Vec3::NEG_ONE, 1.0, [3, 3, 3], &[2.0; 27]).unwrap();
        let optics = Optics { extinction: [1.0; 3], albedo: [0.5; 3], phase: Phase::ISOTROPIC };
        let pixels = density(&Medium::new(grid, optics).unwrap(), &view(), 8, 8);
        assert!((pixels[8 * 4 + 4].scattered.x - 1.0).abs() < 1e-5);
        assert_eq!(pixels[0].scattered.x, 0.0);
    }
}
