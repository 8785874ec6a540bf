//! mmCIF: the loop `_atom_site` of the first data block that has one; models as frames.
//!
//! Finding the frames passes over all tokens up to the loop's end; reading one passes over the whole file once, for the small categories
//! (cell, assemblies) that may stand anywhere. What the columns mean: `atom_site.rs`. Source: wwPDB, PDBx/mmCIF dictionary.

mod tokens;

use std::path::Path;

use tyndall::{Error, Progress, Result};

use self::tokens::{Event, Token, Tokens};
use super::atom_site::{AtomSite, CATEGORIES, Document};
use super::{Index, Request, Span, rows};
use crate::sequence::{Frame, Options};

const HINT: &str = "download it again, or write it again as mmCIF";

/// Whether the file begins like mmCIF.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines = super::whole_lines(head).map(|it| it.trim_ascii_start());
    let first = lines.find(|line| !line.is_empty() && line[0] != b'#');
    super::is_text(head) && first.is_some_and(|it| it.len() >= 5 && it[..5].eq_ignore_ascii_case(b"data_"))
}

/// The category of an item, and its name therein.
fn split(name: &str) -> Option<(&str, &str)> {
    name.strip_prefix('_')?.split_once('.')
}

fn is_of_atoms(name: &str) -> bool {
    split(name).is_some_and(|(category, _)| category.eq_ignore_ascii_case("atom_site"))
}

/// The same, of the small categories.
fn small(name: &str) -> Option<(&str, &str)> {
    split(name).filter(|(category, _)| CATEGORIES.contains(category))
}

/// Passes on to the loop of atoms: the names of its columns; `None` if a single atom stands as items instead.
fn atoms(path: &Path, tokens: &mut Tokens) -> Result<Option<Vec<String>>> {
    let (mut has_items, mut is_crystal) = (false, false);
    while let Some(event) = tokens.next_event() {
        match event {
            Event::Loop(names) if is_of_atoms(&names[0]) => return Ok(Some(names)),
            Event::Item(name, _) => has_items |= is_of_atoms(&name),
            Event::Loop(names) => {
                is_crystal |= names.iter().any(|it| it.eq_ignore_ascii_case("_atom_site_fract_x"));
            }
        }
    }
    if has_items {
        return Ok(None);
    }
    if is_crystal {
        let what = "this CIF is of a crystal: its atoms stand for others by symmetry, at fractions of the cell's edges";
        return Err(Error::format(
            path,
            "",
            what,
            "convert it: ase convert IN OUT.extxyz, which applies the symmetry",
        ));
    }
    let what = "no atoms: this file has no loop _atom_site";
    let hint = "files of structure factors and dictionaries have none: give that of coordinates";
    Err(Error::format(path, "", what, hint))
}

