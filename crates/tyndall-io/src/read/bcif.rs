//! BinaryCIF: the categories of mmCIF, column by column, in MessagePack; models as frames.
//!
//! Takes the first data block that has `_atom_site`. A file is one value from its first byte to its last, so that one that is cut cannot be
//! read at all. What the columns mean: `atom_site.rs`. Source: BinaryCIF specification 0.3.0, github.com/molstar/BinaryCIF.

mod encoding;

use std::path::Path;

use tyndall::{Error, Progress, Result};

use self::encoding::Column;
use super::atom_site::{AtomSite, CATEGORIES, Data, Document, Kind, MOST_OPERATORS, kind};
use super::column::Words;
use super::message::{self, Value};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const HINT: &str = "download it again, or give the entry as mmCIF";

/// Whether the file begins like BinaryCIF: a map whose first names are those that it has.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let is_map = matches!(head.first(), Some(0x81..=0x8f | 0xde | 0xdf));
    is_map && memchr::memmem::find(&head[..head.len().min(512)], b"dataBlocks").is_some()
}

/// A category of a file.
struct Category<'v, 'a> {
    path: &'a Path,
    name: &'v str,
    rows: usize,
    columns: &'v [Value<'a>],
}

fn fault(path: &Path, place: &str, what: impl Into<String>) -> Error {
    Error::format(path, place, what, HINT)
}

fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<Value<'a>> {
    message::read(bytes).map_err(|place| {
        let what = if place == bytes.len() {
            "the file is cut off"
        } else {
            "this is not MessagePack as BinaryCIF has it"
        };
        fault(path, &format!("byte {place}"), what)
    })
}

/// The categories of the first block that has atoms. `bytes` is the size of the file: no category has more rows.
fn categories<'v, 'a>(path: &'a Path, file: &'v Value<'a>, bytes: usize) -> Result<Vec<Category<'v, 'a>>> {
    let blocks = file.get("dataBlocks").and_then(Value::list).unwrap_or_default();
    let of = |block: &'v Value<'a>| -> Vec<&'v Value<'a>> {
        block.get("categories").and_then(Value::list).unwrap_or_default().iter().collect()
    };
    let name = |category: &&'v Value<'a>| {
        let name = category.get("name").and_then(Value::text).unwrap_or_default();
        name.strip_prefix('_').unwrap_or(name)
    };
    let block = blocks.iter().map(of).find(|block| block.iter().any(|it| name(it) == "atom_site"));
    let Some(block) = block else {
        return Err(fault(path, "", "no atoms: this file has no category _atom_site"));
    };
    let mut categories = Vec::new();
    for category in block {
        let rows = category.get("rowCount").and_then(Value::count).unwrap_or(0);
        // Coordinates have a byte a row at least.
        if rows > bytes {
            return Err(fault(path, name(&category), format!("{rows} rows in a file of {bytes} bytes")));
        }
        let columns = category.get("columns").and_then(Value::list).unwrap_or_default();
        categories.push(Category { path, name: name(&category), rows, columns });
    }
    Ok(categories)
}

impl<'a> Category<'_, 'a> {
    /// A column and which of its values are there, decoded; `None` if there is no such column.
    fn column(&self, name: &str) -> Result<Option<(Column<'a>, Vec<i32>)>> {
        let named = |it: &&Value| it.get("name").and_then(Value::text) == Some(name);
        let Some(column) = self.columns.iter().find(named) else { return Ok(None) };
        let place = format!("{}.{name}", self.name);
        let wrong = |what: String| fault(self.path, &place, what);
        let data = column.get("data").ok_or_else(|| wrong("there are no data".to_string()))?;
        let decoded = encoding::decode(data, self.rows).map_err(wrong)?;
        let length = match &decoded {
            Column::Bytes(_) => return Err(wrong("the data are not encoded".to_string())),
            Column::Integers(values) => values.len(),
            Column::Floats(values) => values.len(),
            Column::Words { codes, .. } => codes.len(),
        };
        if length != self.rows {
            return Err(wrong(format!("{length} values were found, {} rows were promised", self.rows)));
        }
        let mask = match column.get("mask") {
            None | Some(Value::Nil) => vec![],
            Some(mask) => match encoding::decode(mask, self.rows).map_err(wrong)? {
                Column::Integers(mask) if mask.len() == self.rows => mask,
                _ => return Err(wrong("its mask has not a number a row".to_string())),
            },
        };
        Ok(Some((decoded, mask)))
    }

    /// The value of a row as text.
    fn text(column: &Column<'a>, mask: &[i32], row: usize) -> Option<String> {
        if mask.get(row).is_some_and(|&it| it != 0) {
            return None;
        }
        match column {
            Column::Bytes(_) => None,
            Column::Integers(values) => Some(values[row].to_string()),
            Column::Floats(values) => Some(values[row].to_string()),
            Column::Words { words, codes } => Some(words.get(usize::try_from(codes[row]).ok()?)?.to_string()),
        }
    }

    /// The rows of a column of `_atom_site` as it is wanted.
    fn data(&self, name: &str, wanted: Kind, rows: std::ops::Range<usize>) -> Result<Option<Data>> {
        let Some((column, mask)) = self.column(name)? else { return Ok(None) };
        let is_told = |row: usize| mask.get(row).is_none_or(|&it| it == 0);
        Ok(Some(match (column, wanted) {
            (Column::Floats(values), Kind::Float) => {
                Data::Floats(rows.map(|row| if is_told(row) { values[row] } else { f64::NAN }).collect())
            }
            (Column::Integers(values), Kind::Float) => Data::Floats(
                rows.map(|row| if is_told(row) { values[row].into() } else { f64::NAN }).collect(),
            ),
            (Column::Integers(values), Kind::Integer) => {
                Data::Integers(rows.map(|row| is_told(row).then(|| values[row].into())).collect())
            }
            (Column::Words { words, codes }, Kind::Word) => {
                let mut column = Words::default();
                for row in rows {
                    let word = usize::try_from(codes[row]).ok().and_then(|it| words.get(it));
                    column.push(word.filter(|_| is_told(row)).map_or(&[], |it| it.as_bytes()));
                }
                Data::Words(column)
            }
            (column, wanted) => {
                // Words that are numbers, or numbers that are names.
                let mut data = Data::new(wanted);
                for row in rows {
                    let text = Self::text(&column, &mask, row);
                    let pushed = data.push(text.as_deref().map(str::as_bytes));
                    pushed.map_err(|wanted| {
                        let found = text.unwrap_or_default();
                        fault(
                            self.path,
                            &format!("{}.{name}, row {row}", self.name),
                            format!("wanted {wanted}, found '{found}'"),
                        )
                    })?;
                }
                data
            }
        }))
    }
}

