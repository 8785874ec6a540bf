//! Which pictures are to be made: which frames, seen from where, in which files.

use std::path::PathBuf;

use tyndall::Error;
use tyndall::scene::camera::Camera;
use tyndall::scene::camera_path::CameraPath;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::Viewpoint;
use tyndall_io::read::{TimeCode, UsdCamera};
use tyndall_io::write::movie;

use crate::args;
use crate::camera::of_stage;
use crate::looks;
use crate::names::Numbers;
use crate::output::Pattern;
use crate::report::{Failure, Outcome, Report, counted};
use crate::scene::Again;
use crate::values::Degrees;

/// One picture to be made.
pub(crate) struct Picture {
    pub(crate) frame: usize,
    /// The file that it goes to.
    pub(crate) path: PathBuf,
    /// What that file would be called among all pictures that are asked for: another name only of a picture that is made anew.
    pub(crate) name: PathBuf,
    shot: Shot,
    /// Whether it is not to be made, but belongs to those that are asked for.
    is_left: bool,
}

/// Where the camera is.
enum Shot {
    /// Turned by so many radians.
    Turned(f64),
    /// At this place of its path.
    At(f64),
    /// That of a stage.
    Stage(UsdCamera),
}

impl Picture {
    /// Whether it is to be made.
    fn is_wanted(&self, skip_existing: bool) -> bool {
        !(self.is_left || skip_existing && self.path.exists())
    }

    /// Its camera, where `camera` and `outline` are those of the first frame.
    pub(crate) fn camera(
        &self,
        args: &args::Render,
        viewpoint: &Viewpoint,
        (camera, outline): (&Camera, &Outline),
    ) -> Outcome<Camera> {
        Ok(match &self.shot {
            Shot::Turned(angle) => viewpoint.turned(camera, outline, *angle),
            Shot::At(place) => CameraPath::new(args.camera.keys())?.camera(*place, camera),
            Shot::Stage(found) => {
                let [width, height] = args.picture.pixels().map(f64::from);
                of_stage(found, width / height, outline)
            }
        })
    }

    /// The radius of its camera's lens, if a stage says so.
    pub(crate) fn lens(&self) -> Option<f64> {
        if let Shot::Stage(found) = &self.shot { found.lens } else { None }
    }
}

/// Which frames go to which files, in order. A picture's number is that of its frame, or its place in an orbit.
pub(crate) fn pictures(
    args: &args::Render,
    pattern: &Pattern,
    numbers: &Numbers,
    report: &Report,
) -> Outcome<Vec<Picture>> {
    let args::Frames { frame, frames, orbit, frame_count, .. } = &args.frames;
    let takes_all = pattern.is_numbered() || movie::is_movie(&args.picture.output);
    let chosen = numbers.chosen(*frame, frames.as_ref(), takes_all)?;
    let count = numbers.count();
    if frame.is_none() && frames.is_none() && !takes_all && count > 1 {
        report.note(format_args!(
            "note: frame {} of {count}; --frame N for another, -o NAME.%04d.png or NAME.mp4 for all of them",
            numbers.number(0)
        ));
    }

    let stage = args.camera.stage()?;
    let keys = CameraPath::new(args.camera.keys())?;
    let has_keys = keys.len() > 0;
    // Around one frame there are as many pictures as are asked for, or as its cameras make.
    let of_cameras = match keys.moves() {
        true => (has_keys && frame_count.is_none()).then(|| keys.end().max(0.0).floor() as usize + 1),
        false => Some(keys.len()).filter(|&count| count > 1),
    };
    let around_one = (chosen.len() == 1).then(|| of_cameras.or(frame_count.map(|it| it as usize))).flatten();
    if frame_count.is_some() && orbit.is_none() && !(has_keys && keys.moves()) && stage.is_none() {
        let text = "--frame-count is for a camera that moves — give --orbit DEGREES, or --camera with at=PICTURE or a stage";
        return Err(Failure::Usage(text.into()));
    }
    if frame_count.is_some() && chosen.len() > 1 {
        return Err(Failure::Usage(format!(
            "--frame-count is for pictures of one frame, here are {} — leave it out, or give --frame N",
            chosen.len()
        )));
    }
    if chosen.len() > 1 && !keys.moves() && keys.len() > 1 {
        return Err(Failure::Usage(format!(
            "several --camera are pictures of one frame, here are {} — give --frame N, or at=PICTURE for a camera that moves",
            chosen.len()
        )));
    }
    let pictures = around_one.unwrap_or(chosen.len());
    if orbit.is_some() && pictures == 1 {
        return Err(Failure::Usage(
            "--orbit needs several pictures — give --frame-count N and -o NAME.%04d.png or NAME.mp4".into(),
        ));
    }
    if pictures > 1 && !takes_all {
        let path = args.picture.output.display();
        let allowed = format!(
            "{pictures} pictures need a number in the name, such as NAME.%04d.png, or a movie: NAME.mp4"
        );
        return Err(Error::setting("-o", path, allowed).into());
    }
    let angle = orbit.map_or(0.0, |Degrees(degrees)| degrees.to_radians());
    let picture = |place: usize| {
        let is_one = around_one.is_some();
        let frame = if is_one { chosen[0] } else { chosen[place] };
        let turned = Shot::Turned(angle * place as f64 / pictures as f64);
        // One camera is that of all frames.
        let key = if keys.moves() || is_one { place } else { 0 };
        let shot = if has_keys { Shot::At(key as f64) } else { turned };
        let name = pattern.name(if is_one { place } else { numbers.number(frame) });
        Picture { frame, path: name.clone(), name, shot, is_left: false }
    };
    let mut pictures: Vec<Picture> = (0..pictures).map(picture).collect();
    if let Some(stage) = stage {
        // Pictures of one frame go on from its time.
        let time = |(place, picture): (usize, &Picture)| {
            let later = if around_one.is_some() { place as f64 } else { 0.0 };
            numbers.time_code(picture.frame).later(later)
        };
        let times: Vec<TimeCode> = pictures.iter().enumerate().map(time).collect();
        let cameras = stage.at(&times)?;
        let is_left_out = args.look.aperture.is_none() && !looks::has_lens_of_stage(args);
        if is_left_out && cameras.iter().any(|it| it.lens.is_some()) {
            report.note(
                "note: the fStop of the camera is left out: only pictures of spheres by paths, such as --look matte, have a lens of its own",
            );
        }
        pictures.iter_mut().zip(cameras).for_each(|(picture, camera)| picture.shot = Shot::Stage(camera));
    }
    if let Some(Again { name, to }) = &args.origin.again {
        let mut is_found = false;
        for picture in &mut pictures {
            picture.is_left = picture.name != *name || is_found;
            if !picture.is_left {
                (picture.path, is_found) = (to.clone(), true);
            }
        }
        if !is_found {
            let text = format!(
                "--again: {} is none of the pictures that are asked for — leave out --frame and --frames",
                name.display()
            );
            return Err(Failure::Usage(text));
        }
    }
    Ok(pictures)
}

