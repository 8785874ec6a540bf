//! Two eyes: cameras side by side that look the same way, and pictures of both in one.
//!
//! What the camera looks at lies in the plane of the picture, what is nearer before it. The cameras are parallel; the pictures are parts of
//! wider ones, each shifted by whole pixels, so that nothing is distorted as by cameras that are turned inward.

use crate::error::{Error, Result};
use crate::film::{Image, Window};
use crate::scene::camera::{Camera, Projection};

/// The distance of the eyes, as a share of the distance of what the camera looks at, if nobody says it.
pub const SEPARATION: f64 = 1.0 / 30.0;
/// The most of its width by which a picture is shifted.
const MOST_SHIFT: f64 = 0.5;

/// How the left and the right eye see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// The camera of each.
    pub cameras: [Camera; 2],
    /// Pixels in a row of the picture that each camera makes; rows are those of the picture that is wanted.
    pub width: u32,
    /// The part of it that is wanted of each.
    pub windows: [Window; 2],
}

impl Eyes {
    /// Left and right of `camera`, `separation` apart, for pictures of that size.
    ///
    /// Fails with [`Error::Setting`] if the camera is not one with an angle of view, sees nothing, or the eyes are too far apart.
    pub fn new(camera: &Camera, separation: Option<f64>, [width, height]: [u32; 2]) -> Result<Self> {
        if !matches!(camera.projection, Projection::Perspective { .. }) {
            let allowed = "used with a camera that has an angle of view";
            return Err(Error::setting("--stereo", "parallel rays or a panorama", allowed));
        }
        let view = camera.view(camera.eye, width, height)?;
        let distance = camera.eye.distance(camera.look_at);
        let separation = separation.unwrap_or(SEPARATION * distance);
        let shift = 0.5 * separation / (distance * f64::from(view.pixel));
        if !(separation > 0.0 && shift <= MOST_SHIFT * f64::from(width)) {
            let most = 2.0 * MOST_SHIFT * f64::from(width) * distance * f64::from(view.pixel);
            let allowed = format!("above 0 and at most {most:.4}, the width of what the picture shows");
            return Err(Error::setting("--eye-separation", separation, allowed));
        }
        let shift = shift.round() as u32;
        let aside = 0.5 * separation * view.right.as_dvec3();
        let moved = |by| Camera { eye: camera.eye + by, look_at: camera.look_at + by, ..*camera };
        let window = |x| Window { x, y: 0, width, height };
        Ok(Self {
            cameras: [moved(-aside), moved(aside)],
            width: width.saturating_add(2 * shift),
            // The left eye sees what it should see in the middle too far on the right.
            windows: [window(2 * shift), window(0)],
        })
    }
}

/// Both pictures, which have one size, side by side.
pub fn side_by_side(left: &Image, right: &Image) -> Image {
    Image {
        width: left.width + right.width,
        height: left.height,
        color: beside(left.width, &left.color, &right.color),
        depth: beside(left.width, &left.depth, &right.depth),
        id: beside(left.width, &left.id, &right.id),
    }
}

/// Two columns of pictures with rows of `width` pixels as that of the picture that has them side by side.
pub fn beside<T: Copy>(width: u32, left: &[T], right: &[T]) -> Vec<T> {
    let rows = left.chunks(width as usize).zip(right.chunks(width as usize));
    rows.flat_map(|(left, right)| left.iter().chain(right)).copied().collect()
}

/// Both pictures, which have one size, for glasses that are red on the left and cyan on the right: red is the brightness of the left
/// picture, green and blue those of the right. Depths and ids are those of the left one.
pub fn anaglyph(left: &Image, right: &Image) -> Image {
    let pixel = |(left, right): (&[f32; 4], &[f32; 4])| {
        let [r, g, b, alpha] = *left;
        // Rec. 709.
        let brightness = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        [brightness, right[1], right[2], alpha.max(right[3])]
    };
    let color = left.color.iter().zip(&right.color).map(pixel).collect();
    Image { color, ..left.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const CAMERA: Camera = Camera {
        eye: DVec3::new(0.0, -10.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::Perspective { vertical_angle: 0.6 },
    };

    /// Where a point is in an eye's picture, in pixels from its left edge.
    fn column(eyes: &Eyes, eye: usize, height: u32, point: DVec3) -> f64 {
        let view = eyes.cameras[eye].view(DVec3::ZERO, eyes.width, height).unwrap();
        let offset = point.as_vec3() - view.eye;
        let across = offset.dot(view.right) / offset.dot(view.forward);
        f64::from((across - view.left) / view.pixel) - f64::from(eyes.windows[eye].x)
    }

    #[test]
    fn what_is_looked_at_is_at_one_place_and_what_is_nearer_before_it() {
        let eyes = Eyes::new(&CAMERA, Some(0.5), [800, 600]).unwrap();
        let parallax = |point| column(&eyes, 1, 600, point) - column(&eyes, 0, 600, point);
        assert!(parallax(DVec3::ZERO).abs() < 1.0, "{}", parallax(DVec3::ZERO));
        assert!(parallax(DVec3::new(1.0, 0.0, -1.0)).abs() < 1.0);
        assert!(parallax(DVec3::new(0.0, -3.0, 0.0)) < -5.0 && parallax(DVec3::new(0.0, 5.0, 0.0)) > 5.0);
        let middle = 0.5 * (column(&eyes, 0, 600, DVec3::ZERO) + column(&eyes, 1, 600, DVec3::ZERO));
        assert!((middle - 400.0).abs() < 1e-2, "{middle}");
        for window in eyes.windows {
            assert!(window.check(eyes.width, 600).is_ok());
        }
    }

    #[test]
    fn eyes_that_cannot_be_are_refused() {
        let parallel = Camera { projection: Projection::Orthographic { height: 1.0 }, ..CAMERA };
        assert!(Eyes::new(&parallel, None, [8, 8]).is_err());
        for separation in [0.0, -1.0, f64::NAN, 100.0] {
            assert!(Eyes::new(&CAMERA, Some(separation), [80, 60]).is_err(), "{separation}");
        }
        assert!(Eyes::new(&CAMERA, None, [80, 60]).is_ok());
    }

    #[test]
    fn both_pictures_are_in_one() {
        let image = |red: f32, id: i64| Image {
            width: 1,
            height: 2,
            color: vec![[red, 0.0, 0.5, 1.0]; 2],
            depth: vec![red; 2],
            id: vec![id, id + 1],
        };
        let both = side_by_side(&image(0.0, 3), &image(1.0, 7));
        assert_eq!((both.width, both.height, both.id), (2, 2, vec![3, 7, 4, 8]));
        let glasses = anaglyph(&image(1.0, 3), &image(0.25, 7));
        assert_eq!(glasses.color[0], [0.2126 + 0.5 * 0.0722, 0.0, 0.5, 1.0]);
    }
}
