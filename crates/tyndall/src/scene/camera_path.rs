//! A camera that moves: from key to key, or from one of several places to the next picture's.

use std::str::FromStr;

use glam::DVec3;

use super::camera::{Camera, Projection};
use super::viewpoint;
use crate::error::{Error, Result};
use crate::names::nearest;

/// Where the camera is at one time; what is not said is that of the camera that nobody moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Key {
    text: String,
    /// When: a picture, counted from 0; `None`: a picture of its own.
    pub at: Option<f64>,
    eye: Option<DVec3>,
    look_at: Option<DVec3>,
    up: Option<DVec3>,
    projection: Option<Projection>,
    /// Whether the camera goes on in a straight line to the next key, at one speed, instead of on a smooth curve through all.
    is_straight: bool,
}

/// The words that a key may have.
const WORDS: [&str; 7] = ["at", "eye", "look-at", "up", "fov", "ortho", "move"];

impl FromStr for Key {
    type Err = Error;

    /// Reads `at=48 eye=1,2,3 look-at=0,0,0 up=0,0,1 fov=30` (degrees) or `ortho=10`, and `move=straight` or `move=smooth`; all may be left out.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = |what: String| {
            let allowed =
                "at=PICTURE eye=X,Y,Z look-at=X,Y,Z up=AXIS fov=DEGREES ortho=HEIGHT move=smooth|straight";
            Error::setting("--camera", text, format!("{what}; a camera is {allowed}"))
        };
        let mut key = Self { text: text.trim().into(), ..Self::default() };
        for word in text.split_whitespace() {
            let (name, value) = word.split_once('=').ok_or_else(|| wrong(format!("'{word}' has no '='")))?;
            let number = || {
                let number = value.parse().ok().filter(|it: &f64| it.is_finite());
                number.ok_or_else(|| wrong(format!("'{value}' is no number")))
            };
            let point = || {
                let point = viewpoint::point(value);
                point.ok_or_else(|| wrong(format!("'{value}' is no point X,Y,Z")))
            };
            match name {
                "at" => key.at = Some(number()?),
                "eye" => key.eye = Some(point()?),
                "look-at" => key.look_at = Some(point()?),
                "up" => {
                    let up = viewpoint::direction(value);
                    key.up = Some(
                        up.ok_or_else(|| wrong(format!("'{value}' is no direction such as z or X,Y,Z")))?,
                    );
                }
                "fov" => {
                    let angle = number()?;
                    if !(0.0..180.0).contains(&angle) || angle == 0.0 {
                        return Err(wrong("an angle of view is above 0 and below 180".into()));
                    }
                    key.projection = Some(Projection::Perspective { vertical_angle: angle.to_radians() });
                }
                "ortho" => {
                    let height = number()?;
                    if height <= 0.0 {
                        return Err(wrong("a height is above 0".into()));
                    }
                    key.projection = Some(Projection::Orthographic { height });
                }
                "move" if value == "straight" => key.is_straight = true,
                "move" if value == "smooth" => key.is_straight = false,
                "move" => return Err(wrong(format!("'{value}' is no way to move"))),
                _ => {
                    let meant =
                        nearest(name, WORDS).map_or(String::new(), |it| format!(", did you mean '{it}'?"));
                    return Err(wrong(format!("'{name}' is unknown{meant}")));
                }
            }
        }
        Ok(key)
    }
}

impl Key {
    /// The camera of this key, where `base` is the one that nobody moves.
    fn camera(&self, base: &Camera) -> Camera {
        Camera {
            eye: self.eye.unwrap_or(base.eye),
            look_at: self.look_at.unwrap_or(base.look_at),
            up: self.up.unwrap_or(base.up),
            projection: self.projection.unwrap_or(base.projection),
        }
    }
}

/// Several cameras, in the order of their times.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    keys: Vec<Key>,
}

