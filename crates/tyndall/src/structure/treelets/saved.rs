//! Treelets taken apart and put together; see [`crate::structure::saved`].

use super::{Child, Children, Heap, Node, Options, Treelets, WIDTH};
use crate::frozen::Frozen;
use crate::structure::heap::Columns;
use crate::structure::saved::{Arrays, Broken, Facts, Named};
use crate::structure::{Kind, box_slack};

/// Nodes lie less deep than this: see [`super::build`].
const DEPTH: u8 = 27;

impl Treelets {
    /// See [`crate::structure::Structure::saved`].
    pub(in crate::structure) fn saved(&self) -> Option<(Facts, Vec<Named<'_>>)> {
        let (radii, mut arrays) = self.columns.saved()?;
        arrays.extend([
            ("heaps", bytemuck::cast_slice(&self.heaps)),
            ("nodes", bytemuck::cast_slice(&self.nodes)),
            ("children", bytemuck::cast_slice(&self.children)),
        ]);
        let facts = Facts {
            kind: Kind::Treelets(self.options),
            count: self.ids().len(),
            bounds: self.bounds,
            radii,
            largest_radius: 0.0,
            packing_error: None,
        };
        Some((facts, arrays))
    }

    /// See [`crate::structure::Structure::restore`].
    pub(in crate::structure) fn restore(
        facts: Facts,
        options: Options,
        arrays: &mut Arrays,
    ) -> Result<Self, Broken> {
        let Facts { count, bounds, radii, .. } = facts;
        let columns = Columns::restore(count, &radii, arrays)?;
        let heaps: Frozen<Heap> = arrays.any("heaps")?;
        let nodes: Frozen<Node> = arrays.any("nodes")?;
        let children: Frozen<Children> = arrays.of("children", nodes.len())?;
        check_heaps(&heaps, count)?;
        check_tree(&children, heaps.len())?;
        Ok(Self { columns, heaps, nodes, children, bounds, slack: box_slack(&bounds), options })
    }
}

/// Whether every particle is in one heap, and no heap is empty.
fn check_heaps(heaps: &[Heap], count: usize) -> Result<(), Broken> {
    let ends = heaps.iter().skip(1).map(|heap| heap.first as usize).chain([count]);
    let broken = heaps.iter().zip(ends).position(|(heap, end)| heap.first as usize >= end);
    match broken {
        Some(heap) => Err(("heaps", format!("heap {heap} ends before it begins"))),
        None if heaps.first().map_or(count, |heap| heap.first as usize) > 0 => {
            Err(("heaps", "the first particles are in none".into()))
        }
        None => Ok(()),
    }
}

/// Whether every node but the first and every heap is the child of one node before it, and none lies too deep.
fn check_tree(children: &[Children], heaps: usize) -> Result<(), Broken> {
    let mut depths = vec![0_u8; children.len()];
    let mut is_held = vec![false; heaps];
    if let Some(root) = depths.first_mut() {
        *root = 1;
    }
    for (node, own) in children.iter().enumerate() {
        let broken = |what: &str| Err(("children", format!("node {node}: {what}")));
        let count = own.existing.count_ones() as usize;
        if own.existing == 0 || u32::from(own.existing) + 1 != 1 << count {
            return broken("its children are not its first");
        }
        let depth = depths[node];
        if depth == 0 || depth >= DEPTH {
            return broken("it is nobody's child, or too deep");
        }
        for child in 0..count.min(WIDTH) {
            let is_free = match own.child(child) {
                Child::Node(place) if place as usize > node => {
                    let slot = depths.get_mut(place as usize);
                    slot.is_some_and(|slot| std::mem::replace(slot, depth + 1) == 0)
                }
                Child::Node(_) => false,
                Child::Treelet(place) => {
                    let slot = is_held.get_mut(place as usize);
                    slot.is_some_and(|slot| !std::mem::replace(slot, true))
                }
            };
            if !is_free {
                return broken(&format!("child {child} is not there, or another's"));
            }
        }
    }
    match is_held.iter().position(|held| !held) {
        Some(heap) => Err(("children", format!("heap {heap} is nobody's child"))),
        None => Ok(()),
    }
}
