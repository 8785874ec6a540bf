//! Cameras of USD as text (`.usda`): `Camera` prims at time codes, under the transforms of the prims that they are in.
//!
//! Takes the text and the times, gives where the camera stands then and what its film sees, in the stage's own coordinates. Numbers go straight from one
//! time sample to the next, orientations the short way round; before the first and behind the last sample they stay. References, payloads and variants
//! are not followed. Source: OpenUSD, "UsdGeomCamera", "UsdGeomXformable" and `GfCamera`.

use std::path::Path;

use glam::DVec3;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::{Error, Result};

use super::scan::{Layer, Prim, Property, Wanted};
use super::transform::{self, numbers_at};
use crate::read::content::content;
use crate::read::unreadable;

const HINT: &str = "save the stage as one text file without references: usdcat --flatten IN -o OUT.usda";
const CAMERAS: Wanted = Wanted { is: |prim| prim.kind == "Camera", name: "cameras", hint: HINT };

/// Units of length of a focal length or an aperture in one of the stage.
const FILM_UNITS: f64 = 10.0;
/// What the cosines of the angles between the axes of a camera may be; those of the stage's numbers are exact to about 1e-7.
const SKEW: f64 = 1e-4;

/// A time on a stage's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TimeCode {
    /// This one.
    At(f64),
    /// Counted from the stage's `startTimeCode`, or from 0 where it has none.
    FromStart(f64),
}

impl TimeCode {
    /// So many time codes later.
    pub fn later(self, codes: f64) -> Self {
        match self {
            Self::At(code) => Self::At(code + codes),
            Self::FromStart(code) => Self::FromStart(code + codes),
        }
    }
}

/// What a camera's film sees.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Film {
    /// The tangent of half the horizontal angle of view.
    Perspective { slope: f64 },
    /// The width of what it sees, in units of the stage.
    Orthographic { width: f64 },
}

/// A camera at one time, in the coordinates of its stage.
#[derive(Clone, Debug, PartialEq)]
pub struct UsdCamera {
    /// The path of its prim: `/world/rig/cam`.
    pub prim: String,
    /// Where it stands.
    pub eye: DVec3,
    /// Where it looks, of unit length.
    pub forward: DVec3,
    /// Which way is up in its picture, of unit length.
    pub up: DVec3,
    /// How far off is what is in focus, if it says so.
    pub focus: Option<f64>,
    /// The radius of its lens, if something is out of focus: half of the focal length over the `fStop`.
    pub lens: Option<f64>,
    film: Film,
}

impl UsdCamera {
    /// The same for a picture of an `aspect`, width over height, that looks at the place that is `distance` ahead. The horizontal aperture is the picture's width, whatever
    /// the vertical one is.
    pub fn camera(&self, aspect: f64, distance: f64) -> Camera {
        let projection = match self.film {
            Film::Perspective { slope } => {
                Projection::Perspective { vertical_angle: 2.0 * (slope / aspect).atan() }
            }
            Film::Orthographic { width } => Projection::Orthographic { height: width / aspect },
        };
        Camera { eye: self.eye, look_at: self.eye + distance * self.forward, up: self.up, projection }
    }
}

/// The camera at the path `prim` of a USD text file, or its only one, at each of some times.
///
/// Fails with [`Error::Io`] if the file cannot be read, with [`Error::Format`] if it is no USD as text, has no such camera, or one that cannot be shown: with a
/// film that is shifted, axes that are not perpendicular, or values that are missing or odd.
pub fn usd_cameras(path: &Path, prim: Option<&str>, times: &[TimeCode]) -> Result<Vec<UsdCamera>> {
    cameras_of(path, content(path)?.as_ref(), prim, times)
}

/// The same from the content of a file.
fn cameras_of(path: &Path, bytes: &[u8], prim: Option<&str>, times: &[TimeCode]) -> Result<Vec<UsdCamera>> {
    if !super::recognise(bytes) {
        let unknown = || Error::format(path, "", "this is no stage of USD as text (.usda)", HINT);
        return Err(unreadable::explain(path, bytes).unwrap_or_else(unknown));
    }
    let layer = Layer::read(path, bytes, CAMERAS)?;
    let camera = chosen(path, &layer.prims, prim)?;
    let start = layer.number("startTimeCode").unwrap_or(0.0);
    let at = |time: &TimeCode| {
        let code = match time {
            TimeCode::At(code) => *code,
            TimeCode::FromStart(code) => start + code,
        };
        camera_at(camera, code)
            .map_err(|(what, hint)| Error::format(path, format!("prim '{}'", camera.path), what, hint))
    };
    times.iter().map(at).collect()
}

