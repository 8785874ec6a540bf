//! Values of the command line: how each is written, and what is allowed.

use std::str::FromStr;
use std::time::Duration;

use glam::DVec3;
use tyndall::film::Window;
use tyndall::scene::coloring::Coloring;
use tyndall::scene::{short, viewpoint};
use tyndall::{Error, Result};

/// The sides of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let side = |text: &str| text.trim().parse().ok().filter(|side| (1..=65536).contains(side));
        let sides = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
        let (width, height) = sides
            .ok_or_else(|| Error::setting("--size", text, "WIDTHxHEIGHT, from 1x1 to 65536x65536 pixels"))?;
        Ok(Self { width, height })
    }
}

/// Reads `X,Y,Z`.
pub(crate) fn point(text: &str) -> Result<DVec3> {
    let allowed = "three numbers X,Y,Z with commas and without spaces";
    viewpoint::point(text).ok_or_else(|| Error::setting("a point or direction", text, allowed))
}

/// Reads `X,Y,Z`, or an axis.
pub(crate) fn direction(text: &str) -> Result<DVec3> {
    let allowed = "an axis such as z or -y, or three numbers X,Y,Z with commas and without spaces";
    viewpoint::direction(text).ok_or_else(|| Error::setting("a direction", text, allowed))
}

/// Reads `NX,NY,NZ`, or one number that stands for all three.
pub(crate) fn images(text: &str) -> Result<[u32; 3]> {
    let numbers: Option<Vec<u32>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|&it| it > 0)).collect();
    match numbers.as_deref() {
        Some(&[all]) => Ok([all; 3]),
        Some(&[x, y, z]) => Ok([x, y, z]),
        _ => Err(Error::setting("--replicate", text, "whole numbers NX,NY,NZ from 1, or one for all three")),
    }
}

/// Reads `X,Y,WIDTH,HEIGHT`.
pub(crate) fn window(text: &str) -> Result<Window> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Window { x, y, width, height }),
        _ => Err(Error::setting("--crop", text, "X,Y,WIDTH,HEIGHT in whole pixels, such as 100,50,640,480")),
    }
}

/// Reads `NEAR:FAR`.
pub(crate) fn depths(text: &str) -> Result<[f32; 2]> {
    let numbers: Option<Vec<f32>> = text.split(':').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[near, far]) => Ok([near, far]),
        _ => Err(Error::setting("--depth-range", text, "NEAR:FAR, two distances such as 20:55.5")),
    }
}

/// Reads a length above 0, or a factor.
pub(crate) fn length(text: &str) -> Result<f32> {
    let number = text.parse().ok().filter(|it: &f32| it.is_finite() && *it > 0.0);
    number.ok_or_else(|| Error::setting("a radius or its scale", text, "a number greater than 0"))
}

/// Reads a time: seconds, or with the unit s, m or h.
pub(crate) fn duration(text: &str) -> Result<Duration> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &text[digits.len()..] {
        "" | "s" => Some(1.0),
        "m" | "min" => Some(60.0),
        "h" => Some(3600.0),
        _ => None,
    };
    let number = digits.trim().parse().ok().filter(|it: &f64| *it > 0.0 && *it < 1e9);
    match (number, unit) {
        (Some(number), Some(unit)) => Ok(Duration::from_secs_f64(number * unit)),
        _ => Err(Error::setting("--time", text, "a time such as 30s, 5m or 1h")),
    }
}

/// Reads a count, also as `1e7`.
pub(crate) fn count(text: &str) -> Result<u64> {
    let number = text.replace('_', "").parse().ok();
    let whole = number.filter(|it: &f64| (1.0..4e9).contains(it) && it.fract() == 0.0);
    whole
        .map(|it| it as u64)
        .ok_or_else(|| Error::setting("--n", text, "counts from 1 to 4e9, such as 1e6,1e7"))
}

/// Reads an amount of memory: a number, with K, M, G or T for powers of 1024.
pub(crate) fn bytes(text: &str) -> Result<u64> {
    let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit());
    let power = match text[digits.len()..].to_ascii_uppercase().trim_end_matches(['B', 'I']) {
        "" => Some(0),
        "K" => Some(1),
        "M" => Some(2),
        "G" => Some(3),
        "T" => Some(4),
        _ => None,
    };
    let number = digits.parse().ok().filter(|it: &f64| *it > 0.0);
    match (number, power) {
        (Some(number), Some(power)) => Ok((number * 1024_f64.powi(power)) as u64),
        _ => Err(Error::setting("--memory", text, "bytes, such as 500M or 16G")),
    }
}

