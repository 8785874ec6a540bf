use std::path::Path;

use tyndall::Vec3;
use tyndall::medium::grid::Brick;

use super::*;
use crate::read::{described_density, map};

/// Numbers that follow from a seed (xorshift64*).
struct Random(u64);

impl Random {
    fn below(&mut self, most: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) % most
    }

    /// Some numbers, odd ones among them.
    fn value(&mut self, components: usize) -> Value {
        const SOME: [f32; 8] = [0.0, -0.0, 1.5, -1.5, f32::NAN, f32::INFINITY, 1e-42, 3.25e7];
        std::array::from_fn(|k| match self.below(4) {
            _ if k >= components => 0.0,
            0 => SOME[self.below(8) as usize],
            _ => self.below(1 << 20) as f32 / 1e5 - 4.0,
        })
    }

    /// A tree of leaves and tiles of all sizes, some of them inactive and with values of their own, on both sides of zero.
    fn tree(&mut self, components: usize) -> Tree {
        let background = if self.below(2) == 0 { Value::default() } else { self.value(components) };
        let mut tree = Tree { components, background, leaves: Vec::new(), tiles: Vec::new() };
        let mut taken = Vec::new();
        let is_free = |taken: &[([i32; 3], i32)], at: [i32; 3], edge: i32| {
            !taken.iter().any(|&(other, other_edge)| {
                (0..3).all(|axis| at[axis] < other[axis] + other_edge && other[axis] < at[axis] + edge)
            })
        };
        for _ in 0..3 + self.below(12) {
            let edge = [8, 8, 8, 128, 4096][self.below(5) as usize];
            let far = if edge == 4096 { 3 } else { 300 };
            let origin = std::array::from_fn(|_| (self.below(2 * far) as i32 - far as i32) * edge);
            if !is_free(&taken, origin, edge) {
                continue;
            }
            taken.push((origin, edge));
            if edge > 8 || self.below(3) == 0 {
                let is_active = self.below(2) == 0;
                let value = self.value(components);
                if is_active || value.map(f32::to_bits) != background.map(f32::to_bits) {
                    tree.tiles.push(Tile { origin, edge, value, is_active });
                }
                continue;
            }
            let kinds = self.below(5);
            let negative = std::array::from_fn(|k| if k < components { -background[k] } else { 0.0 });
            let others = [background, negative, self.value(components), self.value(components)];
            let active: [u64; 8] = std::array::from_fn(|_| match self.below(3) {
                0 => u64::MAX,
                1 => 0,
                _ => self.below(1 << 31) << 20,
            });
            let mut values = Vec::new();
            for place in 0..LEAF_VOXELS {
                let value = match active[place / 64] >> (place % 64) & 1 {
                    0 if kinds < 4 => others[self.below(kinds + 1) as usize],
                    _ => self.value(components),
                };
                values.extend(&value[..components]);
            }
            tree.leaves.push(Leaf { origin, active, values });
        }
        tree
    }
}

fn grid(name: &str, class: Class, tree: Tree) -> Grid {
    let transform = Transform { scale: [0.25; 3], translation: [1.0, -2.0, 3.5] };
    Grid { name: name.into(), class, transform, tree }
}

/// A tree in an order of its own, as bits.
#[derive(Debug, PartialEq)]
struct Bits {
    background: [u32; 3],
    leaves: Vec<([i32; 3], [u64; 8], Vec<u32>)>,
    tiles: Vec<([i32; 3], i32, [u32; 3], bool)>,
}

fn bits(tree: &Tree) -> Bits {
    let of_leaf = |it: &Leaf| (it.origin, it.active, it.values.iter().map(|it| it.to_bits()).collect());
    let of_tile = |it: &Tile| (it.origin, it.edge, it.value.map(f32::to_bits), it.is_active);
    let mut leaves: Vec<_> = tree.leaves.iter().map(of_leaf).collect();
    let mut tiles: Vec<_> = tree.tiles.iter().map(of_tile).collect();
    leaves.sort_by_key(|it| it.0);
    tiles.sort_by_key(|it| it.0);
    Bits { background: tree.background.map(f32::to_bits), leaves, tiles }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn random_trees_come_back_to_the_bit() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    for seed in 1..25 {
        let mut random = Random(seed);
        let trees = [random.tree(1), random.tree(3), random.tree(1)];
        let grids: Vec<Grid> = ["density", "velocity", "T"]
            .into_iter()
            .zip(&trees)
            .map(|(name, tree)| grid(name, Class::FogVolume, tree.clone()))
            .collect();
        write(&path, &grids, Precision::Full, &()).unwrap();
        let (read, notes) = super::read(&path, None, &()).unwrap();
        assert_eq!((read.len(), notes.len()), (3, 0));
        for (found, wanted) in read.iter().zip(&grids) {
            assert_eq!(bits(&found.tree), bits(&wanted.tree), "seed {seed} {}", wanted.name);
            assert_eq!(
                (&found.name, found.class, found.transform),
                (&wanted.name, wanted.class, wanted.transform)
            );
        }
    }
}

