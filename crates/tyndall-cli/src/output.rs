//! Where pictures go: each to a file of its own, whose name may have a number (`%04d`, `####`, `$F4`), or all to one movie.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::ValueEnum;
use tyndall::scene::camera::Camera;
use tyndall::{Error, Image};
use tyndall_io::write::movie::{self, Encoder, Movie, MovieOptions};
use tyndall_io::write::{self, ImageOptions};

use crate::annotate::{Annotator, Bands, Shown};
use crate::args;
use crate::report::{Failure, Outcome, Report, counted, seconds};
use crate::shot::Taken;

/// What encodes an MP4.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EncoderName {
    /// ffmpeg where it is on the PATH and has libx264, else the one that is built in
    Auto,
    /// The program ffmpeg, with libx264
    Ffmpeg,
    /// The one that is built in
    BuiltIn,
}

/// Where the pictures of a command go.
pub(crate) struct Output<'a> {
    args: &'a args::Render,
    report: &'a Report,
    annotator: Annotator<'a>,
    movie: Option<Movie>,
    written: usize,
}

impl<'a> Output<'a> {
    /// Refuses before the work what could not be written.
    pub(crate) fn new(args: &'a args::Render, report: &'a Report) -> Outcome<Self> {
        let annotator = Annotator::new(&args.annotate, report)?;
        let output = Self { args, report, annotator, movie: None, written: 0 };
        let path = &args.picture.output;
        if !movie::is_movie(path) {
            let first = args
                .origin
                .again
                .as_ref()
                .map_or_else(|| Pattern::new(path).name(0), |again| again.to.clone());
            write::check(&first).map_err(Failure::Output)?;
            if !(args.picture.is_opaque() || write::has_alpha(&first)) {
                return Err(Failure::Output(write::transparent(&first, "JPEG")));
            }
            return Ok(output);
        }
        if Pattern::new(path).is_numbered() {
            let allowed = "a movie is one file: leave the number out";
            return Err(Error::setting("-o", path.display(), allowed).into());
        }
        let [width, height] = args.picture.pixels();
        movie::check(path, args.picture.written_pixels(), args.picture.is_opaque(), &output.options(&[]))
            .map_err(Failure::Output)?;
        let args::Picture { size, .. } = &args.picture;
        if [size.width, size.height] != [width, height] {
            report.note(format_args!("note: pictures of {width}x{height}, since an MP4's sides are even"));
        }
        Ok(output)
    }

    /// Refuses annotations that a picture cannot have, before it is made.
    pub(crate) fn check(&self, shown: &Shown, camera: &Camera) -> Outcome<()> {
        self.annotator.check(shown, (camera, &self.args.picture.frame()))
    }

    /// Writes a picture with its annotations to `path`, or appends it to the movie there, and says how long it took to make.
    pub(crate) fn write(
        &mut self,
        path: &Path,
        (taken, mut options): (Taken, ImageOptions),
        shown: &Shown,
        took: impl FnOnce() -> Duration,
    ) -> Outcome<()> {
        self.annotator.write_bar(shown)?;
        let mut described = None;
        let (image, channels) = taken.finished(|seen| {
            described = self.annotator.annotate(path, seen, shown)?;
            Ok(())
        })?;
        options.channels = channels;
        options.metadata.extend(described.map(|text| ("Annotations".into(), text)));
        if self.movie.is_none() && movie::is_movie(path) {
            let begun = Movie::create(path, [image.width, image.height], &self.options(&options.metadata));
            self.movie = Some(begun.map_err(Failure::Output)?);
        }
        let written = match &mut self.movie {
            Some(movie) => movie.add(&image),
            None => write::image(path, &image, &options),
        };
        written.map_err(Failure::Output)?;
        self.written += 1;
        let number = self.movie.as_ref().map_or(String::new(), |_| format!("  picture {}", self.written));
        self.report.note(format_args!("{}{number}  {}", path.display(), seconds(took().as_secs_f64())));
        Ok(())
    }

    /// What is written over the bands of a picture, of which `preview` gives a small one, if anything is.
    pub(crate) fn bands(
        &mut self,
        camera: &Camera,
        shown: &Shown,
        preview: impl FnOnce() -> Outcome<Image>,
    ) -> Outcome<Option<Bands>> {
        self.annotator.write_bar(shown)?;
        self.annotator.bands((*camera, self.args.picture.frame()), shown, preview)
    }

    /// Writes a picture to `path` from bands, of which `band` gives the one that begins with a row, transparent or not; says how long it took,
    /// and returns whether it shows anything.
    pub(crate) fn write_bands(
        &mut self,
        path: &Path,
        (has_alpha, mut options): (bool, ImageOptions),
        over: Option<Bands>,
        mut band: impl FnMut(u32) -> tyndall::Result<Image>,
        took: impl FnOnce() -> Duration,
    ) -> Outcome<bool> {
        let size = self.args.picture.pixels();
        let described = over.as_ref().and_then(Bands::description);
        options.metadata.extend(described.map(|text| ("Annotations".into(), text.into())));
        let (mut shows, mut is_blank) = (false, false);
        let looked_at = |row| {
            let mut image = band(row)?;
            shows |= !image.shows_nothing();
            is_blank = !shows && row + image.height == size[1] && self.args.shapes.holdout().is_none();
            // What shows nothing is not written.
            if is_blank {
                return Err(Error::Interrupted);
            }
            over.iter().try_for_each(|over| over.annotate(row, &mut image))?;
            Ok(image)
        };
        match write::in_bands(path, size, has_alpha, &options, looked_at) {
            Err(_) if is_blank => return Ok(false),
            Err(error @ Error::Interrupted) => return Err(error.into()),
            written => written.map_err(Failure::Output)?,
        }
        self.written += 1;
        self.report.note(format_args!("{}  {}", path.display(), seconds(took().as_secs_f64())));
        Ok(true)
    }

