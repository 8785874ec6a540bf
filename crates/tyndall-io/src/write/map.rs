//! Maps of numbers, one a pixel: NumPy arrays and FITS images, in double precision as they are.
//!
//! An array (`.npy`) has the shape (rows, columns), its first row is the picture's upper one. A FITS image (`.fits`) begins with the
//! lower row, as its readers expect; the header has the unit and where pixels lie. Neither has a place for all of the metadata: an array's go
//! into a text beside it, `NAME.npy.json`.
//! Source: W. Pence et al., "Definition of the Flexible Image Transport System (FITS), version 3.0", A&A 524, 2010.

use std::io::Write;
use std::path::{Path, PathBuf};

use tyndall::{Error, Result};

use super::atomically;
use super::particles::npy_header;

/// Bytes of a FITS record, and of a line of its header.
const RECORD: usize = 2880;
const CARD: usize = 80;

/// A map.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top left; NaN where there is no number.
    pub values: &'a [f64],
    /// What it is of.
    pub quantity: &'a str,
    /// The unit of the numbers, as text; empty if unknown.
    pub unit: &'a str,
    /// The picture plane's coordinates of the middle of the lower left pixel.
    pub origin: [f64; 2],
    /// Edge of a pixel.
    pub pixel: f64,
    /// The unit of the lengths; empty if unknown.
    pub length_unit: &'a str,
    /// Keys and texts that say how the map came about.
    pub metadata: &'a [(String, String)],
}

/// Whether [`map`] writes files of that name.
pub fn is_map(path: &Path) -> bool {
    kind(path).is_some()
}

enum Kind {
    Array,
    Fits,
}

fn kind(path: &Path) -> Option<Kind> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    match extension.as_str() {
        "npy" => Some(Kind::Array),
        "fits" | "fit" => Some(Kind::Fits),
        _ => None,
    }
}

/// Writes a map into a `.npy` or `.fits`. Fails with [`Error::Setting`] on another extension, with [`Error::Io`] if the system refuses.
/// Panics if there are not `width * height` values.
pub fn map(path: &Path, map: &Map) -> Result<()> {
    assert_eq!(map.values.len(), map.width as usize * map.height as usize, "a value for each pixel");
    match kind(path) {
        Some(Kind::Array) => array(path, map),
        Some(Kind::Fits) => fits(path, map),
        None => Err(Error::setting("-o", path.display(), "a map of numbers is .npy or .fits")),
    }
}

fn array(path: &Path, map: &Map) -> Result<()> {
    atomically(path, |file| {
        file.write_all(&npy_header("'<f8'", &[map.height as usize, map.width as usize]))?;
        map.values.iter().try_for_each(|value| file.write_all(&value.to_le_bytes()))
    })?;
    let texts: serde_json::Map<String, serde_json::Value> =
        map.metadata.iter().map(|(key, text)| (key.clone(), text.clone().into())).collect();
    let object = serde_json::json!({
        "quantity": map.quantity,
        "unit": map.unit,
        "shape": [map.height, map.width],
        "lower_left_pixel": map.origin,
        "pixel": map.pixel,
        "length_unit": map.length_unit,
        "metadata": texts,
    });
    let mut beside = path.as_os_str().to_os_string();
    beside.push(".json");
    atomically(&PathBuf::from(beside), |file| file.write_all(format!("{object:#}\n").as_bytes()))
}

fn fits(path: &Path, map: &Map) -> Result<()> {
    let mut cards = vec![
        card("SIMPLE", "T", ""),
        card("BITPIX", "-64", "double precision"),
        card("NAXIS", "2", ""),
        card("NAXIS1", &map.width.to_string(), ""),
        card("NAXIS2", &map.height.to_string(), ""),
        card("BUNIT", &text(map.unit), "unit of the numbers"),
        card("OBJECT", &text(map.quantity), "what the map is of"),
    ];
    for (axis, name) in ["X", "Y"].iter().enumerate() {
        let number = |it: f64| format!("{it:E}");
        cards.push(card(&format!("CTYPE{}", axis + 1), &text(name), "along the picture plane"));
        cards.push(card(&format!("CRPIX{}", axis + 1), "1.0", ""));
        cards.push(card(&format!("CRVAL{}", axis + 1), &number(map.origin[axis]), "middle of that pixel"));
        cards.push(card(&format!("CDELT{}", axis + 1), &number(map.pixel), "edge of a pixel"));
        cards.push(card(&format!("CUNIT{}", axis + 1), &text(map.length_unit), ""));
    }
    for (key, words) in map.metadata {
        let line: Vec<char> = printable(&format!("{key}: {words}")).chars().collect();
        cards
            .extend(line.chunks(CARD - 8).map(|part| format!("HISTORY {}", part.iter().collect::<String>())));
    }
    cards.push("END".into());
    let mut header: String = cards.iter().map(|card| format!("{card:<CARD$}")).collect();
    header += &" ".repeat(header.len().next_multiple_of(RECORD) - header.len());
    let values = 8 * map.values.len();
    atomically(path, |file| {
        file.write_all(header.as_bytes())?;
        for row in map.values.rchunks_exact(map.width as usize) {
            row.iter().try_for_each(|value| file.write_all(&value.to_be_bytes()))?;
        }
        file.write_all(&vec![0; values.next_multiple_of(RECORD) - values])
    })
}

