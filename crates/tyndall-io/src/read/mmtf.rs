//! MMTF: the atoms of an entry as groups, chains and models, packed column by column in MessagePack; models as frames.
//!
//! Takes the whole content, gives the attributes that mmCIF's atoms have. A group is of a type that names its atoms; chains are so many
//! groups, models so many chains, all in order. Bonds are counted and left out. A file is one value from its first byte to its last, so
//! that one that is cut cannot be read at all. Source: MMTF specification 1.1, github.com/rcsb/mmtf.

mod codec;

use std::ops::Range;
use std::path::Path;

use tyndall::{DVec3, Error, Progress, Result};

use self::codec::Column;
use super::assembly::{Assembly, Group, Operator};
use super::atom_site::{AtomSite, Data, Entry, MOST_OPERATORS};
use super::column::Words;
use super::message::{self, Value};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const HINT: &str = "write it again, or give the entry as BinaryCIF or mmCIF";
/// Names of which every file has some.
const NAMES: [&str; 5] = ["mmtfVersion", "mmtfProducer", "groupTypeList", "xCoordList", "chainsPerModel"];

/// Whether the file begins like MMTF: a map in which one of its names stands.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let is_map = matches!(head.first(), Some(0x81..=0x8f | 0xde | 0xdf));
    is_map && NAMES.iter().any(|it| memchr::memmem::find(head, it.as_bytes()).is_some())
}

/// The fields of a file.
struct Fields<'a> {
    path: &'a Path,
    root: Value<'a>,
    /// The size of the file, which no number of atoms exceeds: each coordinate has a byte at least.
    most: usize,
}

impl<'a> Fields<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let root = message::read(bytes).map_err(|place| {
            let is_cut = place == bytes.len();
            let what = if is_cut { "the file is cut off" } else { "this is not MessagePack as MMTF has it" };
            Error::format(path, format!("byte {place}"), what, HINT)
        })?;
        Ok(Self { path, root, most: bytes.len() })
    }

    fn fault(&self, name: &str, what: impl Into<String>) -> Error {
        Error::format(self.path, name, what, HINT)
    }

    /// A packed field; `None` if the file has none of that name.
    fn packed(&self, name: &str) -> Result<Option<Column<'_>>> {
        let Some(bytes) = self.root.get(name).and_then(Value::bytes) else { return Ok(None) };
        codec::decode(bytes, self.most).map(Some).map_err(|what| self.fault(name, what))
    }

    /// Whole numbers, packed or as a list.
    fn integers(&self, name: &str) -> Result<Option<Vec<i32>>> {
        if let Some(list) = self.root.get(name).and_then(Value::list) {
            let numbers = list.iter().map(|it| i32::try_from(it.count()?).ok()).collect::<Option<_>>();
            return numbers.map(Some).ok_or_else(|| self.fault(name, "wanted a list of whole numbers"));
        }
        match self.packed(name)? {
            None => Ok(None),
            Some(Column::Integers(values)) => Ok(Some(values)),
            Some(_) => Err(self.fault(name, "wanted whole numbers")),
        }
    }

    /// The same of a field that every file has.
    fn counts(&self, name: &str) -> Result<Vec<usize>> {
        let values = self.integers(name)?.ok_or_else(|| self.fault(name, "there is no such field"))?;
        let counts = values.iter().map(|&it| usize::try_from(it)).collect::<std::result::Result<_, _>>();
        counts.map_err(|_| self.fault(name, "a number is negative"))
    }

    /// Numbers, one for each of `count`.
    fn floats(&self, name: &str, count: usize) -> Result<Option<Vec<f64>>> {
        let values = match self.packed(name)? {
            None => return Ok(None),
            Some(Column::Floats(values)) => values,
            Some(Column::Integers(values)) => values.into_iter().map(f64::from).collect(),
            Some(_) => return Err(self.fault(name, "wanted numbers")),
        };
        self.check_length(name, values.len(), count)?;
        Ok(Some(values))
    }

    /// Words, one for each of `count`.
    fn words(&self, name: &str, count: usize) -> Result<Option<Vec<String>>> {
        let text = |bytes: &[u8]| {
            String::from_utf8_lossy(bytes).trim_matches(|it: char| it == '\0' || it == ' ').to_string()
        };
        let words: Vec<String> = match self.packed(name)? {
            None => return Ok(None),
            Some(Column::Words(bytes, size)) => bytes.chunks_exact(size).map(text).collect(),
            Some(Column::Letters(letters)) => letters
                .into_iter()
                .map(|it| u32::try_from(it).ok().and_then(char::from_u32).filter(|it| *it != '\0'))
                .map(|it| it.map_or_else(String::new, String::from))
                .collect(),
            Some(_) => return Err(self.fault(name, "wanted words")),
        };
        self.check_length(name, words.len(), count)?;
        Ok(Some(words))
    }

    fn check_length(&self, name: &str, found: usize, count: usize) -> Result<()> {
        match found == count {
            true => Ok(()),
            false => Err(self.fault(name, format!("wanted {count} values, found {found}"))),
        }
    }
}

