//! Formats that are known but not read: each is named, with a way out.
//!
//! Takes the first bytes of a file, gives the error. What is read is asked first, so nothing here shadows a reader.

use std::path::Path;

use tyndall::Error;

use super::whole_lines;

/// Programs of molecular dynamics.
const MOLECULES: &str = "convert it to extended XYZ or a LAMMPS dump, for example with OVITO, ASE or VMD";
/// Point clouds.
const POINTS: &str = "convert it to PLY or CSV, for example with PDAL or CloudCompare";
/// Tools of visual effects.
const EFFECTS: &str = "export the points as PLY, or as classic .bgeo";
/// ParaView.
const PARAVIEW: &str = "open it in ParaView and save the points as PLY or CSV";

struct Known {
    name: &'static str,
    is: fn(&[u8]) -> bool,
    way_out: &'static str,
}

/// Each format that has a recognisable beginning.
const KNOWN: &[Known] = &[
    Known { name: "HDF5", is: is_hdf5, way_out: "read it with h5py and save the columns with numpy.savez" },
    Known {
        name: "GSD",
        is: |head| head.starts_with(&0x65df_65df_65df_65df_u64.to_le_bytes()),
        way_out: MOLECULES,
    },
    Known {
        name: "GROMACS XTC",
        is: |head| matches!(be_u32(head, 0), Some(1995 | 2023)),
        way_out: MOLECULES,
    },
    Known { name: "GROMACS TRR", is: |head| be_u32(head, 0) == Some(1993), way_out: MOLECULES },
    Known { name: "DCD", is: is_dcd, way_out: MOLECULES },
    Known {
        name: "NetCDF",
        is: |head| head.starts_with(b"CDF") && head.get(3).is_some_and(|&it| it < 9),
        way_out: MOLECULES,
    },
    Known { name: "PDB", is: is_pdb, way_out: MOLECULES },
    Known { name: "GROMACS GRO", is: is_gro, way_out: MOLECULES },
    Known { name: "mmCIF", is: is_mmcif, way_out: MOLECULES },
    Known {
        name: "LAMMPS binary dump",
        is: is_lammps_binary,
        way_out: "turn it into text with LAMMPS' binary2txt",
    },
    Known {
        name: "LAMMPS data",
        is: is_lammps_data,
        way_out: "let LAMMPS write a dump: read_data, then write_dump",
    },
    Known {
        name: "Gadget binary",
        is: is_gadget,
        way_out: "read it with pynbody or yt and save the columns with numpy.savez",
    },
    Known {
        name: "TIPSY",
        is: is_tipsy,
        way_out: "read it with pynbody and save the columns with numpy.savez",
    },
    Known { name: "XDMF", is: |head| head_has(head, b"<Xdmf"), way_out: PARAVIEW },
    Known {
        name: "Krakatoa PRT 2 or SPRT",
        is: super::prt::is_later,
        way_out: "save it as PRT 1 in Krakatoa or Stoke, or export the points as PLY",
    },
    Known {
        name: "MegaMol MMSPD",
        is: |head| head.starts_with(b"MMSPD"),
        way_out: "save it as MMPLD with MegaMol",
    },
    Known { name: "LAS or LAZ", is: |head| head.starts_with(b"LASF"), way_out: POINTS },
    Known { name: "E57", is: |head| head.starts_with(b"ASTM-E57"), way_out: POINTS },
    Known { name: "PCD", is: is_pcd, way_out: POINTS },
    Known {
        name: "PTS",
        is: is_pts,
        way_out: "delete the first line and read the rest with --columns x,y,z,…",
    },
    Known { name: "Houdini JSON geometry (since version 12)", is: is_houdini_json, way_out: EFFECTS },
    Known { name: "Houdini blosc (.sc)", is: |head| head.starts_with(b"scf1"), way_out: EFFECTS },
    Known { name: "Alembic", is: |head| head.starts_with(b"Ogawa"), way_out: EFFECTS },
    Known {
        name: "USD",
        is: |head| head.starts_with(b"PXR-USDC") || head.starts_with(b"#usda"),
        way_out: EFFECTS,
    },
    Known {
        name: "OpenVDB",
        is: |head| head.starts_with(b" BDV"),
        way_out: "give the particles, not the grid",
    },
    Known {
        name: "Parquet",
        is: |head| head.starts_with(b"PAR1"),
        way_out: "save it as CSV, or with numpy.savez",
    },
    Known {
        name: "Arrow",
        is: |head| head.starts_with(b"ARROW1"),
        way_out: "save it as CSV, or with numpy.savez",
    },
    Known {
        name: "bzip2",
        is: |head| head.starts_with(b"BZh"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
    Known {
        name: "xz",
        is: |head| head.starts_with(b"\xfd7zXZ\0"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
    Known {
        name: "LZ4",
        is: |head| head.starts_with(b"\x04\x22\x4d\x18"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
];

/// The error about `path`, if its first bytes are those of a known format.
pub(crate) fn explain(path: &Path, head: &[u8]) -> Option<Error> {
    let known = KNOWN.iter().find(|it| (it.is)(head))?;
    let what = format!("this is a file of the format {}, which this version does not read yet", known.name);
    Some(Error::format(path, "", what, known.way_out))
}

fn be_u32(head: &[u8], at: usize) -> Option<u32> {
    let bytes = head.get(at..at + 4)?;
    Some(u32::from_be_bytes(bytes.try_into().expect("four bytes")))
}

fn le_u32(head: &[u8], at: usize) -> Option<u32> {
    be_u32(head, at).map(u32::swap_bytes)
}

fn head_has(head: &[u8], word: &[u8]) -> bool {
    memchr::memmem::find(&head[..head.len().min(1024)], word).is_some()
}

fn is_hdf5(head: &[u8]) -> bool {
    // A user block of a power of two may stand before it.
    [0, 512, 1024, 2048, 4096]
        .iter()
        .any(|&at| head.get(at..).is_some_and(|it| it.starts_with(b"\x89HDF\r\n\x1a\n")))
}

fn is_dcd(head: &[u8]) -> bool {
    [4, 8].iter().any(|&at| head.get(at..at + 4).is_some_and(|it| it == b"CORD" || it == b"VELD"))
}

fn is_pdb(head: &[u8]) -> bool {
    let first = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let records: [&[u8]; 9] =
        [b"HEADER", b"TITLE ", b"REMARK", b"CRYST1", b"ATOM  ", b"HETATM", b"MODEL ", b"COMPND", b"OBSLTE"];
    records.iter().any(|it| first.starts_with(it)) && super::is_text(head)
}

fn is_gro(head: &[u8]) -> bool {
    let mut lines = whole_lines(head).skip(1);
    let count = lines.next().and_then(|line| std::str::from_utf8(line).ok()?.trim().parse::<u64>().ok());
    let coordinate = |line: &[u8], axis: usize| {
        let field = line.get(20 + 8 * axis..28 + 8 * axis).unwrap_or_default();
        fast_float2::parse::<f64, _>(field.trim_ascii()).is_ok()
    };
    count.is_some() && lines.next().is_some_and(|line| (0..3).all(|axis| coordinate(line, axis)))
}

fn is_mmcif(head: &[u8]) -> bool {
    whole_lines(head)
        .find(|line| !line.is_empty() && line[0] != b'#')
        .is_some_and(|it| it.starts_with(b"data_"))
}

fn is_lammps_binary(head: &[u8]) -> bool {
    head.get(8..16).is_some_and(|it| it.starts_with(b"DUMP"))
}

fn is_lammps_data(head: &[u8]) -> bool {
    let is_count = |line: &[u8]| {
        let mut words = line.split(|byte| byte.is_ascii_whitespace()).filter(|it| !it.is_empty());
        words.next().is_some_and(|it| it.iter().all(u8::is_ascii_digit)) && words.next() == Some(b"atoms")
    };
    super::is_text(head) && whole_lines(head).take(40).any(is_count)
}

fn is_gadget(head: &[u8]) -> bool {
    let record = |length: u32, at: usize| {
        [le_u32, be_u32].iter().any(|read| {
            read(head, at) == Some(length) && read(head, at + 4 + length as usize) == Some(length)
        })
    };
    record(256, 0) || (record(8, 0) && head.get(4..8) == Some(b"HEAD"))
}

fn is_tipsy(head: &[u8]) -> bool {
    let header = |read: fn(&[u8], usize) -> Option<u32>| -> Option<bool> {
        let [all, dimensions] = [read(head, 8)?, read(head, 12)?];
        let parts = [read(head, 16)?, read(head, 20)?, read(head, 24)?].map(u64::from);
        Some(all > 0 && dimensions == 3 && parts.iter().sum::<u64>() == u64::from(all))
    };
    header(be_u32) == Some(true) || header(le_u32) == Some(true)
}

fn is_pcd(head: &[u8]) -> bool {
    head.starts_with(b"# .PCD") || (head.starts_with(b"VERSION") && head_has(head, b"\nFIELDS"))
}

/// A count, then rows of numbers without a comment between.
fn is_pts(head: &[u8]) -> bool {
    let mut lines = whole_lines(head);
    let numbers = |line: Option<&[u8]>| -> Option<usize> {
        let tokens: Vec<_> =
            line?.split(|byte| byte.is_ascii_whitespace()).filter(|it| !it.is_empty()).collect();
        let all = tokens.iter().all(|it| fast_float2::parse::<f64, _>(it).is_ok());
        all.then_some(tokens.len())
    };
    let counts = [numbers(lines.next()), numbers(lines.next()), numbers(lines.next())];
    counts[0] == Some(1) && counts[1].is_some_and(|count| count >= 3) && counts[1] == counts[2]
}

fn is_houdini_json(head: &[u8]) -> bool {
    head.starts_with(b"\x7fNSJb") || (head.starts_with(b"[") && head_has(head, b"\"fileversion\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(head: &[u8]) -> String {
        explain(Path::new("file"), head).map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn known_beginnings_are_named_with_a_way_out() {
        let gadget = [&256u32.to_le_bytes()[..], &[0; 256], &256u32.to_le_bytes()].concat();
        let gro = b"Water in a box\n    3\n    1SOL     OW    1   0.126   1.624   1.679\n";
        let cases: [(&[u8], &str); 8] = [
            (b"\x89HDF\r\n\x1a\n", "HDF5"),
            (&2023u32.to_be_bytes(), "XTC"),
            (&gadget, "Gadget"),
            (gro, "GRO"),
            (b"# comment\n\n 12 atoms\n", "LAMMPS data"),
            (b"5\n0 0 0 9\n1 0 0 9\n", "PTS"),
            (b"\xc0PRT2\r\n\x1a", "PRT 2"),
            (b"[\n\t\"fileversion\",\"18\"", "Houdini JSON"),
        ];
        for (head, name) in cases {
            let message = named(head);
            assert!(message.contains(name) && message.contains("does not read yet"), "{name}: {message}");
        }
    }

    #[test]
    fn plain_rows_are_nothing_known() {
        for head in [&b"1 2 3 4 5\n1 2 3 4 5\n"[..], b"", b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"] {
            assert_eq!(named(head), "");
        }
    }
}
