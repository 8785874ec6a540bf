//! Particles that do not fit the memory: they are read in parts, and a sample stands for them where guesses are made.

use std::ops::Range;

use tyndall::medium::density::{self, Carrier, Settings, Volume};
use tyndall::medium::grid::Lattice;
use tyndall::scene::subset;
use tyndall::{DVec3, Error, Particles, Result, Source, Vec3};
use tyndall_io::{Parts, Sequence};

use super::emission::EmissionSpec;
use crate::args::Selection;
use crate::input::args::Input;
use crate::report::{Outcome, Report};
use crate::{dry_run, input, selection};

/// Those particles of a frame that are asked for, in parts.
pub(crate) struct Parted<'a> {
    parts: Parts,
    selection: &'a Selection,
    /// What has to be among their attributes.
    emission: EmissionSpec,
}

impl<'a> Parted<'a> {
    /// The frame as parts, if it has to be read in parts and can be, with so many attributes on the grid; `limit` is the memory that may be used instead of what
    /// is free.
    pub(crate) fn of(
        sequence: &Sequence,
        number: usize,
        (input, selection): (&Input, &'a Selection),
        (emission, attributes): (EmissionSpec, usize),
        limit: Option<u64>,
    ) -> Outcome<Option<Self>> {
        if !input::are_as_stored(input) {
            return Ok(None);
        }
        // What is wrong with the file is said when it is read.
        let Some(parts) = sequence.parts(number).ok().flatten() else { return Ok(None) };
        if dry_run::fits(density::particle_bytes(parts.len(), 1 + attributes), limit) {
            return Ok(None);
        }
        if let Some(clip) = selection.clips.iter().find(|it| it.is_share())
            && parts.part(0..0)?.1.cell().is_none()
        {
            let allowed =
                "in lengths, not in L: the particles do not fit the memory, and the file says no cell";
            return Err(Error::setting("--clip", clip, allowed).into());
        }
        Ok(Some(Self { parts, selection, emission }))
    }

    /// The same, measured from elsewhere.
    pub(crate) fn measured_from(self, origin: DVec3) -> Self {
        Self { parts: self.parts.measured_from(origin), ..self }
    }

    /// How many there are, asked for or not.
    pub(crate) fn count(&self) -> usize {
        self.len() as usize
    }

    /// Particles that stand for all that are asked for.
    pub(crate) fn sample(&self, report: &Report) -> Outcome<Particles> {
        Ok(selection::keep(self.selection, self.parts.sample(report.progress())?)?.0)
    }

    /// Their density, and how many they are; says what is wrong with the particles.
    pub(crate) fn density(
        &self,
        settings: &Settings,
        input: &Input,
        report: &Report,
    ) -> Outcome<(Volume, usize)> {
        let (volume, lost) = density::stream(self, settings, report.progress())?;
        if self.selection.is_empty() {
            input::tell_dropped(lost, self.len(), input, report)?;
        }
        Ok((volume, (self.len() - lost) as usize))
    }

    /// Where the samples of it will lie, and the most memory that it will take.
    pub(crate) fn plan(&self, settings: &Settings, report: &Report) -> Outcome<(Lattice, u64)> {
        Ok(density::plan_stream(self, settings, report.progress())?)
    }

    /// Which of them are asked for.
    fn shown(&self, particles: &Particles) -> Result<Vec<bool>> {
        let shown = subset::shown(particles, &self.selection.all_filters(), &self.selection.clips)?;
        Ok(shown.unwrap_or_else(|_| vec![false; particles.len()]))
    }
}

impl Source for Parted<'_> {
    fn len(&self) -> u64 {
        self.parts.len()
    }

    fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()> {
        if self.selection.is_empty() {
            return self.parts.read(range, into);
        }
        let (centers, particles) = self.parts.part(range.clone())?;
        into.clear();
        into.resize((range.end - range.start) as usize, Vec3::NAN);
        for (id, _) in self.shown(&particles)?.iter().enumerate().filter(|(_, is_shown)| **is_shown) {
            into[(particles.place(id) - range.start) as usize] = centers[id];
        }
        Ok(())
    }
}

impl Carrier for Parted<'_> {
    fn part(&self, range: Range<u64>) -> Result<(Vec<Vec3>, Particles)> {
        let (mut centers, mut particles) = self.parts.part(range)?;
        if !self.selection.is_empty() {
            let shown = self.shown(&particles)?;
            let mut flags = shown.iter();
            centers.retain(|_| flags.next().is_some_and(|it| *it));
            particles = particles.retained(&shown);
        }
        Ok((centers, self.emission.prepare(particles)?.0))
    }
}
