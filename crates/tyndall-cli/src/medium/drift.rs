//! How the noise of a sequence goes with its particles.
//!
//! Takes the frames one by one, reads the others in which the phases of the noise rest, and keeps of these what is needed again. What a frame's noise
//! is like does not depend on which frames came before it.

use std::collections::BTreeMap;

use tyndall::Particles;
use tyndall::medium::noise::advection::{Advection, PHASES, Phase, Schedule};
use tyndall::medium::noise::moved::{ID_NAMES, Moved, Rest, have_ids};
use tyndall::scene::motion::velocities;
use tyndall::scene::wanted::Wanted;
use tyndall::{Error, Vec3};
use tyndall_io::Sequence;

use super::values::NoiseMotion;
use super::{Job, Scene, args};
use crate::input;
use crate::report::Outcome;

/// Nodes of the motion's lattice along the longest side of a medium, at most.
const NODES: f32 = 64.0;
/// What velocities may be called; any name of one means that which the file has.
const VELOCITY: &str = "v";
/// Attributes that a velocity may be found in.
const VELOCITY_NAMES: [&str; 14] = [
    "v",
    "vel",
    "velocity",
    "velocities",
    "u",
    "vx",
    "vy",
    "vz",
    "velocity_x",
    "velocity_y",
    "velocity_z",
    "v_x",
    "v_y",
    "v_z",
];

/// What decides how the noise goes.
#[derive(Clone)]
enum How {
    /// It stands in space.
    Stands,
    Ids(Option<String>),
    Velocities(String),
}

/// The noise of a sequence.
pub(super) struct Drift<'a> {
    job: &'a Job<'a>,
    sequence: &'a Sequence,
    schedule: Schedule,
    /// What the first frame decided.
    how: Option<How>,
    /// By frame where its particles rest.
    rests: BTreeMap<usize, Rest>,
    /// The time from frame to frame, if it has been looked for; none where frames tell none.
    frame_time: Option<Option<f64>>,
}

impl<'a> Drift<'a> {
    /// Nothing has moved yet.
    pub(super) fn new(job: &'a Job<'a>, sequence: &'a Sequence) -> Outcome<Self> {
        let schedule = Schedule::new(job.args.medium.noise_life as usize)?;
        Ok(Self { job, sequence, schedule, how: None, rests: BTreeMap::new(), frame_time: None })
    }

    /// Adds the attributes that are looked at.
    pub(super) fn want(args: &args::Medium, wanted: &mut Wanted) {
        match &args.noise_motion {
            NoiseMotion::None => {}
            NoiseMotion::Ids(Some(name)) if !name.eq_ignore_ascii_case("index") => {
                wanted.one_of.push(vec![name.clone()]);
            }
            NoiseMotion::Velocities(Some(name)) => wanted.vectors.push(name.clone()),
            NoiseMotion::Auto | NoiseMotion::Ids(_) | NoiseMotion::Velocities(None) => {
                wanted.optional.extend(ID_NAMES.iter().chain(&VELOCITY_NAMES).map(ToString::to_string));
            }
        }
    }

    /// How the noise of a frame has gone with its particles, if it has, and what is to be said about it. `None` without noise or a sequence.
    pub(super) fn advection(
        &mut self,
        frame: usize,
        particles: &Particles,
        scene: &Scene,
    ) -> Outcome<Option<(Option<Advection>, String)>> {
        let Some(noise) = scene.noise.filter(|_| self.sequence.len() > 1) else { return Ok(None) };
        let how = match &self.how {
            Some(how) => how.clone(),
            None => {
                let decided = self.decide(particles)?;
                self.how.insert(decided).clone()
            }
        };
        let extent = scene.lattice.spacing * scene.lattice.size.iter().max().copied().unwrap_or(1) as f32;
        let spacing = noise.scale.max(extent / NODES);
        let phases = self.schedule.phases(frame);
        let positions = particles.positions();
        Ok(Some(match how {
            How::Stands => (None, "noise stands in space".to_string()),
            How::Ids(name) => {
                let mut moved: [Vec<Moved>; PHASES] = Default::default();
                for (moved, phase) in moved.iter_mut().zip(&phases) {
                    *moved = self.moved((frame, particles), phase, name.as_deref(), scene)?;
                }
                let advection = Advection::by_ways(positions, spacing, phases, moved)?;
                (Some(advection), "noise goes with the particles, by id".to_string())
            }
            How::Velocities(name) => {
                let velocities = velocities(particles, "--noise-motion", &name)?;
                let Some(time) = self.frame_time()? else {
                    let allowed =
                        "the time between frames, in the unit of the velocities: the frames tell none";
                    return Err(Error::setting("--noise-frame-time", "nothing", allowed).into());
                };
                let ages = phases.map(|phase| ((frame - phase.rest) as f64 * time) as f32);
                let advection = Advection::by_velocities(positions, spacing, phases, &velocities, ages)?;
                (Some(advection), "noise goes with the particles, by velocity".to_string())
            }
        }))
    }

