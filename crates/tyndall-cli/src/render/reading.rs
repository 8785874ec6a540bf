//! How a frame comes into memory: as a whole, in parts, or with the structure that was saved with it.

use std::time::Instant;

use tyndall::particles::{Particles, Radii};
use tyndall::render::estimate::Work;
use tyndall::scene::color::ParticleColors;
use tyndall::scene::guesses::Guesses;
use tyndall::scene::short;
use tyndall::scene::sizes::Size;
use tyndall::structure::saved::RadiiOf;
use tyndall::structure::{Kind, Spheres, Structure};
use tyndall::{Error, Source};
use tyndall_io::{Parts, Saved, Sequence};

use super::{Job, Kept, Reading};
use crate::ahead::Ahead;
use crate::args::{Builder, Selection};
use crate::report::{Outcome, seconds};
use crate::{dry_run, input, sources, structure};

/// A frame as it was read.
pub(super) struct Frame {
    pub(super) number: usize,
    /// When the reading began.
    pub(super) start: Instant,
    /// If it has to be read in parts: then the particles stand for all.
    pub(super) parts: Option<Parts>,
    /// If a structure was saved with it.
    pub(super) opened: Option<Opened>,
    pub(super) particles: Particles,
    pub(super) conventions: Vec<String>,
    /// Of the other sources of particles.
    pub(super) layers: Vec<sources::Frame>,
}

impl Frame {
    /// How many particles there are, without those of layers.
    pub(super) fn count(&self) -> usize {
        self.parts.as_ref().map_or(self.particles.len(), |parts| parts.len() as usize)
    }

    /// The same with those of layers.
    pub(super) fn count_of_all(&self) -> usize {
        self.count() + self.layers.iter().map(|layer| layer.part.particles.len()).sum::<usize>()
    }
}

/// What a saved structure brings along.
pub(super) struct Opened {
    pub(super) structure: Structure,
    pub(super) guesses: Guesses,
    /// Particles that stand for all.
    pub(super) sample: Particles,
}

impl Opened {
    pub(super) fn spheres(&self, radius_scale: f32) -> Spheres<'_> {
        let radii = self.sample.radii().unwrap_or(&Radii::Uniform(0.0));
        Spheres { particles: &self.sample, radii, radius_scale }
    }
}

