//! What must hold of every hierarchy, whoever has built it: for tests.

use glam::Vec3;

use super::build::Levels;
use super::{Bvh, LEAF, Node, Place, WIDTH, box_slack, power_of_two};
use crate::frozen::Frozen;
use crate::math::Bounds;

impl Bvh {
    /// What is broken, if anything: every id once, full leaves and nodes but the last, and boxes that hold every sphere below them
    /// with less than two steps to spare.
    pub(crate) fn check(&self) -> Result<(), String> {
        let count = self.ids.len();
        let mut ids = self.ids.to_vec();
        ids.sort_unstable();
        if !ids.into_iter().eq(0..count as u32) {
            return Err("some id is not there once".into());
        }
        let levels = Levels::over(count);
        if (levels.first, levels.count, levels.top) != (self.first, self.count, self.top) {
            return Err(format!("levels {:?} {:?}", self.first, self.count));
        }
        if self.nodes.len() != self.count[1..].iter().sum::<u32>() as usize {
            return Err(format!("{} nodes", self.nodes.len()));
        }
        if count == 0 {
            return if self.bounds.is_empty() { Ok(()) } else { Err("a box around nothing".into()) };
        }
        let bounds = self.visit(Place { index: 0, level: self.top })?;
        // A device may decode packed radii otherwise by a rounding.
        let is_near = |a: Vec3, b: Vec3| (a - b).abs().cmple(Vec3::splat(self.slack)).all();
        let is_bound = is_near(bounds.min, self.bounds.min) && is_near(bounds.max, self.bounds.max);
        if is_bound && self.boxes == self.bounds && self.slack == box_slack(&self.bounds) {
            return Ok(());
        }
        Err(format!("all lie in {bounds:?}, not in {:?}", self.bounds))
    }

    /// How many nodes are not, to the bit, those that the CPU puts over the same leaves.
    #[cfg(feature = "gpu")]
    pub(crate) fn differing_nodes(self) -> usize {
        let Self { nodes, blocks, sizes, ids, .. } = self;
        let expected = Self::over(blocks, sizes, ids, 1.0).nodes;
        assert_eq!(nodes.len(), expected.len());
        nodes.iter().zip(&expected).filter(|(a, b)| bytemuck::bytes_of(*a) != bytemuck::bytes_of(*b)).count()
    }

    /// Walks a subtree, and gives the box of its spheres.
    fn visit(&self, place: Place) -> Result<Bounds, String> {
        if place.level == 0 {
            let first = place.index * LEAF as u32;
            let own = first..(first + LEAF as u32).min(self.ids.len() as u32);
            let sphere = |node| {
                let (center, radius) = self.sphere(node);
                Bounds { min: center, max: center }.grown(radius)
            };
            return Ok(own.map(sphere).fold(Bounds::EMPTY, Bounds::union));
        }
        let node = self.node(place);
        let mut all = Bounds::EMPTY;
        for child in 0..WIDTH {
            if self.existing(place) >> child & 1 == 0 {
                if node.steps.iter().any(|steps| steps[child] != 0 || steps[WIDTH + child] != 0) {
                    return Err(format!("level {} node {}: a box of no child", place.level, place.index));
                }
                continue;
            }
            let inside = self.visit(self.child(place, child))?;
            node.check_box(child, &inside, self.slack)
                .map_err(|why| format!("level {} node {} child {child}: {why}", place.level, place.index))?;
            all = all.union(inside);
        }
        Ok(all)
    }
}

impl Node {
    /// Whether a child's box holds what is inside, and little more.
    fn check_box(&self, child: usize, inside: &Bounds, slack: f32) -> Result<(), String> {
        let [min, max] = self.decoded(child);
        for axis in 0..3 {
            let spare = 2.0 * power_of_two(self.exponent[axis]) + slack;
            let (below, above) = (inside.min[axis] - min[axis], max[axis] - inside.max[axis]);
            let holds = -slack <= below && -slack <= above;
            if !(holds && below <= spare && above <= spare) {
                return Err(format!("{min} to {max} for {inside:?}"));
            }
        }
        Ok(())
    }
}

/// Puts an altered copy in the place of an array.
fn edit<T: Clone + Send + Sync>(array: &mut Frozen<T>, change: impl FnOnce(&mut [T])) {
    let mut items = array.to_vec();
    change(&mut items);
    *array = items.into();
}

/// Ways to break a hierarchy, each of which the check has to see.
pub(crate) const SABOTAGES: [fn(&mut Bvh); 8] = [
    |bvh| edit(&mut bvh.ids, |ids| ids[3] = ids[4]),
    |bvh| edit(&mut bvh.ids, |ids| ids[0] = u32::MAX),
    |bvh| edit(&mut bvh.nodes, |nodes| nodes[0].steps[1][WIDTH] -= 1),
    |bvh| edit(&mut bvh.nodes, |nodes| nodes[0].steps[2][0] += 2),
    |bvh| edit(&mut bvh.nodes, |nodes| nodes[0].exponent[0] += 2),
    |bvh| edit(&mut bvh.nodes, |nodes| nodes[0].corner[0] += 0.05),
    |bvh| bvh.count[1] += 1,
    |bvh| bvh.bounds.max.y += 0.01,
];
