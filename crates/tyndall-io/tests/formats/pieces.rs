//! Frames that LAMMPS spread over files: together they are what one file would have been.

use std::fmt::Write as _;
use std::path::PathBuf;

use tyndall_io::{Options, Sequence};

use super::{Folder, frame, gzip, open};

/// How atoms are dealt to processors; the first one has none.
const SHARES: [std::ops::Range<usize>; 4] = [0..0, 0..700, 700..701, 701..2000];
/// What a dump has of an atom.
const COLUMNS: &str = "id type element x y z c_q";

/// The values of an atom; the last is a whole number for the first of them.
fn row(step: usize, id: usize) -> String {
    let q = if id < 700 { "3".into() } else { format!("{}.5", id % 7) };
    format!("{} {} {} {id}.25 {}.5 -{step}.125 {q}", id + 1, id % 3 + 1, ["Cu", "Zr"][id / 1000], id % 10)
}

fn text(step: usize, atoms: std::ops::Range<usize>) -> String {
    let mut text = String::new();
    if step == 0 {
        text += "ITEM: UNITS\nmetal\n";
    }
    let count = atoms.len();
    write!(text, "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS pp pp ff\n")
        .unwrap();
    write!(text, "0 2000\n0 10\n-{} 1\nITEM: ATOMS {COLUMNS}\n", step + 1).unwrap();
    atoms.for_each(|id| writeln!(text, "{}", row(step, id)).unwrap());
    text
}

/// A frame of a binary dump of `x y z c_q`, a chunk for each of some processors.
fn binary(step: usize, chunks: &[std::ops::Range<usize>]) -> Vec<u8> {
    let columns = b"x y z c_q";
    let mut file = (-10i64).to_le_bytes().to_vec();
    file.extend(b"DUMPCUSTOM");
    [1i32, 2].iter().for_each(|it| file.extend(it.to_le_bytes()));
    let count: usize = chunks.iter().map(|it| it.len()).sum();
    [step as i64, count as i64].iter().for_each(|it| file.extend(it.to_le_bytes()));
    [0i32; 7].iter().for_each(|it| file.extend(it.to_le_bytes()));
    [0.0, 2000.0, 0.0, 10.0, -9.0, 1.0f64].iter().for_each(|it| file.extend(it.to_le_bytes()));
    [4i32, 0].iter().for_each(|it| file.extend(it.to_le_bytes()));
    file.push(0);
    file.extend((columns.len() as i32).to_le_bytes());
    file.extend(columns);
    file.extend((chunks.len() as i32).to_le_bytes());
    for chunk in chunks {
        file.extend(((4 * chunk.len()) as i32).to_le_bytes());
        for id in chunk.clone() {
            let words: Vec<f64> = row(step, id).split(' ').skip(3).map(|it| it.parse().unwrap()).collect();
            words.iter().for_each(|it| file.extend(it.to_le_bytes()));
        }
    }
    file
}

/// Checks that all frames are the same in pieces and as a whole.
fn check(pieces: &Sequence, whole: &Sequence) {
    assert_eq!(pieces.len(), whole.len());
    // Back and forth, as a player would go.
    for number in (0..whole.len()).chain((0..whole.len()).rev()) {
        let (joined, one) = (frame(pieces, number), frame(whole, number));
        let (particles, wanted) = (&joined.particles, &one.particles);
        assert!(particles.positions() == wanted.positions(), "{number}");
        assert_eq!(particles.attributes(), wanted.attributes(), "{number}");
        let about =
            |it: &tyndall::Particles| (it.cell().copied(), it.time(), it.length_unit().map(String::from));
        assert_eq!(about(particles), about(wanted), "{number}");
        assert_eq!((joined.conventions, joined.warnings), (one.conventions, one.warnings), "{number}");
    }
}

