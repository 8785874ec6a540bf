"""OpenVDB itself reads the grids that `tyndall convert` wrote, and writes grids that Tyndall reads.

usage: grids.py TYNDALL FOLDER (with the Python of Debian's python3-openvdb)
"""

import itertools
import json
import math
import random
import struct
import subprocess
import sys

try:
    import openvdb as vdb
except ImportError:
    import pyopenvdb as vdb

tyndall, folder = sys.argv[1:]
random.seed(224)


def run(*words):
    done = subprocess.run([tyndall, *words], check=True, capture_output=True, text=True)
    return done.stdout + done.stderr


def single(number):
    return struct.unpack("f", struct.pack("f", number))[0]


def voxels(grid):
    """All active voxels and their values; tiles voxel by voxel."""
    found = {}
    for item in grid.citerOnValues():
        for at in itertools.product(*(range(low, high + 1) for low, high in zip(item.min, item.max))):
            found[at] = item.value
    return found


def read(path):
    grids, _ = vdb.readAll(path)
    return {grid.name: grid for grid in grids}


# What we wrote: a block of particles whose velocity and temperature are linear in space, so that means in its middle are known.
spacing, edge = 0.5, 20
with open(f"{folder}/block.xyz", "w") as file:
    file.write(f"{edge**3}\nProperties=pos:R:3:temperature:R:1:velocity:R:3\n")
    for x, y, z in itertools.product(range(edge), repeat=3):
        x, y, z = 3 + spacing * x, spacing * y - 4, spacing * z
        file.write(f"{x} {y} {z} {300 + 10 * z} {2 * x} {-y} 1\n")
for name, options in (("float", []), ("half", ["--half"])):
    path = f"{folder}/{name}.vdb"
    run("convert", f"{folder}/block.xyz", "-o", path, "--field", "density,temperature,velocity", "--voxel", "0.25", *options)
    grids = read(path)
    assert sorted(grids) == ["density", "temperature", "velocity"], grids
    density = grids["density"]
    assert (density.valueTypeName, grids["velocity"].valueTypeName) == ("float", "vec3s")
    for grid in grids.values():
        assert grid.gridClass == vdb.GridClass.FOG_VOLUME and grid.background in (0.0, (0.0, 0.0, 0.0))
        assert grid.saveFloatAsHalf == (name == "half") and grid.creator.startswith("Tyndall "), grid.metadata
        assert grid.transform.voxelSize() == (0.25,) * 3 and grid.transform.isLinear
        assert grid["file_voxel_count"] == grid.activeVoxelCount() == density.activeVoxelCount() > 30000
        low, high = grid.evalActiveVoxelBoundingBox()
        assert (grid["file_bbox_min"], grid["file_bbox_max"]) == (low, high)
        assert grid.activeVoxelCount() == len(voxels(grid))
    mass = sum(voxels(density).values()) * 0.25**3
    assert abs(mass / edge**3 - 1) < 0.1, mass
    worst = [0.0, 0.0]
    temperature, velocity = voxels(grids["temperature"]), voxels(grids["velocity"])
    middle = 0
    for at in voxels(density):
        x, y, z = density.transform.indexToWorld(at)
        if all(abs(it - center) < 2.5 for it, center in zip((x, y, z), (7.75, 0.75, 4.75))):
            middle += 1
            worst[0] = max(worst[0], abs(temperature[at] - (300 + 10 * z)))
            worst[1] = max(worst[1], *(abs(a - b) for a, b in zip(velocity[at], (2 * x, -y, 1))))
    assert middle > 5000 and worst[0] < 2 and worst[1] < 0.4, (middle, worst)
    print(f"OpenVDB reads {name}s: {len(temperature)} voxels, mass {mass:.0f}, means within {worst[0]:.3f} and {worst[1]:.3f}")


