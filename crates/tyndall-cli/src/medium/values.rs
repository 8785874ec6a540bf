//! Values of the command line that only a medium has: how each is written, and what is allowed.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use tyndall::medium::Light;
use tyndall::medium::light::{Cone, Directional, Environment, Point, Spot};
use tyndall::names::nearest;
use tyndall::render::medium::gather::Radius;
use tyndall::{Error, Result, Vec3};
use tyndall_io::read;

/// Reads a number above 0.
pub(crate) fn positive(text: &str) -> Result<f32> {
    let number = text.parse().ok().filter(|it: &f32| it.is_finite() && *it > 0.0);
    number.ok_or_else(|| Error::setting("a length or factor", text, "a number greater than 0"))
}

/// The distance of grid points, or that it is to be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Voxel {
    Auto,
    Length(f32),
}

impl FromStr for Voxel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            _ => positive(text)
                .map(Self::Length)
                .map_err(|_| Error::setting("voxel", text, "auto, or a length greater than 0")),
        }
    }
}

/// One number for all channels, or three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rgb(pub(crate) [f32; 3]);

impl FromStr for Rgb {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        numbers(text)
            .ok_or_else(|| Error::setting("a color", text, "one number, or three as R,G,B"))
            .map(Self)
    }
}

/// `X` or `X,Y,Z`; what they may be is for the library to say.
fn numbers(text: &str) -> Option<[f32; 3]> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers?[..] {
        [all] => Some([all; 3]),
        [x, y, z] => Some([x, y, z]),
        _ => None,
    }
}

/// An amplitude and a number of octaves, as `0.6@3` or `0.6@3oct`; one octave if none is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseAmount {
    pub(crate) amplitude: f32,
    pub(crate) octaves: u32,
}

impl FromStr for NoiseAmount {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (amplitude, octaves) = text.split_once('@').unwrap_or((text, "1"));
        let octaves = octaves.strip_suffix("oct").unwrap_or(octaves).parse();
        match (amplitude.parse(), octaves) {
            (Ok(amplitude), Ok(octaves)) => Ok(Self { amplitude, octaves }),
            _ => Err(Error::setting("noise", text, "AMPLITUDE@OCTAVES, such as 0.6@3")),
        }
    }
}

/// What `--noise` is about: how far noise moves a medium, as `0.6@3`, how much noise may be left in a picture, as `1%`, or both, as `0.6@3,1%`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    /// Position noise.
    pub(crate) position: Option<NoiseAmount>,
    /// A share of white.
    pub(crate) most: Option<f32>,
}

impl FromStr for Noise {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut noise = Self { position: None, most: None };
        for part in text.split(',') {
            let is_twice = match part.strip_suffix('%') {
                None => noise.position.replace(part.parse()?).is_some(),
                Some(digits) => {
                    let share = digits.trim().parse().ok().map(|it: f32| 0.01 * it);
                    let allowed = "more than 0% and less than 100%, or AMPLITUDE@OCTAVES of a medium";
                    let share = share.filter(|it| *it > 0.0 && *it < 1.0);
                    let share = share.ok_or_else(|| Error::setting("--noise", part, allowed))?;
                    noise.most.replace(share).is_some()
                }
            };
            if is_twice {
                return Err(Error::setting("--noise", text, "one of each kind, such as 0.6@3,1%"));
            }
        }
        Ok(noise)
    }
}

/// How noise goes with particles: `auto`, `id`, `id:NAME`, `velocity`, `velocity:NAME` or `none`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NoiseMotion {
    Auto,
    /// By the ids of that name, or of a usual one.
    Ids(Option<String>),
    Velocities(Option<String>),
    None,
}

impl FromStr for NoiseMotion {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (kind, name) = text.split_once(':').map_or((text, None), |(kind, name)| (kind, Some(name)));
        let name = name.map(str::to_string);
        match (kind, &name) {
            ("auto", None) => Ok(Self::Auto),
            ("none", None) => Ok(Self::None),
            ("id", name) if name.as_deref() != Some("") => Ok(Self::Ids(name.clone())),
            ("velocity", name) if name.as_deref() != Some("") => Ok(Self::Velocities(name.clone())),
            _ => {
                let meant = nearest(kind, ["auto", "id", "velocity", "none"]);
                let meant = meant.map_or(String::new(), |meant| format!("; did you mean '{meant}'?"));
                let allowed = format!("auto, id, id:NAME, velocity, velocity:NAME or none{meant}");
                Err(Error::setting("--noise-motion", text, allowed))
            }
        }
    }
}

/// Within which radius photons count: `auto`, `R` or `N@R`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gather(pub(crate) Radius);

