//! The simulation's cell.

use glam::DVec3;

/// The simulation's cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its corner.
    pub origin: DVec3,
    /// Its edges, from that corner.
    pub vectors: [DVec3; 3],
    /// Along which edges it repeats.
    pub periodic: [bool; 3],
}

impl Cell {
    /// The cell's middle.
    pub fn center(&self) -> DVec3 {
        self.origin + 0.5 * (self.vectors[0] + self.vectors[1] + self.vectors[2])
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let edges = (0..3).filter(|axis| corner >> axis & 1 == 1).map(|axis| self.vectors[axis]);
            self.origin + edges.sum::<DVec3>()
        })
    }

    /// The twelve edges, from corner to corner, without those that have no length.
    pub fn edges(&self) -> impl Iterator<Item = [DVec3; 2]> + use<> {
        let corners = self.corners();
        let ends = (0..8).flat_map(|corner| (0..3).map(move |axis| (corner, corner | 1 << axis)));
        ends.filter(|(one, other)| one != other)
            .map(move |(one, other)| [corners[one], corners[other]])
            .filter(|[one, other]| one != other)
    }
}