    /// How the noise goes, by what is asked for and what the particles have.
    fn decide(&mut self, particles: &Particles) -> Outcome<How> {
        Ok(match &self.job.args.medium.noise_motion {
            NoiseMotion::None => How::Stands,
            NoiseMotion::Ids(name) => {
                // Ids that are not there are told of the first frame, in which nothing has moved yet.
                Rest::new(particles, name.as_deref())?;
                How::Ids(name.clone())
            }
            NoiseMotion::Velocities(name) => How::Velocities(name.as_deref().unwrap_or(VELOCITY).to_string()),
            NoiseMotion::Auto if have_ids(particles) => How::Ids(None),
            NoiseMotion::Auto => {
                let are_there = velocities(particles, "--noise-motion", VELOCITY).is_ok();
                match are_there && self.frame_time()?.is_some() {
                    true => How::Velocities(VELOCITY.into()),
                    false => How::Stands,
                }
            }
        })
    }

    /// What particles of a frame have moved since the frame in which a phase rests. Those that were not there yet came by their velocity, if they
    /// have one, since the phases began that take turns; the first is too long ago for that.
    fn moved(
        &mut self,
        (frame, particles): (usize, &Particles),
        phase: &Phase,
        name: Option<&str>,
        scene: &Scene,
    ) -> Outcome<Vec<Moved>> {
        if phase.rest == frame {
            return Ok(vec![Moved { by: Vec3::ZERO, trust: 1.0 }; particles.len()]);
        }
        if !self.rests.contains_key(&phase.rest) {
            let resting = self.read(phase.rest)?.measured_from(scene.origin);
            // The first frame, and those of the two phases that take turns.
            self.rests.retain(|&rest, _| {
                rest == 0 || rest + self.job.args.medium.noise_life as usize + 2 > frame && rest < frame
            });
            self.rests.insert(phase.rest, Rest::new(&resting, name)?);
        }
        let mut moved = self.rests[&phase.rest].moved(particles, name)?;
        if phase.number > 0
            && moved.contains(&Moved::UNKNOWN)
            && let Ok(velocities) = velocities(particles, "--noise-motion", VELOCITY)
            && let Some(time) = self.frame_time()?
        {
            let age = ((frame - phase.rest) as f64 * time) as f32;
            for (moved, velocity) in moved.iter_mut().zip(velocities) {
                if *moved == Moved::UNKNOWN {
                    *moved = Moved { by: age * velocity, trust: 1.0 };
                }
            }
        }
        Ok(moved)
    }

    /// The particles of another frame, where they are wanted.
    fn read(&self, frame: usize) -> Outcome<Particles> {
        let found = self.sequence.frame(frame, self.job.report.progress())?;
        Ok(input::place(found, &self.job.args.input)?.0.particles)
    }

    /// The time from frame to frame, in the unit of velocities: as it is given, or that between the first two frames. `None` where they do not tell it,
    /// or tell steps or a scale factor.
    fn frame_time(&mut self) -> Outcome<Option<f64>> {
        if let Some(time) = self.job.args.medium.noise_frame_time {
            return Ok(Some(time.into()));
        }
        if let Some(found) = self.frame_time {
            return Ok(found);
        }
        let [first, second] = [self.read(0)?, self.read(1)?];
        let is_time = !matches!(first.time_unit(), Some("step" | "a"));
        let between = first.time().zip(second.time()).map(|(first, second)| second - first);
        Ok(*self.frame_time.insert(between.filter(|it| is_time && *it > 0.0 && it.is_finite())))
    }
}
