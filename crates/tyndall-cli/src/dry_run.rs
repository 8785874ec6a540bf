//! How much memory and time a picture needs, and whether the machine has it.

use tyndall::Error;
use tyndall::render::estimate::Work;
use tyndall::structure::{Kind, Packing};

use crate::medium::estimate;
use crate::report::{Outcome, Report, bytes, seconds};

/// Refuses work that needs more than `needed_bytes` of the memory that is free, or of `limit`.
pub(crate) fn check_memory(work: &Work, needed_bytes: u64, limit: Option<u64>) -> Outcome<()> {
    match limit.or_else(available_bytes) {
        Some(available_bytes) if needed_bytes > available_bytes => Err(Error::Memory {
            what: format!("the work on {} particles", tyndall::scene::grouped(work.particles as usize)),
            needed_bytes,
            available_bytes,
            hint: format!(
                "try {}fewer particles, a smaller --size, or a machine with more memory",
                smaller(work.structure)
            ),
        }
        .into()),
        _ => Ok(()),
    }
}

/// What would make the structure smaller, if anything.
fn smaller(structure: Kind) -> &'static str {
    match structure {
        Kind::Bvh(Packing::Exact) => "--pack 16, ",
        Kind::Bvh(Packing::Bits16 | Packing::Bits11) => "--pack 8, ",
        Kind::Bvh(Packing::Bits8) => "",
        _ => "--structure bvh --pack 16, ",
    }
}

/// Whether it takes less memory than is free, or than `limit`.
pub(crate) fn fits(needed_bytes: u64, limit: Option<u64>) -> bool {
    limit.or_else(available_bytes).is_none_or(|available_bytes| needed_bytes <= available_bytes)
}

/// Says what the pictures would cost.
pub(crate) fn tell(work: &Work, pictures: usize, report: &Report) -> Outcome<()> {
    let threads = rayon::current_num_threads();
    let each = work.seconds(threads);
    let needed = bytes(work.memory_bytes());
    let available = available_bytes().map_or(String::new(), |free| format!(" of {} available", bytes(free)));
    let time = match pictures {
        1 => format!("about {}", seconds(each)),
        count => format!("about {} a picture, {} for {count}", seconds(each), seconds(each * count as f64)),
    };
    report.out(&format!("dry run: memory {needed}{available}; time without reading {time} on {threads} threads, up to ten times that if most particles are smaller than a pixel; nothing written\n"))
}

/// Says what a saved structure would cost.
pub(crate) fn tell_build(work: &Work, report: &Report) -> Outcome<()> {
    let needed = bytes(work.memory_bytes());
    let available = available_bytes().map_or(String::new(), |free| format!(" of {} available", bytes(free)));
    let (file, each) = (bytes(work.saved_bytes()), seconds(work.seconds(rayon::current_num_threads())));
    report.out(&format!(
        "dry run: memory {needed}{available}; file about {file}; time without reading and writing about {each}; nothing written\n"
    ))
}

/// Says what pictures of a medium would cost; fails if the memory is less than that.
pub(crate) fn tell_medium(
    work: &estimate::Work,
    pictures: usize,
    available_bytes: Option<u64>,
    report: &Report,
) -> Outcome<()> {
    let threads = rayon::current_num_threads();
    let needed_bytes = work.memory_bytes();
    if let Some(available_bytes) = available_bytes.filter(|&free| needed_bytes > free) {
        let [x, y, z] = work.lattice.size;
        return Err(Error::Memory {
            what: format!("a medium of {x}x{y}x{z} samples in light"),
            needed_bytes,
            available_bytes,
            hint: "try a smaller --grid or --size, or fewer --photons".into(),
        }
        .into());
    }
    let available = available_bytes.map_or(String::new(), |free| format!(" of {} available", bytes(free)));
    let [first, further] = work.seconds(threads);
    let all = match pictures {
        1 => String::new(),
        count => format!(", {} for {count} views of it", seconds(first + further * (count - 1) as f64)),
    };
    let [x, y, z] = work.lattice.size;
    report.out(&format!("dry run: grid {x}x{y}x{z}; memory at most {}{available}; time without reading about {}{all} on {threads} threads, give or take three times; nothing written\n", bytes(needed_bytes), seconds(first)))
}

/// Memory that may be taken without swapping, where the system tells: what is free, and what the process may have.
pub(crate) fn available_bytes() -> Option<u64> {
    let of_machine = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
    });
    let of_group = || -> Option<u64> {
        let number = |name: &str| {
            std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok()?.trim().parse::<u64>().ok()
        };
        Some(number("memory.max")?.saturating_sub(number("memory.current")?))
    };
    match (of_machine, of_group()) {
        (Some(machine), Some(group)) => Some(machine.min(group)),
        (machine, group) => machine.or(group),
    }
}
