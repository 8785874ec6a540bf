"""Writes the HDF5 files of this folder with h5py, which is the C library: python make.py (needs h5py, hdf5plugin and numpy)."""
import os

import h5py
import hdf5plugin
import numpy as np

os.chdir(os.path.dirname(os.path.abspath(__file__)))
ascii_text = np.bytes_


def chain(group, name, data, rows):
    """A data set with SWIFT's chain of filters: fletcher32, then shuffle, then deflate."""
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_chunk((rows,) + data.shape[1:])
    plist.set_fletcher32()
    plist.set_shuffle()
    plist.set_deflate(4)
    space = h5py.h5s.create_simple(data.shape)
    created = h5py.h5d.create(group.id, name.encode(), h5py.h5t.py_create(data.dtype), space, plist)
    dataset = h5py.Dataset(created)
    dataset[...] = data
    return dataset


def swift(name, libver):
    """Five gas and three star particles in a comoving universe, coordinates k, k + 0.25, k + 0.5."""
    with h5py.File(name, "w", libver=libver) as file:
        header = file.create_group("Header").attrs
        header["BoxSize"] = np.array([8.0, 8.0, 8.0])
        header["NumPart_ThisFile"] = np.array([5, 0, 0, 0, 3, 0, 0], dtype="u8")
        header["NumPart_Total"] = np.array([5, 0, 0, 0, 3, 0, 0], dtype="u4")
        header["NumPart_Total_HighWord"] = np.zeros(7, dtype="u4")
        header["NumFilesPerSnapshot"] = np.array([1], dtype="i4")
        header["MassTable"] = np.zeros(7)
        header["Time"] = np.array([0.75])
        header["Redshift"] = np.array([1.0])
        header["Scale-factor"] = np.array([0.5])
        header["Code"] = ascii_text("SWIFT")
        file.create_group("Units").attrs["Unit length in cgs (U_L)"] = np.array([3.08567758e24])
        file.create_group("Cosmology").attrs["h"] = np.array([0.7])
        if libver == "latest":
            scheme = file.create_group("HydroScheme").attrs
            scheme["Kernel function"] = ascii_text("Wendland C2")
            scheme["Dimension"] = np.array([3], dtype="i4")
        for number, count, first in [(0, 5, 0), (4, 3, 5)]:
            group = file.create_group(f"PartType{number}")
            k = np.arange(first, first + count, dtype="f8")
            positions = chain(group, "Coordinates", np.stack([k, k + 0.25, k + 0.5], axis=1), 2)
            positions.attrs["a-scale exponent"] = np.array([1.0])
            positions.attrs["h-scale exponent"] = np.array([0.0])
            positions.attrs["Conversion factor to CGS (not including cosmological corrections)"] = [3.08567758e24]
            positions.attrs["U_L exponent"] = [1.0]
            positions.attrs["U_M exponent"] = [0.0]
            positions.attrs["U_t exponent"] = [0.0]
            chain(group, "Masses", (k + 1).astype("f4"), 2)
            chain(group, "ParticleIDs", (k + 100).astype("u8"), 3)
            chain(group, "Velocities", np.stack([-k, k, 0 * k], axis=1).astype("f4"), 3)
            if number == 0:
                group.create_dataset("SmoothingLengths", data=(0.1 * k).astype("f4"), chunks=(3,), compression="lzf")
                group.create_dataset("Flags", data=np.array([True, False, True, False, True]))
        file["GasParticles"] = h5py.SoftLink("/PartType0")


def gadget(number):
    """One of the two files of a Gadget snapshot: a gas and two halo particles, halo masses in the table."""
    with h5py.File(f"snap_007.{number}.hdf5", "w") as file:
        header = file.create_group("Header").attrs
        header["BoxSize"] = 10.0
        header["HubbleParam"] = 0.7
        header["MassTable"] = np.array([0, 0.5, 0, 0, 0, 0.0])
        header["NumFilesPerSnapshot"] = np.int32(2)
        header["NumPart_ThisFile"] = np.array([1, 2, 0, 0, 0, 0], dtype="i4")
        header["NumPart_Total"] = np.array([2, 4, 0, 0, 0, 0], dtype="u4")
        header["NumPart_Total_HighWord"] = np.zeros(6, dtype="u4")
        header["Redshift"] = 3.0
        header["Time"] = 0.25
        gas, halo = file.create_group("PartType0"), file.create_group("PartType1")
        gas["Coordinates"] = np.array([[1, 2, 3]], dtype="f4") + number
        gas["Masses"] = np.array([2.0 + number], dtype="f4")
        gas["ParticleIDs"] = np.array([10 * number], dtype="u4")
        gas["InternalEnergy"] = np.array([7.0], dtype="f4")
        halo["Coordinates"] = np.array([[4, 5, 6], [7, 8, 9]], dtype=">f4") + number
        halo["ParticleIDs"] = np.array([10 * number + 1, 10 * number + 2], dtype="u4")