#[test]
fn the_comparison_of_trees_sees_one_bit() {
    let tree = Random(5).tree(1);
    let mut other = tree.clone();
    other.background[0] = -other.background[0];
    assert_ne!(bits(&tree), bits(&other));
    let mut leaves = Random(3).tree(1);
    let before = bits(&leaves);
    let leaf = &mut leaves.leaves[0];
    leaf.values[77] = f32::from_bits(leaf.values[77].to_bits() ^ 1);
    assert_ne!(bits(&leaves), before);
}

#[test]
fn halves_come_back_rounded() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    let mut random = Random(7);
    let mut values: Vec<f32> = (0..LEAF_VOXELS).map(|_| random.below(1 << 20) as f32 / 1000.0).collect();
    let leaf = Leaf { origin: [-8, 0, 8], active: [u64::MAX; 8], values: values.clone() };
    let tree = Tree { components: 1, background: [0.1, 0.0, 0.0], leaves: vec![leaf], tiles: Vec::new() };
    write(&path, &[grid("a", Class::Unknown, tree.clone())], Precision::Half, &()).unwrap();
    let (read, _) = super::read(&path, None, &()).unwrap();
    let round = |it: f32| half::f16::from_f32(it).to_f32();
    values.iter_mut().for_each(|it| *it = round(*it));
    assert_eq!((&read[0].tree.leaves[0].values, read[0].tree.background[0]), (&values, round(0.1)));
    let about = grids(&path, &()).unwrap().1;
    assert!(about[0].is_half && about[0].voxel_box == Some([[-8, 0, 8], [-1, 7, 15]]));
    let mut large = tree;
    large.leaves[0].values[5] = 65520.0;
    let error = write(&path, &[grid("a", Class::Unknown, large)], Precision::Half, &()).unwrap_err();
    assert!(error.to_string().contains("65520"), "{error}");
}

/// What the definition says of a voxel, tried one by one.
fn value(tree: &Tree, voxel: [i32; 3]) -> f32 {
    let inside =
        |origin: [i32; 3], edge: i32| (0..3).all(|axis| (0..edge).contains(&(voxel[axis] - origin[axis])));
    if let Some(leaf) = tree.leaves.iter().find(|it| inside(it.origin, LEAF)) {
        return leaf.values[place_in_leaf([0, 1, 2].map(|axis| (voxel[axis] - leaf.origin[axis]) as usize))];
    }
    tree.tiles.iter().find(|it| inside(it.origin, it.edge)).map_or(tree.background[0], |it| it.value[0])
}

