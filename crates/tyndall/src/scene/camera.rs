//! The camera: where the eye is, and which ray belongs to a point of the picture.

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};

/// How rays leave the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// From the eye, within a vertical angle of view, in radians.
    Perspective {
        /// Angle between the picture's lower and upper edge.
        vertical_angle: f64,
    },
    /// In parallel, from the plane through the eye; depth is measured from that plane.
    Orthographic {
        /// Height of what the picture shows, in the unit of the particles.
        height: f64,
    },
    /// From the eye all around (equirectangular): columns are longitudes, with the line of sight in the middle, rows are latitudes from up to
    /// down. A pixel is as wide as it is high, so that a picture twice as wide as high shows everything.
    Panorama,
}

/// Where the camera stands and looks, in the coordinates of the particles' file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at; not the eye.
    pub look_at: DVec3,
    /// Which direction is up in the picture; not along the line of sight.
    pub up: DVec3,
    /// How rays leave it.
    pub projection: Projection,
}

/// The angle of view if none is given: 35 degrees.
pub const VERTICAL_ANGLE: f64 = 35.0 * std::f64::consts::PI / 180.0;

impl Camera {
    /// A camera that looks along `direction` and just shows all `corners` in a picture of that `aspect` (width over height):
    /// in perspective within `vertical_angle`, in radians, or orthographic without one. `center` is measured from; `up` may be
    /// replaced where the camera looks along it.
    pub fn framing(
        center: DVec3,
        corners: &[DVec3],
        direction: DVec3,
        up: DVec3,
        aspect: f64,
        vertical_angle: Option<f64>,
    ) -> Self {
        let forward = direction.normalize_or(DVec3::Y);
        let up = usable_up(forward, up);
        let right = forward.cross(up).normalize();
        let axes = [right, right.cross(forward)];
        let radius = corners.iter().map(|corner| corner.distance(center)).fold(0.0, f64::max);
        let radius = if radius > 0.0 { radius } else { 1.0 };

        // Across each axis the corner that is outermost on either side; in perspective a corner further back is so by less.
        let slope = vertical_angle.map_or(0.0, |angle| (0.5 * angle).tan() / MARGIN);
        let slopes = [slope * aspect, slope];
        let mut highest = [f64::NEG_INFINITY; 2];
        let mut lowest = [f64::INFINITY; 2];
        let mut nearest = 0.0_f64;
        for offset in corners.iter().map(|corner| *corner - center) {
            let depth = offset.dot(forward);
            nearest = nearest.min(depth);
            for axis in 0..2 {
                let across = offset.dot(axes[axis]);
                highest[axis] = highest[axis].max(across - slopes[axis] * depth);
                lowest[axis] = lowest[axis].min(across + slopes[axis] * depth);
            }
        }
        if corners.is_empty() {
            (highest, lowest) = ([radius; 2], [-radius; 2]);
        }
        let middle = [0, 1].map(|axis| 0.5 * (highest[axis] + lowest[axis]));
        let half = [0, 1].map(|axis| 0.5 * (highest[axis] - lowest[axis]));
        let look_at = center + middle[0] * axes[0] + middle[1] * axes[1];
        let (back, projection) = match vertical_angle {
            None => {
                let half_height = (MARGIN * half[1].max(half[0] / aspect)).max(1e-3 * radius);
                (3.0 * radius, Projection::Orthographic { height: 2.0 * half_height })
            }
            Some(vertical_angle) => {
                let back = (half[0] / slopes[0]).max(half[1] / slopes[1]).max(0.01 * radius - nearest);
                (back, Projection::Perspective { vertical_angle })
            }
        };
        Self { eye: look_at - back * forward, look_at, up, projection }
    }

    /// The camera as kernels need it, for particles measured from `origin` and a picture of `width` x `height` pixels.
    /// Fails with [`Error::Setting`] if the camera has no direction or no extent.
    pub fn view(&self, origin: DVec3, width: u32, height: u32) -> Result<View> {
        let forward = (self.look_at - self.eye)
            .try_normalize()
            .ok_or_else(|| Error::setting("look-at", self.look_at, "a point away from the eye"))?;
        let right = forward
            .cross(self.up)
            .try_normalize()
            .filter(|_| forward.cross(self.up.normalize_or_zero()).length() > 1e-9)
            .ok_or_else(|| {
                Error::setting("up", self.up, "a direction that is not along the line of sight")
            })?;
        let up = right.cross(forward);
        let (half_height, perspective) = match self.projection {
            Projection::Panorama => (0.5 * std::f64::consts::PI, true),
            Projection::Perspective { vertical_angle } => {
                if !(vertical_angle > 0.0 && vertical_angle < std::f64::consts::PI) {
                    return Err(Error::setting(
                        "fov",
                        vertical_angle.to_degrees(),
                        "between 0 and 180 degrees",
                    ));
                }
                ((0.5 * vertical_angle).tan(), true)
            }
            Projection::Orthographic { height } => {
                if !(height > 0.0 && height.is_finite()) {
                    return Err(Error::setting("ortho", height, "a height greater than 0"));
                }
                (0.5 * height, false)
            }
        };
        let pixel = 2.0 * half_height / height as f64;
        let corner = -0.5 * pixel * width as f64;
        Ok(View {
            eye: (self.eye - origin).as_vec3(),
            forward: forward.as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            left: corner as f32,
            top: half_height as f32,
            pixel: pixel as f32,
            perspective,
            panorama: self.projection == Projection::Panorama,
        })
    }
}