/// What the atoms of a group are called.
struct Residue<'a> {
    name: &'a str,
    names: Vec<&'a str>,
    elements: Vec<&'a str>,
    charges: Vec<i64>,
    /// Pairs of its atoms.
    bonds: Vec<[usize; 2]>,
}

/// How many atoms make a group, groups a chain, chains a model.
struct Tree<'a> {
    residues: Vec<Residue<'a>>,
    /// The residue of each group.
    groups: Vec<usize>,
    groups_per_chain: Vec<usize>,
    chains_per_model: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn new(fields: &'a Fields<'a>) -> Result<Self> {
        let types = fields.root.get("groupList").and_then(Value::list);
        let types = types.ok_or_else(|| fields.fault("groupList", "there is no such field"))?;
        let residues = types.iter().enumerate().map(|(place, it)| residue(fields, place, it));
        let tree = Self {
            residues: residues.collect::<Result<Vec<_>>>()?,
            groups: fields.counts("groupTypeList")?,
            groups_per_chain: fields.counts("groupsPerChain")?,
            chains_per_model: fields.counts("chainsPerModel")?,
        };
        if let Some(kind) = tree.groups.iter().find(|&&it| it >= tree.residues.len()) {
            let what = format!("a group has type {kind}, there are {} types", tree.residues.len());
            return Err(fields.fault("groupTypeList", what));
        }
        for (name, counts, parts) in [
            ("groupsPerChain", &tree.groups_per_chain, tree.groups.len()),
            ("chainsPerModel", &tree.chains_per_model, tree.groups_per_chain.len()),
        ] {
            let sum = counts.iter().try_fold(0usize, |sum, &it| sum.checked_add(it));
            if sum != Some(parts) {
                return Err(fields.fault(name, format!("they do not add up to the {parts} that there are")));
            }
        }
        Ok(tree)
    }

    fn atoms(&self, groups: Range<usize>) -> usize {
        // No type has more atoms than the file has bytes, nor are there more groups than that: it does not overflow.
        self.groups[groups].iter().map(|&kind| self.residues[kind].names.len()).sum()
    }

    /// The bonds between those of the atoms, which are those of the groups, counted from the first of these: within groups, and `others`,
    /// which are counted from the file's first.
    fn bonds(&self, groups: Range<usize>, atoms: Range<usize>, others: &[i32]) -> Vec<[u32; 2]> {
        let mut bonds = Vec::new();
        let mut first = 0;
        for group in groups {
            let residue = &self.residues[self.groups[group]];
            let is_there = |pair: &&[usize; 2]| pair.iter().all(|&atom| atom < residue.names.len());
            bonds.extend(
                residue.bonds.iter().filter(is_there).map(|pair| pair.map(|atom| (first + atom) as u32)),
            );
            first += residue.names.len();
        }
        let place = |atom: i32| {
            let atom = usize::try_from(atom).ok().filter(|atom| atoms.contains(atom))?;
            Some((atom - atoms.start) as u32)
        };
        let between =
            others.as_chunks().0.iter().filter_map(|&[one, other]| Some([place(one)?, place(other)?]));
        bonds.extend(between);
        bonds
    }

    /// Chains, groups and atoms of each model.
    fn models(&self) -> Vec<[Range<usize>; 3]> {
        let mut ends = [0; 3];
        let mut models = Vec::new();
        for &chains in &self.chains_per_model {
            let [chain, group, atom] = ends;
            let groups: usize = self.groups_per_chain[chain..chain + chains].iter().sum();
            ends = [chain + chains, group + groups, atom + self.atoms(group..group + groups)];
            models.push([chain..ends[0], group..ends[1], atom..ends[2]]);
        }
        models
    }
}

