//! The command line's definition: the one source of parsing, help, completions and man page.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tyndall::film::Window;
use tyndall::scene::select::{Clip, Filter};
use tyndall::scene::sizes::Size as Radius;
use tyndall_io::annotation::Frame;
use tyndall_io::write::{ImageOptions, movie};

use crate::annotate::Annotate;
use crate::bench_culling::CullingBench;
use crate::camera::CameraArgs;
use crate::culling::CullingArgs;
use crate::cut::Cut;
use crate::device::Choice;
use crate::illustrate::Illustrate;
use crate::input::args::Input;
use crate::layers::{Layer, Named};
use crate::looks::Look;
use crate::medium::args::{Density, Medium};
use crate::output::{EncoderName, Pattern};
use crate::project::Project;
use crate::scene::Origin;
use crate::shapes::Shapes;
use crate::values::{Background, Degrees, Size, Slice, count, length};

/// Particle files to pictures: exact spheres, at any count.
#[derive(Parser)]
#[command(
    name = "tyndall",
    version,
    arg_required_else_help = true,
    propagate_version = true,
    args_override_self = true
)]
#[command(
    after_help = "Exit codes: 0 ok, 2 usage, 3 input, 4 memory or disk, 5 device, 6 some pictures failed, 130 interrupted."
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// What can be done.
#[derive(Subcommand)]
pub(crate) enum Verb {
    /// Renders particles to a picture, or to numbered pictures
    Render(Box<Render>),
    /// Says what is in a file
    Info(Box<Info>),
    /// Saves particles with their structure, in a file that opens at once
    Build(Box<Build>),
    /// Writes particles in another format
    Convert(Box<Convert>),
    /// Prints the JSON schema of scene files
    Schema,
    /// Lists what can render: the processor and the graphics cards
    Devices(Devices),
    /// Measures building and rendering on synthetic particles
    Bench(Box<Bench>),
    /// Prints a script that completes commands in a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Prints the manual page, in roff
    Man {
        /// The verb that the page is about; all in brief if none is given
        verb: Option<String>,
    },
    /// Anything else: the name of a file, or a mistyped verb.
    #[command(external_subcommand)]
    Other(Vec<OsString>),
}

impl Verb {
    /// The files that it reads, if it reads files.
    pub(crate) fn input(&mut self) -> Option<&mut Input> {
        match self {
            Self::Render(args) => Some(&mut args.input),
            Self::Info(args) => Some(&mut args.input),
            Self::Build(args) => Some(&mut args.input),
            Self::Convert(args) => Some(&mut args.input),
            _ => None,
        }
    }
}

/// What every verb understands.
#[derive(Args)]
pub(crate) struct Common {
    /// Says nothing but errors
    #[arg(short, long, help_heading = None)]
    pub(crate) quiet: bool,
    /// Says more: times of each stage, causes of errors
    #[arg(short, long, conflicts_with = "quiet", help_heading = None)]
    pub(crate) verbose: bool,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = None)]
    pub(crate) threads: Option<u16>,
}

#[derive(Args)]
pub(crate) struct Render {
    #[command(flatten)]
    pub(crate) input: Input,
    #[command(flatten)]
    pub(crate) picture: Picture,
    #[command(flatten)]
    pub(crate) frames: Frames,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) selection: Selection,
    #[command(flatten)]
    pub(crate) cut: Cut,
    #[command(flatten)]
    pub(crate) look: Look,
    #[command(flatten)]
    pub(crate) layers: Layers,
    #[command(flatten)]
    pub(crate) shapes: Shapes,
    #[command(flatten)]
    pub(crate) illustrate: Illustrate,
    #[command(flatten)]
    pub(crate) annotate: Annotate,
    #[command(flatten)]
    pub(crate) method: Method,
    #[command(flatten)]
    pub(crate) medium: Medium,
    #[command(flatten)]
    pub(crate) project: Project,
    #[command(flatten)]
    pub(crate) common: Common,
    #[arg(skip)]
    pub(crate) origin: Origin,
}

