//! NumPy's NPY (one array) and NPZ (a zip archive of arrays).
//!
//! Takes the whole file. Positions are an array of shape (N, 2), (N, 3) or (N, 4), or the fields or arrays that are named like
//! positions; all else with N rows is an attribute. Source: NumPy enhancement proposal 1, `numpy.lib.format`.

mod archive;
mod header;
mod literal;
mod quantity;
mod rows;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

use tyndall::particles::{Columns, Radii};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Progress, Result};

use self::archive::{Archive, Entry};
use self::header::{Fault, Header};
use self::quantity::{Array, Data, Quantity};
use super::records::{self, Field, Layout, Source};
use super::table;
use crate::sequence::Frame;

pub(crate) use self::rows::Rows;

/// Names of arrays that hold positions, best first.
const POSITION_NAMES: [&str; 12] = [
    "pos",
    "position",
    "positions",
    "coordinates",
    "coords",
    "coord",
    "xyz",
    "points",
    "point",
    "p",
    "r",
    "x",
];

/// Names of three arrays that hold positions together.
const AXIS_NAMES: [[&str; 3]; 3] =
    [["x", "y", "z"], ["pos_x", "pos_y", "pos_z"], ["position_x", "position_y", "position_z"]];

/// Whether the file begins like an array, or like an archive of arrays.
pub(crate) fn recognise(head: &[u8]) -> bool {
    is_archive(head) && memchr::memmem::find(head, b".npy").is_some() || head.starts_with(b"\x93NUMPY")
}

fn is_archive(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04")
}

/// Reads an array or an archive of arrays: of what is no position that which is wanted.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut notes = Notes::default();
    if !is_archive(bytes) {
        let fault = |(what, hint): Fault| Error::format(path, "", what, hint);
        let header = Header::read(bytes).map_err(fault)?;
        let array = Array { name: "", entry: 0, header: &header, bytes: Some(bytes) };
        let quantities = array.quantities(path, &mut notes.warnings)?;
        let end = header.values_bytes().map_or(usize::MAX, |values| header.start + values);
        if end < bytes.len() {
            notes.warnings.push(format!("left out: {} bytes behind the array", bytes.len() - end));
        }
        return assemble(path, quantities, wanted, notes, (bytes.len(), progress));
    }

    let archive = Archive::open(path, bytes)?;
    let is_needed = wanted.and_then(|wanted| needed(path, &archive, wanted));
    let contents =
        archive.read(path, |entry| is_needed.as_ref().is_none_or(|needed| needed[entry]), progress)?;
    let quantities = quantities(path, &archive, &contents, &mut notes.warnings)?;
    assemble(path, quantities, wanted, notes, (0, progress))
}

/// The quantities of an archive, of whose entries some are not read.
fn quantities<'a>(
    path: &Path,
    archive: &'a Archive,
    contents: &'a [Option<Cow<[u8]>>],
    warnings: &mut Vec<String>,
) -> Result<Vec<Quantity<'a>>> {
    let is_alone = archive.entries.len() == 1;
    let mut quantities = Vec::new();
    for (entry, Entry { name, header }) in archive.entries.iter().enumerate() {
        match header {
            Ok(header) => {
                let name = if is_alone { "" } else { name };
                let array = Array { name, entry, header, bytes: contents[entry].as_deref() };
                quantities.extend(array.quantities(path, warnings)?);
            }
            Err((what, _)) => warnings.push(format!("left out: array '{name}': {what}")),
        }
    }
    Ok(quantities)
}

/// Which entries of an archive are looked at: positions, what is wanted, and single numbers. `None`: all, where something is wrong with them,
/// which their reading will say.
fn needed(path: &Path, archive: &Archive, wanted: &Wanted) -> Option<Vec<bool>> {
    let unread = vec![None; archive.entries.len()];
    let mut notes = Notes::default();
    let mut quantities = quantities(path, archive, &unread, &mut notes.warnings).ok()?;
    let names = |of: &[Quantity]| of.iter().map(|it| (it.entry, it.name.clone())).collect::<HashSet<_>>();
    let before = names(&quantities);
    let (count, _) = take_positions(path, &mut quantities, &mut notes).ok()?;
    let mut needed = vec![false; archive.entries.len()];
    for (entry, _) in before.difference(&names(&quantities)) {
        needed[*entry] = true;
    }
    for quantity in quantities.iter().filter(|it| it.is_number()) {
        needed[quantity.entry] = true;
    }
    let kept: Vec<Quantity> = quantities.into_iter().filter_map(|it| it.of_particles(count).ok()).collect();
    for (quantity, flag) in kept.iter().zip(flags(&kept, wanted)) {
        needed[quantity.entry] |= flag;
    }
    Some(needed)
}

