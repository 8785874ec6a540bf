use glam::{DVec3, Quat};

use super::*;
use crate::medium::noise::{Noise, NoiseSettings};
use crate::random::Stream;

const SETTINGS: NoiseSettings = NoiseSettings {
    kind: crate::medium::NoiseKind::Perlin,
    position: 0.5,
    density: 0.6,
    octaves: 2,
    scale: 0.4,
    anchor: Vec3::ZERO,
    detail: 1.0,
    seed: 5,
};
const LIFE: usize = 20;

/// Places in a ball of radius 1.
fn ball(count: usize, seed: u64) -> Vec<Vec3> {
    let mut stream = Stream::new(seed, 0);
    (0..count).map(|_| stream.direction() * stream.unit().cbrt()).collect()
}

fn positions(places: &[Vec3]) -> Positions {
    let column = |axis: usize| places.iter().map(|it| it[axis]).collect();
    Positions::from_offsets(DVec3::ZERO, [0, 1, 2].map(column))
}

/// The noise of a frame where particles, which were at `places`, are in a frame where `path` takes them.
fn advected(places: &[Vec3], frame: usize, path: impl Fn(Vec3, usize) -> Vec3) -> Noise {
    let phases = Schedule::new(LIFE).unwrap().phases(frame);
    let there: Vec<Vec3> = places.iter().map(|&it| path(it, frame)).collect();
    let moved = phases.map(|phase| {
        let way = |&it: &Vec3| Moved { by: path(it, frame) - path(it, phase.rest), trust: 1.0 };
        places.iter().map(way).collect()
    });
    let advection = Advection::by_ways(&positions(&there), SETTINGS.scale, phases, moved).unwrap();
    Noise::new(SETTINGS).unwrap().advected(advection)
}

/// How far the noise is off, within so far from the middle, from the one before anything moved, where that has been taken along by `turn` and then
/// `shift`.
fn off(noise: &Noise, radius: f32, turn: Quat, shift: Vec3) -> f32 {
    let before = Noise::new(SETTINGS).unwrap();
    let inner = ball(300, 2).into_iter().map(|it| radius * it);
    let off = inner.map(|at| {
        let (place, factor) = before.disperse(at, 0.0);
        let (found, other) = noise.disperse(turn * at + shift, 0.0);
        (turn * place + shift).distance(found).max((factor - other).abs())
    });
    off.fold(0.0, f32::max)
}

#[test]
fn what_moves_and_turns_as_a_whole_takes_its_noise_along_for_ever() {
    let places = ball(3000, 1);
    for frame in [10, 57] {
        let along = |frame: usize| Vec3::new(0.3, 0.02, -0.1) * frame as f32;
        let noise = advected(&places, frame, |at, frame| at + along(frame));
        let found = off(&noise, 0.75, Quat::IDENTITY, along(frame));
        assert!(found < 2e-4, "frame {frame}: {found}");

        let turn = |frame: usize| Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.07 * frame as f32);
        let noise = advected(&places, frame, |at, frame| turn(frame) * at + along(frame));
        let found = off(&noise, 0.75, turn(frame), along(frame));
        assert!(found < 0.05, "frame {frame}: {found}");
    }
    // One that stands in space is as far off as any two noises.
    let along = Vec3::new(0.3, 0.02, -0.1) * 10.0;
    assert!(off(&Noise::new(SETTINGS).unwrap(), 0.75, Quat::IDENTITY, along) > 0.5);
}

#[test]
fn what_rests_has_the_noise_of_one_picture_to_the_bit() {
    let places = ball(500, 3);
    let before = Noise::new(SETTINGS).unwrap();
    let frames = [0, 7, 33].map(|frame| advected(&places, frame, |at, _| at));
    let at_rest = vec![Vec3::ZERO; places.len()];
    let phases = Schedule::new(LIFE).unwrap().phases(12);
    let by_velocities =
        Advection::by_velocities(&positions(&places), SETTINGS.scale, phases, &at_rest, [12.0, 12.0, 2.0]);
    let by_velocities = before.clone().advected(by_velocities.unwrap());
    for at in ball(500, 4).into_iter().map(|it| 1.3 * it) {
        let wanted = before.disperse(at, 0.0);
        assert!(frames.iter().chain([&by_velocities]).all(|it| it.disperse(at, 0.0) == wanted), "{at}");
    }
}

/// A whirl that turns faster inside: in some frames nothing is left of what was side by side.
fn whirl(at: Vec3, frame: usize) -> Vec3 {
    Quat::from_rotation_z(frame as f32 * (0.5 + 0.1 * (1.2 - at.truncate().length()))) * at
}