fn residue<'a>(fields: &Fields, place: usize, group: &'a Value<'a>) -> Result<Residue<'a>> {
    let texts = |name: &str| -> Vec<&'a str> {
        let list = group.get(name).and_then(Value::list).unwrap_or_default();
        list.iter().map(|it| it.text().unwrap_or_default().trim()).collect()
    };
    let charges = group.get("formalChargeList").and_then(Value::list).unwrap_or_default();
    let bonded = group.get("bondAtomList").and_then(Value::list).unwrap_or_default();
    let pair = |pair: &[Value<'a>; 2]| Some([pair[0].count()?, pair[1].count()?]);
    let residue = Residue {
        name: group.get("groupName").and_then(Value::text).unwrap_or_default(),
        names: texts("atomNameList"),
        elements: texts("elementList"),
        charges: charges.iter().map(|it| it.number().unwrap_or(0.0) as i64).collect(),
        bonds: bonded.as_chunks().0.iter().filter_map(pair).collect(),
    };
    let atoms = residue.names.len();
    let is_even = |count: usize| count == atoms || count == 0;
    if !is_even(residue.elements.len()) || !is_even(residue.charges.len()) {
        let what = format!("type {place} has {atoms} names of atoms and {} elements", residue.elements.len());
        return Err(fields.fault("groupList", what));
    }
    Ok(residue)
}

/// Finds the models.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let fields = Fields::new(path, bytes)?;
    let models = Tree::new(&fields)?.models();
    let span = |(place, [_, _, atoms]): (usize, &[Range<usize>; 3])| Span {
        offset: atoms.start as u64,
        line: place as u64 + 1,
        bytes: Some(atoms.len() as u64),
    };
    Ok(Index { frames: models.iter().enumerate().map(span).collect(), ..Index::default() })
}

/// Reads the model that `span` counts.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let fields = Fields::new(path, bytes)?;
    let tree = Tree::new(&fields)?;
    let models = tree.models();
    let [chains, groups, atoms] = models
        .get(span.line as usize - 1)
        .ok_or_else(|| Error::format(path, "", "the model is not there any more", "was the file changed?"))?;
    let all = models.last().map_or(0, |[.., atoms]| atoms.end);

    let mut sites = AtomSite::new(&[]);
    for (name, item) in [
        ("xCoordList", "Cartn_x"),
        ("yCoordList", "Cartn_y"),
        ("zCoordList", "Cartn_z"),
        ("bFactorList", "B_iso_or_equiv"),
        ("occupancyList", "occupancy"),
    ] {
        match fields.floats(name, all)? {
            Some(values) => sites.insert(item, Data::Floats(values[atoms.clone()].to_vec())),
            None if item.starts_with("Cartn") => return Err(fields.fault(name, "there is no such field")),
            None => {}
        }
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
    }
    if let Some(ids) = fields.integers("atomIdList")? {
        fields.check_length("atomIdList", ids.len(), all)?;
        sites.insert("id", Data::Integers(ids[atoms.clone()].iter().map(|&it| Some(it.into())).collect()));
    }
    if let Some(words) = fields.words("altLocList", all)? {
        sites.insert("label_alt_id", each(words[atoms.clone()].iter().map(String::as_str)));
    }

    // What groups tell, for each of their atoms.
    let residue = |group: usize| &tree.residues[tree.groups[group]];
    let atoms_of = |group: usize| residue(group).names.len();
    let residues = || groups.clone().map(residue);
    sites.insert("label_atom_id", each(residues().flat_map(|it| it.names.iter().copied())));
    if residues().all(|it| it.elements.len() == it.names.len()) {
        sites.insert("type_symbol", each(residues().flat_map(|it| it.elements.iter().copied())));
    }
    if residues().any(|it| it.charges.iter().any(|&charge| charge != 0)) {
        let charges = residues()
            .flat_map(|it| (0..it.names.len()).map(|atom| Some(it.charges.get(atom).copied().unwrap_or(0))));
        sites.insert("pdbx_formal_charge", Data::Integers(charges.collect()));
    }
    let names = groups.clone().flat_map(|it| std::iter::repeat_n(residue(it).name, atoms_of(it)));
    sites.insert("label_comp_id", each(names));
    if let Some(numbers) = fields.integers("groupIdList")? {
        fields.check_length("groupIdList", numbers.len(), tree.groups.len())?;
        let numbers =
            groups.clone().flat_map(|it| std::iter::repeat_n(Some(numbers[it].into()), atoms_of(it)));
        sites.insert("auth_seq_id", Data::Integers(numbers.collect()));
    }
    if let Some(words) = fields.words("insCodeList", tree.groups.len())? {
        let words = groups.clone().flat_map(|it| std::iter::repeat_n(words[it].as_str(), atoms_of(it)));
        sites.insert("pdbx_PDB_ins_code", each(words));
    }

    // What chains tell.
    let mut sizes = Vec::with_capacity(chains.len());
    let mut group = groups.start;
    for &count in &tree.groups_per_chain[chains.clone()] {
        sizes.push(tree.atoms(group..group + count));
        group += count;
    }
    let of_chains = |words: &[String]| {
        let words = &words[chains.clone()];
        each(words.iter().zip(&sizes).flat_map(|(word, &size)| std::iter::repeat_n(word.as_str(), size)))
    };
    let chain_count = tree.groups_per_chain.len();
    let asym = fields.words("chainIdList", chain_count)?.unwrap_or_default();
    for (item, words) in [
        ("label_asym_id", (!asym.is_empty()).then(|| asym.clone())),
        ("auth_asym_id", fields.words("chainNameList", chain_count)?),
        ("label_entity_id", entities(&fields, chain_count)),
    ] {
        if let Some(words) = words {
            sites.insert(item, of_chains(&words));
        }
    }

    let entry = Entry {
        format: "MMTF",
        lattice: lattice(&fields),
        space_group: fields.root.get("spaceGroup").and_then(Value::text).map(str::to_string),
        assemblies: assemblies(&fields, &asym)?,
        bonds: tree.bonds(
            groups.clone(),
            atoms.clone(),
            &fields.integers("bondAtomList")?.unwrap_or_default(),
        ),
        links: Vec::new(),
    };
    let frame = sites.frame(path, entry, request)?;
    progress.advance(bytes.len() as u64);
    Ok(frame)
}

