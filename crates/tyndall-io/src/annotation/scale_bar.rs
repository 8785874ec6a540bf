//! A scale bar: a line that is as long in the picture as a round length in the data.

use std::str::FromStr;

use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::short;
use tyndall::scene::units::{meters, ratio};
use tyndall::{Error, Result};

use super::Frame;
use super::font::Font;
use super::mark::{Align, Block, Ink, Mark, rectangle};

/// A length, in a unit or in that of the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Length {
    /// How many, above 0.
    pub number: f64,
    /// Of what; `None`: of the unit of the data.
    pub unit: Option<String>,
}

impl FromStr for Length {
    type Err = Error;

    /// Reads a number above 0 and, if there is one, its unit: `10`, `1nm`, `2.5 Mpc`.
    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        // The longest beginning that is a number: `1e3m` is one, of which `1e` is none.
        let mut ends = text.char_indices().map(|(at, letter)| at + letter.len_utf8()).rev();
        let number = ends.find_map(|end| Some((text[..end].parse::<f64>().ok()?, text[end..].trim())));
        let number = number.filter(|(number, _)| number.is_finite() && *number > 0.0);
        let (number, unit) = number.ok_or_else(|| {
            Error::setting(
                "--scalebar",
                text,
                "a length above 0, with its unit or in that of the file: 1nm, 10",
            )
        })?;
        Ok(Self { number, unit: Some(unit).filter(|it| !it.is_empty()).map(str::to_string) })
    }
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleBar {
    /// Its length in the picture, in pixels.
    pub pixels: f64,
    /// The length that it stands for, with its unit.
    pub label: String,
    /// What that is true of, in words.
    pub description: String,
}

/// The share of the picture's width that a bar has of which nobody says how long it is.
const SHARE: f64 = 0.2;

impl ScaleBar {
    /// Of what a camera sees in a picture, where lengths are in `unit`; without a length it is round and about a fifth of
    /// the picture. Orthographic it is true everywhere, in perspective at the distance of what the camera looks at.
    ///
    /// Fails with [`Error::Setting`] if the length's unit is none of the data's kind, or the bar does not fit the picture.
    pub fn new(camera: &Camera, frame: &Frame, wanted: Option<&Length>, unit: Option<&str>) -> Result<Self> {
        let (seen, where_true) = match camera.projection {
            Projection::Orthographic { height } => (height, ""),
            Projection::Perspective { vertical_angle } => {
                let distance = camera.look_at.distance(camera.eye);
                (
                    2.0 * (0.5 * vertical_angle).tan() * distance,
                    ", at the distance of what the camera looks at",
                )
            }
            Projection::Panorama => {
                return Err(Error::setting(
                    "--scalebar",
                    "given",
                    "left out of panoramas, which have no scale",
                ));
            }
        };
        let pixels_per_unit = f64::from(frame.seen[1]) / seen;
        let width = frame.part.width;
        let (length, pixels) = match wanted {
            None => {
                let length = round(SHARE * f64::from(width) / pixels_per_unit, unit);
                let of_file =
                    length.unit.as_deref().zip(unit).and_then(|(own, unit)| ratio(own, unit)).unwrap_or(1.0);
                let pixels = length.number * of_file * pixels_per_unit;
                (length, pixels)
            }
            Some(length) => {
                let of_file = match (length.unit.as_deref(), unit) {
                    (None, _) => 1.0,
                    (Some(own), Some(unit)) => ratio(own, unit).ok_or_else(|| refused(length, unit))?,
                    (Some(_), None) => {
                        let allowed = "a number alone: the file does not say its unit of length, which --units nm would tell";
                        return Err(Error::setting("--scalebar", written(length), allowed));
                    }
                };
                let unit = length.unit.as_deref().or(unit).map(str::to_string);
                (Length { unit, ..*length }, length.number * of_file * pixels_per_unit)
            }
        };
        let label = written(&length);
        if !(0.5..0.95 * f64::from(width)).contains(&pixels) {
            let allowed = format!(
                "a length that fits the picture: this one is {} pixels long, of {width}",
                short(pixels)
            );
            return Err(Error::setting("--scalebar", label, allowed));
        }
        let description = format!("scale bar {label}{where_true}");
        Ok(Self { pixels, label, description })
    }

    /// A line under its length.
    pub(super) fn block(&self, em: f32, font: &Font) -> Block {
        let (length, text) = (self.pixels as f32, font.width(&self.label, em));
        let width = length.max(text);
        let height = (0.2 * em).round().max(2.0);
        let top = (font.ascent(em) + 0.35 * em).round();
        let at = [0.5 * width, font.ascent(em)];
        // The line begins on a pixel and is exactly as long as it is to be: its last pixel is covered in part.
        let line = rectangle([(0.5 * (width - length)).round(), top], [length, height], Ink::Text);
        let text = Mark::Text { text: self.label.clone(), at, em, align: Align::Center };
        Block { size: [width, top + height], marks: vec![text, line] }
    }
}

fn written(length: &Length) -> String {
    let number = short(length.number);
    length.unit.as_ref().map_or(number.clone(), |unit| format!("{number} {unit}"))
}