/// The picture file.
#[derive(Args)]
#[command(next_help_heading = "Picture")]
pub(crate) struct Picture {
    /// The picture or movie; its extension says which kind: .png .jpg .exr, .mp4 .gif .webp, of --mode project also .npy .fits. Several pictures have the number of their frame in the name: %04d, #### or $F4
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Pixels across and down
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub(crate) size: Size,
    /// Samples a pixel; with 1 the sample is the pixel's center [default: 128; of headlight, flat and toon 64, with --opacity,
    /// --shutter and --motion-blur 256, of a medium 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) samples: Option<u32>,
    /// Adds samples for so long to each picture: 30s, 5m; with --noise 1% until one of both is reached. What a medium is lit by is found before
    #[arg(long, value_name = "TIME", value_parser = crate::values::duration, allow_hyphen_values = true)]
    pub(crate) time: Option<Duration>,
    /// Another seed gives other random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u32,
    /// Bits of a PNG's channel: 8 or 16
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = ["8", "16"])]
    pub(crate) bits: String,
    /// Quality of a JPEG, from 1 (small) to 100 (good)
    #[arg(long, value_name = "N", default_value_t = 92, value_parser = clap::value_parser!(u8).range(1..=100))]
    pub(crate) quality: u8,
    /// Pixels an inch on paper, written into the file
    #[arg(long, value_name = "DPI", allow_hyphen_values = true)]
    pub(crate) dpi: Option<f64>,
    /// Only this part of the picture, in pixels from its upper left corner; its pixels are those of the whole
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", value_parser = crate::values::window)]
    pub(crate) crop: Option<Window>,
    /// Layers of an EXR beside its colors: alpha, depth, id (the place in the file), normal, position, albedo (colors without light), direct
    /// (the key light alone), ambient (the sky alone; neither with --light), value (the numbers that --color shows), any attribute by its name (of a vector three
    /// channels) or expression without commas, of a medium transmittance; beauty is always there [default: depth,id, of a medium transmittance too]
    #[arg(long, visible_alias = "aov", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) layers: Option<Vec<Named>>,
    /// For two eyes: side-by-side, or anaglyph for glasses that are red on the left and cyan on the right
    #[arg(long, value_name = "HOW", conflicts_with = "crop")]
    pub(crate) stereo: Option<Stereo>,
    /// Distance of the eyes [default: a thirtieth of that of what the camera looks at]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true, requires = "stereo")]
    pub(crate) eye_separation: Option<f32>,
    /// Behind the particles: white, black, none (transparent), #rrggbb, a color's name; sky, what lights a medium, or with --light the
    /// spheres [default: white, of a medium black]
    #[arg(long, value_name = "COLOR")]
    pub(crate) background: Option<Background>,
    /// Short for --background none
    #[arg(long, conflicts_with = "background")]
    pub(crate) alpha: bool,
    /// Writes what is asked for as a scene file, which renders the same picture; what is guessed is left to be guessed again
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) save_scene: Option<PathBuf>,
    /// Renders a PNG, EXR or JPEG that Tyndall wrote once more, by what is written in it: into the same file, or that of -o. Other flags
    /// and files count before what they were
    #[arg(long, value_name = "PICTURE")]
    pub(crate) again: Option<PathBuf>,
}

impl Picture {
    /// Width and height: those asked for, of a movie the nearest that it can have.
    pub(crate) fn pixels(&self) -> [u32; 2] {
        movie::size(&self.output, [self.size.width, self.size.height])
    }

    /// How the picture's file is written, with these texts.
    pub(crate) fn options(&self, metadata: Vec<(String, String)>) -> ImageOptions {
        let bits = if self.bits == "16" { 16 } else { 8 };
        ImageOptions {
            bits,
            quality: self.quality,
            dpi: self.dpi,
            metadata,
            has_depth: self.has_layer(Layer::Depth),
            has_ids: self.has_layer(Layer::Id),
            part_of: self.crop.map(|window| (window, self.pixels())),
            ..ImageOptions::default()
        }
    }

    /// Whether an EXR has a layer that it has if nothing is said.
    pub(crate) fn has_layer(&self, layer: Layer) -> bool {
        self.layers.as_ref().is_none_or(|layers| layers.contains(&Named::Layer(layer)))
    }

    /// Whether layers are wanted of the surface that the pixel's middle shows.
    pub(crate) fn wants_surfaces(&self) -> bool {
        let is_of_surface = |it: &Named| matches!(it, Named::Layer(Layer::Normal | Layer::Position));
        self.layers.iter().flatten().any(is_of_surface)
    }