fn each<'w>(words: impl Iterator<Item = &'w str>) -> Data {
    let mut column = Words::default();
    words.for_each(|it| column.push(it.as_bytes()));
    Data::Words(column)
}

/// The number of the entity that each chain is one of, counted from 1; `None` if the file has no entities.
fn entities(fields: &Fields, chains: usize) -> Option<Vec<String>> {
    let list = fields.root.get("entityList").and_then(Value::list).filter(|it| !it.is_empty())?;
    let mut names = vec![String::new(); chains];
    for (place, entity) in list.iter().enumerate() {
        let members = entity.get("chainIndexList").and_then(Value::list).unwrap_or_default();
        for chain in members.iter().filter_map(Value::count) {
            if let Some(name) = names.get_mut(chain) {
                *name = (place + 1).to_string();
            }
        }
    }
    Some(names)
}

fn numbers<const N: usize>(list: Option<&Value>) -> Option<[f64; N]> {
    let list: Vec<f64> = list?.list()?.iter().filter_map(Value::number).collect();
    list.try_into().ok()
}

/// Lengths and angles of the cell.
fn lattice(fields: &Fields) -> Option<[[f64; 3]; 2]> {
    let [a, b, c, alpha, beta, gamma] = numbers(fields.root.get("unitCell"))?;
    Some([[a, b, c], [alpha, beta, gamma]])
}

/// The assemblies; `chains` are the names of all chains.
fn assemblies(fields: &Fields, chains: &[String]) -> Result<Vec<Assembly>> {
    let name = "bioAssemblyList";
    let mut left = MOST_OPERATORS;
    let mut assemblies = Vec::new();
    for assembly in fields.root.get(name).and_then(Value::list).unwrap_or_default() {
        let mut groups: Vec<Group> = Vec::new();
        for transform in assembly.get("transformList").and_then(Value::list).unwrap_or_default() {
            let m: [f64; 16] = numbers(transform.get("matrix"))
                .ok_or_else(|| fields.fault(name, "a transform has no matrix of 16 numbers"))?;
            let row = |row: usize| DVec3::from_slice(&m[4 * row..4 * row + 3]);
            let operator = Operator { rows: [row(0), row(1), row(2)], shift: DVec3::new(m[3], m[7], m[11]) };
            let members = transform.get("chainIndexList").and_then(Value::list).unwrap_or_default();
            let names: Option<Vec<String>> =
                members.iter().map(|it| chains.get(it.count()?).cloned()).collect();
            let names = names
                .filter(|it| !it.is_empty())
                .ok_or_else(|| fields.fault(name, "a transform names a chain that is not there, or none"))?;
            left = left
                .checked_sub(1)
                .ok_or_else(|| fields.fault(name, format!("more than {MOST_OPERATORS} transforms")))?;
            match groups.last_mut().filter(|it| it.chains == names) {
                Some(group) => group.operators.push(operator),
                None => groups.push(Group { chains: names, operators: vec![operator] }),
            }
        }
        let number = (assemblies.len() + 1).to_string();
        let name = assembly.get("name").and_then(Value::text).map_or(number, str::to_string);
        assemblies.push(Assembly { name, groups });
    }
    Ok(assemblies)
}