#[test]
fn texts_in_pieces_are_what_one_file_would_be() {
    let folder = Folder::new("pieces");
    let whole: String = (0..3).map(|step| text(step, 0..2000)).collect();
    let whole = open(&folder.file("whole", whole.as_bytes()));
    for (place, share) in SHARES.into_iter().enumerate() {
        let piece: String = (0..3).map(|step| text(step, share.clone())).collect();
        folder.file(&format!("a.{place}.dump"), piece.as_bytes());
        folder.file(&format!("b.{place}.gz"), &gzip(piece.as_bytes()));
    }
    let pieces = open(&folder.path("a.%.dump"));
    assert_eq!((pieces.format(), pieces.paths().len()), ("LAMMPS dump, 4 pieces (text)", 4));
    assert_eq!(pieces.name(1), "a.%.dump[1]");
    check(&pieces, &whole);
    check(&open(&folder.path("b.%.gz")), &whole);
    // Several frames, each in pieces of its own.
    let names: Vec<PathBuf> = (0..3)
        .map(|step| {
            let piece =
                |(place, share)| folder.file(&format!("c.{step}.{place}"), text(step, share).as_bytes());
            SHARES.into_iter().enumerate().for_each(|it| drop(piece(it)));
            folder.path(&format!("c.{step}.%"))
        })
        .collect();
    let sequence = Sequence::open(&names, &Options::default(), &()).unwrap();
    assert_eq!((sequence.paths().len(), sequence.name(2)), (12, "c.2.%".to_string()));
    for number in 0..3 {
        let particles = [&sequence, &whole].map(|it| frame(it, number).particles);
        assert!(particles[0].positions() == particles[1].positions());
        assert_eq!(particles[0].attributes(), particles[1].attributes());
    }
}

#[test]
fn binary_pieces_are_what_one_file_would_be() {
    let folder = Folder::new("binary_pieces");
    let frames = |chunks: &[std::ops::Range<usize>]| [0, 5].map(|step| binary(step, chunks)).concat();
    let whole = open(&folder.file("whole.bin", &frames(&SHARES)));
    // As after `dump_modify nfile 3`: one file of two processors.
    for (place, chunks) in [&SHARES[..2], &SHARES[2..3], &SHARES[3..]].into_iter().enumerate() {
        folder.file(&format!("a.{place}.bin"), &frames(chunks));
    }
    let pieces = open(&folder.path("a.%.bin"));
    assert_eq!(pieces.format(), "LAMMPS binary dump, 3 pieces");
    check(&pieces, &whole);
    assert_eq!(frame(&pieces, 1).particles.len(), 2000);
}

#[test]
fn pieces_that_do_not_belong_together_are_refused() {
    let folder = Folder::new("odd_pieces");
    let first = text(4, 0..3);
    folder.file("a.0", first.as_bytes());
    let message = |second: &str, strict: bool| {
        folder.file("a.1", second.as_bytes());
        let options = Options { strict, ..Options::default() };
        let read = |it: Sequence| it.frame(0, &()).map(|it| it.warnings.join("; "));
        Sequence::open(&[folder.path("a.%")], &options, &()).and_then(read).map_err(|error| error.to_string())
    };
    assert_eq!(message(&text(4, 3..9), true), Ok(String::new()));
    for (second, parts) in [
        (text(5, 3..9), ["this piece is of step 5, a.0 of step 4", "a.1"]),
        (text(4, 3..9).replace("type element", "element type"), ["a.0 the columns id type element", "a.1"]),
        (text(4, 3..9).replace("0 10\n", "0 11\n"), ["another box than a.0", "a.1"]),
        ("1\n\nO 0 0 0\n".into(), ["format XYZ, a.0 of the format LAMMPS dump", "a.1"]),
        (text(4, 3..9)[..90].into(), ["ends inside its first frame", "a.1"]),
    ] {
        let error = message(&second, false).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let longer = [text(4, 3..9), text(5, 3..9)].concat();
    assert!(message(&longer, false).unwrap().contains("a.0 has 1 frame, a.1 has 2 frames"));
    assert!(message(&longer, true).unwrap_err().contains("this piece has 1 frame, a.1 has 2 frames"));
    folder.file("b.0", b"1\n\nO 0 0 0\n");
    let error = Sequence::open(&[folder.path("b.%")], &Options::default(), &()).err().unwrap().to_string();
    assert!(error.contains("in pieces are LAMMPS dump and LAMMPS binary dump"), "{error}");
    // A frame with fewer pieces than the one beside it.
    (0..2).for_each(|place| drop(folder.file(&format!("c.10.{place}"), text(10, 0..3).as_bytes())));
    folder.file("c.20.0", text(20, 0..3).as_bytes());
    let names = ["c.10.%", "c.20.%"].map(|it| folder.path(it));
    let sequence = Sequence::open(&names, &Options::default(), &()).unwrap();
    assert!(frame(&sequence, 0).warnings.is_empty());
    assert_eq!(frame(&sequence, 1).warnings, ["c.20.% has 1 piece, c.10.% has 2: is one missing?"]);
}