/// Which of the quantities are wanted.
fn flags(quantities: &[Quantity], wanted: &Wanted) -> Vec<bool> {
    fn offered<'b>(it: &'b Quantity) -> Offered<'b> {
        Offered { name: &it.name, components: it.components, is_measured: it.is_measured() }
    }
    wanted.flags(&quantities.iter().map(offered).collect::<Vec<_>>())
}

/// What is said about the file.
#[derive(Default)]
struct Notes {
    conventions: Vec<String>,
    warnings: Vec<String>,
}

/// Makes particles of the quantities of a file.
fn assemble(
    path: &Path,
    mut quantities: Vec<Quantity>,
    wanted: Option<&Wanted>,
    mut notes: Notes,
    (total_bytes, progress): (usize, &dyn Progress),
) -> Result<Frame> {
    let (count, axes) = take_positions(path, &mut quantities, &mut notes)?;
    let mut radii = None;
    let mut time = None;
    let mut kept = Vec::new();
    for quantity in quantities {
        let is_turned = quantity.rows != count;
        let quantity = match quantity.of_particles(count) {
            Ok(quantity) => {
                kept.push((is_turned, quantity));
                continue;
            }
            Err(quantity) => quantity,
        };
        let name = quantity.name.to_lowercase();
        if let (Some(value), "radius") = (quantity.single(), name.as_str()) {
            radii = Some(Radii::Uniform(value as f32));
        } else if let (Some(value), "time" | "t") = (quantity.single(), name.as_str()) {
            time = Some(value);
        } else {
            let (name, rows) = (&quantity.name, quantity.rows);
            notes
                .warnings
                .push(format!("left out: array '{name}' has {rows} rows, there are {count} particles"));
        }
    }

    let (turned, mut kept): (Vec<bool>, Vec<Quantity>) = kept.into_iter().unzip();
    for (quantity, _) in kept.iter().zip(turned).filter(|(_, is_turned)| *is_turned) {
        let Quantity { name, components, .. } = quantity;
        notes.conventions.push(format!("'{name}' is taken as transposed: ({components}, N)"));
    }
    if let Some(wanted) = wanted {
        let mut flags = flags(&kept, wanted).into_iter();
        kept.retain(|_| flags.next().expect("a flag a quantity"));
    }
    let mut fields = Vec::new();
    for quantity in &kept {
        if let Data::Numbers(source) = quantity.data {
            fields.push(Field { name: quantity.name.clone(), components: quantity.components, source });
        }
    }
    let layout = Layout { count, axes, fields };
    let mut columns = layout.gather(path, total_bytes, progress)?.into_columns();
    for (place, quantity) in kept.iter().enumerate() {
        if let Data::Words(words) = &quantity.data {
            columns.attributes.insert(place, words.attribute(quantity.name.clone(), count));
        }
    }
    if let Some(Radii::Uniform(radius)) = radii
        && !(0.0..f32::INFINITY).contains(&radius)
    {
        return Err(Error::format(
            path,
            "radius",
            format!("a radius >= 0 was wanted, {radius} was found"),
            "correct it",
        ));
    }
    records::spell_out_colors(&mut columns.attributes, &mut notes.conventions);
    let columns = Columns { radii, time, ..columns };
    records::frame(columns, notes.conventions, notes.warnings)
}

type Axes<'a> = [Option<Source<'a>>; 3];

