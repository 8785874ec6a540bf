//! The outline of the simulation's cell: lines in space, hidden where the picture shows something nearer.

use tyndall::scene::camera::{Camera, View};
use tyndall::{Cell, Result, Vec3};

use super::mark::{Ink, Mark, stroke};
use super::raster::{Canvas, mask};
use super::{Annotations, Behind, Frame};

/// A picture that a cell is drawn into, or a band of its rows.
pub struct Surface<'a> {
    /// What the camera sees, and the picture's part of it.
    pub frame: Frame,
    /// Rows of the picture above those that are drawn into.
    pub first_row: u32,
    /// Of each pixel the distance of what it shows, as in [`tyndall::Image`].
    pub depth: &'a [f32],
    /// What is behind the data.
    pub behind: Behind,
}

/// Nearer than this share of the distance of what the camera looks at nothing is drawn.
const NEAREST: f32 = 1e-3;
/// By how much of its distance a line may lie behind what hides it: the picture's depth is rounded, and of the pixel's middle.
const BIAS: f32 = 1e-3;
/// A panorama shows straight lines as curves, of pieces over this angle.
const PIECE: f32 = 0.01;

impl Annotations {
    /// Draws the edges of a cell over `color`, linear RGB premultiplied by the alpha in the fourth place, as a camera sees them.
    ///
    /// Fails with [`tyndall::Error::Setting`] if the camera has no direction. Panics if the surface's depth and `color` have not as many pixels, in whole rows.
    pub fn draw_cell(
        &self,
        cell: &Cell,
        camera: &Camera,
        surface: &Surface,
        color: &mut [[f32; 4]],
    ) -> Result<()> {
        let &Surface { frame, first_row, depth, behind } = surface;
        let [width, _] = frame.size();
        let rows = color.len() / width as usize;
        assert_eq!([depth.len(), color.len()], [width as usize * rows; 2], "whole rows of the picture");
        // Far from zero only differences are precise.
        let view = camera.view(camera.look_at, frame.seen[0], frame.seen[1])?;
        let near = NEAREST * camera.eye.distance(camera.look_at) as f32;
        let line = (0.07 * self.em(frame.size())).max(1.0);
        let band = [width, rows as u32];
        let canvas = Canvas { size: band, first_row: 0, text: self.ink(behind), rim: [0.0; 3] };
        // Where the band begins in what the camera sees.
        let corner = [frame.part.x, frame.part.y + first_row].map(|it| it as f32);
        for edge in cell.edges() {
            let ends = edge.map(|end| (end - camera.look_at).as_vec3());
            let is_hidden = |x: f32, y: f32| {
                let along = distance_along(&view, ends, [x + corner[0], y + corner[1]]);
                depth[y as usize * width as usize + x as usize] < along * (1.0 - BIAS)
            };
            for run in runs(&view, ends, near, frame.seen[0] as f32) {
                let run: Vec<[f32; 2]> = run.iter().map(|[x, y]| [x - corner[0], y - corner[1]]).collect();
                for mark in strokes(&run, band, line) {
                    if let Some(mask) = mask(&mark, &self.style.font) {
                        canvas.fill_behind(&mask, color, is_hidden);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Where a camera sees a line, in pixels of all that it sees, `width` across: two ends, or a curve, which a panorama may show on both of its sides.
fn runs(view: &View, [from, to]: [Vec3; 2], near: f32, width: f32) -> Vec<Vec<[f32; 2]>> {
    if !view.panorama {
        let near = if view.perspective { near } else { f32::MIN };
        let forward = |point: Vec3| (point - view.eye).dot(view.forward);
        let ends = clipped([from, to], [from, to].map(forward), near);
        let seen = ends.map(|ends| ends.iter().filter_map(|end| view.pixel_of(*end)).collect());
        return seen.into_iter().collect();
    }
    let [first, last] = [from, to].map(|end| (end - view.eye).normalize_or_zero());
    let angle = first.angle_between(last);
    if !angle.is_finite() {
        return Vec::new();
    }
    let pieces = (angle / PIECE).ceil().max(1.0);
    // Across the great circle, by equal angles.
    let across = (last - first.dot(last) * first).normalize_or_zero();
    let mut run: Vec<[f32; 2]> = Vec::new();
    for piece in 0..=pieces as u32 {
        let (sin, cos) = (angle * piece as f32 / pieces).sin_cos();
        let Some([x, y]) = view.pixel_of(view.eye + cos * first + sin * across) else { continue };
        // It goes on beyond the side on which the panorama ends.
        let turns = run.last().map_or(0.0, |[before, _]| ((before - x) / width).round());
        run.push([x + turns * width, y]);
    }
    let shifted = |turns: f32| run.iter().map(|[x, y]| [x + turns * width, *y]).collect();
    [-1.0, 0.0, 1.0].map(shifted).into()
}

/// The parts of a run of points within a picture of that size, as lines of a thickness.
fn strokes(run: &[[f32; 2]], size: [u32; 2], thickness: f32) -> Vec<Mark> {
    if let [from, to] = *run {
        let ends = within([from, to], size, thickness);
        return ends.map(|[from, to]| stroke(from, to, thickness, Ink::Text)).into_iter().collect();
    }
    let mut parts: Vec<Vec<[f32; 2]>> = vec![Vec::new()];
    for piece in run.windows(2) {
        match within([piece[0], piece[1]], size, thickness) {
            Some([from, to]) => {
                let Some(part) = parts.last_mut() else { continue };
                if part.is_empty() {
                    part.push(from);
                }
                part.push(to);
            }
            None => parts.push(Vec::new()),
        }
    }
    parts.iter().filter(|part| part.len() > 1).map(|part| ribbon(part, thickness)).collect()
}

/// A line of that thickness through points of a gentle curve.
fn ribbon(points: &[[f32; 2]], thickness: f32) -> Mark {
    let side = |sign: f32| {
        (0..points.len()).map(move |at| {
            let (before, after) = (points[at.saturating_sub(1)], points[(at + 1).min(points.len() - 1)]);
            let along = [after[0] - before[0], after[1] - before[1]];
            let scale = sign * 0.5 * thickness / along[0].hypot(along[1]).max(1e-6);
            [points[at][0] - scale * along[1], points[at][1] + scale * along[0]]
        })
    };
    Mark::Area { corners: side(1.0).chain(side(-1.0).rev()).collect(), ink: Ink::Text }
}

/// The part of a line, whose ends lie so far ahead, that is farther than `near`.
fn clipped([from, to]: [Vec3; 2], ahead: [f32; 2], near: f32) -> Option<[Vec3; 2]> {
    let cut = |one: Vec3, other: Vec3, [own, others]: [f32; 2]| {
        if own >= near { one } else { one + (near - own) / (others - own) * (other - one) }
    };
    let [first, last] = ahead;
    (first >= near || last >= near).then(|| [cut(from, to, [first, last]), cut(to, from, [last, first])])
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

/// How far along the ray through a place of what a camera sees it passes a line.
fn distance_along(view: &View, [from, to]: [Vec3; 2], [x, y]: [f32; 2]) -> f32 {
    let ray = view.ray(x, y);
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (line, off) = ((to - from).as_dvec3(), origin - from.as_dvec3());
    // The point of the line from which the ray is least far: none is better where they go the same way.
    let across = line - line.dot(direction) * direction;
    let share = (off.dot(across) / across.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (share * line - off).dot(direction) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::DVec3;
    use tyndall::film::Window;
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
        let size = [180, 90];
        let annotations = Annotations::default();
        for (projection, wall) in [
            (Projection::Perspective { vertical_angle: 0.7 }, 11.0),
            (Projection::Orthographic { height: 6.0 }, 11.0),
            (Projection::Panorama, 2.0),
        ] {
            let mut camera = camera(projection);
            let is_panorama = projection == Projection::Panorama;
            if is_panorama {
                // From within, near the corner between two edges.
                camera.eye = camera.look_at + DVec3::new(1.0, 0.4, 0.3);
            }
            let view = camera.view(camera.look_at, 180, 90).unwrap();
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
                        let pixels = off / (view.pixel * if view.perspective { along } else { 1.0 });
                        (if pixels < 0.0 { f32::INFINITY } else { pixels }, along)
                    };
                    steps.map(distance).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
                };
                points.iter().map(nearest).collect()
            };
            let draw_part = |depth: f32, part: Window, first_row: u32| {
                let pixels = (part.width * (part.height - first_row)) as usize;
                let (mut color, depth) = (vec![[1.0; 4]; pixels], vec![depth; pixels]);
                let (frame, behind) = (Frame { seen: size, part }, Behind::Color([1.0; 3]));
                let surface = Surface { frame, first_row, depth: &depth, behind };
                annotations.draw_cell(&cell(), &camera, &surface, &mut color).unwrap();
                color
            };
            let draw = |depth: f32| draw_part(depth, Window::whole(180, 90), 0);
            let (open, walled) = (draw(f32::INFINITY), draw(wall));
            let part = Window { x: 31, y: 12, width: 120, height: 50 };
            let below = Window { y: part.y + 5, height: part.height - 5, ..part };
            let found = draw_part(wall, part, 5);
            let differ = |(one, other): (&[f32; 4], &[f32; 4])| (one[0] - other[0]).abs();
            let most = found.iter().zip(&below.cut(180, &walled)).map(differ).fold(0.0, f32::max);
            assert!(most < 1e-3, "{projection:?}: parts are not those of the whole by {most}");
            let (mut seen, mut hidden) = (0, 0);
            // Toward the poles a panorama is wider than what it shows.
            let rows = if is_panorama { 25..65 } else { 0..90 };
            for place in (180 * rows.start..180 * rows.end).step_by(7) {
                let all = passes(place % 180, place / 180);
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
                if least < 0.3 && others_far && (along - wall).abs() > 0.05 * wall / 11.0 {
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
        assert_eq!(clipped(line, [-1.0, 1.0], 0.5), Some([Vec3::new(1.5, 0.0, 0.5), line[1]]));
        assert_eq!(clipped(line, [-1.0, -2.0], 0.5), None);
        assert_eq!(within([[-10.0, 5.0], [30.0, 5.0]], [20, 10], 0.0), Some([[0.0, 5.0], [20.0, 5.0]]));
        assert_eq!(within([[-10.0, 50.0], [30.0, 50.0]], [20, 10], 0.0), None);
        let flat =
            Cell { vectors: [DVec3::X, DVec3::Y, DVec3::ZERO], origin: DVec3::ZERO, periodic: [true; 3] };
        assert_eq!(flat.edges().count(), 8, "twice the four of a square");
    }
}
