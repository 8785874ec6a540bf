//! Where the camera is: flags, keys of a camera that moves, and the camera of a USD stage.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use glam::DVec3;
use tyndall::Error;
use tyndall::scene::automatic::Outliers;
use tyndall::scene::camera::Camera;
use tyndall::scene::camera_path::Key;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::Side;
use tyndall_io::read::{TimeCode, UsdCamera, usd_cameras};

use crate::report::{Failure, Outcome};
use crate::values::{Degrees, Ortho, direction, point};

/// Where the camera is.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Side to look from: x y z -x -y -z iso [default: from (2, 1.3, 1)]
    #[arg(
        long,
        visible_alias = "axis",
        value_name = "SIDE",
        allow_hyphen_values = true,
        conflicts_with = "eye"
    )]
    pub(crate) view: Option<Side>,
    /// Where the camera stands, in the file's coordinates
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point)]
    pub(crate) eye: Option<DVec3>,
    /// What it looks at [default: the middle of the particles]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point)]
    pub(crate) look_at: Option<DVec3>,
    /// Which direction is up in the picture: an axis, such as y or -z, or X,Y,Z [default: z]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = direction)]
    pub(crate) up: Option<DVec3>,
    /// A camera: 'at=48 eye=1,2,3 look-at=0,0,0 up=0,0,1 fov=30' or 'ortho=10' for fov, 'move=straight' for a straight way to the next; what is left out
    /// is as without. May be repeated: with at=PICTURE the camera moves from one to the next, without each is a picture of its own. Or the camera of a USD stage in text
    /// form, shot.usda:/world/cam, or shot.usda if it has only one, in the particles' coordinates: at the time code that is the number in a file's name, else the
    /// frame's, counted from startTimeCode. Its horizontal aperture is the picture's width; clippingRange is not used, nor fStop but where a look is traced
    #[arg(long = "camera", value_name = "KEY|STAGE", allow_hyphen_values = true)]
    pub(crate) cameras: Vec<CameraSpec>,
    /// Vertical angle of view, in degrees [default: 35]
    #[arg(long, value_name = "DEGREES", conflicts_with = "ortho", allow_hyphen_values = true)]
    pub(crate) fov: Option<Degrees>,
    /// Horizontal angle of view, in degrees
    #[arg(long, value_name = "DEGREES", conflicts_with_all = ["ortho", "fov"], allow_hyphen_values = true)]
    pub(crate) horizontal_fov: Option<Degrees>,
    /// Parallel rays; the height of what the picture shows, or auto
    #[arg(long, value_name = "HEIGHT", allow_hyphen_values = true)]
    pub(crate) ortho: Option<Ortho>,
    /// All around the eye (equirectangular): twice as wide as high shows everything. Without --eye from the middle of the particles
    #[arg(long, conflicts_with_all = ["ortho", "fov", "horizontal_fov"])]
    pub(crate) panorama: bool,
    /// Frames far outliers too
    #[arg(long)]
    pub(crate) frame_all: bool,
    /// Frames what --filter, --select, --clip and --cut leave of the first frame, instead of all particles; media and maps frame what is kept in any case
    #[arg(long)]
    pub(crate) frame_shown: bool,
    /// Frames what a sequence shows from its first frame to its last, instead of the first of its pictures: looks at up to 16 frames beforehand. With --fixed-range colors
    /// have the range of these, too (of maps that of the first picture)
    #[arg(long)]
    pub(crate) frame_sequence: bool,
}

/// One value of `--camera`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CameraSpec {
    Key(Key),
    Stage(StageCamera),
}

/// A camera of a USD file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StageCamera {
    pub(crate) file: PathBuf,
    /// The path of its prim; none for the only one.
    prim: Option<String>,
}

impl FromStr for CameraSpec {
    type Err = Error;

    /// Reads `shot.usda`, `shot.usda:/world/cam`, or a key: see [`Key`].
    fn from_str(text: &str) -> tyndall::Result<Self> {
        match parts(text) {
            Some((file, prim)) => {
                let prim = prim.map(String::from).filter(|it| !it.is_empty());
                Ok(Self::Stage(StageCamera { file: file.into(), prim }))
            }
            None if !text.contains('=') && !text.trim().is_empty() => {
                let allowed = "a camera is words such as 'eye=1,2,3 look-at=0,0,0 fov=30', or of a USD stage: FILE.usda:/PATH";
                Err(Error::setting("--camera", text, allowed))
            }
            None => text.parse().map(Self::Key),
        }
    }
}

/// The file and the prim of a text that names a USD file, if it does: words of keys have a `=`, and paths of prims no dots.
fn parts(text: &str) -> Option<(&str, Option<&str>)> {
    let end = text.to_ascii_lowercase().rfind(".usd").filter(|_| !text.contains('='))?;
    match text[end..].find(':') {
        Some(colon) => Some((&text[..end + colon], Some(&text[end + colon + 1..]))),
        None => Some((text, None)),
    }
}

