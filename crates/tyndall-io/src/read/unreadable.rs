//! Formats that are known but not read: each is named, with a way out.
//!
//! Takes the first bytes of a file, gives the error. What is read is asked first, so nothing here shadows a reader.

use std::path::Path;

use tyndall::Error;

/// Tools of visual effects.
const EFFECTS: &str = "export the points as PLY, or as classic .bgeo";
/// Tables of astronomy.
const ASTROPY: &str = "convert it with Astropy: Table.read(IN).write('OUT.csv'), or 'OUT.hdf5'";
/// Molecules and crystals.
const ASE: &str = "convert it: ase convert IN OUT.extxyz";
const OPEN_BABEL: &str = "convert it: obabel IN -O OUT.pdb";

struct Known {
    name: &'static str,
    is: fn(&[u8]) -> bool,
    way_out: &'static str,
}

/// Each format that has a recognisable beginning.
const KNOWN: &[Known] = &[
    #[cfg(not(feature = "hdf5"))]
    Known { name: "HDF5", is: is_hdf5, way_out: "build with the feature hdf5, which reads it" },
    #[cfg(not(feature = "hdf5"))]
    Known {
        name: "XDMF",
        is: |head| head_has(head, b"<Xdmf"),
        way_out: "build with the feature hdf5, which reads it",
    },
    Known {
        name: "Krakatoa PRT 2 or SPRT",
        is: super::prt::is_later,
        way_out: "save it as PRT 1 in Krakatoa or Stoke, or export the points as PLY",
    },
    Known {
        name: "DualSPHysics .bi4",
        is: is_bi4,
        way_out: "convert it with the program PartVTK of DualSPHysics: PartVTK -dirin OUT -savevtk OUT/PartFluid",
    },
    Known {
        name: "MegaMol MMSPD",
        is: |head| head.starts_with(b"MMSPD"),
        way_out: "save it as MMPLD with MegaMol",
    },
    Known { name: "Houdini JSON geometry (since version 12)", is: is_houdini_json, way_out: EFFECTS },
    Known { name: "Houdini blosc (.sc)", is: |head| head.starts_with(b"scf1"), way_out: EFFECTS },
    Known { name: "Alembic", is: |head| head.starts_with(b"Ogawa"), way_out: EFFECTS },
    Known { name: "binary glTF (.glb)", is: |head| head.starts_with(b"glTF"), way_out: EFFECTS },
    Known {
        name: "binary USD",
        is: |head| head.starts_with(b"PXR-USDC"),
        way_out: "convert it: usdcat IN -o OUT.usda",
    },
    #[cfg(not(feature = "parquet"))]
    Known {
        name: "Parquet",
        is: |head| head.starts_with(b"PAR1"),
        way_out: "build with the feature parquet, which reads it, or save it as CSV or with numpy.savez",
    },
    #[cfg(not(feature = "parquet"))]
    Known {
        name: "Arrow",
        is: |head| head.starts_with(b"ARROW1"),
        way_out: "build with the feature parquet, which reads it, or save it as CSV or with numpy.savez",
    },
    Known {
        name: "Parquet with an encrypted footer",
        is: |head| head.starts_with(b"PARE"),
        way_out: "write it without encryption",
    },
    Known {
        name: "Feather 1",
        is: |head| head.starts_with(b"FEA1"),
        way_out: "write it again as Feather 2 or Parquet: pandas.read_feather, then to_feather",
    },
    Known {
        name: "text in UTF-16",
        is: |head| matches!(head, [0xff, 0xfe, _, 0, ..] | [0xfe, 0xff, 0, _, ..]),
        way_out: "save it as UTF-8: iconv -f UTF-16 -t UTF-8 IN > OUT",
    },
    Known {
        name: "text whose lines end with CR alone",
        is: |head| super::is_text(head) && head.contains(&b'\r') && !head.contains(&b'\n'),
        way_out: "end them with LF: tr '\\r' '\\n' < IN > OUT",
    },
    Known { name: "trajectory of ASE", is: |head| head.starts_with(b"- of Ulm"), way_out: ASE },
    Known { name: "Tripos MOL2", is: |head| head_has(head, b"@<TRIPOS>"), way_out: OPEN_BABEL },
    Known { name: "FITS", is: |head| head.starts_with(b"SIMPLE  ="), way_out: ASTROPY },
    Known { name: "VOTable", is: |head| head_has(head, b"<VOTABLE"), way_out: ASTROPY },
    Known {
        name: "LAMMPS dump in YAML",
        is: |head| head.starts_with(b"---") && head_has(head, b"creator: LAMMPS"),
        way_out: "write it with dump style custom or atom",
    },
    Known {
        name: "mesh (STL)",
        is: |head| head.starts_with(b"solid") && head_has(head, b"facet normal"),
        way_out: "it is drawn beside particles: --mesh FILE",
    },
    Known {
        name: "USD in a package (.usdz)",
        is: |head| head.starts_with(b"PK\x03\x04") && (head_has(head, b".usdc") || head_has(head, b".usda")),
        way_out: "convert it: usdcat IN -o OUT.usda",
    },
    Known {
        name: "archive (zip)",
        is: |head| head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06"),
        way_out: "unpack it: unzip IN",
    },
    Known {
        name: "archive (tar)",
        is: |head| head.get(257..262) == Some(&b"ustar"[..]),
        way_out: "unpack it: tar -xf IN",
    },
    Known {
        name: "LZMA",
        is: |head| {
            head.starts_with(b"\x5d\0\0")
                && head.get(5..13).is_some_and(|it| it == [0xff; 8] || it[6..] == [0; 2])
        },
        way_out: "unpack it: unlzma IN, or pack it with gzip, zstd, bzip2 or xz",
    },
    Known {
        name: "compress (.Z)",
        is: |head| head.starts_with(b"\x1f\x9d"),
        way_out: "unpack it: uncompress IN, or pack it with gzip, zstd, bzip2 or xz",
    },
    Known {
        name: "LZ4",
        is: |head| head.starts_with(b"\x04\x22\x4d\x18"),
        way_out: "unpack it, or pack it with gzip, zstd, bzip2 or xz",
    },
];

