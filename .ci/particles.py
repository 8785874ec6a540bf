"""Reads what `tyndall convert` wrote with independent libraries: the same particles in every format.

usage: particles.py TYNDALL FOLDER TYNDALL_WITH_THE_FEATURE_PARQUET
"""

import struct
import subprocess
import sys
import warnings
import zlib

import numpy as np

tyndall, folder, with_tables = sys.argv[1:]
SOURCE = "examples/pour.dump.gz"


def convert(name, *options, tyndall=tyndall):
    path = f"{folder}/{name}"
    subprocess.run([tyndall, "convert", SOURCE, "-o", path, "-q", *options], check=True)
    return path


def same(what, found, wanted, tolerance=1e-6):
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    assert found.shape == wanted.shape, f"{what}: {found.shape}, not {wanted.shape}"
    worst = np.abs(found - wanted).max() / np.abs(wanted).max()
    assert worst <= tolerance, f"{what} differs by {worst}"
    print(f"{what}: {len(wanted)} rows are the same")


archive = np.load(convert("a.npz"))
position, radius = archive["pos"], archive["radius"]
assert position.shape == (len(radius), 3) and len(radius) > 1000, position.shape

array = np.load(convert("a.npy"))
same("NPY", array["pos"], position)
same("NPY radius", array["radius"], radius)

table = np.genfromtxt(convert("a.csv"), delimiter=",", names=True)
names = list(table.dtype.names)
same("CSV", np.stack([table[name] for name in names[:3]], axis=1), position)
same("CSV radius", table["radius"], radius)

from plyfile import PlyData

vertex = PlyData.read(convert("a.ply"))["vertex"]
same("PLY", np.stack([vertex[axis] for axis in "xyz"], axis=1), position)
same("PLY radius", vertex["radius"], radius)

import pyarrow.feather
import pyarrow.parquet

for table in (
    pyarrow.parquet.read_table(convert("a.parquet", tyndall=with_tables)),
    pyarrow.feather.read_table(convert("a.arrow", tyndall=with_tables)),
):
    same("Parquet or Arrow", np.stack([table[axis].to_numpy() for axis in "xyz"], axis=1), position)
    same("Parquet or Arrow: radius", table["radius"].to_numpy(), radius)
    same("Parquet or Arrow: id", table["id"].to_numpy(), archive["id"])
    assert b"tyndall" in table.schema.metadata, table.schema.metadata
    # And back: what pyarrow writes of it is the same particles.
    pyarrow.parquet.write_table(table, f"{folder}/b.parquet", compression="zstd")
    subprocess.run([with_tables, "convert", f"{folder}/b.parquet", "-o", f"{folder}/b.npz", "-q"], check=True)
    same("Parquet of pyarrow", np.load(f"{folder}/b.npz")["pos"], position)

import ase.io

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    atoms = ase.io.read(convert("a.xyz"), format="extxyz")
    dumped = ase.io.read(convert("a.dump"), format="lammps-dump-text")
same("extended XYZ", atoms.positions, position)
same("extended XYZ radius", atoms.arrays["radius"], radius)
same("LAMMPS dump", dumped.positions[np.argsort(np.argsort(archive["id"]))], position)

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

reader = vtkXMLPolyDataReader()
reader.SetFileName(convert("a.vtp"))
reader.Update()
data = reader.GetOutput()
same("VTP", vtk_to_numpy(data.GetPoints().GetData()), position)
same("VTP radius", vtk_to_numpy(data.GetPointData().GetArray("radius")), radius)
assert data.GetNumberOfVerts() == 1, data.GetNumberOfVerts()

from pxr import Usd, UsdGeom

stage = Usd.Stage.Open(convert("a.usda"))
points = UsdGeom.Points(stage.GetDefaultPrim())
same("USD", points.GetPointsAttr().Get(), position)
same("USD widths", points.GetWidthsAttr().Get(), 2 * radius)

import trimesh

(cloud,) = trimesh.load(convert("a.glb")).geometry.values()
same("GLB", cloud.vertices, position)

# No library of these is at hand: decoded by their descriptions.
with open(convert("a.prt", "--fields", "radius"), "rb") as file:
    head = file.read(56)
    assert head[:8] == b"\xc0PRT\r\n\x1a\n", head[:8]
    (count,) = struct.unpack_from("<q", head, 48)
    _, channels, size = struct.unpack("<III", file.read(12))
    assert (count, channels, size) == (len(radius), 2, 44), (count, channels, size)
    file.seek(channels * size, 1)
    rows = np.frombuffer(zlib.decompress(file.read()), dtype="<f4").reshape(count, 4)
same("PRT", rows[:, :3], position)
same("PRT radius", rows[:, 3], radius)

with open(convert("a.mmpld", "--fields", "radius"), "rb") as file:
    content = file.read()
version, frames = struct.unpack_from("<HI", content, 6)
begin, end = struct.unpack_from("<QQ", content, 60)
_, lists, vertex_type, color_type = struct.unpack_from("<fIBB", content, begin)
assert (version, frames, lists, vertex_type, color_type, end) == (102, 1, 1, 2, 0, len(content))
(count,) = struct.unpack_from("<Q", content, begin + 14)
rows = np.frombuffer(content, dtype="<f4", offset=begin + 22, count=4 * count).reshape(count, 4)
same("MMPLD", rows[:, :3], position)
same("MMPLD radius", rows[:, 3], radius)
