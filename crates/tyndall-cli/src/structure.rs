//! Structures as the command line names them, and what is said about one that is packed.

use tyndall::scene::short;
use tyndall::structure::{Kind, Packing, PackingError, pkd, treelets};

use crate::args::{Pack, PkdAxis, PkdOrder, StructureArgs, StructureName, TreeletCut};
use crate::report::{Failure, Outcome};

/// The structure that the command line names.
pub(crate) fn kind(args: &StructureArgs) -> Outcome<Kind> {
    let packing = match args.pack {
        Pack::Exact => Packing::Exact,
        Pack::Bits16 => Packing::Bits16,
        Pack::Bits11 => Packing::Bits11,
        Pack::Bits8 => Packing::Bits8,
    };
    let structure = args.structure.unwrap_or(StructureName::Bvh);
    if packing != Packing::Exact && structure != StructureName::Bvh {
        return Err(Failure::Usage("--pack is for --structure bvh only — leave one of them out".into()));
    }
    let heap = pkd::Options {
        axis: match args.pkd_axis {
            PkdAxis::Widest => pkd::Axis::WidestExtent,
            PkdAxis::RoundRobin => pkd::Axis::RoundRobin,
        },
        order: match args.pkd_order {
            PkdOrder::Node => pkd::Order::NodeFirst,
            PkdOrder::Near => pkd::Order::NearChildFirst,
        },
    };
    Ok(match structure {
        StructureName::Bvh => Kind::Bvh(packing),
        StructureName::Brute => Kind::Brute,
        StructureName::Pkd => Kind::Pkd(heap),
        StructureName::Treelets => Kind::Treelets(treelets::Options {
            size: args.treelet_size,
            cut: match args.treelet_cut {
                TreeletCut::Median => treelets::Cut::Median,
                TreeletCut::Middle => treelets::Cut::Middle,
            },
            heap,
        }),
    })
}

/// What it is called.
pub(crate) fn name(kind: Kind) -> &'static str {
    match kind {
        Kind::Bvh(Packing::Exact) => "bvh",
        Kind::Bvh(Packing::Bits16) => "bvh packed 16 bits",
        Kind::Bvh(Packing::Bits11) => "bvh packed 11 bits",
        Kind::Bvh(Packing::Bits8) => "bvh packed 8 bits",
        Kind::Pkd(_) => "pkd",
        Kind::Treelets(_) => "treelets",
        Kind::Brute => "brute force",
    }
}

/// What packing cost, in brief.
pub(crate) fn packing_error(error: &PackingError) -> String {
    let largest = error.center_largest.into_iter().fold(0.0, f32::max);
    let mut text = format!("packed: centers off by at most {}", rough(largest));
    if error.mean_radius > 0.0 {
        text += &format!(" ({} of a radius)", percent(largest / error.mean_radius));
    }
    if error.radius_largest > 0.0 {
        text += &format!(", radii by {}", percent(error.radius_largest));
    }
    if let Some(largest) = error.distribution_largest {
        text += &format!(", g(r) by {}", percent(largest));
    }
    text
}

/// The same axis by axis, beside what 32-bit floats can hold.
pub(crate) fn packing_error_by_axis(error: &PackingError) -> String {
    let of = |numbers: [f32; 3]| numbers.map(rough).join(", ");
    let float = rough(0.5 * error.float_spacing);
    let (largest, rms) = (of(error.center_largest), of(error.center_rms));
    let beside = if error.is_within_float() { "no more than" } else { "beside" };
    format!(
        "packing: x, y, z off by at most {largest}, rms {rms}, {beside} {float} that 32-bit floats round off"
    )
}

/// A number with two digits.
fn rough(number: f32) -> String {
    short(format!("{number:.1e}").parse().unwrap_or(number.into()))
}

fn percent(share: f32) -> String {
    format!("{} %", rough(100.0 * share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_packing_cost_is_told_as_far_as_it_is_known() {
        let error = PackingError {
            center_largest: [1.234e-7, 3.06e-8, 0.0],
            center_rms: [5e-8, 1e-8, 0.0],
            radius_largest: 0.0,
            mean_radius: 0.005,
            float_spacing: 6e-8,
            distribution_largest: Some(2.04e-6),
        };
        let text = "packed: centers off by at most 1.2e-7 (0.0025 % of a radius), g(r) by 2e-4 %";
        assert_eq!(packing_error(&error), text);
        let points =
            PackingError { mean_radius: 0.0, radius_largest: 0.012, distribution_largest: None, ..error };
        assert_eq!(packing_error(&points), "packed: centers off by at most 1.2e-7, radii by 1.2 %");
        let axes = "x, y, z off by at most 1.2e-7, 3.1e-8, 0, rms 5e-8, 1e-8, 0, beside 3e-8 that 32-bit";
        assert!(packing_error_by_axis(&error).contains(axes), "{}", packing_error_by_axis(&error));
    }
}