/// How much more than the particles' extent the picture shows: 5 % on each side.
const MARGIN: f64 = 1.05;

/// `up`, or another direction where the camera looks along it.
pub(super) fn usable_up(forward: DVec3, up: DVec3) -> DVec3 {
    let up = up.normalize_or(DVec3::Z);
    if forward.cross(up).length() > 1e-3 {
        return up;
    }
    if forward.cross(DVec3::Y).length() > 1e-3 { DVec3::Y } else { DVec3::Z }
}

/// The corners of a box measured from `origin`.
pub fn corners(bounds: &Bounds, origin: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        origin + Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()
    })
}

/// A camera over a picture's pixels. Lengths are in the unit of the particles, positions measured from their origin.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Where the camera stands.
    pub eye: Vec3,
    /// Its axes, of unit length, perpendicular to each other.
    pub forward: Vec3,
    /// See `forward`.
    pub right: Vec3,
    /// See `forward`.
    pub up: Vec3,
    /// The picture's left edge and upper edge in the picture plane: lengths (orthographic), slopes (perspective) or radians (panorama).
    pub left: f32,
    /// See `left`.
    pub top: f32,
    /// Edge of a pixel in the picture plane.
    pub pixel: f32,
    /// Whether rays start at the eye and `left`, `top` and `pixel` are slopes.
    pub perspective: bool,
    /// Whether, in perspective, they are longitudes and latitudes instead.
    pub panorama: bool,
}

impl View {
    /// The direction in which `at` is seen.
    #[inline(always)]
    pub fn toward(&self, at: Vec3) -> Vec3 {
        if self.perspective { (at - self.eye).normalize_or(self.forward) } else { self.forward }
    }

    /// The direction at a longitude, from the line of sight to the right, and a latitude, in radians.
    pub(crate) fn direction_at(&self, longitude: f32, latitude: f32) -> Vec3 {
        let ((right, ahead), (up, level)) = (longitude.sin_cos(), latitude.sin_cos());
        (self.forward * (level * ahead) + self.right * (level * right) + self.up * up).normalize()
    }

    /// The area across the line of sight that a pixel covers at a place in front of the eye, square units of length.
    pub(crate) fn pixel_area(&self, at: Vec3) -> f32 {
        let offset = at - self.eye;
        let square = offset.length_squared();
        let shrunk = if self.panorama {
            let up = offset.dot(self.up);
            square * (1.0 - up * up / square).max(0.0).sqrt()
        } else if self.perspective {
            let ahead = offset.dot(self.forward);
            ahead * ahead * ahead / square.sqrt()
        } else {
            1.0
        };
        self.pixel * self.pixel * shrunk
    }

    /// Where in the picture a place is seen, in pixels from its upper left corner; none behind the eye.
    pub fn pixel_of(&self, at: Vec3) -> Option<[f32; 2]> {
        let offset = at - self.eye;
        let [ahead, right, up] = [self.forward, self.right, self.up].map(|axis| offset.dot(axis));
        let [u, v] = if self.panorama {
            [right.atan2(ahead), up.atan2(ahead.hypot(right))]
        } else {
            if ahead <= 0.0 {
                return None;
            }
            let scale = if self.perspective { ahead } else { 1.0 };
            [right / scale, up / scale]
        };
        Some([(u - self.left) / self.pixel, (self.top - v) / self.pixel])
    }

    /// How wide a pixel is at the distance `t` along its ray, a length; away from the middle of a picture in perspective a little less.
    #[inline(always)]
    pub(crate) fn footprint(&self, t: f32) -> f32 {
        if self.perspective { self.pixel * t } else { self.pixel }
    }

