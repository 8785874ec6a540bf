//! A density of particles, and their attributes on its grid, as grids of a file.
//!
//! Voxel (i, j, k) is sample (i, j, k) of the lattice. Where there is density, voxels are active; an attribute has its mean there,
//! weighted like the density, and 0 elsewhere. Three components are a vector, other numbers of them a grid each.

use rayon::prelude::*;
use tyndall::DVec3;
use tyndall::medium::Grid as Density;
use tyndall::medium::density::{Field, Volume};
use tyndall::medium::grid::{Brick, CORE_SAMPLES};

use super::Grid;
use super::file::Class;
use super::transform::Transform;
use super::tree::{LEAF, Leaf, Tile, Tree, Value, place_in_leaf};

/// The density itself among the names of fields.
pub const DENSITY: &str = "density";

/// The grids of these names in this order: [`DENSITY`], or the names by which the volume's fields were asked for, which stand in
/// the same order. `origin` is that of the particles.
pub fn of_volume(volume: &Volume, names: &[String], origin: DVec3) -> Vec<Grid> {
    let lattice = volume.density.lattice();
    // The shortest digits of a spacing are what was meant by it.
    let digits = |number: f32| number.to_string().parse().unwrap_or(f64::from(number));
    let transform = Transform {
        scale: [digits(lattice.spacing); 3],
        translation: (origin + lattice.origin.as_dvec3()).to_array(),
    };
    let grid = |name: String, tree: Tree| Grid { name, class: Class::FogVolume, transform, tree };
    let mut fields = &volume.fields[..];
    let mut grids = Vec::new();
    for name in names {
        if name == DENSITY {
            grids.push(grid(name.clone(), density(&volume.density)));
            continue;
        }
        // A field of the next attribute begins with its first component.
        let count = fields.iter().skip(1).position(|it| it.component == 0).map_or(fields.len(), |it| it + 1);
        let (components, later) = fields.split_at(count.min(fields.len()));
        fields = later;
        if [1, 3].contains(&components.len()) {
            grids.push(grid(name.clone(), means(&volume.density, components)));
            continue;
        }
        for field in components {
            let name = format!("{name}_{}", field.component);
            grids.push(grid(name, means(&volume.density, std::slice::from_ref(field))));
        }
    }
    grids
}

/// A density alone.
pub fn density(density: &Density) -> Tree {
    tree(density, 1, |_, densities| densities.map(|it| [it, 0.0, 0.0]))
}

/// Means of one or three components.
fn means(density: &Density, fields: &[Field]) -> Tree {
    tree(density, fields.len(), |brick, densities| {
        let products: Vec<[f32; CORE_SAMPLES]> =
            fields.iter().map(|it| samples(it.product.brick(brick))).collect();
        std::array::from_fn(|place| {
            let mut mean = Value::default();
            if densities[place] > 0.0 {
                mean.iter_mut()
                    .zip(&products)
                    .for_each(|(mean, product)| *mean = product[place] / densities[place]);
            }
            mean
        })
    })
}

fn samples(brick: Brick) -> [f32; CORE_SAMPLES] {
    match brick {
        Brick::Constant(value) => [value; CORE_SAMPLES],
        Brick::Samples(samples) => *samples,
    }
}

/// A tree whose voxels are active where there is density; `values` are those of a brick with these densities.
fn tree(
    density: &Density,
    components: usize,
    values: impl Fn([u32; 3], &[f32; CORE_SAMPLES]) -> [Value; CORE_SAMPLES] + Sync,
) -> Tree {
    let lattice = density.lattice();
    let brick = |number: usize| {
        let brick = lattice.brick(number);
        let densities = density.brick(brick);
        if densities == Brick::EMPTY {
            return None;
        }
        let densities = samples(densities);
        let values = values(brick, &densities);
        let origin = brick.map(|it| it as i32 * LEAF);
        if densities.iter().all(|it| *it > 0.0) && values.iter().all(|it| *it == values[0]) {
            return Some(Node::Tile(Tile { origin, edge: LEAF, value: values[0], is_active: true }));
        }
        let mut leaf = Leaf { origin, active: [0; 8], values: vec![0.0; CORE_SAMPLES * components] };
        for (sample, value) in values.iter().enumerate() {
            let place = place_in_leaf([sample & 7, sample >> 3 & 7, sample >> 6]);
            leaf.values[place * components..][..components].copy_from_slice(&value[..components]);
            leaf.active[place / 64] |= u64::from(densities[sample] > 0.0) << (place % 64);
        }
        Some(Node::Leaf(leaf))
    };
    let nodes: Vec<Node> = (0..lattice.brick_count()).into_par_iter().filter_map(brick).collect();
    let mut tree = Tree { components, background: Value::default(), leaves: Vec::new(), tiles: Vec::new() };
    for node in nodes {
        match node {
            Node::Leaf(leaf) => tree.leaves.push(leaf),
            Node::Tile(tile) => tree.tiles.push(tile),
        }
    }
    tree
}

/// What a brick becomes.
enum Node {
    Leaf(Leaf),
    Tile(Tile),
}