def virtual():
    """SWIFT's way: two parts, and a file that only points to them."""
    for number in [0, 1]:
        with h5py.File(f"virtual.{number}.hdf5", "w") as file:
            swift_header(file.create_group("Header").attrs, [2, 0], [4, 0], 2)
            gas = file.create_group("PartType0")
            gas["Coordinates"] = np.arange(6, dtype="f8").reshape(2, 3) + 10 * number
    with h5py.File("virtual.hdf5", "w", libver="latest") as file:
        header = file.create_group("Header").attrs
        # It counts itself as the only file, as SWIFT does.
        swift_header(header, [4, 0], [4, 0], 1)
        header["Virtual"] = np.array([1], dtype="i4")
        layout = h5py.VirtualLayout(shape=(4, 3), dtype="f8")
        for number in [0, 1]:
            source = h5py.VirtualSource(f"virtual.{number}.hdf5", "PartType0/Coordinates", shape=(2, 3))
            layout[2 * number : 2 * number + 2] = source
        file.create_group("PartType0").create_virtual_dataset("Coordinates", layout)


def swift_header(header, here, total, files):
    header["BoxSize"] = np.array([50.0, 50.0, 50.0])
    header["NumPart_ThisFile"] = np.array(here, dtype="u8")
    header["NumPart_Total"] = np.array(total, dtype="u4")
    header["NumPart_Total_HighWord"] = np.zeros(2, dtype="u4")
    header["NumFilesPerSnapshot"] = np.array([files], dtype="i4")
    header["Code"] = ascii_text("SWIFT")


def filters():
    """Zstandard, which is read, and Blosc, which is not."""
    positions = np.arange(3000, dtype="f4").reshape(1000, 3)
    with h5py.File("zstd.h5", "w") as file:
        file.create_dataset("Coordinates", data=positions, **hdf5plugin.Zstd())
    with h5py.File("blosc.h5", "w") as file:
        file.create_dataset("Coordinates", data=positions, **hdf5plugin.Blosc())


def left_out():
    """Quantities that cannot be read, which are no reason to refuse the positions."""
    with h5py.File("left_out.h5", "w") as file:
        file["Coordinates"] = np.arange(12, dtype="f4").reshape(4, 3)
        file.create_dataset("packed", data=np.zeros((4, 512)), chunks=(4, 512), **hdf5plugin.Blosc())
        file["nothing"] = np.zeros((4, 0))
        file.create_dataset("spectrum", (4, 5000), dtype="f4")
        file["mass"] = np.arange(4.0)


def linked():
    """Positions in another file, more than this one could hold in any packing."""
    with h5py.File("linked_to.h5", "w") as file:
        file.create_dataset("points", data=np.zeros((100_000, 3)), chunks=(20_000, 3), compression="gzip")
    with h5py.File("linked.h5", "w", libver="latest") as file:
        file["Coordinates"] = h5py.ExternalLink("linked_to.h5", "/points")


def circle():
    """A group that has itself as a member under twelve names, and the positions."""
    with h5py.File("circle.h5", "w") as file:
        group = file.create_group("a")
        for number in range(12):
            group[f"b{number}"] = group
        group["points"] = np.arange(6.0).reshape(2, 3)