/// Each format of text that is told by what stands in its first lines: tables may look so, too.
const LIKELY: &[Known] = &[
    Known { name: "XCrySDen structure (XSF)", is: is_xsf, way_out: ASE },
    Known {
        name: "Gaussian cube",
        is: is_cube,
        way_out: "for its atoms: ase convert IN OUT.extxyz; for its grid save it as OpenDX, in VMD for example",
    },
    Known {
        name: "MDL Molfile or SDF",
        is: |head| lines(head).nth(3).is_some_and(is_count_of_molfile),
        way_out: OPEN_BABEL,
    },
    Known {
        name: "CHARMM coordinates (CARD)",
        is: is_charmm_card,
        way_out: "save it as PDB or GRO, in VMD or with MDAnalysis for example",
    },
    Known {
        name: "AMBER restart in ASCII",
        is: is_amber_restart,
        way_out: "convert it: cpptraj -p TOPOLOGY -y IN -x OUT.nc",
    },
    Known {
        name: "GROMACS index (.ndx)",
        is: is_index,
        way_out: "it says which atoms of a file with names a trajectory has: conf.gro traj.xtc --index FILE",
    },
];

/// The error about `path`, if its first bytes are those of a known format.
pub(crate) fn explain(path: &Path, head: &[u8]) -> Option<Error> {
    explain_one(KNOWN, path, head)
}

/// The same of formats that are but likely; for files that nobody calls a table.
pub(crate) fn explain_likely(path: &Path, head: &[u8]) -> Option<Error> {
    explain_one(LIKELY, path, head).filter(|_| super::is_text(head))
}

fn explain_one(formats: &[Known], path: &Path, head: &[u8]) -> Option<Error> {
    let known = formats.iter().find(|it| (it.is)(head))?;
    let what = format!("this is a file of the format {}, which this version does not read yet", known.name);
    Some(Error::format(path, "", what, known.way_out))
}

fn head_has(head: &[u8], word: &[u8]) -> bool {
    memchr::memmem::find(&head[..head.len().min(1024)], word).is_some()
}