    /// Ends the movie of the pictures that were made, also where some failed; one that was interrupted leaves nothing.
    pub(crate) fn finish(self, done: Outcome<()>) -> Outcome<()> {
        let Some(movie) = self.movie.filter(|_| matches!(done, Ok(()) | Err(Failure::Partial(_)))) else {
            return done;
        };
        let encoder = movie.encoder();
        movie.finish().map_err(Failure::Output)?;
        let (path, fps) = (self.args.picture.output.display(), self.args.frames.fps);
        let pictures = counted(self.written, "picture");
        self.report.note(format_args!("{path}  {pictures}, {fps} a second, encoder {encoder}"));
        done
    }

    /// A movie is not of one frame or time.
    fn options(&self, metadata: &[(String, String)]) -> MovieOptions {
        let of_movie = |(key, _): &&(String, String)| !matches!(key.as_str(), "Frame" | "Time" | "Picture");
        MovieOptions {
            frames_per_second: self.args.frames.fps,
            encoder: match self.args.frames.encoder {
                EncoderName::Auto => Encoder::Automatic,
                EncoderName::Ffmpeg => Encoder::Ffmpeg,
                EncoderName::BuiltIn => Encoder::BuiltIn,
            },
            metadata: metadata.iter().filter(of_movie).cloned().collect(),
        }
    }
}

/// A picture's name, with or without a place for a number.
pub(crate) struct Pattern {
    before: String,
    digits: Option<usize>,
    after: String,
    path: PathBuf,
}

impl Pattern {
    /// Finds the place of the number in the file's name: the last one written in a known way.
    pub(crate) fn new(path: &Path) -> Self {
        let text = path.to_str().unwrap_or_default();
        let found = percent(text).or_else(|| houdini(text)).or_else(|| hashes(text));
        let (start, end, digits) =
            found.map_or((0, 0, None), |(start, end, digits)| (start, end, Some(digits)));
        Self { before: text[..start].into(), digits, after: text[end..].into(), path: path.into() }
    }

    /// Whether there is a place for a number.
    pub(crate) fn is_numbered(&self) -> bool {
        self.digits.is_some()
    }

    /// The number that a path has where the pattern has its place, if it is like the pattern elsewhere.
    pub(crate) fn number(&self, path: &Path) -> Option<usize> {
        let digits = path.to_str()?.strip_prefix(&*self.before)?.strip_suffix(&*self.after)?;
        let number = digits.parse().ok().filter(|_| digits.bytes().all(|it| it.is_ascii_digit()))?;
        (self.name(number) == path || self.digits == Some(1)).then_some(number)
    }

    /// The name of picture `number`.
    pub(crate) fn name(&self, number: usize) -> PathBuf {
        match self.digits {
            Some(digits) => format!("{}{number:0digits$}{}", self.before, self.after).into(),
            None => self.path.clone(),
        }
    }
}

/// `%d`, `%4d` or `%04d`: start, end, digits.
fn percent(text: &str) -> Option<(usize, usize, usize)> {
    text.rmatch_indices('%').find_map(|(start, _)| {
        let width: String = text[start + 1..].chars().take_while(char::is_ascii_digit).collect();
        let end = start + 1 + width.len();
        let digits = if width.is_empty() { 1 } else { width.parse().ok().filter(|digits| *digits <= 20)? };
        text[end..].starts_with('d').then_some((start, end + 1, digits))
    })
}

/// `$F` or `$F4`.
fn houdini(text: &str) -> Option<(usize, usize, usize)> {
    let start = text.rfind("$F")?;
    match text[start + 2..].chars().next().and_then(|digit| digit.to_digit(10)) {
        Some(digits) => Some((start, start + 3, digits as usize)),
        None => Some((start, start + 2, 1)),
    }
}

/// A run of `#`.
fn hashes(text: &str) -> Option<(usize, usize, usize)> {
    let end = text.rfind('#')? + 1;
    let start = text[..end].trim_end_matches('#').len();
    (end - start <= 20).then_some((start, end, end - start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_their_place() {
        for (pattern, name) in [
            ("a.%04d.png", "a.0012.png"),
            ("a%d.png", "a12.png"),
            ("d#/a####.exr", "d#/a0012.exr"),
            ("a.$F4.exr", "a.0012.exr"),
            ("a$F.exr", "a12.exr"),
            ("100%.png", "100%.png"),
            ("ä%03d.png", "ä012.png"),
        ] {
            assert_eq!(Pattern::new(Path::new(pattern)).name(12), Path::new(name), "{pattern}");
        }
        let number = |pattern: &str, path: &str| Pattern::new(Path::new(pattern)).number(Path::new(path));
        for (pattern, path, expected) in [
            ("a.%04d.png", "a.0012.png", Some(12)),
            ("a.####.png", "a.12345.png", Some(12345)),
            ("a.####.png", "a.012.png", None),
            ("a.#.png", "a.012.png", Some(12)),
            ("b/a$F", "b/a7", Some(7)),
            ("a%d.png", "a+7.png", None),
            ("a%d.png", "a.png", None),
            ("a%d.png", "a7.exr", None),
        ] {
            assert_eq!(number(pattern, path), expected, "{pattern} {path}");
        }
        assert!(!Pattern::new(Path::new("a.png")).is_numbered());
        assert!(Pattern::new(Path::new("a.#.png")).is_numbered());
    }
}