def h5md():
    """Two particles in three frames, velocities in every second, species fixed and named, a growing box."""
    with h5py.File("fixed_and_varying.h5md", "w") as file:
        file.create_group("h5md").attrs["version"] = np.array([1, 1])
        atoms = file.create_group("particles/atoms")
        step = np.array([0, 10, 20])
        position = atoms.create_group("position")
        position["value"] = np.arange(18, dtype="f4").reshape(3, 2, 3)
        position["value"].attrs["unit"] = "nm"
        position["step"] = step
        position["time"] = 0.5 * step
        velocity = atoms.create_group("velocity")
        velocity["value"] = 100.0 + np.arange(12).reshape(2, 2, 3)
        velocity["step"] = 20
        kinds = h5py.enum_dtype({"H": 1, "O": 8}, basetype="i4")
        atoms.create_dataset("species", data=np.array([8, 1]), dtype=kinds)
        atoms["mass"] = np.array([16.0, 1.0])
        box = atoms.create_group("box")
        box.attrs["dimension"] = 3
        box.attrs["boundary"] = np.array([b"periodic", b"none", b"periodic"])
        edges = box.create_group("edges")
        edges["value"] = np.array([[4.0, 5, 6], [5, 6, 7], [6, 7, 8]])
        edges["step"] = step
        ions = file.create_group("particles/ions/position")
        ions["value"] = np.zeros((1, 1, 3), dtype="f4")
        ions["step"] = 1


def bonds():
    """Four atoms with ids in two frames and three beads without; lists of pairs of all kinds."""
    with h5py.File("bonds.h5md", "w") as file:
        file.create_group("h5md").attrs["version"] = np.array([1, 1])
        for name, count in [("atoms", 4), ("beads", 3), ("grains", 3)]:
            position = file.create_group(f"particles/{name}/position")
            position["value"] = np.arange(6 * count, dtype="f4").reshape(2, count, 3)
            position["step"] = np.array([0, 10])
        atoms, beads, grains = (file[f"particles/{name}"] for name in ["atoms", "beads", "grains"])
        atoms["id"] = np.array([30, 10, 20, 40])
        lists = file.create_group("connectivity")
        lists["bonds"] = np.array([[10, 20], [30, 40], [40, 30], [20, 99]])
        lists["bonds"].attrs["particles_group"] = atoms.ref
        lists["constraints"] = np.array([[10, 40]])
        lists["constraints"].attrs["particles_group"] = atoms.ref
        lists["angles"] = np.array([[10, 20, 30]])
        lists["angles"].attrs["particles_group"] = atoms.ref
        varying = lists.create_group("links")
        varying.create_dataset("value", data=np.array([[[0, 1], [7, 7]], [[0, 2], [2, 1]]], dtype="i4"), fillvalue=7)
        varying["step"] = np.array([0, 10])
        varying.attrs["particles_group"] = "/particles/beads"
        own = grains.create_group("connectivity")
        own["value"] = np.array([[[0, 2, 1.5], [np.nan] * 3], [[1, 0, 1], [1, 2, 2]]])
        own["step"] = np.array([0, 10])
        nested = lists.create_group("grains/more")
        nested["value"] = np.array([[[0, 1]], [[-1, -1]]])
        nested["step"] = np.array([0, 10])


def openpmd():
    """Two iterations; electrons with an offset and a constant component, one ion."""
    with h5py.File("series.h5", "w") as file:
        file.attrs["openPMD"] = ascii_text("1.1.0")
        file.attrs["basePath"] = ascii_text("/data/%T/")
        file.attrs["particlesPath"] = ascii_text("particles/")
        for iteration in [5, 100]:
            base = file.create_group(f"data/{iteration}")
            base.attrs["time"] = float(iteration)
            base.attrs["timeUnitSI"] = 1e-3
            electrons = base.create_group("particles/electrons")
            position = electrons.create_group("position")
            offset = electrons.create_group("positionOffset")
            length = np.array([1.0, 0, 0, 0, 0, 0, 0])
            position.attrs["unitDimension"] = length
            for axis in "xy":
                position[axis] = np.array([1.0, 2.0, 3.0], dtype="f4") + (axis == "y")
                position[axis].attrs["unitSI"] = 0.5
            constants = [(position, "z", 4.0, 0.25)] + [(offset, axis, 1.0, 10.0) for axis in "xyz"]
            for record, axis, value, unit in constants:
                component = record.create_group(axis)
                component.attrs["value"] = value
                component.attrs["shape"] = np.array([3], dtype="u8")
                component.attrs["unitSI"] = unit
            momentum = electrons.create_group("momentum")
            momentum.attrs["unitDimension"] = np.array([1.0, 1, -1, 0, 0, 0, 0])
            for axis in "xyz":
                momentum[axis] = np.array([1.0, 2.0, 3.0])
                momentum[axis].attrs["unitSI"] = 2.0
            electrons["id"] = np.array([7, 8, 9], dtype="u8")
            ions = base.create_group("particles/ions/position")
            for axis in "xyz":
                ions[axis] = np.array([0.5])


