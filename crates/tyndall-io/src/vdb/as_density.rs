//! A tree of voxels as a density: leaves become bricks, what is empty stays empty.
//!
//! Takes a tree of scalars and where its voxels lie, gives a [`Grid`] over its active voxels; the value of a voxel is that of the sample
//! at its middle. A fog volume's values are taken as they are; those of a level set as OpenVDB's `sdfToFogVolume` does. Leaves and bricks
//! coincide, so that no brick is made of two leaves.

use std::path::Path;

use rayon::prelude::*;
use tyndall::medium::Grid;
use tyndall::medium::grid::{Brick, Lattice};
use tyndall::{Error, Result, Vec3};

use super::file::Class;
use super::transform::Transform;
use super::tree::{LEAF, LEAF_VOXELS, Tree, place_in_leaf};

/// Distances that differ by no more than this share count as equal.
const EQUAL: f64 = 1e-4;
/// Bricks that any grid may have, and bricks for each leaf and tile that is there: voxels far apart would need memory for what is between.
const MOST_BRICKS: [u64; 2] = [1 << 18, 1 << 9];

/// What a value becomes.
struct Meaning {
    scale: f64,
    /// Of a level set, the distance inside the surface from which on the density is 1.
    full_depth: Option<f32>,
}

impl Meaning {
    fn density(&self, value: f32) -> f32 {
        let density = match self.full_depth {
            Some(depth) => (-value / depth).clamp(0.0, 1.0),
            None => value,
        };
        (f64::from(density) * self.scale) as f32
    }
}