#[test]
fn a_density_has_the_values_of_voxels_at_their_middles() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    for seed in 1..14 {
        let mut random = Random(seed);
        let mut tree = Tree { components: 1, background: [0.0; 3], leaves: Vec::new(), tiles: Vec::new() };
        if seed % 4 == 0 {
            tree.background = [0.75, 0.0, 0.0];
        }
        for number in 0..1 + random.below(12) as i32 {
            let values = (0..LEAF_VOXELS).map(|_| random.below(100) as f32 / 7.0).collect();
            let active = std::array::from_fn(|_| random.below(1 << 31) << (31 * random.below(2)) | 1);
            let origin = [8 * (number % 3 - 1), 8 * (number / 3 % 3), 8 * (number / 9 - 2)];
            tree.leaves.push(Leaf { origin, active, values });
        }
        tree.tiles.push(Tile { origin: [24, 0, 8], edge: 8, value: [2.5, 0.0, 0.0], is_active: true });
        if seed % 3 == 0 {
            tree.tiles.push(Tile {
                origin: [-128, 0, 0],
                edge: 128,
                value: [0.5, 0.0, 0.0],
                is_active: true,
            });
            tree.leaves.retain(|it| it.origin[0] >= 0 || it.origin[2] < 0);
        }
        let grids = [
            grid("other", Class::FogVolume, Random(seed).tree(1)),
            grid("Density", Class::FogVolume, tree.clone()),
        ];
        write(&path, &grids, Precision::Full, &()).unwrap();
        let Described { grid, conventions, .. } = described_density(&path, &[], 1.0, &()).unwrap();
        assert_eq!(conventions[0], "density: grid 'Density' of other (float), Density (float)");
        assert_eq!(conventions.len(), 1 + usize::from(seed % 4 == 0), "seed {seed}");
        let size = grid.size();
        let mut seen = 0;
        let first = (grid.origin() - Vec3::new(1.0, -2.0, 3.5)) / 0.25;
        assert_eq!(first, first.round(), "seed {seed}");
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    let voxel = (first + Vec3::new(i as f32, j as f32, k as f32)).as_ivec3().to_array();
                    let wanted = value(&tree, voxel);
                    assert_eq!(grid.value(i, j, k).to_bits(), wanted.to_bits(), "seed {seed} {voxel:?}");
                    seen += u64::from(wanted > 0.0);
                }
            }
        }
        assert!(seen > 0, "seed {seed}");
        let [low, high] = tree.active_box().unwrap();
        let lattice = grid.lattice();
        for (corner, voxel) in [(grid.bounds().min, low), (grid.bounds().max, high)] {
            let at =
                Vec3::from_array(super::Transform::position(&grids[1].transform, voxel).map(|it| it as f32));
            assert!((corner - at).abs().max_element() <= 9.0 * lattice.spacing, "seed {seed}");
        }
    }
}

#[test]
fn a_level_set_becomes_fog_as_openvdb_makes_it() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    // A ball of radius 5 whose band is 0.75 wide; beyond it there are tiles inside.
    let (band, radius) = (0.75_f32, 5.0);
    let distance = |voxel: [i32; 3]| {
        let at = Vec3::from_array(voxel.map(|it| it as f32)) * 0.25;
        (at.length() - radius).clamp(-band, band)
    };
    let mut tree =
        Tree { components: 1, background: [band, 0.0, 0.0], leaves: Vec::new(), tiles: Vec::new() };
    for number in 0..216 {
        let origin = [number % 6 - 3, number / 6 % 6 - 3, number / 36 - 3].map(|it| 8 * it);
        let voxels = (0..LEAF_VOXELS as i32).map(|it| {
            [it >> 6, it >> 3 & 7, it & 7]
                .iter()
                .zip(origin)
                .map(|(step, low)| low + step)
                .collect::<Vec<_>>()
        });
        let values: Vec<f32> = voxels.map(|it| distance([it[0], it[1], it[2]])).collect();
        let mut active = [0_u64; 8];
        for place in (0..LEAF_VOXELS).filter(|&place| values[place].abs() < band) {
            active[place / 64] |= 1 << (place % 64);
        }
        if active != [0; 8] {
            tree.leaves.push(Leaf { origin, active, values });
        } else if values[0] < 0.0 {
            tree.tiles.push(Tile { origin, edge: 8, value: [-band, 0.0, 0.0], is_active: false });
        }
    }
    assert!(!tree.tiles.is_empty());
    let ball = Grid {
        name: "ball".into(),
        class: Class::LevelSet,
        transform: Transform { scale: [0.25; 3], translation: [0.0; 3] },
        tree,
    };
    write(&path, &[ball], Precision::Full, &()).unwrap();
    let Described { grid, conventions, .. } = described_density(&path, &["ball"], 2.0, &()).unwrap();
    assert!(conventions[1].contains("level set") && conventions[1].contains("0.75"), "{conventions:?}");
    let first = (grid.origin() / 0.25).as_ivec3();
    for (k, j, i) in
        (0..grid.size()[2]).flat_map(|k| (0..20).flat_map(move |j| (0..20).map(move |i| (k, j, i))))
    {
        let voxel = [first.x + i as i32, first.y + j as i32, first.z + k as i32];
        let wanted = 2.0 * (-distance(voxel) / band).clamp(0.0, 1.0);
        assert_eq!(grid.value(i, j, k), wanted, "{voxel:?}");
    }
    let middle = grid.brick([3, 3, 3]);
    assert_eq!(middle, Brick::Constant(2.0));
}