impl CameraPath {
    /// A path through keys. Fails with [`Error::Setting`] if times are not increasing, if only some keys have one, or if some see in
    /// perspective and others in parallel.
    pub fn new(keys: Vec<Key>) -> Result<Self> {
        let wrong = |key: &Key, allowed: &str| Err(Error::setting("--camera", &key.text, allowed));
        for pair in keys.windows(2) {
            match [pair[0].at, pair[1].at] {
                [Some(before), Some(after)] if before < after => {}
                [None, None] => {}
                [Some(_), Some(_)] => {
                    return wrong(&pair[1], "later than the one before it: at=PICTURE counts upwards");
                }
                _ => {
                    return wrong(
                        &pair[1],
                        "with at=PICTURE if all others have it, or without: then each camera makes a picture",
                    );
                }
            }
        }
        let kind = |key: &Key| key.projection.map(|it| matches!(it, Projection::Perspective { .. }));
        let mut kinds = keys.iter().filter_map(|key| Some((key, kind(key)?)));
        if let Some((_, first)) = kinds.next()
            && let Some((other, _)) = kinds.find(|(_, kind)| *kind != first)
            && keys[0].at.is_some()
        {
            return wrong(other, "as the others: all with fov, or all with ortho");
        }
        let mut keys = keys;
        if keys.first().is_some_and(|key| key.at.is_some()) {
            // A key that says nothing of it keeps that of the one before; the first ones have that of the first that does.
            let mut last = keys.iter().find_map(|key| key.projection);
            for key in &mut keys {
                key.projection = key.projection.or(last);
                last = key.projection;
            }
        }
        Ok(Self { keys })
    }

    /// How many cameras there are.
    #[expect(clippy::len_without_is_empty, reason = "who asks has checked")]
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether the camera moves from key to key; else each key is a picture of its own.
    pub fn moves(&self) -> bool {
        self.keys.iter().all(|key| key.at.is_some())
    }

    /// The time of the last key.
    pub fn end(&self) -> f64 {
        self.keys.last().and_then(|key| key.at).unwrap_or(0.0)
    }

    /// The camera of picture `at`, where `base` is the one that nobody moves: before the first and behind the last key it stands still.
    ///
    /// Between keys eye, target, up and the logarithm of the picture's size follow cubic Hermite curves, whose slopes at a key are those of the
    /// parabola through it and its neighbors (Catmull-Rom for unequal times), zero at both ends.
    pub fn camera(&self, at: f64, base: &Camera) -> Camera {
        if !self.moves() {
            return self.keys.get(at as usize).map_or(*base, |key| key.camera(base));
        }
        let times: Vec<f64> = self.keys.iter().filter_map(|key| key.at).collect();
        let after = times.partition_point(|&time| time <= at);
        let (Some(before), true) = (after.checked_sub(1), after < times.len()) else {
            let last = after.saturating_sub(1);
            return self.keys.get(last).map_or(*base, |key| key.camera(base));
        };
        let cameras: Vec<Camera> = self.keys.iter().map(|key| key.camera(base)).collect();
        let along = Segment { times: &times, before, at, is_straight: self.keys[before].is_straight };
        let point = |of: fn(&Camera) -> DVec3| {
            DVec3::from_array([0, 1, 2].map(|axis| along.value(|key| of(&cameras[key])[axis])))
        };
        let size = along.value(|key| size(cameras[key].projection).ln()).exp();
        let projection = match cameras[before].projection {
            Projection::Perspective { .. } => Projection::Perspective { vertical_angle: 2.0 * size.atan() },
            Projection::Orthographic { .. } => Projection::Orthographic { height: size },
            Projection::Panorama => Projection::Panorama,
        };
        Camera {
            eye: point(|camera| camera.eye),
            look_at: point(|camera| camera.look_at),
            up: point(|camera| camera.up.normalize_or_zero()).normalize_or(cameras[before].up),
            projection,
        }
    }
}

/// What a picture shows: its height, or half of that at distance 1.
fn size(projection: Projection) -> f64 {
    match projection {
        Projection::Perspective { vertical_angle } => (0.5 * vertical_angle).tan(),
        Projection::Orthographic { height } => height,
        Projection::Panorama => 1.0,
    }
}

/// A place between two keys.
struct Segment<'a> {
    times: &'a [f64],
    /// The key before it.
    before: usize,
    at: f64,
    is_straight: bool,
}

