//! `tyndall render --mode project`: maps of numbers, such as the column density of a galaxy.
//!
//! A map is the line integral of a quantity along parallel rays, or its mean along them with `--weight`. Numbers go into `.npy`, `.fits`
//! or `.exr` as they are; pictures and movies show them through a color map. What is not said is guessed from the first frame and printed.

use std::path::Path;
use std::time::{Duration, Instant};

use clap::Args;
use tyndall::medium::density;
use tyndall::particles::{Particles, Radii};
use tyndall::render::project::{Carried, Map, project};
use tyndall::scene::automatic::framing_of;
use tyndall::scene::camera::{Camera, View};
use tyndall::scene::color::{Key, Legend, Scale};
use tyndall::scene::coloring::{Mapping, Norm, Range};
use tyndall::scene::outline::Outline;
use tyndall::scene::short;
use tyndall::scene::viewpoint::{Lens, Viewpoint};
use tyndall::structure::Spheres;
use tyndall::{Error, Image};
use tyndall_io::annotation::Behind;
use tyndall_io::write::map::{self, is_map};
use tyndall_io::write::{self, ImageOptions};

use crate::args::Render;
use crate::looks::LightLook;
use crate::medium::emission::find;
use crate::names::Numbers;
use crate::output::{Output, Pattern};
use crate::report::{Failure, Outcome, Report, bytes, counted, seconds};
use crate::shot::Taken;
use crate::values::Background;
use crate::{ahead, annotate, input, metadata, plan, progress, render, selection, survey, wanted};

/// With --mode project: which quantity is projected. Rays are parallel; --weight makes a mean of it.
#[derive(Args)]
#[command(next_help_heading = "Projection")]
pub(crate) struct Project {
    /// What is integrated along the view: density (mass per area), an attribute or an expression (its line integral); with --weight, such as
    /// --weight mass, its mean along the view, weighted by that
    #[arg(long, value_name = "NAME", default_value = "density")]
    pub(crate) quantity: String,
    /// The unit of the numbers, as text for the printed line and the file: "Msun/kpc^2"
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub(crate) unit: String,
    /// Integrate the kernels of the particles themselves, through no grid: maps are always made so, with this flag or without it
    #[arg(long)]
    pub(crate) exact_kernel: bool,
}

/// The quantity that is the particles' own density.
const DENSITY: &str = "density";
/// Bytes that a particle takes: its spot, its length, what it carries twice, its place in bands of rows.
const PARTICLE_BYTES: u64 = 40 + 4 + 16 + 8;

