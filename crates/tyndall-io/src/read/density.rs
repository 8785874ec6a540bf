//! A density grid of another program: nothing but its samples, x fastest, then y, then z, little-endian.
//!
//! Takes a file and what it does not say of itself: how many samples there are, their type, what one unit of them means, where
//! they lie. The samples may be packed by gzip, Zstandard or as a zlib stream; a file of exactly the right size is taken as plain.
//! Memory grows with what is really there, never by what was promised.

use std::io::{BufReader, Read};
use std::path::Path;

use flate2::read::ZlibDecoder;
use tyndall::medium::Grid;
use tyndall::{Error, Progress, Result, Vec3};

use super::Packing;

/// What a raw grid file does not say of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawGrid {
    /// Samples along x, y, z.
    pub size: [u32; 3],
    /// Type of the samples.
    pub sample: Sample,
    /// Density of a sample of value 1.
    pub scale: f64,
    /// Where the first sample lies, measured from the particles' origin.
    pub origin: Vec3,
    /// Distance of neighboring samples.
    pub spacing: f32,
}

/// Type of a raw grid's samples, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sample {
    /// 16-bit whole numbers from 0.
    U16,
    /// 32-bit floats.
    F32,
}

impl Sample {
    /// The names that [`Sample::named`] knows.
    pub const NAMES: [&'static str; 2] = ["u16", "f32"];

    /// The type called `name`; [`Error::Setting`] with the known names if there is none.
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "u16" => Ok(Self::U16),
            "f32" => Ok(Self::F32),
            _ => Err(Error::setting("sample", name, format!("one of {}", Self::NAMES.join(", ")))),
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }
}

/// Bytes that are read and converted at a time; whole samples of every type.
const STEP: usize = 1 << 20;

/// Reads a raw grid.
///
/// Fails with [`Error::Format`] if the file has too few or too many samples or is damaged, and with [`Error::Setting`] where
/// [`Grid::from_dense`] does: a negative density, for example.
pub fn density(path: &Path, raw: &RawGrid, progress: &dyn Progress) -> Result<Grid> {
    let count = raw.size.iter().try_fold(1u64, |count, &size| count.checked_mul(u64::from(size)));
    let wanted = count.and_then(|count| count.checked_mul(raw.sample.bytes() as u64)).filter(|&it| it > 0);
    let Some(wanted) = wanted else {
        let allowed = "three counts above 0 whose samples have less than 2^64 bytes";
        return Err(Error::setting("size", format!("{:?}", raw.size), allowed));
    };
    if !(raw.scale >= 0.0 && raw.scale.is_finite()) {
        return Err(Error::setting("scale", raw.scale, "a finite number of at least 0"));
    }
    progress.begin("read", Some(wanted), "B");
    let mut stream = unpacked(path, wanted)?;
    let mut values = Vec::new();
    let mut left = wanted;
    let mut bytes = Vec::with_capacity(STEP);
    while left > 0 {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        bytes.clear();
        let step = left.min(STEP as u64);
        (&mut stream).take(step).read_to_end(&mut bytes).map_err(|error| damaged(path, &error))?;
        if (bytes.len() as u64) < step {
            return Err(wrong_size(path, wanted, wanted - left + bytes.len() as u64));
        }
        values.try_reserve(bytes.len() / raw.sample.bytes()).map_err(|_| Error::Memory {
            what: format!("the grid of {}", path.display()),
            needed_bytes: wanted / raw.sample.bytes() as u64 * 4,
            available_bytes: 4 * values.len() as u64,
            hint: "give a coarser grid".to_string(),
        })?;
        convert(&bytes, raw, &mut values);
        left -= step;
        progress.advance(step);
    }
    if stream.read(&mut [0]).map_err(|error| damaged(path, &error))? > 0 {
        return Err(wrong_size(path, wanted, wanted + 1));
    }
    Grid::from_dense(raw.origin, raw.spacing, raw.size, &values)
}

/// The samples' bytes, unpacked.
fn unpacked(path: &Path, wanted: u64) -> Result<Box<dyn Read + Send>> {
    let io = |source| Error::io(path, source);
    let mut file = super::open(path)?;
    let length = file.metadata().map_err(io)?.len();
    let mut head = Vec::new();
    (&mut file).take(4).read_to_end(&mut head).map_err(io)?;
    let file = super::open(path)?;
    // RFC 1950: a zlib stream has the method 8 in its first byte, and its first two bytes are a multiple of 31.
    let is_zlib = head.len() > 1 && head[0] & 15 == 8 && u16::from_be_bytes([head[0], head[1]]) % 31 == 0;
    Ok(match Packing::of(&head) {
        _ if length == wanted => Box::new(BufReader::new(file)),
        Packing::Plain if is_zlib => Box::new(ZlibDecoder::new(BufReader::new(file))),
        Packing::Plain => return Err(wrong_size(path, wanted, length)),
        packing => Box::new(packing.stream(file)),
    })
}