/// An angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Degrees(pub(crate) f64);

impl FromStr for Degrees {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let number = text.parse().ok().filter(|it: &f64| it.is_finite());
        number.map(Self).ok_or_else(|| Error::setting("an angle", text, "a number of degrees"))
    }
}

/// What is in focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Focus {
    /// So far from the eye.
    Distance(f64),
    /// A point.
    Point(DVec3),
}

impl FromStr for Focus {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text.contains(',') {
            return point(text).map(Self::Point);
        }
        let number = text.parse().ok().filter(|it: &f64| it.is_finite() && *it > 0.0);
        let allowed = "a distance greater than 0, or a point X,Y,Z";
        number.map(Self::Distance).ok_or_else(|| Error::setting("--focus", text, allowed))
    }
}

/// The height that an orthographic picture shows; `None` if it follows from the particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ortho(pub(crate) Option<f64>);

impl FromStr for Ortho {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "auto" {
            return Ok(Self(None));
        }
        let number = text.parse().ok().filter(|it: &f64| it.is_finite() && *it > 0.0);
        let allowed = "a height greater than 0 in the file's unit, or auto";
        number.map(|height| Self(Some(height))).ok_or_else(|| Error::setting("--ortho", text, allowed))
    }
}

/// What is behind the particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Background {
    /// Nothing: the picture is transparent there.
    Nothing,
    /// Linear RGB.
    Color([f32; 3]),
    /// The lights all around: those of a medium, or the image that lights spheres.
    Sky,
}

impl FromStr for Background {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.parse() {
            _ if matches!(text, "none" | "transparent") => Ok(Self::Nothing),
            _ if text == "sky" => Ok(Self::Sky),
            Ok(Coloring::Constant(color)) => Ok(Self::Color(color)),
            _ => Err(Error::setting(
                "--background",
                text,
                "white, black, none, sky, #rrggbb or the name of a color in CSS",
            )),
        }
    }
}

/// How a time is written over a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LabelFormat {
    /// By its unit: `step 100`, `z = 0.5`, `t = 2 ps`.
    Auto,
    /// Texts and what stands between them.
    Pieces(Vec<Piece>),
}

/// A part of a label.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Piece {
    Text(String),
    /// The time, with so many decimals.
    Time(Option<usize>),
    /// The redshift, where the time is a scale factor, with so many decimals.
    Redshift(Option<usize>),
    Unit,
    /// The number of the frame.
    Frame,
}

impl FromStr for LabelFormat {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let wanted = || {
            let allowed = "a text with {time}, {time:.2}, {unit}, {z}, {z:.2} or {frame} in it";
            Error::setting("--time-label", text, allowed)
        };
        let (mut pieces, mut rest) = (Vec::new(), text);
        while let Some((before, after)) = rest.split_once('{') {
            let (name, behind) = after.split_once('}').ok_or_else(wanted)?;
            pieces.push(Piece::Text(before.into()));
            let (name, decimals) = match name.split_once(':') {
                Some((name, format)) => {
                    let digits =
                        format.strip_prefix('.').and_then(|it| it.parse().ok()).filter(|it| *it <= 15);
                    (name, Some(digits.ok_or_else(wanted)?))
                }
                None => (name, None),
            };
            pieces.push(match (name, decimals) {
                ("time", decimals) => Piece::Time(decimals),
                ("z", decimals) => Piece::Redshift(decimals),
                ("unit", None) => Piece::Unit,
                ("frame", None) => Piece::Frame,
                _ => return Err(wanted()),
            });
            rest = behind;
        }
        pieces.push(Piece::Text(rest.into()));
        Ok(Self::Pieces(pieces))
    }
}