/// Makes the maps that the command line asks for.
pub(crate) fn run(args: &Render, report: &Report) -> Outcome<()> {
    let job = Job { args, report, viewpoint: viewpoint(args)? };
    job.check()?;
    let path = &args.picture.output;
    let pattern = Pattern::new(path);
    let mut output = match is_map(path) {
        true => {
            write::check_place(&pattern.name(0)).map_err(Failure::Output)?;
            None
        }
        false => Some(Output::new(args, report)?),
    };
    let quantity = Some(args.project.quantity.as_str()).filter(|it| *it != DENSITY);
    let wanted = wanted::of_map(&args.medium.density, &args.selection, quantity);
    let sequence = input::open(&args.input, Some(wanted), report)?;
    let pictures = plan::pictures(args, &pattern, &Numbers::of(&args.input, sequence.len()), report)?;
    if args.method.dry_run {
        let frame = input::read(&sequence, pictures[0].frame, &args.input, report)?;
        let count = frame.particles.len() as u64;
        let needed = count * PARTICLE_BYTES + 32 * job.pixels() as u64;
        return report.out(&format!(
            "dry run: {}; memory about {} beside the particles; nothing written\n",
            counted(count as usize, "particle"),
            bytes(needed)
        ));
    }
    let surveyed = survey::of(args, sequence.len(), |number| {
        let particles = survey::read(&sequence, number, args, report)?.particles;
        let (particles, _) = selection::keep(&args.selection, particles)?;
        Ok(job.outline(&particles, 0.0).0)
    })?;
    let frames = plan::frames_to_read(&pictures, args.frames.skip_existing);
    let done = ahead::reading(&sequence, &frames, args.method.memory, |ahead| {
        plan::each_frame(&pictures, args.frames.skip_existing, report, |number, wanted, kept, written| {
            let frame = input::read_ahead((&sequence, ahead), number, &args.input, report)?;
            let (particles, share) = selection::keep(&args.selection, frame.particles)?;
            let carrying = job.carrying(&particles)?;
            let is_first = kept.is_none();
            let (camera, outline, framed) = match kept.as_ref() {
                Some(Kept { camera, outline, .. }) => {
                    survey::warn(args, &particles, camera, report)?;
                    (*camera, outline.clone(), "framed as the first frame".into())
                }
                None => job.camera(&particles, &carrying.lengths, &surveyed),
            };
            let mut guesses = vec![
                format!("projection, cpu {} threads", rayon::current_num_threads()),
                counted(particles.len(), "particle"),
                carrying.model.clone(),
            ];
            guesses.extend(share);
            guesses.extend(carrying.notes.iter().cloned().chain([framed]));
            let scale = kept.as_ref().and_then(|it: &Kept| it.scale.clone());
            let time = particles.time();
            let entries = |guesses: &[String], picture| {
                let of_frame = metadata::of_frame(args, &sequence, number, time, &job.settings(), guesses);
                metadata::of_picture(of_frame, picture)
            };
            let mut first = Kept { camera, outline, scale };
            for (place, picture) in wanted.iter().enumerate() {
                let start = Instant::now();
                let camera = picture.camera(args, &job.viewpoint, (&first.camera, &first.outline))?;
                let view = job.view(&camera, &particles)?;
                let found = job.map(&particles, &carrying, &view)?;
                let shown = job.shown(&found, &carrying, first.scale.as_ref())?;
                let guesses: Vec<String> = guesses.iter().chain(&shown.told).cloned().collect();
                if is_first && place == 0 {
                    report.note(format_args!("tyndall: {}", guesses.join(" · ")));
                } else {
                    report.detail(format_args!("frame {number}: {}", guesses.join(" · ")));
                }
                if args.frames.fixed_range {
                    first.scale.get_or_insert_with(|| shown.scale.clone());
                }
                let took = || start.elapsed();
                let seen = Seen { camera, view, frame: number, particles: &particles };
                job.write(&picture.path, (&shown, &seen), entries(&guesses, picture), output.as_mut(), took)?;
                *written += 1;
                if progress::stopped() {
                    return Err(Error::Interrupted.into());
                }
            }
            kept.get_or_insert(first);
            Ok(())
        })
    });
    match output {
        Some(output) => output.finish(done),
        None => done,
    }
}

/// What the command line says about the camera, with parallel rays.
fn viewpoint(args: &Render) -> Outcome<Viewpoint> {
    if args.camera.fov.is_some() || args.camera.horizontal_fov.is_some() {
        let text = "--mode project has parallel rays — leave --fov out, or give --ortho HEIGHT";
        return Err(Failure::Usage(text.into()));
    }
    let viewpoint = render::viewpoint(args)?;
    let height = args.camera.ortho.and_then(|ortho| ortho.0);
    Ok(Viewpoint { lens: Lens::Orthographic { height }, ..viewpoint })
}

/// What is found on the first frame and kept.
struct Kept {
    camera: Camera,
    outline: Outline,
    scale: Option<Scale>,
}

/// What the particles carry.
struct Carrying {
    lengths: Vec<f32>,
    /// What is integrated, and what weighs a mean.
    columns: Vec<Vec<f64>>,
    /// The model, its equation and its unit.
    model: String,
    notes: Vec<String>,
    /// What the map is of, for people.
    label: String,
}

/// A map as it is shown.
struct Shown {
    values: Vec<f64>,
    label: String,
    scale: Scale,
    told: Vec<String>,
}

