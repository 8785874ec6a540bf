//! `--frame-sequence`: what a sequence shows from its first frame to its last, looked at before there are pictures.

use tyndall::Particles;
use tyndall::scene::camera::Camera;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::share_in_view;
use tyndall_io::{Frame, Sequence};

use crate::args::Render;
use crate::input;
use crate::report::{Failure, Outcome, Report};

/// At most so many frames stand for all.
const FRAMES: usize = 16;
/// A frame with less of its particles in view than this is told of.
const MOST: f64 = 0.9;

/// What `of_frame` finds in the frames that stand for a sequence of `count`, if all of it is framed: evenly spread from the first to the last, whichever of them become pictures,
/// so that several runs agree. Frames in which nothing is shown are passed over.
pub(crate) fn of<T>(
    args: &Render,
    count: usize,
    of_frame: impl FnMut(usize) -> Outcome<T>,
) -> Outcome<Vec<T>> {
    let chosen = if args.camera.frame_sequence && count > 1 { FRAMES.min(count) } else { 0 };
    let numbers = (0..chosen).map(|place| place * (count - 1) / (chosen - 1));
    numbers.map(of_frame).filter(|found| !matches!(found, Err(Failure::Unseen(_)))).collect()
}

/// Reads such a frame, of which nothing is said.
pub(crate) fn read(sequence: &Sequence, number: usize, args: &Render, report: &Report) -> Outcome<Frame> {
    let frame = sequence.frame(number, report.progress())?;
    Ok(input::place(frame, &args.input)?.0)
}

/// What is framed, and how that was found: of a picture's frame, or of the centers in the frames that stand for the sequence, around which there is that radius.
pub(crate) fn framed(own: (Outline, String), surveyed: &[Outline], radius: f64) -> (Outline, String) {
    if surveyed.is_empty() {
        return own;
    }
    let grown: Vec<Outline> = surveyed.iter().map(|it| it.grown(radius)).collect();
    (Outline::joined(&grown), "framed on the whole sequence".into())
}

/// Warns of a frame of which much is out of view of a camera that was framed on all of another one.
pub(crate) fn warn(args: &Render, particles: &Particles, camera: &Camera, report: &Report) -> Outcome<()> {
    let said = &args.camera;
    let is_framed = said.eye.is_none()
        && said.look_at.is_none()
        && said.cameras.is_empty()
        && said.ortho.is_none_or(|ortho| ortho.0.is_none())
        && args.input.center.is_none();
    if !is_framed || said.frame_shown || said.frame_sequence {
        return Ok(());
    }
    let [width, height] = args.picture.pixels();
    let view = camera.view(particles.positions().origin(), width, height)?;
    if share_in_view(particles, &view) < MOST {
        report.warn("later frames reach out of the picture, which is framed on the first one (--frame-sequence to see all)");
    }
    Ok(())
}