def plain():
    with h5py.File("candidates.h5", "w") as file:
        file["run/a"] = np.arange(12, dtype="f4").reshape(4, 3)
        file["run/b"] = -np.arange(12, dtype="f8").reshape(4, 3)
        file["run/heat"] = np.arange(4, dtype="f2")
        file["run/heat"].attrs["unit"] = "K"
        file["run/note"] = np.arange(5)
    with h5py.File("steps.h5part", "w") as file:
        for step in [0, 2, 10]:
            group = file.create_group(f"Step#{step}")
            group.attrs["TimeValue"] = np.array([0.5 * step])
            for axis in "xyz":
                group[axis] = np.array([step, step + 1.0]) + (axis == "z")
            group["id"] = np.array([1, 2])
    with h5py.File("empty.h5", "w") as file:
        file["Coordinates"] = np.zeros((0, 3), dtype="f4")


def forms():
    """Numbers of few bits behind the N-bit filter, as SWIFT writes them, behind a user block."""
    values = np.array([[0.0, 1.5, -2.25], [100.5, 3e-5, 1e6], [-0.75, 1.0, 7.0], [2.0, 3.0, 4.0]], dtype="f4")
    with h5py.File("forms.h5", "w", userblock_size=8192) as file:
        file["Coordinates"] = np.arange(12, dtype="f4").reshape(4, 3)
        for name, base, exponent, mantissa in [
            ("FMantissa9", h5py.h5t.IEEE_F32LE, 8, 9),
            ("BFloat16", h5py.h5t.IEEE_F32LE, 8, 7),
            ("DMantissa9", h5py.h5t.IEEE_F64LE, 11, 9),
        ]:
            kind = base.copy()
            kind.set_fields(exponent + mantissa, mantissa, exponent, 0, mantissa)
            kind.set_precision(1 + exponent + mantissa)
            kind.set_ebias(2 ** (exponent - 1) - 1)
            kind.set_size(4)
            settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            settings.set_chunk((2, 3))
            settings.set_filter(h5py.h5z.FILTER_NBIT, 0, ())
            space = h5py.h5s.create_simple(values.shape)
            data = h5py.h5d.create(file.id, name.encode(), kind, space, settings)
            data.write(h5py.h5s.ALL, h5py.h5s.ALL, values)