impl FromStr for Gather {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wanted =
            || Error::setting("--gather-radius", text, "auto, a radius, or N@RADIUS for the nearest N");
        let radius = |text: &str| positive(text).map_err(|_| wanted());
        match text.split_once('@') {
            _ if text == "auto" => Ok(Self(Radius::Automatic)),
            None => Ok(Self(Radius::Fixed(radius(text)?))),
            Some((count, most)) => {
                let count = count.parse().ok().filter(|&count| count > 0).ok_or_else(wanted)?;
                Ok(Self(Radius::Nearest(count, radius(most)?)))
            }
        }
    }
}

/// A light: `sun:X,Y,Z:E`, `point:X,Y,Z:I`, `spot:X,Y,Z:X,Y,Z:DEGREES:I`, `sky:L`, `image:FILE` or `image:FACTOR:FILE`. Positions are in
/// the file's coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LightSpec {
    /// Where it travels, and its irradiance.
    Sun([f32; 3], [f32; 3]),
    /// Where it is, and its intensity.
    Point([f32; 3], [f32; 3]),
    /// Where it is, where it shines, half the angle of its cone in degrees, and its intensity.
    Spot([f32; 3], [f32; 3], f32, [f32; 3]),
    /// Its radiance.
    Sky([f32; 3]),
    /// A picture of the sky, and what its radiance is multiplied with.
    Image([f32; 3], PathBuf),
}

impl FromStr for LightSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if let Some(text) = text.strip_prefix("image:").filter(|text| !text.is_empty()) {
            // Names of files may have colons too.
            let factor = text.split_once(':').and_then(|(factor, file)| Some((numbers(factor)?, file)));
            let (factor, file) = factor.unwrap_or(([1.0; 3], text));
            return Ok(Self::Image(factor, file.into()));
        }
        let parts: Vec<&str> = text.split(':').collect();
        let number = |place: usize| parts.get(place).copied().and_then(numbers);
        let spec = match (parts[0], parts.len()) {
            ("sun", 2) => number(1).map(|along| Self::Sun(along, [std::f32::consts::PI; 3])),
            ("sun", 3) => number(1).zip(number(2)).map(|(along, light)| Self::Sun(along, light)),
            ("point", 3) => number(1).zip(number(2)).map(|(at, light)| Self::Point(at, light)),
            ("spot", 5) => {
                let angle = parts[3].trim().parse().ok();
                let places = number(1).zip(number(2));
                places
                    .zip(angle.zip(number(4)))
                    .map(|((at, along), (angle, light))| Self::Spot(at, along, angle, light))
            }
            ("sky", 2) => number(1).map(Self::Sky),
            _ => None,
        };
        spec.ok_or_else(|| {
            let allowed = "sun:X,Y,Z:IRRADIANCE, point:X,Y,Z:INTENSITY, spot:X,Y,Z:X,Y,Z:DEGREES:INTENSITY, sky:RADIANCE or image:FILE";
            Error::setting("--light", text, allowed)
        })
    }
}

/// Share of a spot's cone within which it is full.
const SOFT_EDGE: f32 = 0.8;

impl LightSpec {
    /// The light, for positions measured from `origin`. Up in a picture of the sky is `up`.
    pub(crate) fn light(&self, origin: tyndall::DVec3, up: Vec3) -> Result<Light> {
        Ok(match *self {
            Self::Image(factor, ref file) => Light::Environment(Self::image(factor, file)?.upright(up)?),
            Self::Sun(along, light) => Light::Directional(Directional::new(Vec3::from(along), light)?),
            Self::Point(at, light) => {
                let at = Vec3::from(at).as_dvec3() - origin;
                Light::Point(Point::new(at.as_vec3(), light)?)
            }
            Self::Spot(at, along, degrees, light) => {
                let at = (Vec3::from(at).as_dvec3() - origin).as_vec3();
                let dark = degrees.to_radians();
                Light::Spot(Spot::new(at, Vec3::from(along), light, Cone { full: SOFT_EDGE * dark, dark })?)
            }
            Self::Sky(light) => Light::Environment(Environment::constant(light)?),
        })
    }

    /// Whether it comes from all around.
    pub(crate) fn is_all_around(&self) -> bool {
        matches!(self, Self::Sky(_) | Self::Image(..))
    }