impl Job<'_> {
    /// Reads a frame and those of the layers.
    pub(super) fn read(
        &self,
        (sequence, ahead): (&Sequence, &mut Ahead),
        number: usize,
        kept: Option<&Kept>,
    ) -> Outcome<Frame> {
        let start = Instant::now();
        let parts = self.parts(sequence, number);
        let saved = self.saved(sequence, number, kept)?;
        let mut opened = None;
        let (particles, conventions) = match (&parts, saved) {
            (Some(parts), _) => (parts.sample(self.report.progress())?, vec!["read in parts".to_string()]),
            (None, Some(saved)) => {
                let sample = saved.sample()?;
                opened = Some(Opened { structure: saved.structure, guesses: saved.guesses, sample });
                (saved.particles, [saved.conventions, saved.given].concat())
            }
            (None, None) => {
                let frame = input::read_ahead((sequence, ahead), number, &self.args.input, self.report)?;
                let work = Work::of(&frame.particles, self.structure, self.settings);
                self.check_memory(&Work { columns_bytes: 0, ..work }, Reading::Whole)?;
                (frame.particles, frame.conventions)
            }
        };
        let particles =
            input::sized(particles, self.args.look.radius.as_ref(), &self.args.input, self.report)?;
        self.report.detail(format_args!("read: {}", seconds(start.elapsed().as_secs_f64())));
        let layers = self.sources.read(number, kept.map_or(&[][..], |kept| &kept.layers), self.report)?;
        let frame = Frame { number, start, parts, opened, particles, conventions, layers };
        if !frame.layers.is_empty() {
            let work = Work::of_count(frame.count_of_all() as u64, self.structure, self.settings);
            self.check_memory(&work, Reading::Whole)?;
        }
        Ok(frame)
    }

    /// The frame as parts, if it has to be read in parts and can be.
    pub(super) fn parts(&self, sequence: &Sequence, number: usize) -> Option<Parts> {
        // Particles that are put elsewhere, bonded or drawn as other shapes are all needed at once.
        let needs_all =
            self.args.look.bonds.is_some() || self.args.shapes.are_of_particles() || !self.sources.is_empty();
        if needs_all || !input::are_as_stored(&self.args.input) {
            return None;
        }
        // What is wrong with the file is said when it is read.
        let parts =
            sequence.parts(number).ok().flatten().filter(|_| matches!(self.structure, Kind::Bvh(_)))?;
        let work = self.held(Work::of_count(parts.len(), self.structure, self.settings));
        (!dry_run::fits(work.memory_bytes(), self.args.method.memory)).then_some(parts)
    }

    /// The frame with the structure that was saved with it, if that is what is asked for; says why if it is not.
    pub(super) fn saved(
        &self,
        sequence: &Sequence,
        number: usize,
        kept: Option<&Kept>,
    ) -> Outcome<Option<Saved>> {
        let Some(saved) = sequence.saved(number)? else { return Ok(None) };
        if let Some(why) = self.why_not(&saved, kept) {
            let kind = structure::name(saved.kind());
            self.tell(kept.is_none(), &format!("note: the saved structure ({kind}) is not used: {why}"));
            return Ok(None);
        }
        let told = (&saved.particles, &saved.warnings[..]);
        input::tell(&sequence.name(number), told, &self.args.input, self.report)?;
        Ok(Some(saved))
    }

    /// Why a saved structure is not what is asked for, if it is not.
    fn why_not(&self, saved: &Saved, kept: Option<&Kept>) -> Option<String> {
        let uniform = match saved.particles.radii() {
            Some(Radii::Uniform(radius)) => Some(*radius),
            _ => None,
        };
        if self.is_structure_asked_for && saved.kind() != self.structure {
            return Some(format!("{} is asked for, built otherwise", structure::name(self.structure)));
        }
        if self.args.method.build == Builder::Gpu {
            return Some("--build gpu".into());
        }
        if !input::are_as_stored(&self.args.input) {
            return Some("its particles are to be elsewhere".into());
        }
        if !self.sources.is_empty() {
            return Some("there are other layers".into());
        }
        if let Some(sizes) = self.args.look.radius.as_ref().and_then(Size::quantity) {
            return Some(format!("radius {sizes} is asked for"));
        }
        if let Some((Radii::Uniform(radius), _)) = self.asked_radius(kept)
            && uniform != Some(radius)
        {
            let own =
                uniform.map_or("a radius for each".into(), |own| format!("radius {}", short(own.into())));
            return Some(format!("it has {own}, radius {} is asked for", short(radius.into())));
        }
        // Packed radii are right to a share of the radius that they were packed with.
        let is_packed = saved.structure.saved().is_some_and(|(facts, _)| facts.radii == RadiiOf::Packed);
        (is_packed && self.args.look.radius_scale != 1.0)
            .then(|| "its radii are packed, and --radius-scale changes them".into())
    }

    /// Builds over parts. Returns too how many particles were not finite.
    pub(super) fn stream(
        &self,
        parts: &Parts,
        radii: &Radii,
        colors: &ParticleColors,
    ) -> Outcome<(Structure, u64)> {
        let allowed = "one for all: the particles do not fit the memory with what each has of its own";
        let (&Radii::Uniform(radius), Kind::Bvh(packing)) = (radii, self.structure) else {
            return Err(Error::setting("--radius", "each its own", allowed).into());
        };
        if !colors.is_constant() {
            return Err(Error::setting("--color", &colors.description, allowed).into());
        }
        let Selection { filters, conditions, .. } = &self.args.selection;
        if let Some(filter) = filters.iter().chain(conditions).next() {
            let allowed = "given: the particles do not fit the memory with what each has of its own — --clip is possible";
            return Err(Error::setting("--filter and --select", filter, allowed).into());
        }
        if let Some(name) = self.args.look.drawn() {
            let allowed = "left out: the particles do not fit the memory with what each has of its own";
            return Err(Error::setting(name, "given", allowed).into());
        }
        let radius = radius * self.args.look.radius_scale;
        let (structure, dropped) =
            Structure::stream(parts, parts.origin(), radius, packing, self.report.progress())?;
        input::tell_dropped(dropped, parts.len(), &self.args.input, self.report)?;
        Ok((structure, dropped))
    }
}