/// The camera of that path, or the only one.
fn chosen<'a, 'b>(path: &Path, cameras: &'b [Prim<'a>], prim: Option<&str>) -> Result<&'b Prim<'a>> {
    let names = || cameras.iter().map(|it| &*it.path).collect::<Vec<_>>().join(", ");
    let wrong = |what: String, hint: &str| Err(Error::format(path, "", what, hint));
    match (prim, cameras) {
        (_, []) => wrong("there is no prim of type Camera".into(), HINT),
        (None, [only]) => Ok(only),
        (None, [first, ..]) => {
            let hint = format!("name one of them: FILE:{}", first.path);
            wrong(format!("there are {} cameras: {}", cameras.len(), names()), &hint)
        }
        (Some(name), _) => {
            let path = format!("/{}", name.trim_matches('/'));
            match cameras.iter().find(|it| it.path == path) {
                Some(found) => Ok(found),
                None => wrong(format!("there is no camera '{path}'"), &format!("there is: {}", names())),
            }
        }
    }
}

/// What is wrong, and what to try.
type Wrong = (String, &'static str);

/// A camera at a time code.
fn camera_at(prim: &Prim, code: f64) -> std::result::Result<UsdCamera, Wrong> {
    let transforms = prim.transforms.iter().flat_map(|it| it.iter());
    if let Some(spline) = transforms.chain(&prim.properties).find(|it| it.name.ends_with(".spline")) {
        let hint = "bake it to time samples where the stage is exported";
        return Err((format!("{} is a spline, which is not read", spline.name), hint));
    }
    let (world, left_out) = transform::of(&prim.transforms, Some(code));
    if let Some(name) = left_out.first() {
        return Err((format!("the transform {name} cannot be read"), HINT));
    }
    let [right, up, back] = world.matrix3.to_cols_array_2d().map(|axis| DVec3::from_array(axis).normalize());
    let cosines = [right.dot(up), up.dot(back), back.dot(right)];
    if !cosines.iter().all(|it| it.abs() < SKEW) {
        let what = "the camera's axes are not perpendicular, or have no length: scales above it differ by axis, or are 0";
        return Err((what.into(), "give it transforms that move and turn it"));
    }
    let number = |name: &str, usual: f64| match prim.property(name) {
        Some(property) => number_of(property, code, usual),
        None => Ok(usual),
    };
    for name in ["horizontalApertureOffset", "verticalApertureOffset"] {
        let offset = number(name, 0.0)?;
        if offset != 0.0 {
            let hint = "set it to 0; a larger --size with --crop shows the same";
            return Err((format!("{name} is {offset}: a film that is shifted is not read"), hint));
        }
    }
    let above_0 = |name: &str, usual: f64| match number(name, usual)? {
        value if value > 0.0 => Ok(value),
        value => Err((format!("{name} is {value}, a number above 0 was wanted"), HINT)),
    };
    let (width, focal_length) = (above_0("horizontalAperture", 20.955)?, above_0("focalLength", 50.0)?);
    let projection =
        prim.property("projection").and_then(|it| it.at(Some(code))).unwrap_or(b"\"perspective\"");
    let film = match projection {
        b"\"perspective\"" => Film::Perspective { slope: 0.5 * width / focal_length },
        b"\"orthographic\"" => Film::Orthographic { width: width / FILM_UNITS },
        other => {
            let what = format!("a projection {} is not known", String::from_utf8_lossy(other));
            return Err((what, "perspective and orthographic are"));
        }
    };
    let [stop, distance] = [number("fStop", 0.0)?, number("focusDistance", 0.0)?];
    let focus = Some(distance).filter(|it| *it > 0.0);
    let is_blurred = stop > 0.0 && focus.is_some() && matches!(film, Film::Perspective { .. });
    Ok(UsdCamera {
        prim: prim.path.clone(),
        eye: world.translation,
        forward: -back,
        up,
        focus,
        lens: is_blurred.then(|| 0.5 * focal_length / FILM_UNITS / stop),
        film,
    })
}

/// A number of a property at a time; `usual` where it has none.
fn number_of(property: &Property, code: f64, usual: f64) -> std::result::Result<f64, Wrong> {
    if property.at(Some(code)).is_none() {
        return Ok(usual);
    }
    match numbers_at(property, Some(code)).as_deref() {
        Some([value]) if value.is_finite() => Ok(*value),
        _ => Err((format!("{} has no number at time code {code}", property.name), HINT)),
    }
}

#[cfg(test)]
mod tests;