/// A line of the header: numbers end in column 30, texts begin in column 11.
fn card(key: &str, value: &str, comment: &str) -> String {
    let comment = if comment.is_empty() { String::new() } else { format!(" / {comment}") };
    let value = if value.starts_with('\'') { value.to_string() } else { format!("{value:>20}") };
    let line = format!("{key:<8}= {value}{comment}");
    line.chars().take(CARD).collect()
}

/// A text in quotes, of at most 66 letters.
fn text(words: &str) -> String {
    let words: String = printable(words).replace('\'', "''").chars().take(66).collect();
    format!("'{words:<8}'")
}

/// The letters that FITS allows; others are question marks.
fn printable(words: &str) -> String {
    words.chars().map(|it| if matches!(it, ' '..='~') { it } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::Folder;
    use super::*;
    use std::fs;

    fn sample<'a>(values: &'a [f64], metadata: &'a [(String, String)]) -> Map<'a> {
        Map {
            width: 3,
            height: 2,
            values,
            quantity: "density",
            unit: "Msun/kpc^2",
            origin: [-1.5, 2.0],
            pixel: 0.5,
            length_unit: "kpc",
            metadata,
        }
    }

    #[test]
    fn an_array_has_the_numbers_as_they_are() {
        let folder = Folder::new("map-npy");
        let path = folder.0.join("a.npy");
        let values = [1.0, 2.0, 1e300, -4.0, f64::NAN, 6.5e-200];
        let metadata = [("Command".to_string(), "tyndall render".to_string())];
        map(&path, &sample(&values, &metadata)).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!((&bytes[..6], bytes.len() % 64), (&b"\x93NUMPY"[..], 48));
        assert!(bytes.windows(16).any(|it| it == b"'shape': (2, 3),"));
        let read: Vec<u64> = bytes[bytes.len() - 48..]
            .chunks(8)
            .map(|it| f64::from_le_bytes(it.try_into().unwrap()).to_bits())
            .collect();
        assert_eq!(read, values.map(f64::to_bits));
        let beside: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.0.join("a.npy.json")).unwrap()).unwrap();
        assert_eq!(beside["unit"], "Msun/kpc^2");
        assert_eq!(beside["metadata"]["Command"], "tyndall render");
        assert!(map(&folder.0.join("a.csv"), &sample(&values, &metadata)).is_err());
    }

    #[test]
    fn a_fits_image_begins_with_the_lower_row() {
        let folder = Folder::new("map-fits");
        let path = folder.0.join("a.fits");
        let metadata = [("Guesses".to_string(), format!("µ {}", "long ".repeat(30)))];
        map(&path, &sample(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &metadata)).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes.len(), 2 * RECORD);
        let header = String::from_utf8(bytes[..RECORD].to_vec()).unwrap();
        let card = |key: &str| {
            let mut cards = (0..RECORD / CARD).map(|line| &header[line * CARD..][..CARD]);
            cards.find(|card| card.starts_with(key)).unwrap().to_string()
        };
        assert_eq!(&header[..30], "SIMPLE  =                    T");
        assert_eq!(card("BITPIX")[..30].split_whitespace().last(), Some("-64"));
        assert!(card("BUNIT").starts_with("BUNIT   = 'Msun/kpc^2' /"), "{}", card("BUNIT"));
        assert!(card("CRVAL1").contains("-1.5E0") && card("CDELT2").contains("5E-1"));
        assert!(card("HISTORY").starts_with("HISTORY Guesses: ? long"));
        assert!(card("END").trim_end() == "END");
        let value = |place: usize| f64::from_be_bytes(bytes[RECORD + 8 * place..][..8].try_into().unwrap());
        assert_eq!([value(0), value(2), value(3), value(6)], [4.0, 6.0, 1.0, 0.0]);
    }
}