/// Finds the positions, takes them out of the quantities, and says what was guessed.
fn take_positions<'a>(
    path: &Path,
    quantities: &mut Vec<Quantity<'a>>,
    notes: &mut Notes,
) -> Result<(usize, Axes<'a>)> {
    let conventions = &mut notes.conventions;
    for name in POSITION_NAMES {
        let is_vector = |it: &Quantity| it.vector().is_some() && it.is_named(name);
        if let Some(place) = quantities.iter().position(is_vector) {
            return Ok(split_vector(quantities, place, conventions));
        }
    }
    for names in AXIS_NAMES {
        let find = |name: &str| quantities.iter().position(|it| it.scalar().is_some() && it.is_named(name));
        let places = names.map(find);
        if let [Some(x), Some(y), z] = places {
            let rows = quantities[x].rows;
            let axes = places.map(|place| place.and_then(|place| quantities[place].scalar()));
            if quantities[y].rows != rows || z.is_some_and(|z| quantities[z].rows != rows) {
                let counts = places.map(|place| place.map_or(0, |place| quantities[place].rows));
                let what =
                    format!("{} have {counts:?} values: as many of each were wanted", names.join(", "));
                return Err(Error::format(path, "", what, "write arrays of one length"));
            }
            if z.is_none() {
                conventions.push(format!("there is no {}: it is taken as 0", names[2]));
            }
            let mut place = 0;
            quantities.retain(|_| {
                place += 1;
                !places.contains(&Some(place - 1))
            });
            return Ok((rows, axes));
        }
    }
    let may_be = |it: &Quantity| it.vector().is_some() && !table::is_other_vector(&it.name);
    let vectors: Vec<usize> = (0..quantities.len()).filter(|&place| may_be(&quantities[place])).collect();
    let of_three = |place: &&usize| quantities[**place].vector().is_some_and(|it| it.components == 3);
    let mut threes = vectors.iter().filter(of_three);
    let place = match (&vectors[..], threes.next(), threes.next()) {
        ([place], ..) | (_, Some(place), None) => *place,
        _ if quantities.len() == 1 && quantities[0].is_table() => 0,
        _ => return Err(no_positions(path, quantities, &notes.warnings)),
    };
    let name = &quantities[place].name;
    if !name.is_empty() {
        conventions.push(format!("'{name}' is taken as the positions: no array has a name like pos"));
    }
    Ok(split_vector(quantities, place, conventions))
}

/// Takes the vector at `place` apart: positions, and a radius or columns for what is behind them.
fn split_vector<'a>(
    quantities: &mut Vec<Quantity<'a>>,
    place: usize,
    conventions: &mut Vec<String>,
) -> (usize, Axes<'a>) {
    let given = quantities.remove(place);
    let rows = given.rows;
    let vector = given.vector().unwrap_or(given);
    if vector.rows != rows {
        conventions.push("the positions have shape (3, N): taken as transposed".into());
    }
    let Data::Numbers(source) = vector.data else { unreachable!("words are neither vectors nor tables") };
    let axis = |axis: usize| (axis < vector.components).then(|| source.component(axis));
    let column = |column: usize, name: String| Quantity {
        name,
        components: 1,
        data: Data::Numbers(source.component(column)),
        is_pair: false,
        ..vector
    };
    match vector.components {
        2 => conventions.push("the positions have shape (N, 2): z is taken as 0".into()),
        3 => {}
        4 => {
            conventions.push("the positions have shape (N, 4): the fourth column is taken as radius".into());
            quantities.insert(place, column(3, "radius".into()));
        }
        count => {
            conventions.push(format!(
                "the array has shape (N, {count}): its first three columns are taken as x, y, z, the others are attributes"
            ));
            let columns = (3..count).map(|number| column(number, format!("column {number}")));
            quantities.splice(place..place, columns);
        }
    }
    (vector.rows, [axis(0), axis(1), axis(2)])
}

fn no_positions(path: &Path, quantities: &[Quantity], left_out: &[String]) -> Error {
    let mut list: Vec<String> = quantities.iter().take(20).map(Quantity::describe).collect();
    list.extend_from_slice(left_out);
    let what = match &list[..] {
        [] => "no array that can be read was found".into(),
        list => format!("an array of positions, of shape (N, 3), was wanted; found: {}", list.join(", ")),
    };
    Error::format(path, "", what, "save an array pos of shape (N, 3), or arrays x, y, z; one frame a file")
}