/// Makes the grid; says what was changed.
pub(super) fn grid(
    path: &Path,
    (tree, transform, class): (&Tree, &Transform, Class),
    scale: f64,
    conventions: &mut Vec<String>,
) -> Result<Grid> {
    let fault = |what: String, hint: &str| Error::format(path, "", what, hint);
    let spacing = spacing(path, transform)?;
    let full_depth = tree.background[0];
    let is_level_set = class == Class::LevelSet;
    if is_level_set {
        if !(full_depth > 0.0 && full_depth.is_finite()) {
            let what = format!("the level set has a background of {full_depth}, no width of its narrow band");
            return Err(fault(what, "convert it to a fog volume before it is saved"));
        }
        let width = tyndall::scene::short(full_depth.into());
        conventions.push(format!("a level set: made a fog from 0 at its surface to 1 at a depth of {width}"));
    }
    let meaning = Meaning { scale, full_depth: is_level_set.then_some(full_depth) };
    let Some([low, high]) = tree.active_box() else {
        return Err(fault("the grid has no active voxels".into(), "is it the right frame, the right grid?"));
    };
    let (outside, _) = checked(meaning.density(tree.background[0]));
    // Beyond the last voxels the field falls to a background of 0 within a spacing.
    let margin = i32::from(outside == 0.0);
    let first = low.map(|it| (it.saturating_sub(margin)).div_euclid(LEAF).saturating_mul(LEAF));
    let size = [0, 1, 2].map(|axis| i64::from(high[axis]) + i64::from(margin) - i64::from(first[axis]) + 1);
    let bricks = size.map(|it| it.unsigned_abs().div_ceil(LEAF as u64));
    let [some, each] = MOST_BRICKS;
    let most = some + each * (tree.leaves.len() + tree.tiles.len()) as u64;
    let count = bricks.iter().try_fold(1_u64, |count, &it| count.checked_mul(it));
    if count.is_none_or(|count| count > most) {
        let what = format!(
            "the active voxels lie far apart: from {low:?} to {high:?} there are {bricks:?} blocks of 8 x 8 x 8 for {} leaves and {} tiles",
            tree.leaves.len(),
            tree.tiles.len()
        );
        return Err(fault(what, "crop the grid, or save it at a coarser voxel size"));
    }
    if outside != 0.0 {
        let outside = tyndall::scene::short(outside.into());
        conventions.push(format!("the background's density of {outside} fills the box of the active voxels"));
    }

    let number =
        |brick: [usize; 3]| (brick[2] * bricks[1] as usize + brick[1]) * bricks[0] as usize + brick[0];
    let mut all = vec![Brick::Constant(outside); count.unwrap_or_default() as usize];
    let mut bad = 0_u64;
    for tile in &tree.tiles {
        let (value, is_bad) = checked(meaning.density(tile.value[0]));
        bad += u64::from(is_bad && tile.is_active);
        // The bricks that the tile covers; none where it lies outside.
        let ends: [std::ops::Range<usize>; 3] = std::array::from_fn(|axis| {
            let low = (i64::from(tile.origin[axis]) - i64::from(first[axis])) / i64::from(LEAF);
            let high = low + i64::from(tile.edge / LEAF);
            let most = bricks[axis] as i64;
            low.clamp(0, most) as usize..high.clamp(0, most) as usize
        });
        for z in ends[2].clone() {
            for y in ends[1].clone() {
                let row = number([0, y, z]);
                all[row + ends[0].start..row + ends[0].end].fill(Brick::Constant(value));
            }
        }
    }
    let leaf = |leaf: &super::tree::Leaf| {
        let mut samples = Box::new([0.0; LEAF_VOXELS]);
        let mut bad = 0;
        for (place, sample) in samples.iter_mut().enumerate() {
            let value = leaf.values[place_in_leaf([place & 7, place >> 3 & 7, place >> 6])];
            let (value, is_bad) = checked(meaning.density(value));
            *sample = value;
            bad += u64::from(is_bad);
        }
        let brick: [i64; 3] = std::array::from_fn(|axis| {
            (i64::from(leaf.origin[axis]) - i64::from(first[axis])).div_euclid(i64::from(LEAF))
        });
        let is_inside = (0..3).all(|axis| (0..bricks[axis] as i64).contains(&brick[axis]));
        let first = samples[0];
        let is_constant = samples.iter().all(|it| it.to_bits() == first.to_bits());
        let samples = if is_constant { Brick::Constant(first) } else { Brick::Samples(samples) };
        is_inside.then(|| (number(brick.map(|it| it as usize)), samples, bad))
    };
    // Leaves without an active voxel may lie outside.
    let leaves: Vec<_> = tree.leaves.par_iter().filter_map(leaf).collect();
    for (number, samples, of_leaf) in leaves {
        bad += of_leaf;
        all[number] = samples;
    }
    if bad > 0 {
        conventions.push(format!("{bad} values below 0 or not finite count as 0"));
    }
    let origin = Vec3::from_array(transform.position(first).map(|it| it as f32));
    Grid::from_bricks(Lattice { origin, spacing, size: size.map(|it| it as u32) }, all)
}

/// What the field can hold, and whether that is another value.
fn checked(density: f32) -> (f32, bool) {
    if (0.0..f32::INFINITY).contains(&density) { (density, false) } else { (0.0, true) }
}

/// The distance of voxels, if it is the same along all axes.
fn spacing(path: &Path, transform: &Transform) -> Result<f32> {
    let scale = transform.scale;
    let finite = transform.translation.iter().all(|it| it.is_finite());
    if !finite || scale.iter().any(|it| !(*it > 0.0 && (*it as f32).is_normal())) {
        let what = format!("voxels {scale:?} apart around {:?} were found", transform.translation);
        return Err(Error::format(
            path,
            "",
            what,
            "distances must be above 0: turn the grid before it is saved",
        ));
    }
    let [least, most] = [f64::min, f64::max].map(|of| scale.into_iter().reduce(of).unwrap_or(1.0));
    if most - least > EQUAL * least {
        let what = format!("voxels are {} x {} x {} apart, cubes are wanted", scale[0], scale[1], scale[2]);
        return Err(Error::format(path, "", what, "resample the grid to cubic voxels before it is saved"));
    }
    Ok(least as f32)
}
