//! The part of the command line that is about culling: its definition, what it means, and how it is told.

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};
use tyndall::render::Culling;
use tyndall::render::certified::{self, Counts};
use tyndall::render::confidence::{Interpolation, Neighborhood, Options, Population, Report as Found};
use tyndall::scene::grouped;

use crate::report::{Report, bytes};

/// How hidden particles are left out.
#[derive(Args)]
pub(crate) struct CullingArgs {
    /// How particles that others hide are left out
    #[arg(long, value_name = "HOW", default_value = "certified")]
    pub(crate) culling: CullingName,
    /// Which proofs certified culling seeks; a graphics card seeks visible-set alone
    #[arg(long, value_name = "PROOF,...", value_delimiter = ',', default_values_t = DEFAULT_PROOFS)]
    certified: Vec<Proof>,
    #[command(flatten)]
    pub(crate) confidence: ConfidenceArgs,
}

/// With --culling confidence.
#[derive(Args)]
#[command(next_help_heading = "With --culling confidence (in brackets the names of Walloner 2022)")]
pub(crate) struct ConfidenceArgs {
    /// Slices of the density grid along its shortest axis (vc)
    #[arg(long, visible_alias = "vc", value_name = "N", default_value_t = 256)]
    voxel_count: u32,
    /// Confidence at which a depth is taken to hide all behind it; above 1 nothing is culled (C_occ)
    #[arg(
        long,
        visible_alias = "c-occ",
        value_name = "C",
        default_value_t = 0.95,
        allow_hyphen_values = true
    )]
    occlusion_confidence: f32,
    /// Samples without a change after which a pixel's depth is final (ci)
    #[arg(long, visible_alias = "ci", value_name = "N", default_value_t = 128)]
    convergence_samples: u32,
    /// Samples a pixel and frame: 1, 4 or 16 (spp)
    #[arg(long, visible_alias = "spp", value_name = "N", default_value_t = 4)]
    frame_samples: u32,
    /// Whether depths are moved to the back of their voxel (dq)
    #[arg(long, visible_alias = "dq", value_name = "YES|NO", default_value = "yes")]
    depth_quantization: Choice,
    /// Whether density is interpolated between voxels (di)
    #[arg(long, visible_alias = "di", value_name = "YES|NO", default_value = "no")]
    density_interpolation: Choice,
    /// Edge in pixels of the square that decides together; odd (ks)
    #[arg(long, visible_alias = "ks", value_name = "N", default_value_t = 1)]
    kernel_size: u32,
    /// Level of the depth-confidence pyramid that decides, instead of the square around each pixel
    #[arg(long, value_name = "LEVEL", conflicts_with = "kernel_size", value_parser = RangedU64ValueParser::<u32>::new().range(0..=8))]
    pyramid_level: Option<u32>,
    /// Which particles a pixel's samples are drawn from (N)
    #[arg(long, value_name = "WHICH", default_value = "frustum")]
    population: PopulationName,
    /// Samples within which a nearer depth has to pay off (N_budget)
    #[arg(long, value_name = "N", default_value_t = 25)]
    sample_budget: u32,
}

/// How particles that others hide are left out.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CullingName {
    /// Not beyond what each ray finds for itself
    Off,
    /// Where a pixel is likely to be covered, after Walloner 2022: lossy
    Confidence,
    /// Where that is proven: the same picture, bit for bit
    Certified,
}

/// What certified culling proves.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Proof {
    /// Nothing
    None,
    /// Single rays end at a clip depth, and go on behind it if they find nothing (pkd, treelets, brute); not by default, it saves nothing
    Clip,
    /// Passes after the first begin with the leaves that the first went through (bvh)
    VisibleSet,
    /// Parts of pixels that are covered for good hide all behind them from later passes (bvh); not by default, it saves little
    Coverage,
    /// Shadow rays are answered by bounds in the space of the light (bvh)
    LightBounds,
}

const DEFAULT_PROOFS: [Proof; 2] = [Proof::VisibleSet, Proof::LightBounds];

impl std::fmt::Display for Proof {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.to_possible_value().expect("none is skipped").get_name())
    }
}

/// The knobs of the library.
fn certified_options(proofs: &[Proof]) -> certified::Options {
    let seeks = |proof| proofs.contains(&proof);
    certified::Options {
        clip: seeks(Proof::Clip),
        visible_set: seeks(Proof::VisibleSet),
        coverage: seeks(Proof::Coverage),
        light_bounds: seeks(Proof::LightBounds),
    }
}