    /// The file of picture `number`.
    pub(crate) fn written(&self, number: usize) -> PathBuf {
        Pattern::new(&self.output).name(number)
    }

    /// Width and height of what is written.
    pub(crate) fn written_pixels(&self) -> [u32; 2] {
        let [width, height] = self.crop.map_or(self.pixels(), |window| [window.width, window.height]);
        match self.stereo {
            Some(Stereo::SideBySide) => [2 * width, height],
            _ => [width, height],
        }
    }

    /// The picture as a part of what the camera sees.
    pub(crate) fn frame(&self) -> Frame {
        let [width, height] = self.pixels();
        let part = self.crop.unwrap_or(Window::whole(width, height));
        Frame { seen: [width, height], part }
    }

    /// Whether something lies behind the particles everywhere.
    pub(crate) fn is_opaque(&self) -> bool {
        !self.alpha && self.background != Some(Background::Nothing)
    }
}

/// How two eyes share a picture.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Stereo {
    /// The left eye's picture left of the right eye's: twice as wide
    SideBySide,
    /// In red and cyan
    Anaglyph,
}

/// Which frames.
#[derive(Args)]
#[command(next_help_heading = "Frames")]
pub(crate) struct Frames {
    /// One frame, counted from 0; -1 is the last
    #[arg(long, value_name = "N", allow_hyphen_values = true, conflicts_with = "frames")]
    pub(crate) frame: Option<i64>,
    /// Frames START:STOP:STEP as in Python, STOP not included [default: all if OUT is a movie or has a number, else the first]
    #[arg(long, value_name = "SLICE", allow_hyphen_values = true)]
    pub(crate) frames: Option<Slice>,
    /// Pictures a second of a movie
    #[arg(long, value_name = "RATE", default_value_t = 24.0, allow_hyphen_values = true)]
    pub(crate) fps: f64,
    /// What encodes an MP4: the program ffmpeg, or what is built in; auto takes ffmpeg where it is found
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(crate) encoder: EncoderName,
    /// Turns the camera by so many degrees over the pictures
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, conflicts_with = "cameras")]
    pub(crate) orbit: Option<Degrees>,
    /// How many pictures an orbit around a single frame has, or a camera's way through it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) frame_count: Option<u32>,
    /// Leaves pictures that are there already
    #[arg(long)]
    pub(crate) skip_existing: bool,
    /// Keeps the color range of the first frame, with --frame-sequence that of all
    #[arg(long)]
    pub(crate) fixed_range: bool,
}

/// Which particles are shown; the others cast no shadow either. Camera and colors are those of all, unless --frame-shown moves the camera.
#[derive(Args)]
#[command(next_help_heading = "Selection")]
pub(crate) struct Selection {
    /// Shows only particles with these values, both ends of a range included: c_pe=-4.2:-3.1, v.x=0:, type=1,3, element=O,H; may be repeated
    #[arg(long = "filter", value_name = "NAME=VALUES", allow_hyphen_values = true)]
    pub(crate) filters: Vec<Filter>,
    /// Shows only particles for which this is true: "element == O and z > 2", 'not resname SOL', 'type 1 3 and v.x^2 < 4', "random() < 0.1"; may be repeated. The language is in docs/expressions.md
    #[arg(long = "select", value_name = "EXPRESSION", value_parser = Filter::condition, allow_hyphen_values = true)]
    pub(crate) conditions: Vec<Filter>,
    /// Shows only particles whose center is there: z<10, z<0.5L (L: the cell's size), 'plane X,Y,Z NX,NY,NZ' (cuts away what the normal points to), 'box X,Y,Z X,Y,Z' (keeps what is inside); may be repeated
    #[arg(long = "clip", visible_alias = "slice", value_name = "WHERE", allow_hyphen_values = true)]
    pub(crate) clips: Vec<Clip>,
}

impl Selection {
    /// Filters and conditions.
    pub(crate) fn all_filters(&self) -> Vec<Filter> {
        self.filters.iter().chain(&self.conditions).cloned().collect()
    }

    /// Whether nothing is asked for.
    pub(crate) fn is_empty(&self) -> bool {
        self.filters.is_empty() && self.conditions.is_empty() && self.clips.is_empty()
    }
}