impl LabelFormat {
    /// The label of a frame with that time and its unit; `None` if it needs a time that is not there.
    pub(crate) fn text(&self, (time, unit): (Option<f64>, Option<&str>), frame: usize) -> Option<String> {
        let redshift = time.filter(|a| unit == Some("a") && *a > 0.0).map(|a| 1.0 / a - 1.0);
        let number = |number: f64, decimals: Option<usize>| {
            // Rounding errors of a redshift are no digits that count, and 0 has no sign.
            let number = if number.abs() < 1e-9 { 0.0 } else { number };
            let text = decimals.map_or_else(|| short(number), |decimals| format!("{number:.decimals$}"));
            text.replace('-', "\u{2212}")
        };
        match self {
            Self::Auto => {
                let time = time?;
                Some(match (unit, redshift) {
                    (Some("step"), _) => format!("step {time}"),
                    (_, Some(redshift)) => format!("z = {}", number(redshift, None)),
                    (Some(unit), _) => format!("t = {} {unit}", number(time, None)),
                    (None, _) => format!("t = {}", number(time, None)),
                })
            }
            Self::Pieces(pieces) => pieces
                .iter()
                .map(|piece| {
                    Some(match piece {
                        Piece::Text(text) => text.clone(),
                        Piece::Time(decimals) => number(time?, *decimals),
                        Piece::Redshift(decimals) => number(redshift?, *decimals),
                        Piece::Unit => unit?.into(),
                        Piece::Frame => frame.to_string(),
                    })
                })
                .collect(),
        }
    }
}

/// Frames as Python slices a list: `START:STOP:STEP`, each of which may be left out or count from the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slice {
    start: Option<i64>,
    stop: Option<i64>,
    step: i64,
}

impl FromStr for Slice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wanted =
            || Error::setting("--frames", text, "START:STOP:STEP as in Python, such as 10:20, ::5 or -3:");
        let number = |part: &str| match part.trim() {
            "" => Ok(None),
            digits => digits.parse().map(Some).map_err(|_| wanted()),
        };
        let parts: Vec<Option<i64>> = text.split(':').map(number).collect::<Result<_>>()?;
        let (start, stop, step) = match parts[..] {
            [start @ Some(frame)] => {
                return Ok(Self { start, stop: frame.checked_add(1).filter(|&it| it != 0), step: 1 });
            }
            [start, stop] => (start, stop, None),
            [start, stop, step] => (start, stop, step),
            _ => return Err(wanted()),
        };
        match step {
            Some(0) => Err(wanted()),
            _ => Ok(Self { start, stop, step: step.unwrap_or(1) }),
        }
    }
}

impl Slice {
    /// The numbers below `count` that the slice takes, in its order.
    pub(crate) fn of(&self, count: usize) -> Vec<usize> {
        let count = count as i64;
        let (least, most) = if self.step > 0 { (0, count) } else { (-1, count - 1) };
        let bound = |end: i64| if end < 0 { end.saturating_add(count) } else { end }.clamp(least, most);
        self.walk(count, bound)
    }
}

impl Slice {
    /// The places of the numbers, which ascend, that the slice takes, in its order: START and STOP are numbers, STEP counts places.
    pub(crate) fn among(&self, numbers: &[usize]) -> Vec<usize> {
        let is_up = self.step > 0;
        let place = |end: i64| match usize::try_from(end) {
            // Downwards a slice begins with the last number that is not beyond.
            Ok(number) if is_up => numbers.partition_point(|&it| it < number) as i64,
            Ok(number) => numbers.partition_point(|&it| it <= number) as i64 - 1,
            Err(_) => end.saturating_add(numbers.len() as i64),
        };
        let (least, most) = if is_up { (0, numbers.len() as i64) } else { (-1, numbers.len() as i64 - 1) };
        self.walk(numbers.len() as i64, |end| place(end).clamp(least, most))
    }

    /// The places below `count` between both ends, which `bound` makes places of.
    fn walk(&self, count: i64, bound: impl Fn(i64) -> i64) -> Vec<usize> {
        let (first, last) = if self.step > 0 { (0, count) } else { (count - 1, -1) };
        let (mut at, stop) = (self.start.map_or(first, &bound), self.stop.map_or(last, &bound));
        let mut places = Vec::new();
        while (self.step > 0 && at < stop) || (self.step < 0 && at > stop) {
            places.push(at as usize);
            at = at.saturating_add(self.step);
        }
        places
    }
}