/// Whether HDF5 begins here.
pub(super) fn is_hdf5(head: &[u8]) -> bool {
    // A user block of a power of two may stand before it.
    let places = std::iter::once(0).chain((9..usize::BITS).map(|power| 1 << power));
    let mut heads = places.map_while(|at| head.get(at..));
    heads.any(|it| it.starts_with(b"\x89HDF\r\n\x1a\n"))
}

/// Whether a title of sixty bytes, `#File` and what is in it, stands before binary data.
fn is_bi4(head: &[u8]) -> bool {
    head.starts_with(b"#File ") && head.get(58) == Some(&b'\n') && !super::is_text(head)
}

/// The lines at the front, without their ends.
fn lines(head: &[u8]) -> impl Iterator<Item = &[u8]> {
    head.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii_end)
}

/// The numbers of a line, if it has nothing else.
fn numbers(line: &[u8]) -> Vec<f64> {
    let text = std::str::from_utf8(line).unwrap_or("no numbers");
    text.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>().unwrap_or_default()
}

/// Whether a line is one of counts and of a version, as Molfiles have it.
fn is_count_of_molfile(line: &[u8]) -> bool {
    line.ends_with(b"V2000") || line.ends_with(b"V3000")
}

/// Whether the first line that is no comment is a word with which XSF begins.
fn is_xsf(head: &[u8]) -> bool {
    const FIRST: [&[u8]; 7] =
        [b"CRYSTAL", b"SLAB", b"POLYMER", b"MOLECULE", b"DIM-GROUP", b"ATOMS", b"ANIMSTEPS"];
    let first = lines(head).map(<[u8]>::trim_ascii).find(|it| !it.is_empty() && it[0] != b'#');
    let word = first.and_then(|it| it.split(u8::is_ascii_whitespace).next());
    word.is_some_and(|it| FIRST.contains(&it))
}

/// Whether two lines of text stand before a count of atoms and three axes, a count and three numbers each, and atoms of five.
fn is_cube(head: &[u8]) -> bool {
    let numbers: Vec<Vec<f64>> = lines(head).skip(2).take(5).map(numbers).collect();
    let counted = |it: &Vec<f64>| it.first().is_some_and(|it| *it != 0.0 && it.fract() == 0.0);
    let widths: Vec<usize> = numbers.iter().map(Vec::len).collect();
    matches!(widths[..], [4 | 5, 4, 4, 4, 5]) && numbers[..4].iter().all(counted)
}

/// Whether a title of lines with `*` stands before a count.
fn is_charmm_card(head: &[u8]) -> bool {
    let mut behind = lines(head).skip_while(|it| it.starts_with(b"*"));
    let count = behind.next().map(|it| numbers(it.strip_suffix(b"EXT").unwrap_or(it)));
    head.starts_with(b"*")
        && count.is_some_and(|it| matches!(it[..], [count] if count >= 0.0 && count.fract() == 0.0))
}

/// Whether a count, and perhaps times, stand between a title and numbers of twelve digits each.
fn is_amber_restart(head: &[u8]) -> bool {
    let (count, first) = (lines(head).nth(1).map(numbers), lines(head).nth(2));
    let is_count =
        count.is_some_and(|it| (1..=3).contains(&it.len()) && it[0] >= 1.0 && it[0].fract() == 0.0);
    let is_wide =
        |line: &[u8]| matches!(line.len(), 36 | 72) && line.chunks(12).all(|it| numbers(it).len() == 1);
    is_count && first.is_some_and(is_wide)
}

/// Whether a name in brackets stands before lines of whole numbers.
fn is_index(head: &[u8]) -> bool {
    let mut own = lines(head).map(<[u8]>::trim_ascii).filter(|it| !it.is_empty() && it[0] != b';');
    let is_name = own.next().is_some_and(|it| it.starts_with(b"[") && it.ends_with(b"]"));
    let atoms = own.next().map(numbers).unwrap_or_default();
    is_name && !atoms.is_empty() && atoms.iter().all(|it| *it >= 1.0 && it.fract() == 0.0)
}