fn atoms<'c, 'v, 'a>(categories: &'c [Category<'v, 'a>]) -> &'c Category<'v, 'a> {
    categories.iter().find(|it| it.name == "atom_site").expect("a block without atoms is refused")
}

/// Finds the models: rows that follow each other with the same model number.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let file = parse(path, bytes)?;
    let categories = categories(path, &file, bytes.len())?;
    let atoms = atoms(&categories);
    let models = match atoms.data("pdbx_PDB_model_num", Kind::Integer, 0..atoms.rows)? {
        Some(Data::Integers(models)) => models,
        _ => vec![Some(1); atoms.rows],
    };
    let mut index = Index::default();
    let mut row = 0;
    for model in models.chunk_by(|one, other| one == other) {
        let count = model.len() as u64;
        index.frames.push(Span { offset: row, line: index.frames.len() as u64 + 1, bytes: Some(count) });
        row += count;
    }
    if index.frames.is_empty() {
        index.frames.push(Span { offset: 0, line: 1, bytes: Some(0) });
    }
    Ok(index)
}

/// Reads the model whose rows begin at the offset of `span`; its bytes are how many they are.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let file = parse(path, bytes)?;
    let categories = categories(path, &file, bytes.len())?;
    let mut document = Document::default();
    for category in categories.iter().filter(|it| CATEGORIES.contains(&it.name)) {
        for column in category.columns {
            let Some(name) = column.get("name").and_then(Value::text) else { continue };
            if let Some((values, mask)) = category.column(name)? {
                for row in 0..category.rows.min(MOST_OPERATORS) {
                    let text = Category::text(&values, &mask, row);
                    document.push(category.name, name, text.as_deref().map(str::as_bytes));
                }
            }
        }
    }
    let atoms = atoms(&categories);
    let rows = span.offset as usize..(span.offset + span.bytes.unwrap_or_default()) as usize;
    if rows.end > atoms.rows {
        let what = "the model is not there any more";
        return Err(Error::format(path, "atom_site", what, "was the file changed?"));
    }
    let mut sites = AtomSite::new(&[]);
    for column in atoms.columns {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let known = column.get("name").and_then(Value::text).and_then(|name| Some((name, kind(name)?)));
        let Some((name, kind)) = known else { continue };
        if let Some(data) = atoms.data(name, kind, rows.clone())? {
            sites.insert(name, data);
        }
    }
    progress.advance(bytes.len() as u64);
    sites.frame(path, document.entry(), request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;
    use tyndall::particles::Values;
    use tyndall::{DVec3, Particles};

    /// Writes MessagePack, for maps and lists of up to fifteen entries.
    fn map(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let entry = |(name, value): &(&str, Vec<u8>)| [text(name), value.clone()].concat();
        std::iter::once(0x80 | entries.len() as u8).chain(entries.iter().flat_map(entry)).collect()
    }

    fn list(entries: &[Vec<u8>]) -> Vec<u8> {
        [&[0xdc, 0, entries.len() as u8][..], &entries.concat()].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [&[0xd9, text.len() as u8][..], text.as_bytes()].concat()
    }

    fn bytes(bytes: &[u8]) -> Vec<u8> {
        [&[0xc4, bytes.len() as u8][..], bytes].concat()
    }

    fn array(kind: u8) -> Vec<u8> {
        map(&[("kind", text("ByteArray")), ("type", vec![kind])])
    }

    fn column(name: &str, data: Vec<u8>, encoding: &[Vec<u8>], mask: Option<&[u8]>) -> Vec<u8> {
        let mask = match mask {
            Some(mask) => map(&[("data", bytes(mask)), ("encoding", list(&[array(4)]))]),
            None => vec![0xc0],
        };
        let data = map(&[("data", bytes(&data)), ("encoding", list(encoding))]);
        map(&[("name", text(name)), ("mask", mask), ("data", data)])
    }

    fn words(name: &str, all: &str, offsets: &[u8], rows: &[u8]) -> Vec<u8> {
        let encoding = map(&[
            ("kind", text("StringArray")),
            ("dataEncoding", list(&[array(1)])),
            ("stringData", text(all)),
            ("offsetEncoding", list(&[array(4)])),
            ("offsets", bytes(offsets)),
        ]);
        column(name, rows.to_vec(), &[encoding], None)
    }

    /// Two models of two atoms, and one atom more in the second.
    fn sample() -> Vec<u8> {
        let hundredths = map(&[("kind", text("FixedPoint")), ("factor", vec![100])]);
        let axis = |name: &str, values: [i8; 5]| {
            column(name, values.map(|it| it as u8).to_vec(), &[hundredths.clone(), array(1)], None)
        };
        let run = map(&[("kind", text("RunLength")), ("srcSize", vec![5])]);
        let delta = map(&[("kind", text("Delta")), ("origin", vec![1])]);
        let columns = [
            axis("Cartn_x", [100, -100, 50, -50, 0]),
            axis("Cartn_y", [0, 10, 20, 30, 40]),
            axis("Cartn_z", [1, 2, 3, 4, 5]),
            column("id", vec![0, 1, 1, 1, 1], &[delta, array(4)], None),
            words("type_symbol", "FEN", &[0, 2, 3], &[1, 0, 1, 0, 255]),
            column("auth_seq_id", vec![7, 7, 7, 7, 7], &[array(4)], Some(&[0, 1, 0, 0, 0])),
            column("pdbx_PDB_model_num", vec![1, 2, 2, 3], &[run, array(4)], None),
        ];
        let atoms = map(&[("name", text("_atom_site")), ("rowCount", vec![5]), ("columns", list(&columns))]);
        let cell: Vec<Vec<u8>> =
            ["length_a", "length_b", "length_c", "angle_alpha", "angle_beta", "angle_gamma"]
                .iter()
                .zip([4, 5, 6, 90, 90, 90])
                .map(|(name, value)| column(name, vec![value], &[array(4)], None))
                .collect();
        let cell = map(&[("name", text("_cell")), ("rowCount", vec![1]), ("columns", list(&cell))]);
        let block = map(&[("header", text("X")), ("categories", list(&[cell, atoms]))]);
        map(&[("version", text("0.3.0")), ("encoder", text("test")), ("dataBlocks", list(&[block]))])
    }

    fn symbols(particles: &Particles) -> String {
        let Values::Text { codes, names } = &particles.attribute("element").unwrap().values else { panic!() };
        codes.iter().map(|&code| names[code as usize].as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn models_columns_and_cell_are_read() {
        let frames = real_data::open(&sample()).unwrap();
        assert_eq!(frames.iter().map(|it| it.particles.len()).collect::<Vec<_>>(), [2, 3]);
        let [first, second] = [0, 1].map(|it| &frames[it].particles);
        assert!(second.positions().world(1).abs_diff_eq(DVec3::new(-0.5, 0.3, 0.04), 1e-7));
        assert_eq!(second.attribute("id").unwrap().values, Values::I32(vec![3, 4, 5]));
        assert_eq!((symbols(first), symbols(second)), ("N Fe".to_string(), "N Fe ".to_string()));
        assert_eq!(first.attribute("resid").unwrap().values, Values::I32(vec![7, 0]));
        assert_eq!(first.cell().unwrap().vectors[2], 6.0 * DVec3::Z);
    }

    #[test]
    fn what_is_cut_or_claims_too_much_is_refused() {
        let file = sample();
        for length in 0..file.len() {
            let index = index(Path::new("test"), &file[..length], &Options::default());
            assert!(index.is_err(), "{length}");
        }
        let message = |file: &[u8]| real_data::open(file).unwrap_err().to_string();
        let mut rows = file.clone();
        let place = memchr::memmem::find_iter(&rows, b"rowCount").nth(1).unwrap() + 8;
        rows[place] = 6;
        assert!(message(&rows).contains("5 values were found, 6 rows were promised"), "{}", message(&rows));
        rows.splice(place..=place, [0xce, 0x7f, 0xff, 0xff, 0xff]);
        assert!(message(&rows).contains("2147483647 rows in a file of"), "{}", message(&rows));
    }

    #[test]
    fn damage_never_panics() {
        let file = sample();
        let open = &real_data::recognised(&file).open;
        real_data::damage(&file, |file| drop(real_data::frames(open, file, &Options::default())));
    }
}