/// Frame `number` of `count`, where negative numbers count from the end.
pub(crate) fn frame(number: i64, count: usize) -> Result<usize> {
    let from_start = if number < 0 { number.saturating_add(count as i64) } else { number };
    let found = usize::try_from(from_start).ok().filter(|&it| it < count);
    found.ok_or_else(|| match count {
        1 => Error::setting("--frame", number, "there is only frame 0"),
        _ => {
            Error::setting("--frame", number, format!("there are frames 0 to {}, -1 is the last", count - 1))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_say_the_time_as_the_file_does() {
        let label = |format: &str, time, unit| format.parse::<LabelFormat>().unwrap().text((time, unit), 7);
        let some = |text: &str| Some(text.to_string());
        assert_eq!(label("auto", Some(2.5), Some("ps")), some("t = 2.5 ps"));
        assert_eq!(label("auto", Some(1_500_000.0), Some("step")), some("step 1500000"));
        assert_eq!(label("auto", Some(0.5), Some("a")), some("z = 1"));
        assert_eq!(label("auto", Some(1.0), Some("a")), some("z = 0"));
        assert_eq!(label("auto", Some(-1.0), None), some("t = \u{2212}1"));
        assert_eq!(label("auto", None, Some("ps")), None);
        assert_eq!(label("{time:.2} {unit}, frame {frame}", Some(1.0), Some("s")), some("1.00 s, frame 7"));
        assert_eq!(label("frame {frame}", None, None), some("frame 7"));
        assert_eq!(label("z={z:.1}", Some(0.25), Some("a")), some("z=3.0"));
        assert_eq!(label("z={z}", Some(0.25), Some("ps")), None);
        for bad in ["{", "{x}", "{time:2}", "{frame:.1}", "{time:.99}"] {
            assert!(bad.parse::<LabelFormat>().is_err(), "{bad}");
        }
    }

    #[test]
    fn frames_are_sliced_as_python_does() {
        let slice = |text: &str| text.parse::<Slice>().unwrap().of(10);
        for (text, expected) in [
            (":", vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            ("2:5", vec![2, 3, 4]),
            ("::4", vec![0, 4, 8]),
            ("-3:", vec![7, 8, 9]),
            (":-8", vec![0, 1]),
            ("::-3", vec![9, 6, 3, 0]),
            ("5:2:-1", vec![5, 4, 3]),
            ("8:99", vec![8, 9]),
            ("99:", vec![]),
            ("-99:2", vec![0, 1]),
            ("4", vec![4]),
            ("-1", vec![9]),
            ("10", vec![]),
        ] {
            assert_eq!(slice(text), expected, "{text}");
        }
        for bad in ["", "a", "1:2:0", "1:2:3:4", "1.5:"] {
            assert!(bad.parse::<Slice>().is_err(), "{bad}");
        }
        assert!("::1".parse::<Slice>().unwrap().of(0).is_empty());
    }

    #[test]
    fn one_frame_may_count_from_the_end() {
        assert_eq!((frame(0, 3).unwrap(), frame(-1, 3).unwrap(), frame(-3, 3).unwrap()), (0, 2, 0));
        assert!(frame(3, 3).is_err() && frame(-4, 3).is_err() && frame(i64::MIN, 3).is_err());
    }

    #[test]
    fn bad_values_are_refused() {
        assert_eq!("800x600".parse::<Size>().unwrap(), Size { width: 800, height: 600 });
        for bad in ["800", "0x5", "5x0", "-1x2", "99999x1", "x", "1x1x1"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
        assert_eq!(point("-1,2.5,3e2").unwrap(), DVec3::new(-1.0, 2.5, 300.0));
        assert!(["1,2", "1,2,3,4", "1,2,nan", ""].iter().all(|bad| point(bad).is_err()));
        assert_eq!((images("3,3,1").unwrap(), images("2").unwrap()), ([3, 3, 1], [2; 3]));
        assert!(["0", "3,3", "1,2,3,4", "1,0,1", "-1", "1.5", ""].iter().all(|bad| images(bad).is_err()));
        assert_eq!(window("1,2,3,4").unwrap(), Window { x: 1, y: 2, width: 3, height: 4 });
        assert!(["1,2,3", "1,2,0,4", "-1,2,3,4", ""].iter().all(|bad| window(bad).is_err()));
        assert!(["0", "-1", "nan", "inf", "x"].iter().all(|bad| length(bad).is_err()));
        assert_eq!(duration("90s").unwrap(), duration("1.5m").unwrap());
        assert!(["0", "-1", "nan", "s", "1d", "inf", ""].iter().all(|bad| duration(bad).is_err()));
        assert_eq!("1,2,3".parse::<Focus>().unwrap(), Focus::Point(DVec3::new(1.0, 2.0, 3.0)));
        assert!(["0", "-2", "1,2", "auto"].iter().all(|bad| bad.parse::<Focus>().is_err()));
        assert!(
            ["0", "1.5", "x"].iter().all(|bad| count(bad).is_err()) && count("1e7").unwrap() == 10_000_000
        );
        assert_eq!("none".parse::<Background>().unwrap(), Background::Nothing);
        assert_eq!("#ffffff".parse::<Background>().unwrap(), "white".parse().unwrap());
        assert!("c_pe".parse::<Background>().is_err());
    }
}
