//! Where the particles are.

use glam::{DVec3, Vec3};

use crate::frozen::Frozen;

/// Centers: an origin in double precision, and single-precision offsets from it, one column an axis.
///
/// The origin lies near the middle of the data, so that coordinates far from zero (lidar, cosmology) keep their precision.
#[derive(Clone, Debug, Default)]
pub struct Positions {
    origin: Option<DVec3>,
    offsets: Offsets,
}

/// The offsets from the origin, one column an axis.
#[derive(Clone, Debug)]
enum Offsets {
    Own([Vec<f32>; 3]),
    Frozen([Frozen<f32>; 3]),
}

impl Default for Offsets {
    fn default() -> Self {
        Self::Own(Default::default())
    }
}

impl Offsets {
    #[inline(always)]
    fn column(&self, axis: usize) -> &[f32] {
        match self {
            Self::Own(columns) => &columns[axis],
            Self::Frozen(columns) => &columns[axis],
        }
    }

    /// The columns, to be changed: frozen ones are copied first.
    fn own(&mut self) -> &mut [Vec<f32>; 3] {
        if let Self::Frozen(columns) = self {
            *self = Self::Own(columns.each_ref().map(|column| column.to_vec()));
        }
        match self {
            Self::Own(columns) => columns,
            Self::Frozen(_) => unreachable!("they were copied"),
        }
    }
}

impl Positions {
    /// No positions yet; the origin will be the middle of the first chunk pushed.
    pub fn new() -> Self {
        Self::default()
    }

    /// No positions yet; the origin is known, usually the middle of the simulation's cell.
    pub fn around(origin: DVec3) -> Self {
        Self { origin: Some(origin), ..Self::default() }
    }

    /// Positions from three columns of offsets from `origin`. Panics if their lengths differ.
    pub fn from_offsets(origin: DVec3, offsets: [Vec<f32>; 3]) -> Self {
        assert!(offsets.iter().all(|column| column.len() == offsets[0].len()), "columns of one length");
        Self { origin: Some(origin), offsets: Offsets::Own(offsets) }
    }

    /// The same of columns that stay where they are, such as in a mapped file. Panics if their lengths differ.
    pub fn from_frozen(origin: DVec3, offsets: [Frozen<f32>; 3]) -> Self {
        assert!(offsets.iter().all(|column| column.len() == offsets[0].len()), "columns of one length");
        Self { origin: Some(origin), offsets: Offsets::Frozen(offsets) }
    }

    /// Makes room for `count` more positions in all.
    pub fn reserve(&mut self, count: usize) {
        for column in self.offsets.own() {
            column.reserve(count);
        }
    }

    /// Appends a chunk. Chunks of some thousand positions are best: the first one decides the origin if there is none yet.
    pub fn extend(&mut self, chunk: &[DVec3]) {
        let origin = *self.origin.get_or_insert_with(|| middle(chunk));
        for (axis, column) in self.offsets.own().iter_mut().enumerate() {
            column.extend(chunk.iter().map(|position| (position[axis] - origin[axis]) as f32));
        }
    }

    /// Leaves those that are flagged, a flag for each.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        for column in self.offsets.own() {
            let mut kept = keep.iter();
            column.retain(|_| *kept.next().expect("one flag a particle"));
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.offsets.column(0).len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The point from which the offsets are measured.
    pub fn origin(&self) -> DVec3 {
        self.origin.unwrap_or(DVec3::ZERO)
    }

    /// Moves the zero of the coordinates to a point of them.
    pub(super) fn measure_from(&mut self, center: DVec3) {
        self.origin = Some(self.origin() - center);
    }

    /// The columns of offsets from the origin: x, y, z.
    #[inline(always)]
    pub fn offsets(&self) -> [&[f32]; 3] {
        [0, 1, 2].map(|axis| self.offsets.column(axis))
    }

    /// The offset of particle `id` from the origin.
    #[inline(always)]
    pub fn offset(&self, id: usize) -> Vec3 {
        let [x, y, z] = self.offsets();
        Vec3::new(x[id], y[id], z[id])
    }

    /// The coordinate along `axis` of what lies `offset` from the origin, in the coordinates of its file: of all numbers that are
    /// stored as this offset the one with the fewest digits, which is what the file says if it says no more than is stored.
    pub fn decimal(&self, axis: usize, offset: f32) -> f64 {
        let origin = self.origin()[axis];
        let exact = origin + f64::from(offset);
        // Decimals first: a coordinate that is 0 but for rounding has no leading digit to begin with. Adding 0 makes -0 positive.
        let decimals = (0..if exact.abs() < 1e15 { 17 } else { 0 }).map(|digits| format!("{exact:.digits$}"));
        let leading = (0..17).map(|digits| format!("{exact:.digits$e}"));
        let numbers = decimals.chain(leading).filter_map(|text| text.parse().ok());
        numbers.map(|it: f64| it + 0.0).find(|it| (it - origin) as f32 == offset).unwrap_or(exact)
    }

    /// The position of particle `id` in the coordinates of its file.
    pub fn world(&self, id: usize) -> DVec3 {
        self.origin() + self.offset(id).as_dvec3()
    }
}

impl PartialEq for Positions {
    fn eq(&self, other: &Self) -> bool {
        self.origin == other.origin && self.offsets() == other.offsets()
    }
}

/// The middle of the finite positions; zero if there are none.
fn middle(chunk: &[DVec3]) -> DVec3 {
    let mut min = DVec3::INFINITY;
    let mut max = DVec3::NEG_INFINITY;
    for position in chunk.iter().filter(|position| position.is_finite()) {
        min = min.min(*position);
        max = max.max(*position);
    }
    if min.cmple(max).all() { 0.5 * min + 0.5 * max } else { DVec3::ZERO }
}
