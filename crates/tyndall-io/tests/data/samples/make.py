"""Writes the samples of this folder, a few particles in every format that can be read, mostly with the formats' own libraries.

python make.py TYNDALL (the command, for formats that few others write; needs numpy, MDAnalysis, gsd, laspy, lazrs, pye57, vtk, msgpack,
OpenEXR, pyarrow, h5py; and Debian's python3-openvdb). `universal.usda`, `vasp.poscar` and `atomeye.cfg` are written by hand.
"""
import bz2
import gzip
import lzma
import os
import struct
import subprocess
import sys

import msgpack
import numpy as np

os.chdir(os.path.dirname(os.path.abspath(__file__)))
COUNT = 24
random = np.random.default_rng(1)
positions = random.uniform(0.0, 10.0, (COUNT, 3)).astype(np.float32)
velocities = random.normal(0.0, 1.0, (COUNT, 3)).astype(np.float32)


def write(name, content):
    with open(name, "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def lines(rows, form):
    return "".join(form.format(*row) + "\n" for row in rows)


def text():
    def dump(step):
        head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{COUNT}\nITEM: BOX BOUNDS pp pp pp\n0 10\n0 10\n0 10\n"
        rows = [(k + 1, k % 2 + 1, *positions[k], *velocities[k]) for k in range(COUNT)]
        return head + "ITEM: ATOMS id type x y z vx vy vz\n" + lines(rows, "{} {} {:.4f} {:.4f} {:.4f} {:.3f} {:.3f} {:.3f}")

    write("lammps.dump", dump(0) + dump(100))
    write("lammps.dump.gz", gzip.compress((dump(0) + dump(100)).encode(), mtime=0))
    atoms = [(k + 1, 1, k % 2 + 1, 0.5, *positions[k]) for k in range(COUNT)]
    write("lammps.data", f"LAMMPS data file\n\n{COUNT} atoms\n2 bonds\n2 atom types\n1 bond types\n\n0 10 xlo xhi\n0 10 ylo yhi\n0 10 zlo zhi\n\n"
          "Masses\n\n1 12.0\n2 1.0\n\nAtoms # full\n\n" + lines(atoms, "{} {} {} {} {:.4f} {:.4f} {:.4f}")
          + "\nVelocities\n\n" + lines([(k + 1, *velocities[k]) for k in range(COUNT)], "{} {:.3f} {:.3f} {:.3f}")
          + "\nBonds\n\n1 1 1 2\n2 1 3 4\n")
    atoms = lines([("OH"[k % 2], *positions[k], k) for k in range(COUNT)], "{} {:.4f} {:.4f} {:.4f} {}")
    frame = f'{COUNT}\nLattice="10 0 0 0 10 0 0 0 10" Properties=species:S:1:pos:R:3:tag:I:1 Time=0.5\n' + atoms
    write("extended.xyz", frame + frame)
    write("extended.xyz.bz2", bz2.compress((frame + frame).encode()))
    write("extended.xyz.xz", lzma.compress((frame + frame).encode()))
    gro = [(1 + k // 3, "SOL", ["OW", "HW1", "HW2"][k % 3], k + 1, *positions[k] / 10, *velocities[k]) for k in range(COUNT)]
    gro = f"water t= 1.0\n{COUNT}\n" + lines(gro, "{:5d}{:<5}{:>5}{:5d}{:8.3f}{:8.3f}{:8.3f}{:8.4f}{:8.4f}{:8.4f}") + "   1.0 1.0 1.0\n"
    write("gromacs.gro", gro + gro)
    write("table.csv", "x,y,z,mass,name\n" + lines([(*positions[k], k / 8, "ab"[k % 2]) for k in range(COUNT)], "{:.4f},{:.4f},{:.4f},{},{}"))
    write("cloud.pts", f"{COUNT}\n" + lines([(*positions[k], k, 10 * k, 0, 255) for k in range(COUNT)], "{:.4f} {:.4f} {:.4f} {} {} {} {}"))
    # The second scan is turned and moved; every fifth direction has no echo.
    def scan(rows, matrix):
        points = [(*positions[k], k / 32, 10 * k, 0, 255) if k % 5 else (0, 0, 0, 0.5, 0, 0, 0) for k in rows]
        axes = "1 0 0\n0 1 0\n0 0 1\n"
        return f"3\n{len(points) // 3}\n0 0 0\n{axes}" + lines(matrix, "{} {} {} {}") + lines(points, "{:.4f} {:.4f} {:.4f} {:.6f} {} {} {}")
    unit = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
    write("scanner.ptx", scan(range(12), unit) + scan(range(12, COUNT), [(0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (100, 0, 2.5, 1)]))
    atoms = [(k + 1, k % 2, 1.5, *positions[k], *velocities[k], -k / 8) for k in range(COUNT)]
    write("atoms.imd", "#F A 1 1 1 3 3 1\n#C number type mass x y z vx vy vz Epot\n#X 10 0 0\n#Y 1 10 0\n#Z 0 0 10\n#E\n"
          + lines(atoms, "{} {} {} {:.4f} {:.4f} {:.4f} {:.3f} {:.3f} {:.3f} {}"))
    write("binary.imd", b"#F b 1 1 1 3 3 1\n#C number type mass x y z vx vy vz Epot\n#X 10 0 0\n#Y 1 10 0\n#Z 0 0 10\n#E\n"
          + b"".join(struct.pack(">2i8f", *atom) for atom in atoms))
    names, types = "position velocity mass particleId", "V V R I"
    write("maya.pda", f"ATTRIBUTES\n {names} \nTYPES\n {types} \nNUMBER_OF_PARTICLES: {COUNT}\nBEGIN DATA\n"
          + lines([(*positions[k], *velocities[k], 1.5, k) for k in range(COUNT)], " {:.4f} {:.4f} {:.4f} {:.3f} {:.3f} {:.3f} {} {} "))
    def atom(k):
        return ("HETATM" if k % 5 == 4 else "ATOM  ", k + 1, ["N", "CA", "C", "O"][k % 4], "GLY", "AB"[k // 12], k // 4 + 1, *positions[k], "NCCO"[k % 4])
    atoms = lines([atom(k) for k in range(COUNT)], "{}{:5d}  {:<3} {} {}{:4d}    {:8.3f}{:8.3f}{:8.3f}  1.00 20.00          {:>2}")
    biomt = "".join(f"REMARK 350   BIOMT{row}   {copy}  {' '.join(f'{float(row == axis):9.6f}' for axis in (1, 2, 3))}     {10.0 * (copy - 1) * (row == 1):10.5f}\n"
                    for copy in (1, 2) for row in (1, 2, 3))
    write("protein.pdb", "HEADER    TEST\nREMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A, B\n" + biomt
          + "CRYST1   10.000   10.000   10.000  90.00  90.00  90.00 P 1           1\nMODEL        1\n" + atoms
          + "ENDMDL\nMODEL        2\n" + atoms + "ENDMDL\nEND\n")
    charged = lines([(*atom(k)[:-1], k / 10 - 1, 1 + k / 16) for k in range(COUNT)], "{}{:5d}  {:<3} {} {}{:4d}    {:8.3f}{:8.3f}{:8.3f} {:7.4f} {:6.4f}")
    write("charges.pqr", "REMARK   1 charges and radii\n" + charged + "TER\nEND\n")
    keys = "group_PDB id type_symbol label_atom_id label_comp_id label_asym_id label_seq_id Cartn_x Cartn_y Cartn_z pdbx_PDB_model_num".split()
    write("protein.cif", "data_TEST\n_cell.length_a 10.0\n_cell.length_b 10.0\n_cell.length_c 10.0\n"
          "_cell.angle_alpha 90\n_cell.angle_beta 90\n_cell.angle_gamma 90\nloop_\n" + "".join(f"_atom_site.{key}\n" for key in keys)
          + lines([("ATOM", k + 1, "NCCO"[k % 4], ["N", "CA", "C", "O"][k % 4], "GLY", "A", k // 4 + 1, *positions[k], 1) for k in range(COUNT)],
                  "{} {} {} {} {} {} {} {:.3f} {:.3f} {:.3f} {}") + "#\n")
    values = positions.reshape(-1)[:27] ** 2
    write("grid.dx", "object 1 class gridpositions counts 3 3 3\norigin 0 0 0\ndelta 1 0 0\ndelta 0 1 0\ndelta 0 0 1\n"
          "object 2 class gridconnections counts 3 3 3\nobject 3 class array type double rank 0 items 27 data follows\n"
          + "".join(" ".join(f"{it:.4f}" for it in values[k:k + 3]) + "\n" for k in range(0, 27, 3)) + 'attribute "dep" string "positions"\n')
    vertices = "".join(f"{positions[k][0]:.4f} {positions[k][1]:.4f} {positions[k][2]:.4f} {k}\n" for k in range(COUNT))
    write("text.ply", f"ply\nformat ascii 1.0\nelement vertex {COUNT}\nproperty float x\nproperty float y\nproperty float z\nproperty int tag\nend_header\n" + vertices)
    rows = lines([(*positions[k], k) for k in range(COUNT)], "{:.4f} {:.4f} {:.4f} {}")
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z tag\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA {1}\n"
    write("text.pcd", head.format(COUNT, "ascii") + rows)
    records = np.rec.fromarrays([*positions.T, np.arange(COUNT, dtype="u4")])
    write("binary.pcd", head.format(COUNT, "binary").encode() + records.tobytes())
    columns = positions.T.tobytes() + np.arange(COUNT, dtype="<u4").tobytes()
    literals = b"".join(bytes([len(columns[k:k + 32]) - 1]) + columns[k:k + 32] for k in range(0, len(columns), 32))
    write("packed.pcd", head.format(COUNT, "binary_compressed").encode() + struct.pack("<II", len(literals), len(columns)) + literals)
    # A Houdini GEO of version 5, as partio writes it.
    write("houdini.geo", f"PGEOMETRY V5\nNPoints {COUNT} NPrims 1\nNPointGroups 0 NPrimGroups 0\nNPointAttrib 1 NVertexAttrib 0 NPrimAttrib 1 NAttrib 0\n"
          "PointAttrib\npscale 1 float 0\n" + lines([(*positions[k], k / 8) for k in range(COUNT)], "{:.4f} {:.4f} {:.4f} 1 ({})")
          + f"PrimitiveAttrib\ngenerator 1 index 1 papi\nPart {COUNT} " + " ".join(map(str, range(COUNT))) + " [0]\nbeginExtra\nendExtra\n")


def binary():
    def dump(step):
        units, columns = b"lj", b"id type x y z"
        out = struct.pack("<q", -len(b"DUMPCUSTOM")) + b"DUMPCUSTOM" + struct.pack("<ii", 1, 2)
        out += struct.pack("<qqi6i6di", step, COUNT, 0, *[0] * 6, 0, 10, 0, 10, 0, 10, 5)
        out += struct.pack("<i", len(units)) + units + struct.pack("<bd", 1, 0.5) + struct.pack("<i", len(columns)) + columns
        out += struct.pack("<i", 2)
        rows = np.column_stack([np.arange(COUNT) + 1, np.arange(COUNT) % 2 + 1, positions]).astype("<f8")
        for half in (rows[:10], rows[10:]):
            out += struct.pack("<i", half.size) + half.tobytes()
        return out

    write("lammps.bin", dump(0) + dump(100))

    def record(content, order="<", tag=None):
        size = struct.pack(order + "I", len(content))
        marked = b"" if tag is None else struct.pack(order + "I", 8) + tag + struct.pack(order + "I", len(content) + 8) + struct.pack(order + "I", 8)
        return marked + size + content + size

    counts = [10, 14, 0, 0, 0, 0]
    for name, order, tags in (("snapshot.gadget1", "<", False), ("snapshot.gadget2", ">", True)):
        header = struct.pack(order + "6I6ddd2i6I2i4d", *counts, 0, 0.25, 0, 0, 0, 0, 0.5, 1.0, 0, 0, *counts, 0, 1, 10.0, 0.3, 0.7, 0.7)
        header += bytes(256 - len(header))
        tag = (lambda word: word) if tags else (lambda _: None)
        put = lambda array, kind: np.asarray(array).astype(order + kind).tobytes()
        write(name, record(header, order, tag(b"HEAD")) + record(put(positions, "f4"), order, tag(b"POS "))
              + record(put(velocities, "f4"), order, tag(b"VEL ")) + record(put(np.arange(COUNT), "u4"), order, tag(b"ID  "))
              + record(put(np.ones(10), "f4"), order, tag(b"MASS")) + record(put(np.ones(10), "f4"), order, tag(b"U   ")))
    # TIPSY: 4 gas, 12 dark, 8 star particles, big-endian with the header's pad.
    def rows(part, behind):
        return np.column_stack([np.full(len(part), 0.5), part, part, *[np.full(len(part), 0.1)] * behind]).astype(">f4").tobytes()

    write("snapshot.tipsy", struct.pack(">diiiiii", 1.0, COUNT, 3, 4, 12, 8, 0)
          + rows(positions[:4], 5) + rows(positions[4:16], 2) + rows(positions[16:], 4))
    points = np.zeros(COUNT, dtype=[("p", "<f4", 3), ("n", "<u2", 2), ("r", "<f4"), ("v", "<f4", 4)])
    points["p"], points["r"] = positions, 0.5
    variables = b"float mass\ncolor Cd\n"
    write("renderman.ptc", b"pptc" + struct.pack("<Id6f", 0, COUNT, *[0.0] * 6) + bytes(140) + struct.pack("<II", 2, 4) + variables + points.tobytes())
    sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"
    for row in range(4):
        sky += bytes([2, 2, 0, 8]) + b"".join(bytes([128 + 8, value + row]) for value in (60, 80, 100, 120))
    write("sky.hdr", sky)
    np.save("positions.npy", positions)
    np.savez_compressed("arrays.npz", pos=positions, vel=velocities, mass=np.ones(COUNT))
    # BinaryCIF: Cartesian coordinates as scaled differences, elements as a table of words.
    def encoded(data, *encodings):
        return {"data": data, "encoding": list(encodings)}

    def integers(values):
        return encoded(np.asarray(values, "<i4").tobytes(), {"kind": "ByteArray", "type": 3})

    def column(name, data):
        return {"name": name, "data": data, "mask": None}

    def coordinates(axis):
        values = np.round(positions[:, axis] * 1000).astype(int)
        steps = np.diff(values, prepend=0)
        packed = bytearray()
        for step in steps:
            while step >= 32767:
                packed += struct.pack("<h", 32767)
                step -= 32767
            while step <= -32768:
                packed += struct.pack("<h", -32768)
                step += 32768
            packed += struct.pack("<h", step)
        return encoded(bytes(packed), {"kind": "FixedPoint", "factor": 1000, "srcType": 33}, {"kind": "Delta", "origin": 0, "srcType": 3},
                       {"kind": "IntegerPacking", "byteCount": 2, "isUnsigned": False, "srcSize": COUNT}, {"kind": "ByteArray", "type": 2})

    def words(all_words, rows):
        offsets = np.cumsum([0] + [len(word) for word in all_words])
        return encoded(np.asarray(rows, "<i4").tobytes(), {
            "kind": "StringArray", "dataEncoding": [{"kind": "ByteArray", "type": 3}], "stringData": "".join(all_words),
            "offsets": offsets.astype("<i4").tobytes(), "offsetEncoding": [{"kind": "ByteArray", "type": 3}]})

    runs = encoded(np.asarray([1, COUNT], "<i4").tobytes(), {"kind": "RunLength", "srcType": 3, "srcSize": COUNT}, {"kind": "ByteArray", "type": 3})
    columns = [column("id", integers(np.arange(COUNT) + 1)), column("type_symbol", words(["N", "C", "O"], [[0, 1, 1, 2][k % 4] for k in range(COUNT)])),
               column("Cartn_x", coordinates(0)), column("Cartn_y", coordinates(1)), column("Cartn_z", coordinates(2)), column("pdbx_PDB_model_num", runs)]
    file = {"version": "0.3.0", "encoder": "make.py", "dataBlocks": [{"header": "TEST", "categories": [{"name": "_atom_site", "rowCount": COUNT, "columns": columns}]}]}
    write("protein.bcif", msgpack.packb(file))


def mmtf():
    """Two models of two amino acids in a chain each and four ions, with as many of the encodings as fit."""
    def packed(codec, count, parameter, form, values):
        return struct.pack(">iii", codec, count, parameter) + struct.pack(f">{len(values)}{form}", *values)

    def narrow(values):
        for value in values:
            while abs(value) >= 32767:
                part = 32767 if value > 0 else -32768
                yield part
                value -= part
            yield value

    def words(names):
        return struct.pack(">iii", 5, len(names), 4) + b"".join(it.encode().ljust(4, b"\0") for it in names)

    atoms = COUNT // 2
    x, y, z = np.concatenate([positions[:atoms], positions[:atoms] + np.float32([1, 0, 0])]).T
    x, y = (np.round(it * 1000).astype(int) for it in (x, y))
    residue = {"groupName": "GLY", "atomNameList": ["N", "CA", "C", "O"], "elementList": ["N", "C", "C", "O"], "formalChargeList": [0] * 4,
               "bondAtomList": [0, 1, 1, 2, 2, 3], "bondOrderList": [1, 1, 2], "singleLetterCode": "G", "chemCompType": "PEPTIDE LINKING"}
    ion = {"groupName": "NA", "atomNameList": ["NA"], "elementList": ["Na"], "formalChargeList": [1], "bondAtomList": [], "bondOrderList": [],
           "singleLetterCode": "?", "chemCompType": "NON-POLYMER"}
    unit = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    turn = [-1.0, 0, 0, 5, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    transforms = [{"chainIndexList": [0, 1], "matrix": unit}, {"chainIndexList": [0, 1], "matrix": turn}, {"chainIndexList": [2], "matrix": unit}]
    file = {
        "mmtfVersion": "1.0.0", "mmtfProducer": "make.py", "unitCell": [10.0, 20.0, 30.0, 90.0, 90.0, 90.0], "spaceGroup": "P 1",
        "bioAssemblyList": [{"name": "dimer", "transformList": transforms}],
        "entityList": [{"chainIndexList": [0, 1, 3, 4], "description": "", "type": "polymer", "sequence": "G"},
                       {"chainIndexList": [2, 5], "description": "", "type": "non-polymer", "sequence": ""}],
        "numBonds": 12, "numAtoms": COUNT, "numGroups": 12, "numChains": 6, "numModels": 2, "groupList": [residue, ion],
        "xCoordList": packed(10, COUNT, 1000, "h", list(narrow(np.diff(x, prepend=0)))),
        "yCoordList": packed(10, COUNT, 1000, "h", list(narrow(np.diff(y, prepend=0)))), "zCoordList": packed(1, COUNT, 0, "f", z),
        "bFactorList": packed(11, COUNT, 100, "h", range(100, 100 + COUNT)), "occupancyList": packed(9, COUNT, 100, "i", [100, COUNT]),
        "atomIdList": packed(8, COUNT, 0, "i", [1, COUNT]), "altLocList": packed(6, COUNT, 0, "i", [0, 3, 66, 1, 0, 11, 66, 1, 0, 8]),
        "groupTypeList": packed(4, 12, 0, "i", [0, 0, 1, 1, 1, 1] * 2),
        "groupIdList": packed(8, 12, 0, "i", [7, 1, 1, 1, 90, 1, 1, 3, -94, 1, 1, 1, 90, 1, 1, 3]),
        "insCodeList": packed(6, 12, 0, "i", [0, 1, 65, 1, 0, 5, 65, 1, 0, 4]), "secStructList": packed(2, 12, 0, "b", [7] * 12),
        "sequenceIndexList": packed(7, 12, 0, "i", [0, 12]), "chainIdList": words(["A", "B", "C"] * 2), "chainNameList": words(["A", "B", "C"] * 2),
        "groupsPerChain": [1, 1, 4] * 2, "chainsPerModel": [3, 3],
    }
    write("protein.mmtf", msgpack.packb(file))


def trajectories():
    import MDAnalysis
    import gsd.hoomd

    universe = MDAnalysis.Universe.empty(COUNT, trajectory=True, velocities=True, forces=True)
    universe.dimensions = [10, 10, 10, 90, 90, 90]
    for name in ("gromacs.xtc", "gromacs.trr", "charmm.dcd", "amber.nc"):
        with MDAnalysis.Writer(name, COUNT) as writer:
            for step in range(3):
                universe.atoms.positions = positions + step
                universe.atoms.velocities = velocities
                writer.write(universe.atoms)
    with gsd.hoomd.open("hoomd.gsd", "w") as file:
        for step in range(2):
            frame = gsd.hoomd.Frame()
            frame.configuration.step, frame.configuration.box = step, [10, 10, 10, 0, 0, 0]
            frame.particles.N, frame.particles.position, frame.particles.velocity = COUNT, positions - 5, velocities
            frame.particles.types, frame.particles.typeid = ["A", "B"], np.arange(COUNT) % 2
            file.append(frame)


def clouds():
    import laspy
    import pye57

    for name, form in (("scan.las", 7), ("scan.laz", 3), ("scan_1_4.laz", 7)):
        header = laspy.LasHeader(point_format=form, version="1.2" if form == 3 else "1.4")
        header.scales = [0.001] * 3
        file = laspy.LasData(header)
        file.x, file.y, file.z = positions.T
        file.intensity, file.red = np.arange(COUNT), np.arange(COUNT) * 100
        file.write(name)
    with pye57.E57("scan.e57", mode="w") as file:
        x, y, z = positions.T.astype("f8")
        file.write_scan_raw({"cartesianX": x, "cartesianY": y, "cartesianZ": z, "intensity": np.linspace(0, 1, COUNT)})


def vtk_files():
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    def cloud(of):
        data = of()
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk(positions, deep=True))
        data.SetPoints(points)
        for name, values in (("mass", np.linspace(0, 1, COUNT)), ("velocity", velocities)):
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            data.GetPointData().AddArray(array)
        return data

    def put(writer, name, data, **settings):
        writer = writer()
        writer.SetFileName(name)
        writer.SetInputData(data)
        for key, value in settings.items():
            getattr(writer, key)(*value)
        writer.Write()

    poly, grid = cloud(vtk.vtkPolyData), cloud(vtk.vtkUnstructuredGrid)
    put(vtk.vtkPolyDataWriter, "legacy_text.vtk", poly, SetFileTypeToASCII=())
    put(vtk.vtkPolyDataWriter, "legacy_binary.vtk", poly, SetFileTypeToBinary=())
    put(vtk.vtkXMLPolyDataWriter, "text.vtp", poly, SetDataModeToAscii=())
    put(vtk.vtkXMLPolyDataWriter, "appended_zlib.vtp", poly, SetDataModeToAppended=(), SetCompressorTypeToZLib=())
    put(vtk.vtkXMLPolyDataWriter, "appended_raw.vtp", poly, SetDataModeToAppended=(), SetCompressorTypeToNone=(), EncodeAppendedDataOff=())
    put(vtk.vtkXMLUnstructuredGridWriter, "base64_lz4.vtu", grid, SetDataModeToBinary=(), SetCompressorTypeToLZ4=())
    put(vtk.vtkXMLPPolyDataWriter, "parallel.pvtp", poly, SetNumberOfPieces=(1,), SetDataModeToAppended=(), SetCompressorTypeToNone=())
    write("list.pvd", '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
          '<DataSet timestep="0" file="text.vtp"/>\n<DataSet timestep="1" file="appended_raw.vtp"/>\n</Collection>\n</VTKFile>\n')
    write("list.vtp.series", '{"file-series-version": "1.0", "files": [{"name": "text.vtp", "time": 0}, {"name": "appended_raw.vtp", "time": 1}]}\n')
    image = vtk.vtkImageData()
    image.SetDimensions(3, 3, 3)
    array = numpy_to_vtk(positions.reshape(-1)[:27], deep=True)
    array.SetName("density")
    image.GetPointData().SetScalars(array)
    put(vtk.vtkXMLImageDataWriter, "grid.vti", image, SetDataModeToAppended=(), SetCompressorTypeToZLib=())


def xdmf():
    import h5py

    with h5py.File("series_xdmf.h5", "w") as file:
        file["x"], file["y"], file["one"] = np.arange(4.0), 10 * np.arange(4.0), np.array([1.0])
        file["step_0/position"] = np.arange(12.0).reshape(4, 3)
        for step, sign in [(0, 1), (1, -1)]:
            file[f"step_{step}/velocity"] = sign * np.arange(12, dtype="f4").reshape(4, 3)
            file[f"step_{step}/mass"] = sign * np.arange(4, dtype="f4")
    def item(name, size):
        return f'<DataItem Dimensions="{size}" NumberType="Float" Format="HDF">\n          series_xdmf.h5:/{name}\n        </DataItem>'
    def step(number, time, points):
        return (f'      <Grid Name="particles" GridType="Uniform">\n        <Time Value="{time}"/>\n        {points}\n'
                f'        <Attribute Name="velocity" AttributeType="Vector" Center="Node">{item(f"step_{number}/velocity", "4 3")}</Attribute>\n'
                f'        <Attribute Name="mass" AttributeType="Scalar" Center="Node">{item(f"step_{number}/mass", "4")}</Attribute>\n      </Grid>\n')
    own = f'<Topology TopologyType="Polyvertex" NumberOfElements="4"/>\n        <Geometry GeometryType="XYZ">{item("step_0/position", "4 3")}</Geometry>'
    included = '<xi:include xpointer="xpointer(//Grid[@Name=&quot;series&quot;]/Grid[1]/*[self::Topology or self::Geometry])"/>'
    write("series.xdmf", '<?xml version="1.0"?>\n<Xdmf Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude">\n  <Domain>\n'
          '    <Grid Name="series" GridType="Collection" CollectionType="Temporal">\n'
          + step(0, 0.5, own) + step(1, 0.75, included) + "    </Grid>\n  </Domain>\n</Xdmf>\n")


def voxels():
    """With the Python of the system, for which Debian has python3-openvdb; packed by Blosc."""
    script = """
import pyopenvdb as vdb, random
random.seed(3)
density, velocity, ball = vdb.FloatGrid(), vdb.Vec3SGrid(), vdb.createLevelSetSphere(radius=1.5, center=(3, 3, 3), voxelSize=0.25, halfWidth=2)
density.name, velocity.name, ball.name = 'density', 'velocity', 'ball'
density.gridClass = vdb.GridClass.FOG_VOLUME
density.transform = velocity.transform = vdb.createLinearTransform(0.25)
density.fill((16, 0, 8), (23, 7, 15), 0.5)
values, vectors = density.getAccessor(), velocity.getAccessor()
for k in range(40):
    at = tuple(random.randrange(16) for axis in range(3))
    values.setValueOn(at, random.randrange(1000) / 16)
    vectors.setValueOn(at, (k, -k, 0.5))
vdb.write('cloud.vdb', grids=[velocity, density, ball])
"""
    subprocess.run(["/usr/bin/python3", "-c", script], check=True)


def tables():
    """One table in all packings, and others with positions elsewhere. What has a message but is not read stands a folder above."""
    import decimal

    import pyarrow as pa
    import pyarrow.feather
    import pyarrow.parquet

    k = np.arange(COUNT)
    x, y, z = 0.5 * k, 100.0 - k, np.full(COUNT, -3.25)
    huge = k.astype("u8")
    huge[0] = 2**64 - 1
    columns = {
        "x [kpc]": x, "y [kpc]": y, "z [kpc]": z, "id": k * 10**12, "small": (k - 12).astype("i2"), "byte": (10 * k).astype("u1"), "flag": k % 3 == 0,
        "half": (k / 4).astype("f2"), "velocity": pa.FixedSizeListArray.from_arrays(pa.array(np.arange(3 * COUNT, dtype="f4")), 3),
        "pair": pa.array([[2.0 * i, 2.0 * i + 1] for i in range(COUNT)]), "count": pa.array([None if i % 5 == 4 else 7 * i for i in range(COUNT)]),
        "gap": pa.array([None if i % 2 else float(i) for i in range(COUNT)], pa.float32()),
        "price": pa.array([decimal.Decimal(i) / 100 for i in range(COUNT)], pa.decimal128(9, 2)),
        "when": pa.array([10**15 + 250_000 * i for i in range(COUNT)], pa.timestamp("us")), "huge": huge,
        "kind": pa.array([["gas", "star", None][i % 3] for i in range(COUNT)]).dictionary_encode(), "name": pa.array([f'\u03a9{i} ""' for i in range(COUNT)]),
        "ragged": pa.array([[1.0] * (i % 3) for i in range(COUNT)]), "blob": pa.array([b"\0\1"] * COUNT),
    }
    table = pa.table(columns)
    velocity = table.schema.get_field_index("velocity")
    table = table.cast(table.schema.set(velocity, table.schema.field(velocity).with_metadata({"unit": "km/s"})))
    write = pa.parquet.write_table
    write(table, "groups_snappy.parquet", compression="snappy", row_group_size=9)
    write(table, "version_2_zstd.parquet", compression="zstd", data_page_version="2.0", row_group_size=20)
    write(table, "plain_gzip.parquet", compression="gzip", use_dictionary=False)
    write(table, "pages_lz4.parquet", compression="lz4", data_page_size=64, write_batch_size=5)
    pa.feather.write_feather(table, "feather_lz4.feather", compression="lz4", chunksize=10)
    with pa.OSFile("stream.arrows", "wb") as file, pa.ipc.new_stream(file, table.schema) as stream:
        stream.write_table(table, max_chunksize=7)
    pa.feather.write_feather(table, "../feather_zstd.feather", compression="zstd")
    write(table.select(["x [kpc]", "y [kpc]", "z [kpc]"]), "../brotli.parquet", compression="brotli")

    rows = np.stack([x, y, z], axis=1)
    mass = np.full(COUNT, 1.5, "f4")
    vector = pa.FixedSizeListArray.from_arrays(pa.array(rows.astype("f4").reshape(-1)), 3)
    write(pa.table({"mass": mass, "Position": vector}), "vector.parquet")
    write(pa.table({"where": pa.array(rows.tolist()), "mass": mass, "index": k}), "lists.parquet", compression="none")
    structure = pa.StructArray.from_arrays([pa.array(it) for it in (x, y, z)], ["x", "y", "z"])
    pa.feather.write_feather(pa.table({"pos": structure, "mass": mass}), "structure.feather", compression="uncompressed")


def sky():
    import OpenEXR

    pixels = random.uniform(0.0, 2.0, (4, 8, 3)).astype(np.float16)
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": pixels}).write("sky.exr")


def converted(tyndall):
    for name in ("houdini.bgeo", "krakatoa.prt", "megamol.mmpld", "binary.ply"):
        if os.path.exists(name):
            os.remove(name)
        subprocess.run([tyndall, "convert", "--quiet", "extended.xyz" if name != "binary.ply" else "table.csv", "-o", name], check=True)
    subprocess.run([tyndall, "build", "table.csv", "-o", "saved.tyn"], check=True)


if __name__ == "__main__":
    text()
    binary()
    mmtf()
    trajectories()
    clouds()
    vtk_files()
    xdmf()
    voxels()
    tables()
    sky()
    converted(os.path.abspath(sys.argv[1]))