/// Finds the models: rows that follow each other with the same model number.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut tokens = Tokens::new(bytes, 0, 1);
    let Some(names) = atoms(path, &mut tokens)? else {
        let whole = Span { offset: 0, line: 1, bytes: Some(bytes.len() as u64) };
        return Ok(Index { frames: vec![whole], ..Index::default() });
    };
    let column = names.iter().position(|it| split(it).is_some_and(|(_, name)| name == "pdbx_PDB_model_num"));
    let mut index = Index::default();
    let (mut model, mut row, mut rows): (Option<&[u8]>, Vec<Token>, u64) = (None, Vec::new(), 0);
    let mut begins = false;
    let found = loop {
        let found = tokens.row(names.len(), &mut row);
        if found < names.len() {
            break found;
        }
        let number = column.map(|column| row[column].text);
        begins = index.frames.is_empty() || number != model;
        if begins {
            model = number;
            let last = index.frames.last_mut();
            last.into_iter().for_each(|last: &mut Span| last.bytes = Some(row[0].place as u64 - last.offset));
            index.frames.push(Span { offset: row[0].place as u64, line: row[0].line, bytes: None });
        }
        rows += 1;
    };
    let (end, is_last) = (tokens.place() as u64, tokens.at_end());
    index.frames.last_mut().into_iter().for_each(|last| last.bytes = Some(end - last.offset));
    let line = row.first().map_or(0, |it| it.line);
    if found > 0 && !is_last {
        let what = format!("the last row of _atom_site has {found} values of {}", names.len());
        return Err(Error::format(path, format!("line {line}"), what, HINT));
    }
    // A row of a new model at the very end may be that of the model before, with its number cut.
    let torn = begins && rows > 1 && !bytes.ends_with(b"\n") && is_last;
    if found > 0 || torn {
        index.frames.pop();
        index.cut = true;
    } else if is_last && !ends_with_comment(bytes) && is_entry(bytes) {
        let what = format!("nothing follows the {rows} rows of _atom_site: the file is cut off");
        return Err(Error::format(
            path,
            "",
            what,
            "if it is whole, add a line with a hash, '#', as entries of the PDB have it",
        ));
    } else if is_last && !ends_with_comment(bytes) {
        index.doubt =
            Some("nothing follows the last atom, so nobody can tell whether it is the last one".into());
    }
    if rows == 0 && found == 0 {
        index.frames.push(Span { offset: end, line: 1, bytes: Some(0) });
    }
    Ok(index)
}

/// The names of items without their category.
fn own_names(names: &[String]) -> Vec<&str> {
    names.iter().map(|it| split(it).map_or("", |(_, name)| name)).collect()
}

/// Appends an atom.
fn push(path: &Path, site: &mut AtomSite, names: &[String], row: &[Token]) -> Result<()> {
    site.push(row.iter().map(Token::told)).map_err(|(column, wanted)| {
        let found = rows::shortened(row[column].text);
        let what = format!("wanted {wanted} for {}, found '{found}'", names[column]);
        Error::format(path, format!("line {}", row[column].line), what, HINT)
    })
}

/// Whether this is an entry of the archive, or made of one: a comment ends each of its categories.
fn is_entry(bytes: &[u8]) -> bool {
    [&b"\n_audit_conform."[..], b"\n_database_2."].iter().any(|it| memchr::memmem::find(bytes, it).is_some())
}

fn ends_with_comment(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_end();
    let last = memchr::memrchr(b'\n', text).map_or(text, |place| &text[place + 1..]);
    last.trim_ascii_start().starts_with(b"#")
}

