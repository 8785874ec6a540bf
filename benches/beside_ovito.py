#!/usr/bin/env python3
"""Tyndall's reading beside OVITO's, chemfiles' and MDAnalysis': the same files, in turn, as a Markdown table with ratios.

Needs beside Rust `pip install ovito chemfiles MDAnalysis numpy h5py` (numpy and h5py write the files). Packages that are absent are left
out.

    benches/beside_ovito.py                        # 1e6 particles, three rounds: about a minute on two cores
    benches/beside_ovito.py --n 1e7 --rounds 5     # 3.5 GB of files in the temporary folder, --folder to choose another

Each file is read once before it is timed, so that it lies in the system's cache: what is measured is the reader, not the disk. Every
reading is a process of its own that tells its time (opening and reading, without starting and importing) and the most memory that it
had; a cell is the median over the rounds. In brackets stands the processor's time, which says more where the machine is not left alone.
Ratios are the others' time by ours: above 1 we are faster.
"""

import argparse
import os
import statistics
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FRAMES = ROOT / "target/release/examples/1_frames"
EDGE = 200.0

# What other programs do with a file: prints seconds and megabytes.
READERS = {
    "OVITO": """
from ovito.io import import_file
begin()
count = import_file(PATH).compute().particles.count
""",
    "chemfiles": """
import chemfiles
chemfiles.set_warnings_callback(lambda message: None)
begin()
with chemfiles.Trajectory(PATH) as trajectory:
    for _ in range(trajectory.nsteps):
        frame = trajectory.read()
""",
    "MDAnalysis": """
from MDAnalysis.coordinates.XTC import XTCReader
begin()
for frame in XTCReader(PATH):
    pass
""",
    "h5py": """
import h5py
begin()
with h5py.File(PATH) as file:
    columns = [column[:] for column in file["PartType1"].values()]
""",
    "numpy": """
import numpy
begin()
columns = numpy.load(PATH)
""",
}
FRAME = """
import resource, sys, time, warnings
warnings.filterwarnings("ignore")
PATH = sys.argv[1]
def begin():
    global start, used
    start, used = time.perf_counter(), time.process_time()
{body}
megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
print(time.perf_counter() - start, time.process_time() - used, megabytes)
"""


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--n", type=float, default=1e6, help="particles")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--folder", help="where the files are written, and left for the next time")
    arguments.add_argument("--files", default="", help="names of those to measure, separated by commas")
    chosen = arguments.parse_args()

    build = ["cargo", "build", "--release", "--quiet", "-p", "tyndall-io", "--example", "1_frames"]
    subprocess.run(build, cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(chosen.folder or temporary)
        names = [name for name in FILES if not chosen.files or name in chosen.files.split(",")]
        print("| file | MB | ours s (processor) | MB/s | memory MB | other | its s (processor) | ratio | its memory MB |")
        print("|---|--:|--:|--:|--:|---|--:|--:|--:|")
        for name in names:
            path = folder / name
            write, others = FILES[name]
            if not path.exists():
                write(path, int(chosen.n))
            print(f"{name}, load {os.getloadavg()[0]:.2f}", file=sys.stderr)
            with open(path, "rb") as file:
                while file.read(1 << 24):
                    pass
            results = {}
            for _ in range(chosen.rounds):
                for reader in ["ours", *others]:
                    results.setdefault(reader, []).append(ours(path) if reader == "ours" else other(reader, path))
            print_rows(name, path.stat().st_size / 1e6, results)


def ours(path):
    """Seconds, those of the processor, and megabytes of our reading."""
    process = subprocess.Popen([FRAMES, path], stdout=subprocess.PIPE, text=True)
    words = process.stdout.read().split()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{FRAMES} {path} failed")
    seconds = sum(float(words[words.index(name) + 1]) for name in ("open", "read"))
    return seconds, used.ru_utime + used.ru_stime, float(words[-2])


def other(reader, path):
    """The same of another program; none if it is not there or cannot read the file."""
    program = FRAME.format(body=READERS[reader])
    done = subprocess.run([sys.executable, "-c", program, path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        print(f"{reader}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    return tuple(map(float, done.stdout.split()[-3:]))


def print_rows(name, size, results):
    def middle(values):
        return statistics.median(values) if values else float("nan")

    medians = {
        reader: [middle([it[place] for it in found if it]) for place in range(3)] for reader, found in results.items()
    }
    seconds, used, memory = medians.pop("ours")
    mine = f"| {name} | {size:.0f} | {seconds:.3f} ({used:.2f}) | {size / seconds:.0f} | {memory:.0f}"
    if not medians:
        print(f"{mine} | | | | |", flush=True)
    for reader, (its, its_used, its_memory) in medians.items():
        ratio = its / seconds
        print(f"{mine} | {reader} | {its:.3f} ({its_used:.2f}) | {ratio:.1f} | {its_memory:.0f} |", flush=True)


def columns(count, step=200_000):
    """Positions, velocities, types and ids in pieces, from a fixed seed."""
    import numpy

    random = numpy.random.default_rng(1)
    for start in range(0, count, step):
        rows = min(step, count - start)
        positions = random.random((rows, 3)) * EDGE
        yield positions, random.normal(size=(rows, 3)), random.integers(1, 4, rows), numpy.arange(start + 1, start + rows + 1)


def text(path, header, line, count, fields):
    with open(path, "w") as file:
        file.write(header)
        for piece in columns(count):
            rows = zip(*(column.tolist() for column in fields(*piece)))
            file.write("\n".join(map(line.__mod__, rows)) + "\n")


def dump(path, count):
    header = (
        f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS pp pp pp\n"
        + 3 * f"0 {EDGE}\n"
        + "ITEM: ATOMS id type x y z vx vy vz\n"
    )
    text(path, header, "%d %d" + 6 * " %.6g", count, lambda p, v, t, i: [i, t, *p.T, *v.T])


def names(types):
    import numpy

    return numpy.array(["", "H", "O", "Cu"])[types]


def xyz(path, count):
    text(path, f"{count}\n\n", "%s" + 3 * " %.6f", count, lambda p, v, t, i: [names(t), *p.T])


def extxyz(path, count):
    header = f'{count}\nLattice="{EDGE} 0 0 0 {EDGE} 0 0 0 {EDGE}" Properties=species:S:1:pos:R:3:force:R:3\n'
    text(path, header, "%s" + 6 * " %.8f", count, lambda p, v, t, i: [names(t), *p.T, *v.T])


def whole(count):
    import numpy

    pieces = list(columns(count, count))[0]
    return [numpy.ascontiguousarray(it, kind) for it, kind in zip(pieces, ("f4", "f4", "i4", "u4"))]


def npy(path, count):
    import numpy

    numpy.save(path, whole(count)[0])


def hdf5(path, count, **how):
    import h5py
    import numpy

    positions, velocities, _, ids = whole(count)
    counts = numpy.array([0, count, 0, 0, 0, 0])
    with h5py.File(path, "w") as file:
        header = file.create_group("Header").attrs
        header["NumPart_ThisFile"] = header["NumPart_Total"] = counts.astype("u4")
        header["NumPart_Total_HighWord"] = numpy.zeros(6, "u4")
        header["MassTable"] = numpy.array([0, 1.0, 0, 0, 0, 0])
        header.update({"Time": 1.0, "Redshift": 0.0, "BoxSize": EDGE, "NumFilesPerSnapshot": 1, "HubbleParam": 0.7})
        part = file.create_group("PartType1")
        for name, column in (("Coordinates", positions), ("Velocities", velocities), ("ParticleIDs", ids)):
            chunks = (65536, *column.shape[1:]) if how else None
            part.create_dataset(name, data=column, chunks=chunks, **how)


def deflated_hdf5(path, count):
    hdf5(path, count, compression="gzip", compression_opts=1, shuffle=True)


def gadget(path, count):
    positions, velocities, _, ids = whole(count)
    header = struct.pack("<6I6d2d2i6I2i", 0, count, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, count, 0, 0, 0, 0, 0, 1)
    header += struct.pack("<4d", EDGE, 0.3, 0.7, 0.7)
    records(path, [header.ljust(256, b"\0"), positions.tobytes(), velocities.tobytes(), ids.tobytes()])


def dcd(path, count):
    control = struct.pack("<20i", 1, 0, 1, *16 * [0], 24)
    axes = [axis.tobytes() for axis in whole(count)[0].T]
    records(path, [b"CORD" + control, struct.pack("<i", 1) + 80 * b" ", struct.pack("<i", count), *axes])


def records(path, contents):
    """Fortran records."""
    with open(path, "wb") as file:
        for content in contents:
            mark = struct.pack("<I", len(content))
            file.write(mark + content + mark)


def las(path, count):
    import numpy

    positions = whole(count)[0]
    header = bytearray(227)
    header[:4], header[24:26] = b"LASF", bytes([1, 2])
    struct.pack_into("<HI", header, 94, 227, 227)
    struct.pack_into("<BHI", header, 104, 0, 20, count)
    struct.pack_into("<6d", header, 131, 0.001, 0.001, 0.001, 0, 0, 0)
    struct.pack_into("<6d", header, 179, EDGE, 0, EDGE, 0, EDGE, 0)
    points = numpy.zeros(count, [("place", "<i4", 3), ("intensity", "<u2"), ("others", "u1", 6)])
    points["place"] = positions * 1000
    path.write_bytes(bytes(header) + points.tobytes())


def xtc(path, count):
    """As many frames of 50,000 atoms as make up ten times the particles."""
    import MDAnalysis
    import numpy

    universe = MDAnalysis.Universe.empty(50_000, trajectory=True)
    universe.dimensions = [80, 80, 80, 90, 90, 90]
    random = numpy.random.default_rng(1)
    # Molecules of three near atoms, as in water.
    centers = random.random((16_667, 1, 3)) * 80
    with MDAnalysis.Writer(str(path), 50_000) as writer:
        for _ in range(max(10 * count // 50_000, 1)):
            centers += random.normal(size=centers.shape) * 0.1
            atoms = centers + random.normal(size=(16_667, 3, 3)) * 0.5
            universe.atoms.positions = atoms.reshape(-1, 3)[:50_000]
            writer.write(universe.atoms)


# How a file is written, and who else reads it.
FILES = {
    "big.dump": (dump, ["OVITO"]),
    "big.xyz": (xyz, ["OVITO", "chemfiles"]),
    "big.extxyz": (extxyz, ["OVITO"]),
    "big.xtc": (xtc, ["chemfiles", "MDAnalysis"]),
    "big.npy": (npy, ["numpy"]),
    "big.hdf5": (hdf5, ["h5py"]),
    "deflated.hdf5": (deflated_hdf5, ["h5py"]),
    "big.gadget": (gadget, []),
    "big.dcd": (dcd, []),
    "big.las": (las, []),
}


if __name__ == "__main__":
    main()
