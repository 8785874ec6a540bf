//! Pictures to files: the extension says which kind, and a file appears whole or not at all.

mod exr;
mod jpeg;
pub mod map;
pub mod movie;
pub mod particles;
mod png;
mod stored;

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tyndall::film::Window;
use tyndall::{Error, Image, Result};

/// How a picture is written, and what is written with it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageOptions {
    /// Bits of a PNG's channel: 8 or 16. An EXR always has 32-bit floats.
    pub bits: u8,
    /// Quality of a JPEG, from 1 (small) to 100 (good).
    pub quality: u8,
    /// Pixels an inch on paper, above 0.
    pub dpi: Option<f64>,
    /// Keys and texts that say how the picture came about. A key has 1 to 79 letters and signs of Latin-1; a text is any.
    pub metadata: Vec<(String, String)>,
    /// Names and values of further channels, pixel by pixel; only an EXR has them.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Whether an EXR has `depth`.
    pub has_depth: bool,
    /// Whether an EXR has `id`.
    pub has_ids: bool,
    /// Of which part of a larger picture, and how large that is, the pixels are; only an EXR knows of that.
    pub part_of: Option<(Window, [u32; 2])>,
}

impl Default for ImageOptions {
    fn default() -> Self {
        Self {
            bits: 8,
            quality: 92,
            dpi: None,
            metadata: Vec::new(),
            channels: Vec::new(),
            has_depth: true,
            has_ids: true,
            part_of: None,
        }
    }
}

/// The kinds of picture files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Png,
    Exr,
    Jpeg,
}

/// Writes a picture: `.png` (sRGB, straight alpha unless all is opaque), `.jpg` (sRGB, opaque) or `.exr` (linear 32-bit floats,
/// premultiplied, with `depth`, `id` and further channels). Replaces the file that is there.
///
/// Fails with [`Error::Setting`] on another extension or a setting out of its range, with [`Error::Io`] if the system refuses.
/// Panics if the image's columns do not have `width * height` values.
pub fn image(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let pixels = image.width as usize * image.height as usize;
    assert!(
        [image.color.len(), image.depth.len(), image.id.len()] == [pixels; 3],
        "columns of {pixels} pixels"
    );
    assert!(options.channels.iter().all(|(_, values)| values.len() == pixels), "channels of {pixels} pixels");
    check_options([image.width, image.height], options)?;
    match kind(path)? {
        Kind::Png => png::write(path, image, options),
        Kind::Exr => exr::write(path, image, options),
        Kind::Jpeg => jpeg::write(path, image, options),
    }
}

/// Writes a PNG of that size from bands of rows, from the top down, so that the picture need not be in memory: `band` gives the one that begins
/// with a row, as wide as the picture and with at least one row. With `has_alpha` it is taken to be transparent.
///
/// Fails as [`image()`] does, and if `band` does; then nothing is written.
pub fn in_bands(
    path: &Path,
    size: [u32; 2],
    has_alpha: bool,
    options: &ImageOptions,
    band: impl FnMut(u32) -> Result<Image>,
) -> Result<()> {
    check_options(size, options)?;
    match kind(path)? {
        Kind::Png => png::write_in_bands(path, size, has_alpha, options, band),
        Kind::Exr | Kind::Jpeg => {
            Err(Error::setting("-o", path.display(), "a picture that is written in bands is a .png"))
        }
    }
}

/// Whether a picture there can have further channels.
pub fn takes_channels(path: &Path) -> bool {
    matches!(kind(path), Ok(Kind::Exr))
}

/// Whether [`in_bands`] can write there.
pub fn takes_bands(path: &Path) -> bool {
    matches!(kind(path), Ok(Kind::Png))
}

fn check_options([width, height]: [u32; 2], options: &ImageOptions) -> Result<()> {
    if width == 0 || height == 0 {
        let size = format!("{width}x{height}");
        return Err(Error::setting("--size", size, "a picture has at least one pixel"));
    }
    if let Some(dpi) = options.dpi.filter(|dpi| !(1e-3..1e6).contains(dpi)) {
        return Err(Error::setting("--dpi", dpi, "pixels an inch, from 0.001 to a million"));
    }
    if let Some((key, _)) = options.metadata.iter().find(|(key, _)| !is_key(key)) {
        return Err(Error::setting(
            "metadata",
            key,
            "a key has 1 to 79 letters and signs of Latin-1, and single spaces inside",
        ));
    }
    Ok(())
}

