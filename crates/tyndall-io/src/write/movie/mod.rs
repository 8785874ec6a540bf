//! Movies: many pictures in one file, of which the extension says the kind. It grows under a hidden name and appears when it is finished.

mod ffmpeg;
mod gif;
mod h264;
mod mp4;
mod webp;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use tyndall::{Error, Image, Result};

use super::Target;
use super::stored::{Stored, is_opaque};

/// How a movie is written.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieOptions {
    /// Pictures a second, above 0, at most 1000; of a GIF at most 50, since viewers show faster ones slowly.
    pub frames_per_second: f64,
    /// What encodes an MP4.
    pub encoder: Encoder,
    /// Keys and texts that say how the movie came about: XMP of an MP4 and WebP, a comment of a GIF.
    pub metadata: Vec<(String, String)>,
}

impl Default for MovieOptions {
    fn default() -> Self {
        Self { frames_per_second: 24.0, encoder: Encoder::Automatic, metadata: Vec::new() }
    }
}

/// What encodes an MP4 (H.264, 4:2:0, BT.709). Other kinds have one encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoder {
    /// The program `ffmpeg` where it is found and has libx264, else the one that is built in.
    #[default]
    Automatic,
    /// The program `ffmpeg` with libx264. Files are smaller.
    Ffmpeg,
    /// The one that is built in.
    BuiltIn,
}

/// The kinds of movie files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Mp4,
    Gif,
    WebP,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "mp4" => Some(Self::Mp4),
            "gif" => Some(Self::Gif),
            "webp" => Some(Self::WebP),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Mp4 => "MP4",
            Self::Gif => "GIF",
            Self::WebP => "WebP",
        }
    }

    fn has_alpha(self) -> bool {
        self == Self::WebP
    }

    /// The most pixels across and down.
    fn most_pixels(self) -> u32 {
        match self {
            Self::Mp4 | Self::WebP => 16_384,
            Self::Gif => 65_535,
        }
    }
}

/// Whether the extension is that of a movie: `.mp4`, `.gif` or `.webp`.
pub fn is_movie(path: &Path) -> bool {
    Kind::of(path).is_some()
}

/// The size of a movie's pictures that comes nearest to the one wanted: an MP4's width and height are even.
pub fn size(path: &Path, [width, height]: [u32; 2]) -> [u32; 2] {
    match Kind::of(path) {
        Some(Kind::Mp4) => [width.next_multiple_of(2), height.next_multiple_of(2)],
        _ => [width, height],
    }
}

/// Whether a movie of pictures of `size`, through which something shines or not, could be written: says so before the work of
/// rendering. Leaves nothing behind.
///
/// Fails with [`Error::Setting`] where the kind has no such pictures or rate, with [`Error::Io`] if the system refuses the file.
pub fn check(path: &Path, size: [u32; 2], is_opaque: bool, options: &MovieOptions) -> Result<()> {
    let kind = plan(path, size, options)?;
    if !is_opaque && !kind.has_alpha() {
        return Err(transparent(path, kind));
    }
    let (_, aside) = Aside::create(path)?;
    drop(aside);
    Ok(())
}

/// Encodes the pictures of a kind, of which each is 8 bits a channel, row by row.
trait Frames {
    /// A picture, red, green, blue (and alpha, in a WebP) of each pixel.
    fn add(&mut self, pixels: &[u8]) -> io::Result<()>;

    /// Writes what is left, and the metadata.
    fn finish(self: Box<Self>, metadata: &[(String, String)]) -> io::Result<()>;
}

/// A movie that is being written. Dropped before [`Movie::finish`], it leaves nothing behind.
pub struct Movie {
    path: PathBuf,
    kind: Kind,
    size: [u32; 2],
    frames: Box<dyn Frames>,
    encoder: &'static str,
    metadata: Vec<(String, String)>,
    aside: Aside,
}

impl Movie {
    /// Begins a movie of pictures of that width and height. Fails as [`check`] does, and with [`Error::Setting`] where `ffmpeg` is asked
    /// for and not there.
    pub fn create(path: &Path, size: [u32; 2], options: &MovieOptions) -> Result<Self> {
        let kind = plan(path, size, options)?;
        let rate = options.frames_per_second;
        let uses_ffmpeg = match (kind, options.encoder) {
            (Kind::Mp4, Encoder::Automatic) => ffmpeg::has_x264(),
            (Kind::Mp4, Encoder::Ffmpeg) if ffmpeg::has_x264() => true,
            (Kind::Mp4, Encoder::Ffmpeg) => {
                let allowed = "ffmpeg with libx264 is not on the PATH: install it, or leave --encoder out";
                return Err(Error::setting("--encoder", "ffmpeg", allowed));
            }
            _ => false,
        };
        let (file, aside) = Aside::create(path)?;
        let told = |error| Error::io(path, error);
        let (frames, encoder): (Box<dyn Frames>, _) = match kind {
            Kind::Mp4 if uses_ffmpeg => {
                drop(file);
                let process = ffmpeg::Process::start(&aside.target.aside, size, rate).map_err(told)?;
                (Box::new(process), "ffmpeg, libx264")
            }
            Kind::Mp4 => (Box::new(mp4::File::new(file, size, rate).map_err(told)?), "built in"),
            Kind::Gif => {
                (Box::new(gif::File::new(file, size, rate, &options.metadata).map_err(told)?), "built in")
            }
            Kind::WebP => (Box::new(webp::File::new(file, size, rate).map_err(told)?), "built in"),
        };
        let metadata = options.metadata.clone();
        Ok(Self { path: path.into(), kind, size, frames, encoder, metadata, aside })
    }