/// The frames that [`each_frame`] will read, in order.
pub(crate) fn frames_to_read(pictures: &[Picture], skip_existing: bool) -> Vec<usize> {
    let first = pictures.first().map(|it| it.frame);
    let missing = pictures.iter().filter(|it| it.is_wanted(skip_existing)).map(|it| it.frame);
    let mut frames: Vec<usize> = first.into_iter().chain(missing).collect();
    frames.dedup();
    frames
}

/// Makes the pictures frame by frame with `of_frame`, and counts what failed: a frame that fails does not stop the others.
///
/// `of_frame` gets the frame, its pictures, what it keeps of the first frame, and how many pictures were written, to which it adds.
/// With `skip_existing` pictures that are there are left; the first frame is read even then, without pictures: what is guessed from it
/// must not change.
pub(crate) fn each_frame<K>(
    pictures: &[Picture],
    skip_existing: bool,
    report: &Report,
    mut of_frame: impl FnMut(usize, &[&Picture], &mut Option<K>, &mut usize) -> Outcome<()>,
) -> Outcome<()> {
    let (mut written, mut skipped, mut failures) = (0, 0, Vec::new());
    let mut kept: Option<K> = None;
    let mut left = pictures;
    while let Some(first) = left.first() {
        // Pictures of one frame follow each other: it is read once.
        let same = left.iter().take_while(|it| it.frame == first.frame).count();
        let (now, later) = left.split_at(same);
        left = later;
        let wanted: Vec<&Picture> = now.iter().filter(|it| it.is_wanted(skip_existing)).collect();
        skipped += now.iter().filter(|it| !it.is_left && !it.is_wanted(skip_existing)).count();
        if wanted.is_empty() && (kept.is_some() || left.is_empty()) {
            continue;
        }
        match of_frame(first.frame, &wanted, &mut kept, &mut written) {
            Ok(()) => {}
            Err(Failure::Interrupted(_)) => {
                let text = format!("{written} of {} pictures written", pictures.len() - skipped);
                return Err(Failure::Interrupted(text));
            }
            Err(failure @ Failure::Library(Error::Memory { .. })) => return Err(failure),
            // What the first frame does not have would be told of all.
            Err(failure @ Failure::Library(Error::Setting { .. })) if kept.is_none() => return Err(failure),
            Err(failure) if pictures.len() == 1 => return Err(failure),
            Err(failure) => {
                report.error(&failure);
                failures.push((first.frame, wanted.len().max(1), failure));
            }
        }
    }
    if skipped > 0 {
        report.note(format_args!("note: {} there already", counted(skipped, "picture")));
    }
    let Some((frame, _, first)) = failures.first() else { return Ok(()) };
    let failed: usize = failures.iter().map(|(_, count, _)| count).sum();
    let text = format!(
        "{failed} of {} pictures failed, {written} were written (first failure: frame {frame})",
        pictures.len()
    );
    if written + skipped == 0 && failures.iter().all(|(_, _, it)| it.code() == first.code()) {
        // Nothing was achieved: the reason counts, not that it came often.
        report.note(format_args!("{text}"));
        return Err(failures.swap_remove(0).2);
    }
    Err(Failure::Partial(text))
}