/// Where a map is of.
struct Seen<'a> {
    camera: Camera,
    view: View,
    frame: usize,
    particles: &'a Particles,
}

/// The command line.
struct Job<'a> {
    args: &'a Render,
    report: &'a Report,
    viewpoint: Viewpoint,
}

impl Job<'_> {
    /// Refuses before the work what cannot be.
    fn check(&self) -> Outcome<()> {
        let (look, picture) = (&self.args.look, &self.args.picture);
        let others = [
            ("--replicate", look.images().is_some()),
            ("--bonds", look.bonds.is_some()),
            ("--opacity", look.opacity.is_some()),
            ("--shutter", look.shutter.is_some()),
            ("--motion-blur", look.motion_blur.is_some()),
            (self.args.shapes.name().unwrap_or_default(), self.args.shapes.name().is_some()),
            ("--holdout", self.args.shapes.holdout().is_some()),
            ("--aperture", look.aperture.is_some()),
            ("--bounces", look.bounces.is_some()),
            ("--noise", self.args.medium.noise.is_some()),
            ("--time", picture.time.is_some()),
            ("--crop", picture.crop.is_some()),
            ("--stereo", picture.stereo.is_some()),
            ("--layers", picture.layers.is_some()),
            ("--panorama", self.args.camera.panorama),
        ];
        if let Some((flag, _)) = others.iter().find(|(_, is_given)| *is_given) {
            return Err(Failure::Usage(format!("{flag} is for spheres — leave it out with --mode project")));
        }
        self.args.illustrate.refuse("--mode project")?;
        self.args.cut.refuse("--mode project")?;
        if self.args.look.look != LightLook::Default {
            let text = "--look is for spheres and media — leave it out with --mode project (--cmap, --norm, --range)";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.picture.background == Some(Background::Sky) {
            let allowed = "a color or none; sky is for --mode medium";
            return Err(Error::setting("--background", "sky", allowed).into());
        }
        Ok(())
    }

    fn pixels(&self) -> usize {
        self.args.picture.pixels().iter().map(|it| *it as usize).product()
    }

    /// The settings that are written into the file.
    fn settings(&self) -> tyndall::render::Settings {
        let [width, height] = self.args.picture.pixels();
        let culling = tyndall::render::Culling::Off;
        tyndall::render::Settings { width, height, samples: 1, seed: self.args.picture.seed, culling }
    }

    /// What is asked for, of the particles.
    fn carrying(&self, particles: &Particles) -> Outcome<Carrying> {
        let density = &self.args.medium.density;
        let spread = density::spread(particles, &density.settings(None), self.report.progress())?;
        let mut notes = spread.notes.clone();
        let weights: Vec<f64> = (0..particles.len()).map(|id| spread.weight(id)).collect();
        let quantity = self.args.project.quantity.as_str();
        let weight = spread.weight_name();
        let unit = match self.args.project.unit.as_str() {
            "" => String::new(),
            unit => format!(" in {unit}"),
        };
        let (columns, model, label);
        if quantity == DENSITY {
            columns = vec![weights];
            model = format!("column density of {weight}, integral of rho dl{unit}");
            label = format!("column density of {weight}");
        } else {
            let values = find(particles, "--quantity", quantity)?;
            let times = |factors: &[f64]| -> Vec<f64> {
                factors.iter().enumerate().map(|(id, factor)| factor * values.value(id)).collect()
            };
            if density.weight.is_some() {
                columns = vec![times(&weights), weights];
                model = format!(
                    "mean of {quantity} weighted by {weight}, integral of rho A dl / integral of rho dl{unit}"
                );
                label = format!("mean of {quantity}");
            } else {
                let (volumes, how) = spread.volumes(self.report.progress());
                notes.push(how);
                columns = vec![times(&volumes)];
                model = format!("line integral of {quantity}, integral of A dl{unit}");
                label = format!("integral of {quantity}");
            }
        }
        Ok(Carrying { lengths: spread.lengths, columns, model, notes, label })
    }

    /// The camera, and how it was found.
    fn camera(
        &self,
        particles: &Particles,
        lengths: &[f32],
        surveyed: &[Outline],
    ) -> (Camera, Outline, String) {
        let mut sorted = lengths.to_vec();
        let middle = sorted.len() / 2;
        let usual = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        let (outline, framed) = survey::framed(self.outline(particles, usual), surveyed, usual.into());
        let [width, height] = self.args.picture.pixels().map(f64::from);
        let camera = self.viewpoint.camera(&outline, width / height);
        let given = self.viewpoint.eye.map(|_| "camera given".into());
        let given = self.args.camera.described().or(given);
        (camera, outline, given.unwrap_or(framed))
    }

    /// What is framed of particles of that radius, and how it was found.
    fn outline(&self, particles: &Particles, radius: f32) -> (Outline, String) {
        let spheres = Spheres { particles, radii: &Radii::Uniform(radius), radius_scale: 1.0 };
        let outliers = self.args.camera.outliers();
        let framing = framing_of(spheres, outliers);
        (Outline::of(spheres, &framing), framing.description)
    }

    fn view(&self, camera: &Camera, particles: &Particles) -> Outcome<View> {
        let [width, height] = self.args.picture.pixels();
        Ok(camera.view(particles.positions().origin(), width, height)?)
    }

    fn map(&self, particles: &Particles, carrying: &Carrying, view: &View) -> Outcome<Map> {
        let columns: Vec<&[f64]> = carrying.columns.iter().map(|it| &it[..]).collect();
        let carried = Carried {
            positions: particles.positions(),
            lengths: &carrying.lengths,
            columns: &columns,
            kernel: self.args.medium.density.kernel.kernel(),
        };
        let start = Instant::now();
        let map = project(&carried, view, self.args.picture.pixels(), self.report.progress())?;
        self.report.detail(format_args!("projection: {}", seconds(start.elapsed().as_secs_f64())));
        Ok(map)
    }

    /// The numbers and their colors, and what is told about them.
    fn shown(&self, map: &Map, carrying: &Carrying, kept: Option<&Scale>) -> Outcome<Shown> {
        let last = map.columns.len() - 1;
        if map.columns[last].iter().all(|it| *it == 0.0) {
            let text = "nothing of the particles is in the map — where does it look? (--look-at, --ortho, --quantity)";
            return Err(Failure::Unseen(text.into()));
        }
        let values = if last == 0 { map.columns[0].clone() } else { map.mean(0, 1) };
        let mapping = self.args.look.mapping();
        let (norm, range) = match kept {
            Some(scale) => (Some(scale.norm), Range::Given(scale.low, scale.high)),
            None => (mapping.norm, mapping.range),
        };
        // Of what is summed up nearly nothing lies at the edges of kernels, where it falls by orders of magnitude.
        let most = (kept.is_none() && last == 0 && range == Range::Auto && norm != Some(Norm::Linear))
            .then(|| most_of(&values))
            .flatten();
        let (range, norm) = most.map_or((range, norm), |range| (range, Some(Norm::Log)));
        let mapping = Mapping { norm, range, ..mapping };
        let (scale, mut colors) = Scale::of_numbers(&carrying.label, &values, &mapping)?;
        if most.is_some() {
            colors = colors.replace("(given)", "(99 % of it above, 99.9 % of the pixels below)");
        }
        let total = map.totals[last];
        let mut told = vec![
            format!("colors: {colors}"),
            format!(
                "{} of {} in the map ({:.2} %)",
                short(map.sum(last)),
                short(total),
                100.0 * map.sum(last) / total
            ),
            format!("pixels of {}", short(map.pixel_area.sqrt())),
        ];
        if map.missing > 0 {
            told.push(format!("{} left out: no number", counted(map.missing, "particle")));
        }
        let [width, height] = self.args.picture.pixels();
        told.push(format!("{width}x{height}"));
        Ok(Shown { values, label: carrying.label.clone(), scale, told })
    }

    /// Writes a map or its picture.
    fn write(
        &self,
        path: &Path,
        (shown, seen): (&Shown, &Seen),
        metadata: Vec<(String, String)>,
        output: Option<&mut Output>,
        took: impl Fn() -> Duration,
    ) -> Outcome<()> {
        let [width, height] = self.args.picture.pixels();
        let Seen { view, particles, .. } = seen;
        let Some(output) = output else {
            let [pixel, left, top] = [view.pixel, view.left, view.top].map(f64::from);
            let map = map::Map {
                width,
                height,
                values: &shown.values,
                quantity: &shown.label,
                unit: &self.args.project.unit,
                origin: [left + 0.5 * pixel, top - (f64::from(height) - 0.5) * pixel],
                pixel,
                length_unit: particles.length_unit().unwrap_or_default(),
                metadata: &metadata,
            };
            map::map(path, &map).map_err(Failure::Output)?;
            self.report.note(format_args!("{}  {}", path.display(), seconds(took().as_secs_f64())));
            return Ok(());
        };
        let is_exr = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("exr"));
        let behind = match self.args.picture.background.unwrap_or(Background::Color([0.0; 3])) {
            Background::Color(color) if self.args.picture.is_opaque() => Some(color),
            _ => None,
        };
        let color = |&value: &f64| {
            let is_nothing = value.is_nan() || (value == 0.0 && shown.scale.norm == Norm::Log);
            match (is_exr, is_nothing) {
                (true, _) => [value as f32, value as f32, value as f32, 1.0],
                (false, false) => opaque(shown.scale.color(value)),
                (false, true) => behind.map_or([0.0; 4], opaque),
            }
        };
        let image = Image {
            width,
            height,
            color: shown.values.iter().map(color).collect(),
            depth: vec![f32::INFINITY; shown.values.len()],
            id: vec![-1; shown.values.len()],
        };
        let channels = vec![("map".into(), shown.values.iter().map(|it| *it as f32).collect())];
        let options =
            ImageOptions { has_depth: false, has_ids: false, ..self.args.picture.options(metadata) };
        let unit = Some(self.args.project.unit.clone()).filter(|unit| !unit.is_empty());
        let key = Key::Amounts(shown.scale.clone());
        let legend = Legend { label: shown.label.clone(), unit, key, missing: None };
        let annotated = annotate::Shown {
            behind: behind.map_or(Behind::Nothing, Behind::Color),
            colors: (Some(&legend), "of the map"),
            frame: seen.frame,
            time: (particles.time(), particles.time_unit()),
            length_unit: particles.length_unit(),
            cell: particles.cell().copied(),
        };
        let frame = self.args.picture.frame();
        let taken = Taken::one(annotate::Seen { image, channels, camera: seen.camera, frame });
        output.write(path, (taken, options), &annotated, took)
    }
}

