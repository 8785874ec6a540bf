#!/usr/bin/env python3
"""Tyndall beside Embree: the same particles and pictures, measured in turn, as Markdown tables with ratios.

Needs beside Rust a C++ compiler and Embree 3: on Debian and Ubuntu `apt-get install g++ libembree-dev`. Nothing else: the
standard library does. Particles are those of `tyndall bench`, written once for `benches/embree/spheres.cpp`.

    benches/beside_embree.py                          # 1e6 particles, three rounds: about two minutes on two cores
    benches/beside_embree.py --n 1e6,1e7 --rounds 3   # a quarter of an hour

In each round both programs run one after the other; a cell is the median over the rounds. Ratios are Embree's time by ours:
above 1 we are faster. Leave the machine alone meanwhile; the load before each set is told on stderr.
"""

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TYNDALL = ROOT / "target/release/tyndall"
CENTERS = ROOT / "target/release/examples/1_centers"
CAMERAS = ["orthographic", "perspective"]
# What Embree's program calls a picture, what the columns of `tyndall bench` that may stand beside it are called, the best
# first, and what the table calls it then.
PICTURES = [
    ("1", [(r"^1 samples? ms", "1 sample")]),
    ("16", [(r"^16 samples? ms", "16 samples")]),
    (
        "16+1",
        [
            (r"(ambient|\bAO\b|\+ ?1).* ms", "16 samples + 1 AO ray"),
            (r"default look.* ms", "16 samples, ours with 2 light rays, Embree with 1"),
        ],
    ),
]
INCOHERENT = r"incoherent|loose rays"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--n", default="1e6", help="particle counts, separated by commas")
    arguments.add_argument("--sets", default="packed,uniform,clustered")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--threads", type=int, default=os.cpu_count())
    chosen = arguments.parse_args()

    ours = ["--bin", "tyndall", "--example", "1_centers"]
    subprocess.run(["cargo", "build", "--release", "--quiet", *ours], cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as folder:
        embree = Path(folder) / "spheres"
        source = ROOT / "benches/embree/spheres.cpp"
        compiler = os.environ.get("CXX", "g++")
        subprocess.run(
            [compiler, "-O3", "-march=native", "-std=c++17", source, "-o", embree, "-lembree3", "-lpthread"], check=True
        )
        pairs = []
        for count in (int(float(word)) for word in chosen.n.split(",")):
            for name in chosen.sets.split(","):
                centers = Path(folder) / "centers.npy"
                radius = output([CENTERS, f"{name}?n={count}&seed=1", centers]).strip()
                print(f"{name} {count}, load {os.getloadavg()[0]:.2f}", file=sys.stderr)
                ours, theirs = [], []
                for _ in range(chosen.rounds):
                    command = [TYNDALL, "bench", "--quiet", "--n", str(count), "--sets", name]
                    ours.append(table_of(output(command + ["--threads", str(chosen.threads)])))
                    theirs.append(lines_of(output([embree, centers, radius, str(chosen.threads)])))
                pairs.append((f"{name} {count:,}", merged(ours), merged(theirs)))
                centers.unlink()
    print(f"{chosen.threads} threads, medians of {chosen.rounds} rounds, {commit()}\n")
    print_table(*pictures(pairs))
    print_table(*builds(pairs))
    print_table(*loose_rays(pairs))


def output(command):
    return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True).stdout


def commit():
    try:
        return "commit " + output(["git", "-C", ROOT, "describe", "--always", "--dirty"]).strip()
    except (OSError, subprocess.CalledProcessError):
        return "no commit"


def table_of(text):
    """Numbers of Markdown tables with a column `camera`, by camera and heading."""
    numbers, headings = {}, []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|") or set(line) <= set("|-: "):
            continue
        if not re.search(r"\d", cells[-1]) or "camera" in cells:
            headings = cells
            continue
        row = dict(zip(headings, cells))
        for heading, cell in row.items():
            number = re.fullmatch(r"[\d,]*\.?\d+(e-?\d+)?", cell)
            if number:
                numbers.setdefault((row.get("camera"), heading), float(cell.replace(",", "")))
    if not numbers:
        sys.exit("error: `tyndall bench` printed no table")
    return numbers


def lines_of(text):
    """Numbers of lines of name, tab, value."""
    return {name: float(value) for name, value in (line.split("\t") for line in text.splitlines())}


def merged(rounds):
    return {key: statistics.median(numbers[key] for numbers in rounds) for key in rounds[0]}


def ours_at(ours, camera, pattern):
    """Our number in the first column that is called so; None if there is none."""
    for (row, heading), number in ours.items():
        if row == camera and re.search(pattern, heading):
            return number
    return None


def pictures(pairs):
    headings = ["set", "camera", "picture", "ours ms", "Embree single ms", "packets ms", "single : ours", "packets : ours"]
    rows = []
    for name, ours, theirs in pairs:
        for camera in CAMERAS:
            for picture, columns in PICTURES:
                found = ((ours_at(ours, camera, pattern), title) for pattern, title in columns)
                time, title = next((it for it in found if it[0] is not None), (None, columns[0][1]))
                single, packets = (1e3 * theirs[f"{camera} {picture} {rays} s"] for rays in ("single", "packets"))
                ratios = [ratio(single, time), ratio(packets, time)]
                rows.append([name, camera, title, told(time, 1), told(single, 1), told(packets, 1), *ratios])
    return headings, rows


def builds(pairs):
    headings = ["set", "build: ours s", "Embree s", "ratio", "ours B/particle", "Embree B/particle"]
    rows = []
    for name, ours, theirs in pairs:
        secs, size = (ours_at(ours, CAMERAS[0], pattern) for pattern in (r"build s", r"B/particle"))
        times = [told(secs, 2), told(theirs["build s"], 2), ratio(theirs["build s"], secs)]
        rows.append([name, *times, told(size, 1), told(theirs["B/particle"], 1)])
    return headings, rows


def loose_rays(pairs):
    headings = ["set", "incoherent single rays: ours Mray/s", "Embree Mray/s", "ours : Embree"]
    rows = []
    for name, ours, theirs in pairs:
        rate, other = ours_at(ours, CAMERAS[0], INCOHERENT), 1e-6 * theirs["incoherent rays/s"]
        rows.append([name, told(rate, 2), told(other, 2), ratio(rate, other)])
    return headings, rows


def told(number, decimals):
    return "–" if number is None else f"{number:.{decimals}f}"


def ratio(above, below):
    return "–" if above is None or not below else f"{above / below:.2f}"


def print_table(headings, rows):
    for cells in [headings, ["---"] * len(headings), *rows]:
        print("| " + " | ".join(cells) + " |")
    print()


if __name__ == "__main__":
    main()
