//! The axes x, y and z as arrows from a point, as the camera is turned. Colors that color-blind people tell apart, and letters at the tips.

use tyndall::scene::camera::View;

use super::mark::{Align, Block, Ink, Mark, stroke};

/// Vermilion, bluish green and blue of M. Okabe and K. Ito, Color Universal Design, 2008.
const COLORS: [[u8; 3]; 3] = [[0xd5, 0x5e, 0x00], [0x00, 0x9e, 0x73], [0x00, 0x72, 0xb2]];

/// The axes x, y and z as a camera sees them in the middle of its picture: how far each goes to the right, up, and toward the eye.
pub fn directions(view: &View) -> [[f32; 3]; 3] {
    [0, 1, 2].map(|axis| [view.right[axis], view.up[axis], -view.forward[axis]])
}

/// Arrows within a square that is always as large, so that it stays in place when the camera turns.
pub(super) fn block(directions: &[[f32; 3]; 3], em: f32) -> Block {
    let length = 2.4 * em;
    let reach = length + 0.95 * em;
    let (shaft, head, half_head) = (0.13 * em, 0.6 * em, 0.21 * em);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| directions[a][2].total_cmp(&directions[b][2]));
    let mut marks = Vec::new();
    for axis in order {
        let [right, up, _] = directions[axis];
        let flat = right.hypot(up);
        // Which way a direction goes that points at the eye does not matter: its letter stands beside.
        let [x, y] = if flat > 1e-3 { [right / flat, -up / flat] } else { [0.0, 0.0] };
        let at = |along: f32, across: f32| [reach + along * x - across * y, reach + along * y + across * x];
        let tip = flat * length;
        let head = head.min(tip);
        let ink = Ink::Color(COLORS[axis]);
        if tip > head {
            marks.push(stroke(at(0.5 * shaft, 0.0), at(tip - head, 0.0), shaft, ink));
        }
        marks.push(Mark::Area {
            corners: vec![at(tip, 0.0), at(tip - head, half_head), at(tip - head, -half_head)],
            ink,
        });
        let [left, top] =
            if flat > 1e-3 { at(tip + 0.5 * em, 0.0) } else { [reach + 0.5 * em, reach + 0.5 * em] };
        let text = ["x", "y", "z"][axis].to_string();
        let baseline = top + 0.27 * em;
        marks.push(Mark::Text { text, at: [left, baseline], em, align: Align::Center });
    }
    Block { size: [2.0 * reach; 2], marks }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::DVec3;
    use tyndall::scene::camera::{Camera, Projection};

    #[test]
    fn axes_point_where_the_camera_sees_them() {
        // From the front right and above: x to the lower left, toward the eye; z up.
        let camera = Camera {
            eye: DVec3::new(3.0, 2.0, 1.0),
            look_at: DVec3::ZERO,
            up: DVec3::Z,
            projection: Projection::Orthographic { height: 1.0 },
        };
        let view = camera.view(DVec3::ZERO, 100, 100).unwrap();
        let found = directions(&view);
        for (axis, direction) in found.iter().enumerate() {
            // The slow way: where the camera's rays come from on both sides of the middle.
            let across = view.ray(51.0, 50.0).origin - view.ray(50.0, 50.0).origin;
            let upward = view.ray(50.0, 49.0).origin - view.ray(50.0, 50.0).origin;
            let wanted = [across, upward].map(|it| it.normalize()[axis]);
            assert!((direction[0] - wanted[0]).abs() < 1e-4 && (direction[1] - wanted[1]).abs() < 1e-4);
            let length = direction.iter().map(|it| it * it).sum::<f32>();
            assert!((length - 1.0).abs() < 1e-5);
        }
        assert!(found[0][0] < 0.0 && found[0][1] < 0.0 && found[0][2] > 0.0 && found[2][1] > 0.9);
    }
}