#[test]
fn what_is_no_density_says_what_the_file_has() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    let says = |grids: &[Grid], name: Option<&str>| {
        write(&path, grids, Precision::Full, &()).unwrap();
        match described_density(&path, name.as_slice(), 1.0, &()) {
            Ok(Described { conventions, .. }) => conventions.join("; "),
            Err(error) => error.to_string(),
        }
    };
    let leaf = |components: usize, value: f32| {
        let leaf =
            Leaf { origin: [0; 3], active: [u64::MAX; 8], values: vec![value; LEAF_VOXELS * components] };
        Tree { components, background: [0.0; 3], leaves: vec![leaf], tiles: Vec::new() }
    };
    let vector = grid("v", Class::Staggered, leaf(3, 1.0));
    assert!(says(&[], None).contains("no grids"));
    assert!(says(std::slice::from_ref(&vector), None).contains("none of its grids is a density: v (vec3s)"));
    let both = [vector, grid("rho", Class::FogVolume, leaf(1, 1.0))];
    assert!(says(&both, Some("V")).contains("of vectors, which are no density"));
    assert!(says(&both, Some("x")).contains("the file has: v (vec3s), rho (float)"));
    assert_eq!(says(&both, None), "density: grid 'rho' of v (vec3s), rho (float)");
    let negative = says(&[grid("a", Class::FogVolume, leaf(1, -1.0))], None);
    assert!(negative.contains("512 values below 0 or not finite count as 0"), "{negative}");
    let none = Tree { components: 1, background: [0.0; 3], leaves: Vec::new(), tiles: Vec::new() };
    assert!(says(&[grid("a", Class::FogVolume, none)], None).contains("no active voxels"));
    let mut apart = leaf(1, 1.0);
    apart.leaves.push(Leaf { origin: [1 << 30; 3], ..apart.leaves[0].clone() });
    assert!(says(&[grid("a", Class::FogVolume, apart)], None).contains("lie far apart"));
    let twice = [grid("a", Class::Unknown, leaf(1, 1.0)), grid("a", Class::Unknown, leaf(1, 1.0))];
    assert!(write(&path, &twice, Precision::Full, &()).unwrap_err().to_string().contains("twice"));
    let mut flat = grid("a", Class::Unknown, leaf(1, 1.0));
    flat.transform.scale[1] = 0.5;
    assert!(write(&path, &[flat], Precision::Full, &()).unwrap_err().to_string().contains("voxels"));
}

#[test]
fn a_file_of_openvdb_has_what_its_maker_put_there() {
    // See tests/data/samples/make.py: Blosc, several roots' children, a tile, a level set, vectors.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/samples/cloud.vdb");
    let (version, grids) = grids(&path, &()).unwrap();
    let told: Vec<(&str, &str, Class, i64)> =
        grids.iter().map(|it| (&it.name[..], &it.kind[..], it.class, it.voxel_count.unwrap_or(-1))).collect();
    let vectors = told.iter().find(|it| it.0 == "velocity").unwrap().3;
    assert_eq!(version, 224);
    assert!(told.contains(&("density", "float", Class::FogVolume, 512 + vectors)), "{told:?}");
    assert!(told.iter().any(|it| (it.0, it.2) == ("ball", Class::LevelSet)), "{told:?}");

    let Described { grid, .. } = described_density(&path, &[], 1.0, &()).unwrap();
    let at = |voxel: [f32; 3]| 0.25 * Vec3::from_array(voxel);
    assert_eq!([grid.density(at([20.0, 4.0, 12.0])), grid.density(at([40.0, 4.0, 12.0]))], [0.5, 0.0]);
    let (read, _) = super::read(&path, None, &()).unwrap();
    let tree = |name: &str| &read.iter().find(|it| it.name == name).unwrap().tree;
    assert_eq!(tree("density").tiles.iter().filter(|it| it.is_active).count(), 1);
    // Of vector k the parts are k, -k and 1/2.
    let mut seen = 0;
    for leaf in &tree("velocity").leaves {
        for (place, value) in
            leaf.values.as_chunks::<3>().0.iter().enumerate().filter(|it| leaf.is_active(it.0))
        {
            assert_eq!(value, &[value[0], -value[0], 0.5], "{:?} {place}", leaf.origin);
            seen += 1;
        }
    }
    assert_eq!(seen, vectors);
    // The ball of radius 1.5 around (3, 3, 3) is full but for half a voxel's fog.
    let Described { grid, .. } = described_density(&path, &["ball"], 1.0, &()).unwrap();
    for (x, wanted) in [(3.0, 1.0), (4.0, 1.0), (4.25, 0.5), (4.5, 0.0), (4.75, 0.0)] {
        assert!((grid.density(Vec3::new(x, 3.0, 3.0)) - wanted).abs() < 1e-3, "{x}");
    }
}

