//! The outline of the simulation's cell: lines in space, hidden where the picture shows something nearer.

use tyndall::scene::camera::{Camera, View};
use tyndall::{Cell, Result, Vec3};

use super::mark::{Ink, stroke};
use super::raster::{Canvas, mask};
use super::{Annotations, Behind};

/// A picture that a cell is drawn into.
pub struct Surface<'a> {
    /// Its pixels across and down.
    pub size: [u32; 2],
    /// Of each pixel the distance of what it shows, as in [`tyndall::Image`].
    pub depth: &'a [f32],
    /// What is behind the data.
    pub behind: Behind,
}

/// Nearer than this share of the distance of what the camera looks at nothing is drawn.
const NEAREST: f32 = 1e-3;
/// By how much of its distance a line may lie behind what hides it: the picture's depth is rounded, and of the pixel's middle.
const BIAS: f32 = 1e-3;

impl Annotations {
    /// Draws the edges of a cell over `color`, linear RGB premultiplied by the alpha in the fourth place, as a camera sees them.
    ///
    /// Fails with [`tyndall::Error::Setting`] if the camera has no direction. Panics if the surface and `color` have not `width * height` pixels.
    pub fn draw_cell(
        &self,
        cell: &Cell,
        camera: &Camera,
        surface: &Surface,
        color: &mut [[f32; 4]],
    ) -> Result<()> {
        let &Surface { size, depth, behind } = surface;
        let [width, height] = size;
        assert_eq!(
            [depth.len(), color.len()],
            [width as usize * height as usize; 2],
            "pixels of the picture"
        );
        // Far from zero only differences are precise.
        let view = camera.view(camera.look_at, width, height)?;
        let distance = camera.eye.distance(camera.look_at) as f32;
        let near = if view.perspective { NEAREST * distance } else { 0.0 };
        let line = (0.07 * self.em(size)).max(1.0);
        let canvas = Canvas { size, text: self.ink(behind), rim: [0.0; 3] };
        for [from, to] in cell.edges() {
            let ends = [from, to].map(|corner| inside(&view, (corner - camera.look_at).as_vec3()));
            let Some(ends) = clipped(ends, near) else { continue };
            let [start, end] = ends.map(|end| pixel(&view, end));
            let Some([start, end]) = within([start, end], size, line) else { continue };
            let Some(mask) = mask(&stroke(start, end, line, Ink::Text), &self.style.font) else { continue };
            let [first, last] = [start, end].map(|at| distance_along(&view, ends, at));
            canvas.fill_behind(&mask, color, |x, y| {
                let place = share([x, y], start, end);
                let forward = if view.perspective {
                    // Along a line in the picture the inverse of the distance grows evenly.
                    1.0 / ((1.0 - place) / first + place / last)
                } else {
                    (1.0 - place) * first + place * last
                };
                let [u, v] = [view.left + x * view.pixel, view.top - y * view.pixel];
                let along_ray =
                    if view.perspective { forward * (1.0 + u * u + v * v).sqrt() } else { forward };
                depth[y as usize * width as usize + x as usize] < along_ray * (1.0 - BIAS)
            });
        }
        Ok(())
    }
}

/// How far a point is to the right, up and forward from the eye.
fn inside(view: &View, point: Vec3) -> Vec3 {
    let off = point - view.eye;
    Vec3::new(off.dot(view.right), off.dot(view.up), off.dot(view.forward))
}

/// The part of a line that is farther than `near`.
fn clipped([from, to]: [Vec3; 2], near: f32) -> Option<[Vec3; 2]> {
    let cut = |one: Vec3, other: Vec3| {
        if one.z >= near { one } else { one + (near - one.z) / (other.z - one.z) * (other - one) }
    };
    (from.z >= near || to.z >= near).then(|| [cut(from, to), cut(to, from)])
}

/// Where a point is in the picture.
fn pixel(view: &View, point: Vec3) -> [f32; 2] {
    let scale = if view.perspective { 1.0 / (point.z * view.pixel) } else { 1.0 / view.pixel };
    [point.x * scale - view.left / view.pixel, view.top / view.pixel - point.y * scale]
}

/// The part of a line in the picture, or little more: Liang and Barsky 1984.
fn within([from, to]: [[f32; 2]; 2], size: [u32; 2], margin: f32) -> Option<[[f32; 2]; 2]> {
    let (mut first, mut last) = (0.0_f32, 1.0_f32);
    for axis in 0..2 {
        let along = to[axis] - from[axis];
        for (bound, sign) in [(-margin, 1.0), (size[axis] as f32 + margin, -1.0)] {
            let (speed, room) = (sign * along, sign * (bound - from[axis]));
            if speed == 0.0 {
                if room > 0.0 {
                    return None;
                }
            } else if speed > 0.0 {
                first = first.max(room / speed);
            } else {
                last = last.min(room / speed);
            }
        }
    }
    let at = |place: f32| [0, 1].map(|axis| from[axis] + place * (to[axis] - from[axis]));
    (first < last).then(|| [at(first), at(last)])
}