    /// The word with which it begins.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Sun(..) => "sun",
            Self::Point(..) => "point",
            Self::Spot(..) => "spot",
            Self::Sky(_) => "sky",
            Self::Image(..) => "image",
        }
    }

    /// The same, so many times as bright where it comes from all around.
    pub(crate) fn times(&self, factor: f32) -> Self {
        let scaled = |rgb: &[f32; 3]| rgb.map(|value| factor * value);
        match self {
            Self::Sky(light) => Self::Sky(scaled(light)),
            Self::Image(of_file, file) => Self::Image(scaled(of_file), file.clone()),
            other => other.clone(),
        }
    }

    fn image(factor: [f32; 3], file: &Path) -> Result<Environment> {
        if let Some(bad) = factor.iter().find(|it| !(0.0..f32::INFINITY).contains(*it)) {
            return Err(Error::setting("--light", bad, "an image times a finite number of at least 0"));
        }
        read::sky(file, factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_they_are_written() {
        assert_eq!("0.5".parse::<Rgb>().unwrap(), Rgb([0.5; 3]));
        assert_eq!("1,2,3".parse::<Rgb>().unwrap(), Rgb([1.0, 2.0, 3.0]));
        assert_eq!("0.6@3oct".parse::<NoiseAmount>().unwrap(), NoiseAmount { amplitude: 0.6, octaves: 3 });
        assert_eq!("1".parse::<NoiseAmount>().unwrap(), NoiseAmount { amplitude: 1.0, octaves: 1 });
        let amount = NoiseAmount { amplitude: 0.6, octaves: 3 };
        let noise = |text: &str| text.parse::<Noise>().unwrap();
        assert_eq!(noise("2%"), Noise { position: None, most: Some(0.02) });
        assert_eq!(noise("0.6@3"), Noise { position: Some(amount), most: None });
        assert_eq!(noise("2%,0.6@3"), Noise { position: Some(amount), most: Some(0.02) });
        assert_eq!("50@1.5".parse::<Gather>().unwrap(), Gather(Radius::Nearest(50, 1.5)));
        assert_eq!("auto".parse::<Gather>().unwrap(), Gather(Radius::Automatic));
        assert_eq!("sky:0.25".parse::<LightSpec>().unwrap(), LightSpec::Sky([0.25; 3]));
        let spot = LightSpec::Spot([1.0, 2.0, 3.0], [0.0, -1.0, 0.0], 20.0, [5.0; 3]);
        assert_eq!("spot:1,2,3:0,-1,0:20:5".parse::<LightSpec>().unwrap(), spot);
        assert!(spot.light(tyndall::DVec3::ZERO, Vec3::Z).is_ok());
        let image = |factor: f32, file: &str| LightSpec::Image([factor; 3], file.into());
        assert_eq!("image:a.hdr".parse::<LightSpec>().unwrap(), image(1.0, "a.hdr"));
        assert_eq!("image:2.5:C:/a.exr".parse::<LightSpec>().unwrap(), image(2.5, "C:/a.exr"));
        assert_eq!("image:C:/a.exr".parse::<LightSpec>().unwrap(), image(1.0, "C:/a.exr"));
        let sun = LightSpec::Sun([0.0, -1.0, 0.0], [3.0, 2.0, 1.0]);
        assert_eq!("sun:0,-1,0:3,2,1".parse::<LightSpec>().unwrap(), sun);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert!(["", "1,2", "x", "1,2,3,4"].iter().all(|bad| bad.parse::<Rgb>().is_err()));
        let name = || Some("a".to_string());
        for (text, wanted) in [
            ("auto", NoiseMotion::Auto),
            ("id", NoiseMotion::Ids(None)),
            ("id:a", NoiseMotion::Ids(name())),
            ("velocity:a", NoiseMotion::Velocities(name())),
            ("none", NoiseMotion::None),
        ] {
            assert_eq!(text.parse::<NoiseMotion>().unwrap(), wanted);
        }
        let error = "velocty".parse::<NoiseMotion>().unwrap_err().to_string();
        assert!(error.contains("did you mean 'velocity'?"), "{error}");
        assert!(["id:", "none:a", ""].iter().all(|bad| bad.parse::<NoiseMotion>().is_err()));
        assert!(["", "a@2", "1@", "1@-2"].iter().all(|bad| bad.parse::<Noise>().is_err()));
        assert!(
            ["0%", "100%", "-1%", "nan%", "%", "1%,2%", "1,2", "1%,"]
                .iter()
                .all(|bad| bad.parse::<Noise>().is_err())
        );
        assert!(["0", "-1", "0@1", "5@0", "x"].iter().all(|bad| bad.parse::<Gather>().is_err()));
        assert!(
            ["sun", "moon:1", "sky:1:2", "point:1,2,3", "image:"]
                .iter()
                .all(|bad| bad.parse::<LightSpec>().is_err())
        );
        assert!(["0", "nan", "-1"].iter().all(|bad| positive(bad).is_err()));
    }
}