/// Tells what certified culling saved.
pub(crate) fn tell(culling: &Culling, counts: &Counts, report: &Report) {
    let Culling::Certified(options) = culling else { return };
    let percent = |part: u64, all: u64| format!("{:.2} %", 100.0 * part as f64 / all.max(1) as f64);
    if options.light_bounds && counts.light_points > 0 {
        let all = counts.light_points;
        let lit = all.saturating_sub(counts.surely_shadowed + counts.traced);
        report.detail(format_args!(
            "light-bounds: {} points looked for light; surely lit {}, surely shadowed {}, traced {}",
            grouped(all as usize),
            percent(lit, all),
            percent(counts.surely_shadowed, all),
            percent(counts.traced, all),
        ));
    }
    if options.visible_set && counts.remembered_leaves > 0 {
        report.detail(format_args!(
            "visible-set: {} leaves drawn again without a way to them",
            grouped(counts.remembered_leaves as usize),
        ));
    }
    if options.coverage && counts.leaves > 0 {
        report.detail(format_args!(
            "coverage: no ray can see {} of {} leaves, {} of {} bricks",
            percent(counts.evicted_leaves, counts.leaves),
            grouped(counts.leaves as usize),
            counts.evicted_bricks,
            counts.bricks,
        ));
    }
    if options.clip && counts.clipped_rays > 0 {
        report.detail(format_args!(
            "clip: {} rays clipped, {} of them resumed",
            grouped(counts.clipped_rays as usize),
            percent(counts.resumed_rays, counts.clipped_rays),
        ));
    }
}

/// Tells how far culling by confidence came.
pub(crate) fn tell_confidence(found: &Found, report: &Report) {
    let Found { depths, converged, voxels: [x, y, z], grid_bytes, pixel_bytes } = found;
    let cut = depths.iter().filter(|depth| depth.is_finite()).count();
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    report.detail(format_args!(
        "confidence: {} of the pixels cut, {} final; a grid of {x}x{y}x{z} voxels in {}, pixels in {}",
        percent(cut as f64 / depths.len().max(1) as f64),
        percent(*converged),
        bytes(*grid_bytes),
        bytes(*pixel_bytes),
    ));
}

/// Which particles a pixel's samples are drawn from.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PopulationName {
    /// All of its frustum that is not culled, as in the thesis
    Frustum,
    /// Those up to the depth in question: fewer artifacts, less culling
    Depth,
}

/// Yes or no.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Choice {
    Yes,
    No,
}

impl ConfidenceArgs {
    /// The knobs of the library.
    pub(crate) fn options(&self) -> Options {
        Options {
            voxel_count: self.voxel_count,
            occlusion_confidence: self.occlusion_confidence,
            convergence_samples: self.convergence_samples,
            frame_samples: self.frame_samples,
            depth_quantization: self.depth_quantization == Choice::Yes,
            density_interpolation: match self.density_interpolation {
                Choice::Yes => Interpolation::Trilinear,
                Choice::No => Interpolation::Nearest,
            },
            neighborhood: match self.pyramid_level {
                Some(level) => Neighborhood::Pyramid(level),
                None => Neighborhood::Kernel(self.kernel_size),
            },
            population: match self.population {
                PopulationName::Frustum => Population::Frustum,
                PopulationName::Depth => Population::UpToDepth,
            },
            sample_budget: self.sample_budget,
        }
    }
}

/// The culling that the command line names.
pub(crate) fn culling(args: &CullingArgs) -> Culling {
    match args.culling {
        CullingName::Off => Culling::Off,
        CullingName::Confidence => Culling::Confidence(args.confidence.options()),
        CullingName::Certified => Culling::Certified(certified_options(&args.certified)),
    }
}

/// What it is called, with what it was told.
pub(crate) fn description(culling: &Culling) -> String {
    match culling {
        Culling::Off => "no culling".into(),
        Culling::Certified(_) => "certified culling".into(),
        Culling::Confidence(options) => {
            let yes = |on: bool| if on { "yes" } else { "no" };
            let population = match options.population {
                Population::Frustum => "frustum",
                Population::UpToDepth => "depth",
            };
            let together = match options.neighborhood {
                Neighborhood::Kernel(edge) => format!("ks {edge}"),
                Neighborhood::Pyramid(level) => format!("pyramid level {level}"),
            };
            format!(
                "culling by confidence (vc {}, C_occ {}, ci {}, spp {}, dq {}, di {}, {together}, N of the {population}, N_budget {}): \
                 lossy, it may show background where there are particles",
                options.voxel_count,
                options.occlusion_confidence,
                options.convergence_samples,
                options.frame_samples,
                yes(options.depth_quantization),
                yes(options.density_interpolation == Interpolation::Trilinear),
                options.sample_budget,
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: CullingArgs,
    }

    #[test]
    fn defaults_are_those_of_the_library() {
        let line = Line::parse_from(["test"]);
        assert_eq!(culling(&line.args), Culling::default());
        assert_eq!(line.args.confidence.options(), Options::default());
    }

    #[test]
    fn the_names_of_the_thesis_are_understood() {
        let words = "test --culling confidence --vc 512 --c-occ 0.9 --ci 64 --spp 16 --dq no --di yes --ks 3 --population depth";
        let line = Line::parse_from(words.split(' '));
        let expected = Options {
            voxel_count: 512,
            occlusion_confidence: 0.9,
            convergence_samples: 64,
            frame_samples: 16,
            depth_quantization: false,
            density_interpolation: Interpolation::Trilinear,
            neighborhood: Neighborhood::Kernel(3),
            population: Population::UpToDepth,
            sample_budget: 25,
        };
        assert_eq!(culling(&line.args), Culling::Confidence(expected));
        let text = description(&Culling::Confidence(expected));
        assert!(
            text.contains(
                "vc 512, C_occ 0.9, ci 64, spp 16, dq no, di yes, ks 3, N of the depth, N_budget 25"
            ),
            "{text}"
        );
    }
}