/// More particles in the same picture.
#[derive(Args)]
#[command(next_help_heading = "Layers")]
pub(crate) struct Layers {
    /// More particles in the same picture: files with flags of their own for reading, choice, colors, radii and bonds, in one word, such as
    /// --layer 'walls.ply --color gray --radius 0.1'; may be repeated. One of all may be a medium ('smoke.vdb', 'gas.hdf5 --look smoke'): spheres
    /// and medium shade and light each other then, in the lights of the medium. A layer of one frame is in all pictures
    #[arg(long = "layer", value_name = "WORDS", allow_hyphen_values = true)]
    pub(crate) texts: Vec<String>,
    /// What they say.
    #[arg(skip)]
    pub(crate) sources: Vec<Render>,
}

/// How it is done.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct Method {
    /// How particles are seen
    #[arg(long, value_name = "MODE", default_value = "spheres")]
    pub(crate) mode: Mode,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
    /// What renders: auto takes a graphics card if there is one and the particles fit, cpu, gpu, gpu:NAME (see `tyndall devices`)
    #[arg(long, value_name = "DEVICE", default_value = "auto")]
    pub(crate) device: Choice,
    /// Who arranges the particles of bvh for a graphics card: cpu, whose structure is copied to the card, or gpu, which sorts them itself: a
    /// slightly looser structure, for the same picture
    #[arg(long, value_name = "BUILDER", default_value = "cpu")]
    pub(crate) build: Builder,
    /// Memory that may be used, such as 500M or 16G, instead of all that is free; what does not fit is read in parts where its
    /// format allows that
    #[arg(long, value_name = "BYTES", value_parser = crate::values::bytes)]
    pub(crate) memory: Option<u64>,
    /// Says how much memory and time it would take, and stops
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) culling: CullingArgs,
}

/// Which structure finds what a ray meets.
#[derive(Args)]
pub(crate) struct StructureArgs {
    /// Structure over the particles; unless packed, all give the same picture [default: bvh, for bench culling pkd]
    #[arg(long, value_name = "NAME")]
    pub(crate) structure: Option<StructureName>,
    /// Bits of a coordinate in a leaf of bvh, less memory for small errors that are measured and told: exact 16 11 8
    #[arg(long, value_name = "BITS", default_value = "exact")]
    pub(crate) pack: Pack,
    /// Particles in a treelet, at most: 16 to 4096
    #[arg(long, value_name = "COUNT", default_value = "64", value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub(crate) treelet_size: u32,
    /// Where particles are cut in two until they are treelets: at their median, or in the middle of the space they take
    #[arg(long, value_name = "CUT", default_value = "median")]
    pub(crate) treelet_cut: TreeletCut,
    /// How pkd and treelets choose the axis of a node
    #[arg(long, value_name = "AXIS", default_value = "widest")]
    pub(crate) pkd_axis: PkdAxis,
    /// When pkd and treelets test a node's own particle: before its children, or after the near one
    #[arg(long, value_name = "ORDER", default_value = "node")]
    pub(crate) pkd_order: PkdOrder,
}

/// Who builds the structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Builder {
    /// The processor: cuts along the widest axis
    #[default]
    Cpu,
    /// The graphics card: a sort along a space-filling curve
    Gpu,
}

/// How centers are held; 11 has one less for z.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pack {
    /// As they are
    Exact,
    /// 7 bytes a particle
    #[value(name = "16")]
    Bits16,
    /// 5 bytes a particle
    #[value(name = "11")]
    Bits11,
    /// 4 bytes a particle
    #[value(name = "8")]
    Bits8,
}