fn refused(length: &Length, unit: &str) -> Error {
    let allowed = match length.unit.as_deref().and_then(meters) {
        Some(_) => format!("in the file's unit, {unit}, or a number alone"),
        None => format!("in {unit} or a unit of its kind, such as Å nm µm mm cm m km pc kpc Mpc"),
    };
    Error::setting("--scalebar", written(length), allowed)
}

/// Units that follow each other as lengths grow.
const CHAINS: [&[&str]; 6] = [
    &["pm", "Å", "nm", "µm", "mm", "m", "km"],
    &["pm", "nm", "µm", "mm", "cm", "m", "km"],
    &["pc", "kpc", "Mpc"],
    &["cpc", "ckpc", "cMpc"],
    &["pc/h", "kpc/h", "Mpc/h"],
    &["cpc/h", "ckpc/h", "cMpc/h"],
];

/// The largest 1, 2 or 5 times a power of ten up to `most` of the data's unit, in the unit that makes it a number from 1 to 1000 if it can.
fn round(most: f64, unit: Option<&str>) -> Length {
    let best = |most: f64| {
        let power = 10_f64.powf(most.log10().floor());
        [5.0, 2.0, 1.0]
            .into_iter()
            .map(|digit| digit * power)
            .find(|it| *it <= most * (1.0 + 1e-9))
            .unwrap_or(power)
    };
    let Some(unit) = unit else { return Length { number: best(most), unit: None } };
    let chain = CHAINS.iter().find(|chain| chain.contains(&unit)).copied().unwrap_or_default();
    let in_unit = |own: &str| ratio(own, unit).map(|of_file| best(most / of_file));
    let is_handy = |own: &str| in_unit(own).is_some_and(|number| (1.0..1000.0).contains(&number));
    let chosen = [unit].iter().chain(chain).copied().find(|own| is_handy(own)).unwrap_or(unit);
    Length { number: in_unit(chosen).unwrap_or(best(most)), unit: Some(chosen.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::DVec3;

    fn camera(projection: Projection) -> Camera {
        Camera { eye: DVec3::ZERO, look_at: DVec3::X * 100.0, up: DVec3::Z, projection }
    }

    #[test]
    fn bars_are_as_long_as_what_they_stand_for() {
        let parallel = camera(Projection::Orthographic { height: 50.0 });
        let bar = |wanted: Option<&str>, unit: Option<&str>| {
            let wanted: Option<Length> = wanted.map(|it| it.parse().unwrap());
            ScaleBar::new(&parallel, &Frame::whole([800, 400]), wanted.as_ref(), unit)
                .map(|it| (it.label, it.pixels))
        };
        // 8 pixels a unit: a fifth of the width is 20 units.
        assert_eq!(bar(None, None).unwrap(), ("20".into(), 160.0));
        assert_eq!(bar(None, Some("Å")).unwrap(), ("20 Å".into(), 160.0));
        assert_eq!(bar(Some("3"), Some("Å")).unwrap(), ("3 Å".into(), 24.0));
        let (label, pixels) = bar(Some("1 nm"), Some("Å")).unwrap();
        assert_eq!((label.as_str(), (pixels - 80.0).abs() < 1e-9), ("1 nm", true));
        for (wanted, unit) in
            [("1nm", None), ("1nm", Some("sigma")), ("1Mpc", Some("ckpc")), ("1e3", None), ("1e-9", None)]
        {
            assert!(bar(Some(wanted), unit).is_err(), "{wanted} {unit:?}");
        }
        let wide = camera(Projection::Orthographic { height: 50_000.0 });
        let bar = ScaleBar::new(&wide, &Frame::whole([800, 400]), None, Some("ckpc/h")).unwrap();
        assert_eq!((bar.label.as_str(), (bar.pixels - 160.0).abs() < 1e-9), ("20 cMpc/h", true));
    }

    #[test]
    fn in_perspective_a_bar_is_true_where_the_camera_looks() {
        let camera = camera(Projection::Perspective { vertical_angle: 0.6 });
        let bar =
            ScaleBar::new(&camera, &Frame::whole([800, 400]), Some(&"10".parse().unwrap()), None).unwrap();
        // Two points 10 apart there, seen by the camera's own rays.
        let view = camera.view(DVec3::ZERO, 800, 400).unwrap();
        let at = |x: f32| view.eye + view.ray(x, 200.0).direction * (100.0 / view.ray(x, 200.0).direction.x);
        let half = 0.5 * bar.pixels as f32;
        let apart = at(400.0 + half).distance(at(400.0 - half));
        assert!((apart - 10.0).abs() < 1e-3, "{apart}");
        assert!(bar.description.ends_with("at the distance of what the camera looks at"));
    }

    #[test]
    fn lengths_are_read() {
        let length = |text: &str| text.parse::<Length>().map(|it| (it.number, it.unit)).ok();
        assert_eq!(length("1nm"), Some((1.0, Some("nm".into()))));
        assert_eq!(length(" 2.5e3 cMpc/h"), Some((2500.0, Some("cMpc/h".into()))));
        assert_eq!(length("1e3m"), Some((1000.0, Some("m".into()))));
        assert_eq!(length("7"), Some((7.0, None)));
        for bad in ["", "nm", "-1nm", "0", "inf", "nan m"] {
            assert_eq!(length(bad), None, "{bad}");
        }
    }
}