    /// What encodes it, for people to read.
    pub fn encoder(&self) -> &'static str {
        self.encoder
    }

    /// Appends a picture.
    ///
    /// Fails with [`Error::Setting`] if something shines through it in a kind that has no alpha, with [`Error::Io`] if it cannot be
    /// written. Panics if it has another size than the movie.
    pub fn add(&mut self, image: &Image) -> Result<()> {
        assert_eq!([image.width, image.height], self.size, "a movie's pictures have one size");
        let has_alpha = self.kind.has_alpha();
        if !has_alpha && !is_opaque(image) {
            return Err(transparent(&self.path, self.kind));
        }
        let stored = Stored { is_wide: false, has_alpha };
        let pixels = stored.bytes(&image.color).concat();
        self.frames.add(&pixels).map_err(|error| Error::io(&self.path, error))
    }

    /// Ends the movie, and lets the file appear.
    pub fn finish(self) -> Result<()> {
        let Self { path, frames, metadata, aside, .. } = self;
        let appeared = frames.finish(&metadata).and_then(|()| aside.appear());
        appeared.map_err(|error| Error::io(path, error))
    }
}

/// The kind of the movie, if there can be one like that.
fn plan(path: &Path, size: [u32; 2], options: &MovieOptions) -> Result<Kind> {
    let Some(kind) = Kind::of(path) else {
        let allowed = "the extension says what to write; movies are .mp4 .gif .webp";
        return Err(Error::setting("-o", path.display(), allowed));
    };
    let (rate, fastest) = (options.frames_per_second, if kind == Kind::Gif { 50.0 } else { 1000.0 });
    if !(rate > 0.0 && rate <= fastest) {
        return Err(Error::setting(
            "--fps",
            rate,
            format!("above 0, of a {} at most {fastest}", kind.name()),
        ));
    }
    let [width, height] = size;
    let text = format!("{width}x{height}");
    let most = kind.most_pixels();
    if width.min(height) == 0 || width.max(height) > most {
        let allowed = format!("pictures of a {} have 1 to {most} pixels across and down", kind.name());
        return Err(Error::setting("--size", text, allowed));
    }
    if kind == Kind::Mp4 {
        if self::size(path, size) != size {
            return Err(Error::setting("--size", text, "width and height of an MP4 are even"));
        }
        if h264::level(size, rate).is_none() {
            let allowed = "no level of H.264 has pictures as large as these at this rate: fewer pixels or a lower --fps, or numbered pictures";
            return Err(Error::setting("--size", text, allowed));
        }
    }
    Ok(kind)
}

fn transparent(path: &Path, kind: Kind) -> Error {
    let allowed =
        format!("a {} has no transparency: give a background, or write .webp or numbered .png", kind.name());
    Error::setting("-o", path.display(), allowed)
}

/// A file that grows under a hidden name, and goes with this unless it has appeared.
struct Aside {
    target: Target,
}

impl Aside {
    fn create(path: &Path) -> Result<(File, Self)> {
        let Some(target) = Target::of(path)? else {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "is no ordinary file: a movie needs one");
            return Err(Error::io(path, error));
        };
        let file = File::options().read(true).write(true).create(true).truncate(true).open(&target.aside);
        Ok((file.map_err(|error| Error::io(path, error))?, Self { target }))
    }

    fn appear(self) -> io::Result<()> {
        File::open(&self.target.aside)?.sync_all()?;
        fs::rename(&self.target.aside, &self.target.place)
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        // Where it has appeared, nothing is left to remove.
        let _ = fs::remove_file(&self.target.aside);
    }
}

/// How many units of time picture `number` is shown at a rate: whole ones that do not drift.
fn duration(number: u64, rate: f64, units_a_second: f64) -> u64 {
    let time = |number: u64| (number as f64 * units_a_second / rate).round() as u64;
    time(number + 1) - time(number)
}

#[cfg(test)]
mod tests;