    /// The ray through the point (x, y) of the picture, in pixels from its upper left corner.
    #[inline(always)]
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let u = self.left + x * self.pixel;
        let v = self.top - y * self.pixel;
        if self.panorama {
            let direction = self.direction_at(u, v);
            return Ray { origin: self.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
        }
        let across = self.right * u + self.up * v;
        let (origin, direction) = if self.perspective {
            let toward = self.forward + across;
            let length_sq = toward.x * toward.x + toward.y * toward.y + toward.z * toward.z;
            (self.eye, toward * (1.0 / length_sq.sqrt()))
        } else {
            (self.eye + across, self.forward)
        };
        Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_picture_is_what_the_camera_looks_at() {
        for projection in
            [Projection::Perspective { vertical_angle: 0.6 }, Projection::Orthographic { height: 3.0 }]
        {
            let camera = Camera {
                eye: DVec3::new(1.0, 2.0, 3.0),
                look_at: DVec3::new(4.0, -1.0, 2.5),
                up: DVec3::Z,
                projection,
            };
            let ray = camera.view(DVec3::ONE, 40, 20).unwrap().ray(20.0, 10.0);
            let toward = (camera.look_at - camera.eye).normalize().as_vec3();
            assert!(ray.direction.abs_diff_eq(toward, 1e-6));
            assert!(ray.origin.abs_diff_eq((camera.eye - DVec3::ONE).as_vec3(), 1e-6));
        }
    }

    #[test]
    fn a_panorama_shows_all_around() {
        let camera = Camera {
            eye: DVec3::ONE,
            look_at: DVec3::new(1.0, 5.0, 1.0),
            up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let view = camera.view(DVec3::ZERO, 80, 40).unwrap();
        for (x, y, toward) in [
            (40.0, 20.0, Vec3::Y),
            (60.0, 20.0, Vec3::X),
            (20.0, 20.0, Vec3::NEG_X),
            (0.0, 20.0, Vec3::NEG_Y),
            (80.0, 20.0, Vec3::NEG_Y),
            (17.0, 0.0, Vec3::Z),
            (17.0, 40.0, Vec3::NEG_Z),
            (50.0, 10.0, Vec3::new(0.5, 0.5, 0.5_f32.sqrt())),
        ] {
            let ray = view.ray(x, y);
            assert!(ray.direction.abs_diff_eq(toward, 1e-5), "{x} {y}: {}", ray.direction);
            assert_eq!(ray.origin, Vec3::ONE);
        }
        let [x, y] = view.pixel_of(view.eye + 3.0 * view.ray(13.25, 31.5).direction).unwrap();
        assert!((x - 13.25).abs() < 1e-3 && (y - 31.5).abs() < 1e-3);
    }

    #[test]
    fn a_pixel_covers_what_lies_between_the_rays_of_its_corners() {
        for projection in [
            Projection::Perspective { vertical_angle: 1.5 },
            Projection::Orthographic { height: 3.0 },
            Projection::Panorama,
        ] {
            let (eye, look_at) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, -1.0, 2.5));
            let view = Camera { eye, look_at, up: DVec3::Z, projection }.view(DVec3::ZERO, 400, 200).unwrap();
            for (x, y) in [(200.0, 100.0), (20.0, 30.0), (370.0, 180.0)] {
                let at = |x, y| {
                    let ray = view.ray(x, y);
                    ray.origin + 7.0 * ray.direction
                };
                let [across, down] = [at(x + 1.0, y) - at(x - 1.0, y), at(x, y + 1.0) - at(x, y - 1.0)];
                let (wanted, found) = (across.cross(down).length() / 4.0, view.pixel_area(at(x, y)));
                assert!((found / wanted - 1.0).abs() < 2e-3, "{projection:?} {x} {y}: {found} for {wanted}");
            }
        }
    }

    #[test]
    fn framing_shows_every_corner_and_little_more() {
        let bounds = Bounds { min: Vec3::new(-1.0, -4.0, 0.0), max: Vec3::new(2.0, 1.0, 7.0) };
        let corners = corners(&bounds, DVec3::new(100.0, 0.0, 0.0));
        let center = DVec3::new(100.5, -1.5, 3.5);
        for direction in [DVec3::new(-2.0, -1.3, -1.0), DVec3::X, DVec3::NEG_Z] {
            for angle in [None, Some(VERTICAL_ANGLE)] {
                let camera = Camera::framing(center, &corners, direction, DVec3::Z, 2.0, angle);
                let view = camera.view(DVec3::ZERO, 200, 100).unwrap();
                let mut most = 0.0_f32;
                for corner in corners {
                    let offset = corner.as_vec3() - view.eye;
                    let depth = if view.perspective { offset.dot(view.forward) } else { 1.0 };
                    let across = (offset.dot(view.right) / depth / (view.pixel * 100.0)).abs();
                    let along = (offset.dot(view.up) / depth / (view.pixel * 50.0)).abs();
                    assert!(depth > 0.0 && across <= 1.0 && along <= 1.0, "{across} {along}");
                    most = most.max(across).max(along);
                }
                assert!(most > 0.9, "{most}");
            }
        }
    }

    #[test]
    fn a_camera_without_direction_is_refused() {
        let camera = Camera {
            eye: DVec3::ONE,
            look_at: DVec3::ONE,
            up: DVec3::Z,
            projection: Projection::Orthographic { height: 1.0 },
        };
        assert!(camera.view(DVec3::ZERO, 10, 10).is_err());
        let along = Camera { look_at: DVec3::new(1.0, 1.0, 2.0), ..camera };
        assert!(along.view(DVec3::ZERO, 10, 10).is_err());
    }
}