#[test]
fn a_file_that_is_cut_is_never_read_in_silence() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/samples/cloud.vdb");
    let folder = folder();
    let path = folder.path().join("cut.vdb");
    let zipped = folder.path().join("zipped.vdb");
    let trees = [Random(11).tree(1), Random(12).tree(3)];
    let grids: Vec<Grid> =
        ["a", "b"].into_iter().zip(trees).map(|(name, tree)| grid(name, Class::FogVolume, tree)).collect();
    write(&zipped, &grids, Precision::Full, &()).unwrap();
    for file in [&sample, &zipped] {
        let bytes = map(file).unwrap().to_vec();
        assert!(super::read(file, None, &()).is_ok());
        for k in 0..60 {
            let cut = bytes.len() * k / 60;
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let error = super::read(&path, None, &()).expect_err("a part").to_string();
            assert!(error.contains("cut.vdb"), "{error}");
        }
    }
    crate::read::real_data::damage_some(&std::fs::read(&sample).unwrap(), |bytes| {
        std::fs::write(&path, bytes).unwrap();
        let _ = super::read(&path, None, &());
        let _ = described_density(&path, &[], 1.0, &());
    });
}

/// Numbers as a file has them, zipped behind their size or plain.
fn stored(values: impl IntoIterator<Item = f64>, is_double: bool, is_zipped: bool) -> Vec<u8> {
    let number =
        |it: f64| if is_double { it.to_le_bytes().to_vec() } else { (it as f32).to_le_bytes().to_vec() };
    let plain: Vec<u8> = values.into_iter().flat_map(number).collect();
    if !is_zipped {
        return plain;
    }
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut encoder, &plain).unwrap();
    let zipped = encoder.finish().unwrap();
    [(zipped.len() as i64).to_le_bytes().to_vec(), zipped].concat()
}

/// A file with all values written out: `density` with a tile in every kind of node and a leaf at the origin that holds 0 to 511, of
/// which voxel 5 is not active; and `again`, an instance of it that lies elsewhere.
fn written_out(version: u32, is_double: bool, is_zipped: bool) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let is_older = version < 222;
    let flags = if is_older { Vec::new() } else { u32::from(is_zipped).to_le_bytes().to_vec() };
    let all = if is_older { Vec::new() } else { vec![6] };
    let number = |it: f64| stored([it], is_double, false);
    let doubles = |it: &[f64]| it.iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>();
    let place = |at: [i32; 3]| at.map(i32::to_le_bytes).concat();

    let mut body = [flags.clone(), vec![0; 4], text("ScaleMap"), doubles(&[0.5; 15])].concat();
    // One buffer, a background, one tile of the root and one child.
    body.extend(
        [&1_u32.to_le_bytes()[..], &number(0.25), &1_u32.to_le_bytes(), &1_u32.to_le_bytes()].concat(),
    );
    body.extend([place([4096, 0, 0]), number(7.0), vec![1], place([0; 3])].concat());
    for (count, value) in [(1 << 15, 3.5), (1 << 12, 4.5)] {
        let mut children = vec![0; count / 8];
        children[0] = 1;
        // Its first place is a child, of which older files have no value; the second is an active tile.
        let mut active = vec![0; count / 8];
        active[0] = 2;
        let values = (usize::from(is_older)..count).map(|it| if it == 1 { value } else { 0.25 });
        body.extend([children, active, all.clone(), stored(values, is_double, is_zipped)].concat());
    }
    let mask = [&[!(1 << 5)][..], &[0xff; 63]].concat();
    let leaf = if is_older { [place([0; 3]), vec![1]].concat() } else { all };
    let values = stored((0..512).map(f64::from), is_double, is_zipped);
    body.extend([mask.clone(), mask, leaf, values].concat());
    let again = [flags, vec![0; 4], text("TranslationMap"), doubles(&[1.0, 2.0, 3.0])].concat();

    let mut file = [&file::MAGIC[..], &version.to_le_bytes(), &[0; 8], &[1]].concat();
    if (220..222).contains(&version) {
        file.push(u8::from(is_zipped));
    }
    file.extend([&[b'0'; 36][..], &[0; 4], &2_u32.to_le_bytes()].concat());
    let kind = if is_double { "Tree_double_5_4_3" } else { "Tree_float_5_4_3" };
    for (name, parent, body) in [("density", "", body), ("again", "density", again)] {
        file.extend([text(name), text(kind), text(parent)].concat());
        let begin = file.len() + 24;
        let end = begin + body.len();
        file.extend([begin, begin, end].map(|it| (it as i64).to_le_bytes()).as_flattened());
        file.extend(body);
    }
    file
}

