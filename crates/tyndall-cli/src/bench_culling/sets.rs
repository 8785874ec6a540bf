//! What is evaluated: the thesis' data sets (table 6.1) by their stand-ins, their parameters (table 6.2), and four views of each.

use tyndall::DVec3;
use tyndall::math::Bounds;
use tyndall::render::confidence::{Interpolation, Neighborhood, Options, Population};
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, corners};

/// Pixels along an edge of the picture.
pub(super) const EDGE: u32 = 800;

/// A stand-in.
pub(super) struct Set {
    pub(super) name: &'static str,
    /// What the thesis calls what it stands for.
    pub(super) title: &'static str,
    pub(super) count: u64,
    pub(super) options: Options,
    /// Frames a second in the thesis' table 6.3 by view: without culling, before and after convergence.
    pub(super) thesis: [[f64; 3]; 4],
}

const fn options(voxel_count: u32, kernel: u32) -> Options {
    Options {
        voxel_count,
        occlusion_confidence: 0.95,
        convergence_samples: 128,
        frame_samples: 4,
        depth_quantization: true,
        density_interpolation: Interpolation::Nearest,
        neighborhood: Neighborhood::Kernel(kernel),
        population: Population::Frustum,
        sample_budget: 25,
    }
}

pub(super) const SETS: [Set; 4] = [
    Set {
        name: "nozzle",
        title: "Nozzle",
        count: 1_550_333,
        options: options(128, 1),
        thesis: [[27.2, 9.9, 27.8], [15.8, 10.2, 16.4], [24.8, 10.0, 25.5], [21.7, 11.4, 21.9]],
    },
    Set {
        name: "virion",
        title: "Covid-19",
        count: 14_566_669,
        options: options(512, 3),
        thesis: [[6.4, 2.3, 6.4], [8.8, 2.9, 9.2], [6.4, 2.6, 6.4], [9.6, 4.4, 9.8]],
    },
    Set {
        name: "fluid",
        title: "Fluid",
        count: 29_999_997,
        options: options(256, 1),
        thesis: [[15.4, 6.6, 16.1], [23.1, 10.0, 28.2], [11.0, 4.7, 11.1], [10.8, 4.6, 11.1]],
    },
    Set {
        name: "ablation",
        title: "Laser Ablation",
        count: 48_000_000,
        options: options(256, 1),
        thesis: [[18.9, 14.1, 26.5], [21.4, 9.6, 21.9], [18.5, 6.8, 26.4], [22.4, 16.8, 30.9]],
    },
];

/// Where the camera looks, and whether all rays run along an axis.
pub(super) const VIEWS: [([f64; 3], bool); 4] = [
    ([-2.0, -1.3, -1.0], false),
    ([-1.0, 0.0, 0.0], true),
    ([0.6, 1.0, -1.2], false),
    ([0.0, 0.0, -1.0], true),
];

/// The views of a scene.
pub(super) fn cameras(scene: &Scene) -> [Camera; 4] {
    cameras_of(scene.structure().bounds(), scene.structure().origin())
}

/// The views of what lies within `bounds`, measured from `origin`.
pub(super) fn cameras_of(bounds: Bounds, origin: DVec3) -> [Camera; 4] {
    let (center, corners) = (origin + bounds.center().as_dvec3(), corners(&bounds, origin));
    VIEWS.map(|(direction, _)| {
        Camera::framing(center, &corners, DVec3::from_array(direction), DVec3::Z, 1.0, None)
    })
}

/// Which view of the set is measured with other knobs too, and with which.
pub(super) fn variants(set: &Set) -> Option<(usize, Vec<(String, Options)>)> {
    let at = |kernel, density_interpolation| Options {
        neighborhood: Neighborhood::Kernel(kernel),
        density_interpolation,
        ..set.options
    };
    let of_figure = [
        ("1x1, nearest", at(1, Interpolation::Nearest)),
        ("1x1, trilinear", at(1, Interpolation::Trilinear)),
        ("3x3, nearest", at(3, Interpolation::Nearest)),
        ("3x3, trilinear", at(3, Interpolation::Trilinear)),
    ];
    let own = |(name, options): (&str, Options)| (name.to_string(), options);
    let mut variants: Vec<(String, Options)> = of_figure.into_iter().map(own).collect();
    match set.name {
        "ablation" => {}
        "virion" => {
            let one = at(1, Interpolation::Nearest);
            for (voxel_count, name) in [(128, "a quarter"), (256, "half")] {
                let name = format!("1x1, nearest, {name} of the slices");
                variants.push((name, Options { voxel_count, ..one }));
            }
            let pyramid = Options { neighborhood: Neighborhood::Pyramid(1), ..one };
            variants.push(("pyramid, level 1".into(), pyramid));
            let depth = Options { population: Population::UpToDepth, ..one };
            variants.push(("1x1, nearest, N up to the depth".into(), depth));
            variants
                .push(("1x1, nearest, no quantization".into(), Options { depth_quantization: false, ..one }));
        }
        _ => return None,
    }
    let view = if set.name == "ablation" { 3 } else { 1 };
    Some((view, variants))
}