/// Whether a picture there may be transparent: not a JPEG.
pub fn has_alpha(path: &Path) -> bool {
    !matches!(kind(path), Ok(Kind::Jpeg))
}

/// The error about a transparent picture of a kind that is opaque.
pub fn transparent(path: &Path, kind: &str) -> Error {
    let allowed =
        format!("a {kind} cannot be transparent: give a background, or a name that ends in .png or .exr");
    Error::setting("-o", path.display(), allowed)
}

/// Whether [`image()`] could write `path`: says so before the work of rendering, by the same errors. Leaves nothing behind.
pub fn check(path: &Path) -> Result<()> {
    kind(path)?;
    check_place(path)
}

/// Whether a file can be written at `path`, whatever is in it. Leaves nothing behind.
pub fn check_place(path: &Path) -> Result<()> {
    let Some(target) = Target::of(path)? else { return Ok(()) };
    File::create(&target.aside).map_err(|error| Error::io(path, error))?;
    fs::remove_file(&target.aside).map_err(|error| Error::io(&target.aside, error))
}

/// Writes a file by `fill`, so that it appears at `path` complete or not at all: it grows under a hidden name in the same folder,
/// is flushed to the disk and then renamed. If anything fails, what was there before stays and the hidden file goes.
///
/// A path that is no ordinary file (a pipe, a device) is written directly.
pub fn atomically(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    let Some(target) = Target::of(path)? else {
        let file = File::options().write(true).open(path);
        let filled = file.map(BufWriter::new).and_then(|mut file| {
            fill(&mut file)?;
            file.flush()
        });
        return filled.map_err(|error| Error::io(path, error));
    };
    let filled = File::create(&target.aside).map(BufWriter::new).and_then(|mut file| {
        fill(&mut file)?;
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&target.aside, &target.place)
    });
    filled.map_err(|error| {
        // The first error is the one to tell; if even this fails, there is nothing to add.
        let _ = fs::remove_file(&target.aside);
        Error::io(path, error)
    })
}

/// Where a file is to appear, and where it grows.
struct Target {
    place: PathBuf,
    aside: PathBuf,
}

impl Target {
    /// `None` if the path is there and no ordinary file. A link is followed, so that it stays one.
    fn of(path: &Path) -> Result<Option<Self>> {
        let refused = |kind, what: &str| Err(Error::io(path, io::Error::new(kind, what)));
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => {
                return refused(ErrorKind::IsADirectory, "is a folder, not a file");
            }
            Ok(found) if !found.is_file() => return Ok(None),
            _ => {}
        }
        let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        let Some(name) = place.file_name() else {
            return refused(ErrorKind::InvalidInput, "has no file name");
        };
        let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return refused(ErrorKind::NotFound, "its folder does not exist: create it first");
        }
        let aside = folder.join(format!(".{}.{}.tmp", name.to_string_lossy(), std::process::id()));
        Ok(Some(Self { aside, place }))
    }
}

/// Whether both formats take the key: PNG's rule is the narrower one.
fn is_key(key: &str) -> bool {
    let printable = |letter: char| matches!(letter, ' '..='~' | '\u{a1}'..='\u{ff}');
    (1..=79).contains(&key.chars().count())
        && key.chars().all(printable)
        && !key.starts_with(' ')
        && !key.ends_with(' ')
        && !key.contains("  ")
}