# What OpenVDB wrote, packed as it does by itself: our copy of it has the same voxels, tiles and trees.
def noise(kind, background, value):
    grid = kind(background)
    grid.name = kind.__name__
    grid.transform = vdb.createLinearTransform(0.1)
    grid.fill((0, 0, 0), (135, 40, 60), value(), active=True)
    grid.fill((-4096, 0, 0), (-1, 4095, 4095), value(), active=False)
    grid.fill((3, 3, 3), (20, 60, 30), value(), active=False)
    grid.prune(grid.zeroValue)
    accessor = grid.getAccessor()
    for _ in range(1000):
        at = tuple(random.randrange(-20, 100) for _ in range(3))
        (accessor.setValueOn if random.random() < 0.7 else accessor.setValueOff)(at, value())
    return grid


def number():
    return single(random.choice([random.uniform(-5, 5), random.gauss(0, 1e-30), 0.0, 7.5]))


def same(found, wanted):
    """Whether two grids are equal at all nodes, active or not, to the bit."""
    def nodes(grid):
        return {(item.min, item.max, item.active): struct.pack("3f", *(item.value if isinstance(item.value, tuple) else (item.value, 0, 0)))
                for item in grid.citerAllValues()}

    assert found.background == wanted.background and found.valueTypeName == wanted.valueTypeName
    left, right = nodes(found), nodes(wanted)
    assert left == right, f"{len(left)} and {len(right)} nodes, {len(set(left.items()) ^ set(right.items()))} differ"
    assert found.gridClass == wanted.gridClass and found.transform == wanted.transform
    return len(right)


scalars, vectors = noise(vdb.FloatGrid, 0.25, number), noise(vdb.Vec3SGrid, (0.0, 1.0, -0.5), lambda: (number(), number(), number()))
ball = vdb.createLevelSetSphere(radius=2.0, center=(5.0, 1.0, -1.0), voxelSize=0.1)
ball.name = "ball"
vdb.write(f"{folder}/theirs.vdb", grids=[scalars, vectors, ball])
print(run("info", f"{folder}/theirs.vdb"), end="")
run("convert", f"{folder}/theirs.vdb", "-o", f"{folder}/ours.vdb")
ours, theirs = read(f"{folder}/ours.vdb"), read(f"{folder}/theirs.vdb")
for name, grid in theirs.items():
    print(f"{name}: {same(ours[name], grid)} nodes are the same")

try:
    changed = ours["ball"].deepCopy()
    changed.getAccessor().setValueOn((50, 10, -10), single(0.123))
    same(changed, theirs["ball"])
except AssertionError:
    pass
else:
    raise SystemExit("the comparison does not see a voxel")

# Half of it as half floats, with instances: two names for one tree.
for grid in theirs.values():
    grid.saveFloatAsHalf = True
copy = theirs["ball"].copy()
copy.name = "again"
vdb.write(f"{folder}/half_theirs.vdb", grids=[theirs["ball"], copy])
run("convert", f"{folder}/half_theirs.vdb", "-o", f"{folder}/half_ours.vdb", "--half")
ours, theirs = read(f"{folder}/half_ours.vdb"), read(f"{folder}/half_theirs.vdb")
assert sorted(ours) == ["again", "ball"]
for name, grid in theirs.items():
    print(f"{name}: {same(ours[name], grid)} nodes are the same, as halves")

# A level set is rendered as fog, from where it lies.
run("render", f"{folder}/theirs.vdb", "-o", f"{folder}/ball.png", "--dataset", "ball", "--size", "64x48")
about = json.loads(run("info", f"{folder}/theirs.vdb", "--json"))
found = next(grid for grid in about["grids"] if grid["name"] == "ball")
for axis, center in enumerate((5.0, 1.0, -1.0)):
    for side, sign in (("min", -1), ("max", 1)):
        apart = found["bounds"][side][axis] - (center + 2.0 * sign)
        assert math.fabs(apart) < 0.4, (axis, side, apart)