/// Reads the model at `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut tokens = Tokens::new(bytes, 0, 1);
    let mut document = Document::default();
    let mut sites = None;
    let (mut items, mut atom) = (Vec::new(), Vec::new());
    let mut row = Vec::new();
    while let Some(event) = tokens.next_event() {
        match event {
            Event::Loop(names) if sites.is_none() && is_of_atoms(&names[0]) => {
                let mut site = AtomSite::new(&own_names(&names));
                let mut tokens = Tokens::new(bytes, span.offset as usize, span.line);
                let (start, end) = (span.offset, span.offset + span.bytes.unwrap_or_default());
                let mut told = start;
                while (tokens.place() as u64) < end && tokens.row(names.len(), &mut row) == names.len() {
                    push(path, &mut site, &names, &row)?;
                    let place = row[0].place as u64;
                    if place - told > 1 << 20 {
                        progress.advance(place - told);
                        told = place;
                        if progress.cancelled() {
                            return Err(Error::Interrupted);
                        }
                    }
                }
                progress.advance(end - told);
                sites = Some(site);
            }
            Event::Loop(names) => {
                if small(&names[0]).is_none() {
                    continue;
                }
                while tokens.row(names.len(), &mut row) == names.len() {
                    for (name, token) in names.iter().zip(&row) {
                        let Some((category, item)) = small(name) else { continue };
                        document.push(category, item, token.told());
                    }
                }
            }
            Event::Item(name, value) if is_of_atoms(&name) => {
                items.push(name);
                atom.push(value);
            }
            Event::Item(name, value) => {
                if let Some((category, item)) = small(&name) {
                    document.push(category, item, value.told());
                }
            }
        }
    }
    if sites.is_none() && !items.is_empty() {
        let mut site = AtomSite::new(&own_names(&items));
        push(path, &mut site, &items, &atom)?;
        sites = Some(site);
    }
    let sites =
        sites.ok_or_else(|| Error::format(path, "", "no loop _atom_site", "was the file changed?"))?;
    sites.frame(path, document.entry(), request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data::{self, words};
    use tyndall::DVec3;
    use tyndall::particles::Values;

    const SMALL: &str = "# made up\ndata_test\n_entry.id test\n_cell.length_a 10\n_cell.length_b 20.0(3)\n_cell.length_c 30\n\
        _cell.angle_alpha 90\n_cell.angle_beta 90\n_cell.angle_gamma 90\n_struct.title\n;a title\n_atom_site.id 7\n;\n\
        loop_\n_atom_site.group_PDB\n_atom_site.id\n_atom_site.type_symbol\n_atom_site.label_atom_id\n_atom_site.label_comp_id\n\
        _atom_site.label_asym_id\n_atom_site.auth_asym_id\n_atom_site.auth_seq_id\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n\
        _atom_site.Cartn_z\n_atom_site.B_iso_or_equiv\n_atom_site.pdbx_PDB_model_num\n\
        ATOM 1 N \"N'\" ALA A X -3 1.0 2.0 3.0 9.5 1\nHETATM 2 FE FE HEM B X 5 -1.5 0\n0.25 ? 1\n\
        ATOM 1 N 'N' ALA A X -3 1.5 2.0 3.0 9.5 2\nHETATM 2 FE FE HEM B X 5 -1 0 0.25 . 2\n\
        loop_\n_pdbx_struct_assembly_gen.assembly_id\n_pdbx_struct_assembly_gen.oper_expression\n\
        _pdbx_struct_assembly_gen.asym_id_list\n1 '(1,2)' A,B\n2 2 B\n\
        loop_\n_pdbx_struct_oper_list.id\n_pdbx_struct_oper_list.matrix[1][1]\n_pdbx_struct_oper_list.matrix[1][2]\n\
        _pdbx_struct_oper_list.matrix[1][3]\n_pdbx_struct_oper_list.vector[1]\n_pdbx_struct_oper_list.matrix[2][1]\n\
        _pdbx_struct_oper_list.matrix[2][2]\n_pdbx_struct_oper_list.matrix[2][3]\n_pdbx_struct_oper_list.vector[2]\n\
        _pdbx_struct_oper_list.matrix[3][1]\n_pdbx_struct_oper_list.matrix[3][2]\n_pdbx_struct_oper_list.matrix[3][3]\n\
        _pdbx_struct_oper_list.vector[3]\n1 1 0 0 0 0 1 0 0 0 0 1 0\n2 -1 0 0 5 0 -1 0 0 0 0 1 0\n";

    fn read(text: &str, assembly: Option<&str>) -> Result<Vec<Frame>> {
        let options = Options { assembly: assembly.map(str::to_string), ..Options::default() };
        real_data::frames(&real_data::recognised(SMALL.as_bytes()).open, text.as_bytes(), &options)
    }

    #[test]
    fn atoms_models_and_cell_are_read() {
        for text in [SMALL.to_string(), SMALL.replace('\n', "\r\n"), SMALL.trim_end().to_string()] {
            let frames = read(&text, None).unwrap();
            assert_eq!(frames.len(), 2);
            let particles = &frames[0].particles;
            assert_eq!(particles.positions().world(1), DVec3::new(-1.5, 0.0, 0.25));
            assert_eq!(frames[1].particles.positions().world(0).x, 1.5);
            assert_eq!(words(particles, "name"), "N' FE");
            assert_eq!(words(particles, "element"), "N Fe");
            assert_eq!(
                (words(particles, "chain"), words(particles, "asym")),
                ("X X".to_string(), "A B".to_string())
            );
            assert_eq!(words(particles, "group"), "ATOM HETATM");
            assert_eq!(particles.attribute("resid").unwrap().values, Values::I32(vec![-3, 5]));
            assert!(particles.attribute("b_factor").unwrap().number(1, 0).is_nan());
            assert_eq!(particles.cell().unwrap().vectors[1], 20.0 * DVec3::Y);
            assert_eq!(particles.length_unit(), Some("Å"));
            assert!(
                frames[0].conventions.iter().any(|it| it.contains("--assembly 1")),
                "{:?}",
                frames[0].conventions
            );
        }
        let crystal = SMALL.replace("_entry.id test", "_symmetry.space_group_name_H-M 'P 21 21 21'");
        assert!(read(&crystal, None).unwrap()[0].particles.cell().is_none());
    }

    #[test]
    fn a_single_atom_may_stand_as_items() {
        let text = "data_x\n_atom_site.Cartn_x 1.5\n_atom_site.Cartn_y 2\n_atom_site.Cartn_z 3\n_atom_site.type_symbol CL\n";
        let particles = &read(text, None).unwrap()[0].particles;
        assert_eq!((particles.len(), particles.positions().world(0)), (1, DVec3::new(1.5, 2.0, 3.0)));
        assert_eq!(words(particles, "element"), "Cl");
    }

    #[test]
    fn assemblies_are_made_of_the_archive_s_chains() {
        let first = &read(SMALL, Some("1")).unwrap()[0].particles;
        assert_eq!((first.len(), first.positions().world(2)), (4, DVec3::new(4.0, -2.0, 3.0)));
        let second = &read(SMALL, Some("2")).unwrap()[1].particles;
        assert_eq!((second.len(), second.positions().world(0)), (1, DVec3::new(6.0, 0.0, 0.25)));
        let message = read(SMALL, Some("3")).unwrap_err().to_string();
        assert!(message.contains("one of 1, 2, or all"), "{message}");
    }

    #[test]
    fn what_is_wrong_or_cut_is_said() {
        let message = |text: &str| read(text, None).unwrap_err().to_string();
        assert!(
            message(&SMALL.replace("2.0 3.0 9.5 1", "2.0 x 9.5 1"))
                .contains("wanted a number for _atom_site.Cartn_z, found 'x'")
        );
        assert!(
            message(&SMALL.replace("9.5 1\n", "1\n"))
                .contains("the last row of _atom_site has 12 values of 13")
        );
        assert!(message("data_x\n_entry.id x\n").contains("no loop _atom_site"));
        let crystal = "data_x\nloop_\n_atom_site_label\n_atom_site_fract_x\nNa 0.5\n";
        assert!(message(crystal).contains("is of a crystal"));
        assert!(message(&SMALL.replace("Cartn_z", "fract_z")).contains("no column Cartn_z"));
        let start = SMALL.find("ATOM 1").unwrap();
        let end = SMALL.find("\nloop_\n_pdbx").unwrap();
        for length in start + 1..end {
            let Ok(index) = index(Path::new("test"), &SMALL.as_bytes()[..length], &Options::default()) else {
                continue;
            };
            assert!(
                index.cut || SMALL[..length].trim_end().ends_with([' ', '1', '2']),
                "{}",
                &SMALL[start..length]
            );
        }
        let entry = SMALL.replace("_entry.id test\n", "_entry.id test\n_audit_conform.dict_name x\n");
        let cut = &entry[..entry.find("ATOM 1 N 'N'").unwrap()];
        assert!(message(cut).contains("nothing follows the 2 rows"), "{}", message(cut));
    }

    #[test]
    fn damage_never_panics() {
        real_data::damage(SMALL.as_bytes(), |file| {
            let options = Options { assembly: Some("all".to_string()), ..Options::default() };
            drop(real_data::frames(&real_data::recognised(SMALL.as_bytes()).open, file, &options));
        });
    }
}