/// How far along a line in the picture a point is: 0 at its start, 1 at its end.
fn share(point: [f32; 2], from: [f32; 2], to: [f32; 2]) -> f32 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length_sq = along[0] * along[0] + along[1] * along[1];
    let off = [point[0] - from[0], point[1] - from[1]];
    ((off[0] * along[0] + off[1] * along[1]) / length_sq.max(1e-12)).clamp(0.0, 1.0)
}

/// How far forward the point of a line is that is seen at a place of the picture.
fn distance_along(view: &View, ends: [Vec3; 2], at: [f32; 2]) -> f32 {
    let [from, to] = ends.map(|end| pixel(view, end));
    let place = share(at, from, to);
    let [first, last] = ends.map(|end| end.z);
    if view.perspective {
        1.0 / ((1.0 - place) / first + place / last)
    } else {
        (1.0 - place) * first + place * last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::DVec3;
    use tyndall::scene::camera::Projection;

    fn camera(projection: Projection) -> Camera {
        let far = DVec3::new(1e6, -2e6, 3e6);
        Camera { eye: far + DVec3::new(9.0, 5.0, 4.0), look_at: far, up: DVec3::Z, projection }
    }

    fn cell() -> Cell {
        let vectors = [DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0), DVec3::new(0.5, 0.2, 2.0)];
        let origin = DVec3::new(1e6, -2e6, 3e6) - 0.5 * (vectors[0] + vectors[1] + vectors[2]);
        Cell { origin, vectors, periodic: [true; 3] }
    }

    #[test]
    fn edges_are_where_rays_pass_them_and_hidden_by_what_is_nearer() {
        let size = [120, 90];
        let annotations = Annotations::default();
        for projection in
            [Projection::Perspective { vertical_angle: 0.7 }, Projection::Orthographic { height: 6.0 }]
        {
            let camera = camera(projection);
            let view = camera.view(camera.look_at, 120, 90).unwrap();
            let points: Vec<[Vec3; 2]> =
                cell().edges().map(|edge| edge.map(|end| (end - camera.look_at).as_vec3())).collect();
            assert_eq!(points.len(), 12);
            // The slow way: by how much each pixel's ray passes each edge, in pixels, and how far that is from the eye.
            let passes = |x: usize, y: usize| -> Vec<(f32, f32)> {
                let ray = view.ray(x as f32 + 0.5, y as f32 + 0.5);
                let nearest = |[from, to]: &[Vec3; 2]| {
                    let steps = (0..=600).map(|k| *from + k as f32 / 600.0 * (*to - *from));
                    let distance = |point: Vec3| {
                        let along = (point - ray.origin).dot(ray.direction);
                        let off = (point - ray.origin - along * ray.direction).length();
                        (off / (view.pixel * if view.perspective { along } else { 1.0 }), along)
                    };
                    steps.map(distance).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
                };
                points.iter().map(nearest).collect()
            };
            let draw = |depth: f32| {
                let mut color = vec![[1.0; 4]; 120 * 90];
                let depth = vec![depth; 120 * 90];
                let surface = Surface { size, depth: &depth, behind: Behind::Color([1.0; 3]) };
                annotations.draw_cell(&cell(), &camera, &surface, &mut color).unwrap();
                color
            };
            let wall = 11.0;
            let (open, walled) = (draw(f32::INFINITY), draw(wall));
            let (mut seen, mut hidden) = (0, 0);
            for place in (0..120 * 90).step_by(7) {
                let all = passes(place % 120, place / 120);
                let (least, along) = all.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
                let is_dark = |color: &[[f32; 4]]| color[place][0] < 0.9;
                if least < 0.3 {
                    assert!(is_dark(&open), "pixel {place} passes an edge by {least}");
                    seen += 1;
                }
                if least > 1.6 {
                    assert!(!is_dark(&open), "pixel {place} is {least} from any edge");
                }
                let others_far = all.iter().filter(|it| it.0 < 1.6).count() == 1;
                if least < 0.3 && others_far && (along - wall).abs() > 0.05 {
                    assert_eq!(is_dark(&walled), along < wall, "pixel {place}, {along} away");
                    hidden += usize::from(along > wall);
                }
            }
            assert!(seen > 20 && hidden > 5, "{seen} {hidden}");
        }
    }

    #[test]
    fn what_is_behind_the_eye_is_cut_off() {
        let line = [Vec3::new(0.0, 0.0, -1.0), Vec3::new(2.0, 0.0, 1.0)];
        assert_eq!(clipped(line, 0.5), Some([Vec3::new(1.5, 0.0, 0.5), line[1]]));
        assert_eq!(clipped([Vec3::NEG_Z, 2.0 * Vec3::NEG_Z], 0.5), None);
        assert_eq!(within([[-10.0, 5.0], [30.0, 5.0]], [20, 10], 0.0), Some([[0.0, 5.0], [20.0, 5.0]]));
        assert_eq!(within([[-10.0, 50.0], [30.0, 50.0]], [20, 10], 0.0), None);
        let flat =
            Cell { vectors: [DVec3::X, DVec3::Y, DVec3::ZERO], origin: DVec3::ZERO, periodic: [true; 3] };
        assert_eq!(flat.edges().count(), 8, "twice the four of a square");
    }
}