/// A text of `--camera`, of which a file that it names is where `place` puts it.
pub(crate) fn with_file(text: &str, place: impl Fn(&Path) -> String) -> String {
    match parts(text) {
        Some((file, Some(prim))) => format!("{}:{prim}", place(Path::new(file))),
        Some((file, None)) => place(Path::new(file)),
        None => text.into(),
    }
}

impl CameraArgs {
    /// Whether far outliers are framed.
    pub(crate) fn outliers(&self) -> Outliers {
        if self.frame_all { Outliers::Shown } else { Outliers::Left }
    }

    /// The keys that are given.
    pub(crate) fn keys(&self) -> Vec<Key> {
        let key = |spec: &CameraSpec| match spec {
            CameraSpec::Key(key) => Some(key.clone()),
            CameraSpec::Stage(_) => None,
        };
        self.cameras.iter().filter_map(key).collect()
    }

    /// The camera of a stage, if one is given. Fails if others are given too.
    pub(crate) fn stage(&self) -> Outcome<Option<&StageCamera>> {
        let found = self.cameras.iter().find_map(|spec| match spec {
            CameraSpec::Stage(stage) => Some(stage),
            CameraSpec::Key(_) => None,
        });
        let Some(stage) = found else { return Ok(None) };
        let others = [
            (self.cameras.len() > 1, "another --camera"),
            (self.view.is_some(), "--view"),
            (self.eye.is_some(), "--eye"),
            (self.look_at.is_some(), "--look-at"),
            (self.fov.is_some(), "--fov"),
            (self.horizontal_fov.is_some(), "--horizontal-fov"),
            (self.ortho.is_some(), "--ortho"),
            (self.panorama, "--panorama"),
        ];
        match others.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, name)) => Err(Failure::Usage(format!(
                "{name} is not for the camera of {}, which says all of that — leave out one of them",
                stage.file.display()
            ))),
            None => Ok(Some(stage)),
        }
    }

    /// What pictures are seen by, if that is neither guessed nor said by other flags.
    pub(crate) fn described(&self) -> Option<String> {
        self.cameras.iter().find_map(|spec| match spec {
            CameraSpec::Stage(StageCamera { file, prim }) => {
                let prim = prim.as_ref().map_or(String::new(), |prim| format!("{prim} "));
                Some(format!("camera {prim}of {}", file.display()))
            }
            CameraSpec::Key(_) => None,
        })
    }
}

impl StageCamera {
    /// It at each of some times.
    pub(crate) fn at(&self, times: &[TimeCode]) -> tyndall::Result<Vec<UsdCamera>> {
        usd_cameras(&self.file, self.prim.as_deref(), times)
    }
}

/// A camera of a stage in a picture of an `aspect`: it looks at what it is focused on, else as far as the middle of `outline` is, which says how far apart eyes are.
pub(crate) fn of_stage(found: &UsdCamera, aspect: f64, outline: &Outline) -> Camera {
    let offset = outline.center - found.eye;
    let ahead = Some(offset.dot(found.forward)).filter(|it| *it > 0.0);
    let distance = found.focus.or(ahead).or(Some(offset.length())).filter(|it| *it > 0.0);
    found.camera(aspect, distance.unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_keys_are_told_apart() {
        let stage = |file: &str, prim: Option<&str>| {
            CameraSpec::Stage(StageCamera { file: file.into(), prim: prim.map(String::from) })
        };
        for (text, wanted) in [
            ("shot.usda", stage("shot.usda", None)),
            ("shot.usda:", stage("shot.usda", None)),
            ("a.usda/b.usda:/world/cam", stage("a.usda/b.usda", Some("/world/cam"))),
            ("C:/x/shot.USDA:cam", stage("C:/x/shot.USDA", Some("cam"))),
            ("shot.usdc:/cam", stage("shot.usdc", Some("/cam"))),
            ("shot.usd", stage("shot.usd", None)),
            ("at=2 eye=1,2,3", CameraSpec::Key("at=2 eye=1,2,3".parse().unwrap())),
        ] {
            assert_eq!(text.parse::<CameraSpec>().unwrap(), wanted, "{text}");
        }
        assert!("shot.abc".parse::<CameraSpec>().is_err());
        let moved = |text| with_file(text, |file| format!("b/{}", file.display()));
        assert_eq!(moved("shot.usda:/cam"), "b/shot.usda:/cam");
        assert_eq!(moved("shot.usda"), "b/shot.usda");
        assert_eq!(moved("at=2 fov=30"), "at=2 fov=30");
    }
}