/// The range of numbers that has most of their sum: 1 % of it lies in smaller ones, and one in a thousand is greater. `None` if any is below
/// 0, or they do not differ.
fn most_of(values: &[f64]) -> Option<Range> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|it| *it != 0.0 && it.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    if sorted.first().is_none_or(|least| *least < 0.0) {
        return None;
    }
    let total: f64 = sorted.iter().sum();
    let mut sum = 0.0;
    let low = sorted.iter().find(|value| {
        sum += **value;
        sum >= 0.01 * total
    })?;
    let high = sorted[(sorted.len() - 1) * 999 / 1000];
    (*low < high).then_some(Range::Given(*low, high))
}

fn opaque([r, g, b]: [f32; 3]) -> [f32; 4] {
    [r, g, b, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_has_most_of_the_sum() {
        let value = |k: u32| if k < 500 { 1e-9 * f64::from(k) } else { f64::from(k) };
        let values: Vec<f64> = (0..1000).map(value).collect();
        let Some(Range::Given(low, high)) = most_of(&values) else { panic!("a range") };
        assert!((500.0..520.0).contains(&low) && high == 998.0, "{low} {high}");
        assert_eq!((most_of(&[-1.0, 2.0]), most_of(&[3.0, 3.0]), most_of(&[])), (None, None, None));
    }
}