#[test]
fn what_is_stirred_keeps_mean_and_contrast_and_changes_little_from_frame_to_frame() {
    let places = ball(4000, 5);
    let before = Noise::new(SETTINGS).unwrap();
    let probes: Vec<Vec3> = ball(1500, 6).into_iter().map(|it| 0.9 * it).collect();
    let factors = |noise: &Noise, frame: usize| -> Vec<f32> {
        probes.iter().map(|&it| noise.disperse(whirl(it, frame), 0.0).1).collect()
    };
    let mean = |all: &[f32]| all.iter().sum::<f32>() / all.len() as f32;
    let deviation = |all: &[f32]| {
        let mean = mean(all);
        (all.iter().map(|it| (it - mean).powi(2)).sum::<f32>() / all.len() as f32).sqrt()
    };
    let usual = deviation(&factors(&before, 0));
    let mut last: Option<[Vec<f32>; 2]> = None;
    // Over a time in which both phases that take turns begin anew.
    for frame in [29, 30, 31, 39, 40, 41] {
        let noise = advected(&places, frame, whirl);
        let found = [factors(&noise, frame), factors(&before, frame)];
        let (mean, contrast) = (mean(&found[0]), deviation(&found[0]) / usual);
        assert!((mean - 1.0).abs() < 0.05, "frame {frame}: {mean}");
        assert!((contrast - 1.0).abs() < 0.15, "frame {frame}: {contrast}");
        if let Some(last) = &last {
            let change = |now: &[f32], before: &[f32]| {
                let squares = now.iter().zip(before).map(|(a, b)| (a - b).powi(2));
                (squares.sum::<f32>() / now.len() as f32).sqrt() / usual
            };
            let [moved, standing] = [0, 1].map(|it| change(&found[it], &last[it]));
            assert!(moved < 0.6 && moved < 0.6 * standing, "frame {frame}: {moved} {standing}");
        }
        last = [29, 30, 39, 40].contains(&frame).then_some(found).or(None);
    }
}

#[test]
fn velocities_lead_back_along_their_streamlines() {
    let places = ball(2500, 7);
    let spin = Vec3::new(0.3, -0.2, 0.5);
    let velocities: Vec<Vec3> = places.iter().map(|it| spin.cross(*it)).collect();
    let phases = Schedule::new(LIFE).unwrap().phases(4);
    for age in [0.5, 3.0] {
        let ages = [age; PHASES];
        let advection =
            Advection::by_velocities(&positions(&places), 0.5 * SETTINGS.scale, phases, &velocities, ages);
        let noise = Noise::new(SETTINGS).unwrap().advected(advection.unwrap());
        let turn = Quat::from_scaled_axis(spin * age);
        let found = off(&noise, 0.5, turn, Vec3::ZERO);
        assert!(found < 0.1, "age {age}: {found}");
    }
}

#[test]
fn where_nothing_is_known_there_is_noise_all_the_same() {
    let places = ball(200, 8);
    let phases = Schedule::new(LIFE).unwrap().phases(13);
    let unknown = phases.map(|_| vec![Moved::UNKNOWN; places.len()]);
    let advection = Advection::by_ways(&positions(&places), SETTINGS.scale, phases, unknown).unwrap();
    let noise = Noise::new(SETTINGS).unwrap().advected(advection);
    let factors: Vec<f32> = ball(1000, 9).into_iter().map(|it| noise.disperse(it, 0.0).1).collect();
    assert!(factors.iter().all(|it| it.is_finite()) && factors.iter().any(|it| (it - 1.0).abs() > 0.2));

    let none = phases.map(|_| Vec::new());
    assert!(Advection::by_ways(&positions(&[]), 1.0, phases, none.clone()).is_err());
    assert!(Advection::by_ways(&positions(&places), 1.0, phases, none.clone()).is_err());
    assert!(Advection::by_ways(&positions(&places), 0.0, phases, none).is_err());
    assert!(Schedule::new(1).is_err());
}

#[test]
fn phases_take_turns() {
    let schedule = Schedule::new(9).unwrap();
    for frame in 0..40 {
        let [first, older, younger] = schedule.phases(frame);
        assert_eq!((first.rest, first.number), (0, 0));
        assert!((older.share + younger.share - 1.0).abs() < 1e-6 && older.number + 1 == younger.number);
        assert!(younger.rest <= frame && frame - older.rest < 10);
        let [_, after, _] = schedule.phases(frame + 5);
        assert_eq!((after.rest, after.number), (younger.rest, younger.number));
    }
    assert_eq!(
        [0, 5].map(|frame| schedule.phases(frame)[2].share),
        [0.0; 2],
        "what comes in begins at nothing"
    );
}