fn is_houdini_json(head: &[u8]) -> bool {
    head.starts_with(b"\x7fNSJb") || (head.starts_with(b"[") && head_has(head, b"\"fileversion\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(head: &[u8]) -> String {
        let path = Path::new("file");
        let error = explain(path, head).or_else(|| explain_likely(path, head));
        error.map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn known_beginnings_are_named_with_a_way_out() {
        let bi4 = [&b"#File JPartDataBi4"[..], &[b' '; 40], b"\n\0\x01\0\0\0"].concat();
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        let cases: [(&[u8], &str); 30] = [
            (b"glTF\x02\0\0\0", "glTF"),
            (b"SIMPLE  =                    T / conforms to FITS standard", "FITS"),
            (b"<?xml version=\"1.0\"?>\n<VOTABLE version=\"1.4\">\n<RESOURCE/></VOTABLE>\n", "VOTable"),
            (b"# made by\n CRYSTAL\nPRIMVEC\n 1 0 0\n", "XSF"),
            (b"ATOMS\n6 0.0 0.0 0.0\n1 1.0 0.0 0.0\n", "XSF"),
            (b"t\nc\n 1 0. 0. 0.\n 2 1. 0. 0.\n 2 0. 1. 0.\n 2 0. 0. 1.\n 8 8. 0. 0. 0.\n 1. 2.\n 3. 4.\n", "cube"),
            (b"@<TRIPOS>MOLECULE\nX\n 2 1 0 0 0\n", "MOL2"),
            (b"X\n  prog\n\n  2  1  0  0  0  0            999 V2000\n    0.0000\n", "SDF"),
            (b"* TITLE\n*\n    2\n    1    1 MET  N     24.96300  -4.50000   3.06000 PROT 1 0.0\n", "CHARMM"),
            (b"* TITLE\n*\n         2  EXT\n         1         1  MET       N\n", "CHARMM"),
            (b"name\n    1\n  24.9630000  -4.5000000   3.0600000\n", "cpptraj"),
            (b"name\n    2  0.1E+01\n  24.9630000  -4.5000000   3.0600000  24.0110000  -3.4000000   3.1600000\n", "AMBER"),
            (b"; made by gmx\n[ System ]\n   1    2    3\n", "--index FILE"),
            (&bi4, "DualSPHysics .bi4"),
            (&tar, "tar"),
            (b"- of UlmASE-Trajectory", "ASE"),
            (b"---\ncreator: LAMMPS\n", "YAML"),
            (b"solid x\nfacet normal 0 0 1\n", "STL"),
            (b"PK\x03\x04............................a.usdc", "usdz"),
            (b"PK\x03\x04............................a.dump", "zip"),
            (b"\x5d\0\0\x80\0\xff\xff\xff\xff\xff\xff\xff\xff\0", "LZMA"),
            (b"\x1f\x9d\x90", "compress"),
            (b"\xff\xfex\0,\0y\0\n\0", "UTF-16"),
            (b"x,y,z\r1,2,3\r", "CR alone"),
            (b"FEA1\0\0\0\0", "Feather 1"),
            (b"PARE", "encrypted"),
            (b"PXR-USDC\0", "usdcat"),
            (b"Ogawa\xff\0", "Alembic"),
            (b"\xc0PRT2\r\n\x1a", "PRT 2"),
            (b"[\n\t\"fileversion\",\"18\"", "Houdini JSON"),
        ];
        for (head, name) in cases {
            let message = named(head);
            assert!(message.contains(name) && message.contains("does not read yet"), "{name}: {message}");
        }
    }

    #[cfg(not(feature = "parquet"))]
    #[test]
    fn what_another_build_reads_says_which() {
        for (head, name) in [(&b"PAR1\x15\x04"[..], "Parquet"), (b"ARROW1\0\0", "Arrow")] {
            let message = named(head);
            assert!(message.contains(name) && message.contains("the feature parquet"), "{message}");
        }
    }

    #[test]
    fn plain_rows_are_nothing_known() {
        let heads = [
            &b"1 2 3 4 5\n1 2 3 4 5\n"[..],
            b"",
            b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0",
            b"* 1 2\n* 3 4\n",
            b"[ moleculetype ]\nProtein 3\n",
            b"a\n3\n1 2 3\n4 5 6\n",
            b"a\nb\n1 2 3 4\n1 2 3 4\n1 2 3\n1 2 3 4\n\n\n\n",
        ];
        for head in heads {
            assert_eq!(named(head), "");
        }
    }
}