fn convert(bytes: &[u8], raw: &RawGrid, values: &mut Vec<f32>) {
    match raw.sample {
        Sample::U16 => values.extend(
            bytes
                .as_chunks::<2>()
                .0
                .iter()
                .map(|&bytes| (f64::from(u16::from_le_bytes(bytes)) * raw.scale) as f32),
        ),
        Sample::F32 => values.extend(
            bytes
                .as_chunks::<4>()
                .0
                .iter()
                .map(|&bytes| (f64::from(f32::from_le_bytes(bytes)) * raw.scale) as f32),
        ),
    }
}

fn damaged(path: &Path, error: &std::io::Error) -> Error {
    let what = format!("the compressed data end early or are damaged: {error}");
    Error::format(path, "", what, "was the file copied to its end?")
}

fn wrong_size(path: &Path, wanted: u64, found: u64) -> Error {
    let found = if found > wanted { "more are there".to_string() } else { format!("{found} are there") };
    let what = format!("the grid's size asks for {wanted} bytes of samples, {found}");
    Error::format(path, "", what, "are size and sample type right?")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::PathBuf;

    const RAW: RawGrid =
        RawGrid { size: [3, 2, 2], sample: Sample::U16, scale: 0.5, origin: Vec3::ONE, spacing: 0.25 };

    /// A file of `bytes` that is gone afterwards.
    fn with_file<T>(name: &str, bytes: &[u8], act: impl Fn(&Path) -> T) -> T {
        let path: PathBuf =
            std::env::temp_dir().join(format!("tyndall-density-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        let result = act(&path);
        std::fs::remove_file(&path).unwrap();
        result
    }

    fn read(name: &str, bytes: &[u8], raw: RawGrid) -> Result<Grid> {
        with_file(name, bytes, |path| density(path, &raw, &()))
    }

    fn samples() -> Vec<u8> {
        (0..12u16).flat_map(|k| (k * 1000).to_le_bytes()).collect()
    }

    fn zlib(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn plain_and_packed_samples_are_read_alike() {
        let zstd =
            ruzstd::encoding::compress_to_vec(&samples()[..], ruzstd::encoding::CompressionLevel::Fastest);
        for (name, bytes) in [("plain", samples()), ("zlib", zlib(&samples())), ("zstd", zstd)] {
            let grid = read(name, &bytes, RAW).unwrap();
            assert_eq!((grid.size(), grid.origin(), grid.spacing()), ([3, 2, 2], Vec3::ONE, 0.25));
            // x fastest, then y, then z.
            assert_eq!(
                (grid.value(1, 0, 0), grid.value(0, 1, 0), grid.value(2, 1, 1)),
                (500.0, 1500.0, 5500.0)
            );
        }
        let floats: Vec<u8> = (0..12).flat_map(|k| (0.1 * k as f32).to_le_bytes()).collect();
        let grid = read("f32", &floats, RawGrid { sample: Sample::F32, scale: 2.0, ..RAW }).unwrap();
        assert_eq!(grid.value(0, 0, 1), 2.0 * (0.1_f32 * 6.0));
    }

    #[test]
    fn what_does_not_fit_is_refused_in_bounded_memory() {
        let says = |name: &str, bytes: &[u8], raw: RawGrid| read(name, bytes, raw).unwrap_err().to_string();
        assert!(says("short", &samples()[..23], RAW).contains("24 bytes of samples, 23 are there"));
        assert!(says("short.z", &zlib(&samples()[..22]), RAW).contains("22 are there"));
        assert!(says("long.z", &zlib(&[samples(), samples()].concat()), RAW).contains("more are there"));
        let packed = zlib(&samples());
        assert!(says("cut.z", &packed[..packed.len() / 2], RAW).contains("damaged"));
        // Sizes that no machine holds: refused before or as soon as the samples end.
        let huge = RawGrid { size: [1 << 24; 3], ..RAW };
        assert!(says("huge", &samples(), huge).contains("bytes"));
        let large = RawGrid { size: [1 << 20, 1 << 20, 1 << 10], ..RAW };
        assert!(says("large.z", &packed, large).contains("24 are there"));
        assert!(says("none", &[], RawGrid { size: [0, 1, 1], ..RAW }).contains("above 0"));
        let negative: Vec<u8> = [-1.0_f32; 12].iter().flat_map(|it| it.to_le_bytes()).collect();
        assert!(says("negative", &negative, RawGrid { sample: Sample::F32, ..RAW }).contains("density"));
        let scale = RawGrid { scale: f64::NAN, ..RAW };
        assert!(says("scale", &samples(), scale).contains("scale"));
        assert!(Sample::named("u8").is_err() && Sample::named("f32").unwrap() == Sample::F32);
        assert!(density(Path::new("/nowhere/grid"), &RAW, &()).is_err());
    }

    #[test]
    fn no_damage_makes_it_panic() {
        super::super::real_data::damage(&zlib(&samples()), |bytes| {
            let _ = read("damage", bytes, RAW);
        });
    }
}