impl Segment<'_> {
    /// A number that is `of` the keys at these.
    fn value(&self, of: impl Fn(usize) -> f64) -> f64 {
        let (start, end) = (self.before, self.before + 1);
        let span = self.times[end] - self.times[start];
        let t = (self.at - self.times[start]) / span;
        let (from, to) = (of(start), of(end));
        if self.is_straight {
            return from + t * (to - from);
        }
        let slope = |key: usize| match key {
            0 => 0.0,
            key if key + 1 == self.times.len() => 0.0,
            key => {
                let [before, after] =
                    [self.times[key] - self.times[key - 1], self.times[key + 1] - self.times[key]];
                let [rise, fall] = [(of(key) - of(key - 1)) / before, (of(key + 1) - of(key)) / after];
                (rise * after + fall * before) / (before + after)
            }
        };
        let [t2, t3] = [t * t, t * t * t];
        (2.0 * t3 - 3.0 * t2 + 1.0) * from
            + (t3 - 2.0 * t2 + t) * span * slope(start)
            + (3.0 * t2 - 2.0 * t3) * to
            + (t3 - t2) * span * slope(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(keys: &[&str]) -> Result<CameraPath> {
        CameraPath::new(keys.iter().map(|it| it.parse()).collect::<Result<_>>()?)
    }

    fn base() -> Camera {
        let projection = Projection::Perspective { vertical_angle: 0.5 };
        Camera { eye: DVec3::X, look_at: DVec3::ZERO, up: DVec3::Z, projection }
    }

    #[test]
    fn the_camera_is_at_its_keys_and_stands_still_around_them() {
        let path =
            path(&["at=2 eye=0,0,9 fov=20", "at=5 eye=4,0,9", "at=6 eye=4,8,9 up=0,1,0 fov=40"]).unwrap();
        assert!(path.moves() && path.end() == 6.0);
        for (at, eye) in [
            (0.0, [0.0, 0.0, 9.0]),
            (2.0, [0.0, 0.0, 9.0]),
            (5.0, [4.0, 0.0, 9.0]),
            (6.0, [4.0, 8.0, 9.0]),
            (9.0, [4.0, 8.0, 9.0]),
        ] {
            let camera = path.camera(at, &base());
            assert!(camera.eye.distance(DVec3::from_array(eye)) < 1e-12, "{at}: {camera:?}");
            assert_eq!(camera.look_at, DVec3::ZERO);
        }
        let Projection::Perspective { vertical_angle } = path.camera(9.0, &base()).projection else {
            panic!()
        };
        assert!((vertical_angle.to_degrees() - 40.0).abs() < 1e-9);
        assert!(path.camera(5.5, &base()).up.y > 0.1, "it tilts on the way");
    }

    #[test]
    fn it_moves_without_jumps_in_speed_and_straight_where_that_is_asked_for() {
        let smooth = path(&["at=0 eye=0,0,0", "at=2 eye=1,0,0", "at=3 eye=3,2,0", "at=7 eye=3,3,0"]).unwrap();
        let eye = |path: &CameraPath, at: f64| path.camera(at, &base()).eye;
        let speed = |at: f64| (eye(&smooth, at + 1e-6) - eye(&smooth, at - 1e-6)) / 2e-6;
        for key in [2.0, 3.0] {
            assert!(speed(key - 1e-4).distance(speed(key + 1e-4)) < 1e-2, "at {key}");
        }
        assert!(speed(1e-4).length() < 1e-3 && speed(6.9999).length() < 1e-3, "it starts and ends at rest");
        let straight = path(&["at=0 eye=0,0,0 move=straight", "at=4 eye=8,4,0"]).unwrap();
        assert_eq!(eye(&straight, 1.0), DVec3::new(2.0, 1.0, 0.0));
        // Uniform motion is uniform between inner keys.
        let even = path(&["at=0 eye=0,0,0", "at=1 eye=1,0,0", "at=3 eye=3,0,0", "at=4 eye=4,0,0"]).unwrap();
        assert!((eye(&even, 1.7).x - 1.7).abs() < 1e-12);
    }

    #[test]
    fn cameras_without_times_are_pictures_of_their_own() {
        let several = path(&["eye=1,0,0", "ortho=3", "eye=0,5,0 fov=90"]).unwrap();
        assert!(!several.moves() && several.len() == 3);
        assert_eq!(
            several.camera(1.0, &base()),
            Camera { projection: Projection::Orthographic { height: 3.0 }, ..base() }
        );
        assert_eq!(several.camera(2.0, &base()).eye, DVec3::new(0.0, 5.0, 0.0));
    }

    #[test]
    fn what_cannot_be_a_path_is_explained() {
        for (keys, why) in [
            (&["eye=1,2"][..], "'1,2' is no point X,Y,Z"),
            (&["at=x"], "'x' is no number"),
            (&["fov=180"], "above 0 and below 180"),
            (&["ortho=0"], "a height is above 0"),
            (&["eye 1,2,3"], "'eye' has no '='"),
            (&["lookat=1,2,3"], "did you mean 'look-at'?"),
            (&["move=slowly"], "no way to move"),
            (&["at=1", "at=1"], "later than the one before it"),
            (&["at=1", "eye=1,2,3"], "if all others have it"),
            (&["at=1 fov=30", "at=2", "at=3 ortho=5"], "as the others"),
        ] {
            let error = path(keys).unwrap_err().to_string();
            assert!(error.starts_with("--camera cannot be") && error.contains(why), "{keys:?}: {error}");
        }
    }
}
