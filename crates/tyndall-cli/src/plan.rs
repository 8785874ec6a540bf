//! Which pictures are to be made: which frames, seen from where, in which files.

use std::path::PathBuf;

use tyndall::Error;

use crate::args;
use crate::output::Pattern;
use crate::report::{Failure, Outcome, Report};
use crate::values::{Degrees, frame as frame_number};

/// One picture to be made.
pub(crate) struct Picture {
    pub(crate) frame: usize,
    pub(crate) path: PathBuf,
    /// By how much the camera is turned, in radians.
    pub(crate) turn: f64,
}

/// Which of `count` frames go to which files, in order. A picture's number is that of its frame, or its place in an orbit.
pub(crate) fn pictures(
    args: &args::Render,
    pattern: &Pattern,
    count: usize,
    report: &Report,
) -> Outcome<Vec<Picture>> {
    let args::Frames { frame, frames, orbit, frame_count, .. } = &args.frames;
    let chosen = match (frame, frames) {
        (Some(number), _) => vec![frame_number(*number, count)?],
        (None, Some(slice)) => slice.of(count),
        (None, None) if pattern.is_numbered() => (0..count).collect(),
        (None, None) => vec![0],
    };
    if chosen.is_empty() {
        let allowed = format!("it takes none of the frames 0 to {}", count - 1);
        return Err(Failure::Usage(format!("--frames takes no frame — {allowed}")));
    }
    if frame.is_none() && frames.is_none() && !pattern.is_numbered() && count > 1 {
        report.note(format_args!(
            "note: frame 0 of {count}; --frame N for another, -o NAME.%04d.png for all of them"
        ));
    }

    // An orbit around one frame has as many pictures as are asked for.
    let around_one = chosen.len() == 1 && frame_count.is_some();
    if frame_count.is_some() && chosen.len() > 1 {
        return Err(Failure::Usage(format!(
            "--frame-count is for an orbit around one frame, here are {} — leave it out, or give --frame N",
            chosen.len()
        )));
    }
    let pictures = if around_one { frame_count.unwrap_or(1) as usize } else { chosen.len() };
    if orbit.is_some() && pictures == 1 {
        return Err(Failure::Usage(
            "--orbit needs several pictures — give --frame-count N and -o NAME.%04d.png".into(),
        ));
    }
    if pictures > 1 && !pattern.is_numbered() {
        let path = args.picture.output.display();
        let allowed = format!("{pictures} pictures need a number in the name, such as NAME.%04d.png");
        return Err(Error::setting("-o", path, allowed).into());
    }
    let angle = orbit.map_or(0.0, |Degrees(degrees)| degrees.to_radians());
    let picture = |place: usize| {
        let frame = if around_one { chosen[0] } else { chosen[place] };
        let path = pattern.name(if around_one { place } else { frame });
        Picture { frame, path, turn: angle * place as f64 / pictures as f64 }
    };
    Ok((0..pictures).map(picture).collect())
}