/// How particles are seen.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// As opaque spheres
    Spheres,
    /// As smoke or cloud: a density that light is scattered in
    Medium,
    /// As a map of numbers: line integrals or means along the view, straight from the particles' kernels
    Project,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum StructureName {
    /// Wide nodes over packed leaves
    Bvh,
    /// A balanced k-d tree in place
    Pkd,
    /// Wide nodes over small k-d trees in place
    Treelets,
    /// Tries every particle: slow, for comparison
    Brute,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TreeletCut {
    /// Half of the particles on each side: treelets are full
    Median,
    /// Half of the space on each side: treelets are of any size
    Middle,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PkdAxis {
    /// The widest extent
    Widest,
    /// x, y, z in turn
    RoundRobin,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PkdOrder {
    /// Before both children
    Node,
    /// After the near child
    Near,
}

#[derive(Args)]
pub(crate) struct Info {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The frame to describe, counted from 0; -1 is the last
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,
    /// Prints one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Reads a .tyn file as a whole and compares it with its checksums
    #[arg(long)]
    pub(crate) check: bool,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Args)]
pub(crate) struct Convert {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The file; its extension says the format: .xyz .dump .csv .tsv .ply .npy .npz .vtp .mmpld .prt .bgeo .usda .glb; where the
    /// build has the feature parquet also .parquet .arrow .feather; or .vdb, for the density of the particles as OpenVDB grids. Where
    /// each frame needs its own file, it has the number in its name: %04d, #### or $F4
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Names of the attributes to write, in order: id,velocity [default: all]. Into .vdb: grids, of which density is the particles'
    /// own and others are means: density,temperature,velocity [default: density]
    #[arg(long, visible_alias = "field", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) fields: Option<Vec<String>>,
    /// Into .vdb: 16-bit floats, of half the size
    #[arg(long)]
    pub(crate) half: bool,
    /// One frame, counted from 0; -1 is the last
    #[arg(long, value_name = "N", allow_hyphen_values = true, conflicts_with = "frames")]
    pub(crate) frame: Option<i64>,
    /// Frames START:STOP:STEP as in Python, STOP not included [default: all if OUT can hold them, else the first]
    #[arg(long, value_name = "SLICE", allow_hyphen_values = true)]
    pub(crate) frames: Option<Slice>,
    /// Leaves files that are there already
    #[arg(long)]
    pub(crate) skip_existing: bool,
    #[command(flatten)]
    pub(crate) density: Density,
    #[command(flatten)]
    pub(crate) selection: Selection,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Args)]
pub(crate) struct Build {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The file: its extension is .tyn
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Names of the attributes to save: id,velocity; that of the radii is always saved [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) fields: Option<Vec<String>>,
    /// The frame to save, counted from 0; -1 is the last [default: the first]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) frame: Option<i64>,
    /// Radius of the particles: a number for all, an attribute, or an expression such as diameter/2 or "if(type == 1, 0.5, 1)"
    /// [default: the file's, else by element, else half the usual distance]
    #[arg(long, value_name = "R", allow_hyphen_values = true)]
    pub(crate) radius: Option<Radius>,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
    /// Memory that may be used, such as 500M or 16G, instead of all that is free
    #[arg(long, value_name = "BYTES", value_parser = crate::values::bytes)]
    pub(crate) memory: Option<u64>,
    /// Says how much memory and disk it would take, and stops
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Args)]
pub(crate) struct Devices {
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Args)]
pub(crate) struct Bench {
    /// What to measure
    #[arg(default_value = "spheres")]
    pub(crate) what: BenchWhat,
    /// Particle counts [default: 1e6; of gpu 1e6,1e7,1e8]
    #[arg(long, value_name = "COUNTS", value_delimiter = ',', value_parser = count)]
    pub(crate) n: Vec<u64>,
    /// Sets of particles [default: packed,uniform,clustered; of culling nozzle,virion,fluid,ablation; of gpu all of these]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) sets: Vec<String>,
    /// Pixels across and down; other than the default compares with nothing
    #[arg(long, value_name = "WxH", default_value = "800x800")]
    pub(crate) size: Size,
    /// Prints one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Of gpu: the card, gpu or gpu:NAME
    #[arg(long, value_name = "DEVICE", default_value = "auto")]
    pub(crate) device: Choice,
    /// Of gpu: begins no set after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) time: Option<u64>,
    /// Of gpu: a file that has all figures so far, after each set
    #[arg(long, value_name = "FILE")]
    pub(crate) figures: Option<PathBuf>,
    /// Of gpu: compares layouts of the kernel too
    #[arg(long)]
    pub(crate) variants: bool,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
    #[command(flatten)]
    pub(crate) culling: CullingBench,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BenchWhat {
    /// Primary visibility and the default look at 800x800
    Spheres,
    /// Memory, building and single rays of every structure, treelets of five sizes and both cuts
    Structures,
    /// Density, light and march, as in the tables of Cha, Son and Ihm 2009
    Medium,
    /// Spheres in a medium: relMSE and time by samples, marched and traced by paths, on a fourth of --size across and down
    Bodies,
    /// Culling by confidence, as in chapter 6 of Walloner 2022: a report with pictures
    Culling,
    /// Spheres on a graphics card
    Gpu,
}