fn kind(path: &Path) -> Result<Kind> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        Some("png") => Ok(Kind::Png),
        Some("exr") => Ok(Kind::Exr),
        Some("jpg" | "jpeg") => Ok(Kind::Jpeg),
        _ => Err(Error::setting(
            "-o",
            path.display(),
            "the extension says what to write; known: .png .jpg .exr, of movies .mp4 .gif .webp",
        )),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A folder of this test's own, removed with it.
    pub(crate) struct Folder(pub(crate) PathBuf);

    impl Folder {
        pub(crate) fn new(test: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("tyndall-{test}-{}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            Self(folder)
        }

        pub(crate) fn names(&self) -> Vec<String> {
            let entries = fs::read_dir(&self.0).unwrap();
            let mut names: Vec<_> =
                entries.map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    /// A picture with a ramp of colors and alphas, and pixels that show nothing.
    pub(crate) fn ramp(width: u32, height: u32, opaque: bool) -> Image {
        let pixels = (width * height) as usize;
        let pixel = |k: usize| {
            let t = k as f32 / pixels as f32;
            let alpha = if opaque { 1.0 } else { t };
            [alpha * t, alpha * (1.0 - t), alpha * 0.25, alpha]
        };
        let met = |k: usize| !k.is_multiple_of(3);
        Image {
            width,
            height,
            color: (0..pixels).map(pixel).collect(),
            depth: (0..pixels).map(|k| if met(k) { 0.1 * k as f32 } else { f32::INFINITY }).collect(),
            id: (0..pixels).map(|k| if met(k) { k as i64 } else { -1 }).collect(),
        }
    }

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = Folder::new("atomically");
        let path = folder.0.join("out.bin");
        atomically(&path, |file| file.write_all(b"old")).unwrap();
        let error = atomically(&path, |file| {
            file.write_all(b"half of the n")?;
            Err(io::Error::from(ErrorKind::StorageFull))
        });
        assert!(matches!(&error, Err(Error::Io { path: told, .. }) if *told == path), "{error:?}");
        assert_eq!(
            (fs::read(&path).unwrap(), folder.names()),
            (b"old".to_vec(), vec!["out.bin".to_string()])
        );
        atomically(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!((fs::read(&path).unwrap(), folder.names().len()), (b"new".to_vec(), 1));
    }

    #[test]
    fn a_full_disk_is_told_with_the_path() {
        let full = Path::new("/dev/full");
        if full.exists() {
            let error = atomically(full, |file| file.write_all(&[0; 100_000])).unwrap_err();
            assert!(error.to_string().starts_with("/dev/full: "), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = Folder::new("link");
        let (file, link) = (folder.0.join("real.bin"), folder.0.join("link.bin"));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        atomically(&link, |file| file.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }

    #[test]
    fn what_cannot_be_written_is_refused_before_the_work() {
        let folder = Folder::new("check");
        check(&folder.0.join("a.PNG")).unwrap();
        check(Path::new("here.exr")).unwrap();
        assert!(folder.names().is_empty());
        for name in ["a.tga", "png", "a", ".png"] {
            let message = check(&folder.0.join(name)).unwrap_err().to_string();
            assert!(
                message.starts_with("-o cannot be") && message.contains("known: .png .jpg .exr"),
                "{message}"
            );
        }
        assert!(matches!(check(&folder.0.join("none/a.png")), Err(Error::Io { .. })));
        fs::create_dir(folder.0.join("folder.png")).unwrap();
        assert!(check(&folder.0.join("folder.png")).unwrap_err().to_string().contains("is a folder"));
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let folder = Folder::new("settings");
        let refused = |name: &str, size: u32, options: ImageOptions| {
            matches!(
                image(&folder.0.join(name), &ramp(size, size, true), &options),
                Err(Error::Setting { .. })
            )
        };
        assert!(refused("a.png", 0, ImageOptions::default()));
        assert!(refused("a.png", 2, ImageOptions { bits: 12, ..Default::default() }));
        assert!(refused("a.exr", 2, ImageOptions { dpi: Some(f64::NAN), ..Default::default() }));
        for key in ["", " a", "a  b", "\u{3b1}", "a\0", &"k".repeat(80)] {
            let metadata = vec![(key.to_string(), "text".to_string())];
            assert!(
                refused("a.png", 2, ImageOptions { metadata: metadata.clone(), ..Default::default() }),
                "{key:?}"
            );
            assert!(refused("a.exr", 2, ImageOptions { metadata, ..Default::default() }), "{key:?}");
        }
        assert!(folder.names().is_empty());
    }
}