def vtkhdf():
    """Two steps of three and two points."""
    with h5py.File("steps.vtkhdf", "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0])
        root.attrs.create("Type", np.bytes_("PolyData"))
        root["NumberOfPoints"] = np.array([3, 2])
        root["Points"] = np.arange(15, dtype="f4").reshape(5, 3)
        root["PointData/mass"] = np.arange(5.0)
        # The same for both steps.
        root["PointData/kind"] = np.array([7, 8, 9])
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = 2
        steps["Values"] = np.array([0.5, 1.5])
        steps["PartOffsets"] = np.array([0, 1])
        steps["NumberOfParts"] = np.array([1, 1])
        steps["PointOffsets"] = np.array([0, 3])
        steps["PointDataOffsets/mass"] = np.array([0, 3])
        steps["PointDataOffsets/kind"] = np.array([0, 0])


def frames():
    """MDTraj's way, which is that of AMBER's NetCDF-4 too."""
    with h5py.File("frames.h5", "w") as file:
        file["coordinates"] = np.arange(24, dtype="f4").reshape(2, 4, 3)
        file["coordinates"].attrs["units"] = ascii_text("nanometers")
        file["velocities"] = -np.arange(24, dtype="f4").reshape(2, 4, 3)
        file["time"] = np.array([0.0, 2.5])
        file["time"].attrs["units"] = ascii_text("picoseconds")
        file["cell_lengths"] = np.array([[2.0, 3.0, 4.0], [2.5, 3.5, 4.5]])
        file["cell_angles"] = np.full((2, 3), 90.0)
        file["mass"] = np.arange(4.0)


def scaled():
    """AMBER's NetCDF-4, in which values are multiplied by scale_factor."""
    with h5py.File("scaled.nc", "w") as file:
        file.attrs["Conventions"] = ascii_text("AMBER")
        def variable(name, values, factor, unit):
            file[name] = values
            file[name].attrs["units"] = ascii_text(unit)
            if factor is not None:
                file[name].attrs["scale_factor"] = factor
        variable("coordinates", 100 + np.arange(24, dtype="f4").reshape(2, 4, 3), 0.5, "angstrom")
        variable("velocities", np.arange(24, dtype="f4").reshape(2, 4, 3), np.float32(20.455), "angstrom/picosecond")
        variable("time", np.array([1.0, 3.0]), np.array([2.0]), "picosecond")
        variable("cell_lengths", np.array([[20.0, 30.0, 40.0]] * 2), 0.1, "angstrom")
        variable("cell_angles", np.full((2, 3), 90.0), None, "degree")
        variable("charge", np.array([-4, -3, 2, 8], dtype="i2"), 0.25, "e")
        file["charge"].attrs["add_offset"] = 1.0


def tables():
    """Rows that are records, with coordinates as members, and as one member."""
    axes = np.zeros(5, [("z", ">f8"), ("id", "i8"), ("word", "S4"), ("x", "f4"), ("spin", "f4", (3,)), ("y", "i2"), ("up", "?")])
    axes["x"], axes["y"], axes["z"], axes["id"] = np.arange(5), 10 + np.arange(5), 0.25 * np.arange(5), 2**40 + np.arange(5)
    axes["spin"] = np.arange(15).reshape(5, 3)
    axes["up"] = [True, False, True, True, False]
    with h5py.File("table.h5", "w") as file:
        file.create_dataset("group/particles", data=axes, chunks=(2,), compression="gzip")
        file["group/beside"] = np.arange(5)
        # An index of PyTables.
        file["group/_i_particles/id/bounds"] = np.zeros((0, 3))
        file["group/_i_particles/id/pos"] = np.zeros((2, 3))
    rows = np.zeros(3, [("mass", "f8"), ("Position", ">f4", (3,))])
    rows["Position"] = np.arange(9).reshape(3, 3)
    rows["mass"] = [1, 2, 3]
    with h5py.File("table_of_rows.h5", "w") as file:
        file["particles"] = rows


def large():
    """Chunks of more than 2^20 bytes, with the filters in every order that is common and the ways to find chunks that HDF5 has."""
    count, rows = 150_000, 1 << 17
    k = np.arange(count)
    packed = dict(compression="gzip", compression_opts=9)
    for version in ["earliest", "latest"]:
        with h5py.File(f"large_{version}.h5", "w", libver=version) as file:
            position = np.stack([k // 2500, k // 3000 * 0.5, k // 1000], axis=1)
            file.create_dataset("position", data=position, chunks=(rows, 3), shuffle=True, **packed)
            # Two dimensions without an end have a tree of the second version, one an array that grows.
            file.create_dataset("last", data=(k // 640).astype(">f8"), chunks=(rows,), maxshape=(None,), fletcher32=True, **packed)
            file.create_dataset("both", data=np.stack([k // 700, k // 500], axis=1), chunks=(rows, 2), maxshape=(None, None),
                                fletcher32=True, shuffle=True, **packed)
            file.create_dataset("lzf", data=k // 4096 + 0.25, chunks=(rows,), compression="lzf", shuffle=True)
            file.create_dataset("single", data=k // 3000 - 1, chunks=(count,), **packed)
            plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            plist.set_chunk((rows, 2))
            plist.set_fletcher32()
            plist.set_shuffle()
            plist.set_deflate(9)
            # What is behind the end of the last chunk is not 0: it is in the sum, too.
            plist.set_fill_value(np.array(7, "f4"))
            space = h5py.h5s.create_simple((count, 2))
            data = h5py.h5d.create(file.id, b"first", h5py.h5t.IEEE_F32LE, space, plist)
            data.write(h5py.h5s.ALL, h5py.h5s.ALL, np.stack([k // 3200, k // 900], axis=1).astype("f4"))


swift("swift.hdf5", None)
swift("swift_latest.hdf5", "latest")
for number in [0, 1]:
    gadget(number)
virtual()
filters()
left_out()
linked()
circle()
h5md()
bonds()
openpmd()
plain()
forms()
vtkhdf()
frames()
scaled()
tables()
large()