#[test]
fn older_versions_doubles_plain_values_and_instances_are_read() {
    let folder = folder();
    let path = folder.path().join("a.vdb");
    let scalar = |value: f32| [value, 0.0, 0.0];
    let tile = |origin: [i32; 3], edge: i32, value: f32| Tile {
        origin,
        edge,
        value: scalar(value),
        is_active: true,
    };
    let mut active = [u64::MAX; 8];
    active[0] &= !(1 << 5);
    let leaf = Leaf { origin: [0; 3], active, values: (0..512).map(|it| it as f32).collect() };
    let tiles = vec![tile([4096, 0, 0], 4096, 7.0), tile([0, 0, 128], 128, 3.5), tile([0, 0, 8], 8, 4.5)];
    let wanted = Tree { components: 1, background: scalar(0.25), leaves: vec![leaf], tiles };
    for (version, is_zipped) in
        [(218, true), (220, true), (220, false), (221, false), (222, true), (222, false), (224, false)]
    {
        for is_double in [false, true] {
            std::fs::write(&path, written_out(version, is_double, is_zipped)).unwrap();
            let (grids, _) = super::read(&path, None, &()).unwrap();
            let what = format!("version {version}, zipped {is_zipped}, doubles {is_double}");
            assert_eq!(grids.len(), 2, "{what}");
            for grid in &grids {
                assert_eq!(bits(&grid.tree), bits(&wanted), "{what} {}", grid.name);
            }
            assert_eq!(grids[0].transform, Transform { scale: [0.5; 3], translation: [0.0; 3] }, "{what}");
            let there = Transform { scale: [1.0; 3], translation: [1.0, 2.0, 3.0] };
            assert_eq!((&grids[1].name[..], grids[1].transform), ("again", there), "{what}");
        }
    }
    std::fs::write(&path, written_out(217, false, true)).unwrap();
    assert!(grids(&path, &()).unwrap_err().to_string().contains("version 217"));
}

#[test]
fn transforms_are_along_the_axes_or_told() {
    let read = |name: &str, numbers: &[f64]| {
        let numbers = numbers.iter().flat_map(|it| it.to_le_bytes());
        let bytes: Vec<u8> =
            (name.len() as u32).to_le_bytes().into_iter().chain(name.bytes()).chain(numbers).collect();
        let order = crate::read::numbers::Order::Little;
        let mut cursor = crate::read::cursor::Cursor::new(Path::new("a"), &bytes, 0, order, "");
        transform::read(&mut cursor).map(|it| (it, cursor.left()))
    };
    let scale = [2.0, 3.0, 4.0];
    let moved = [5.0, 6.0, 7.0];
    let follows = [0.0; 12];
    let diagonal = [2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 5.0, 6.0, 7.0, 1.0];
    let both = Transform { scale, translation: moved };
    let only_scale = Transform { translation: [0.0; 3], ..both };
    for name in ["ScaleMap", "UniformScaleMap"] {
        assert_eq!(read(name, &[&scale[..], &follows].concat()).unwrap(), (Ok(only_scale), 0));
    }
    for name in ["ScaleTranslateMap", "UniformScaleTranslateMap"] {
        assert_eq!(read(name, &[&moved[..], &scale, &follows].concat()).unwrap(), (Ok(both), 0));
    }
    assert_eq!(read("AffineMap", &diagonal).unwrap(), (Ok(both), 0));
    let mut turned = diagonal;
    turned[1] = 0.5;
    assert_eq!(read("AffineMap", &turned).unwrap().0, Err("turned or sheared".to_string()));
    assert!(read("Map", &scale).unwrap_err().to_string().contains("'Map' is not known"));
    assert!(read("ScaleMap", &scale).is_err());
    assert_eq!(both.position([1, 0, -1]), [7.0, 6.0, 3.0]);
    assert_eq!(
        both.bytes()[..48],
        [moved, scale].concat().iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>()
    );
}
