//! Small cases whose instructions are counted, which tells a regression where times are too noisy.
//!
//! `.ci/instructions.py` runs them under Valgrind, which counts what is done inside `measured`. `instructions CASE` prepares
//! a case and does it once, on one thread; `--list` prints the names of all; without a word all are done.

mod cube;

use std::hint::black_box;

use tyndall::render::{Culling, Settings, render};
use tyndall::structure::{Kind, Packing, pkd};
use tyndall::synthetic;

use cube::{Look, ORTHOGRAPHIC, PERSPECTIVE};

const LAWS: [&str; 3] = ["packed", "uniform", "clustered"];
const EDGE: u32 = 200;
const RAYS: u64 = 10_000;

#[derive(Clone, Copy)]
enum Case {
    Build(Kind),
    /// Orthographic and in perspective.
    Picture {
        kind: Kind,
        look: Look,
        samples: u32,
        culling: Culling,
    },
    /// Single rays that share nothing.
    Rays,
}

/// What is done with the particles of each law.
fn cases() -> [(&'static str, Case); 10] {
    let pkd = Kind::Pkd(pkd::Options::default());
    let picture = |kind, look, samples| Case::Picture { kind, look, samples, culling: Culling::Off };
    let certified =
        Case::Picture { kind: Kind::default(), look: Look::Studio, samples: 16, culling: Culling::default() };
    [
        ("build", Case::Build(Kind::default())),
        ("headlight_1", picture(Kind::default(), Look::Headlight, 1)),
        ("headlight_16", picture(Kind::default(), Look::Headlight, 16)),
        ("headlight_16_of_16_bits", picture(Kind::Bvh(Packing::Bits16), Look::Headlight, 16)),
        ("headlight_16_of_11_bits", picture(Kind::Bvh(Packing::Bits11), Look::Headlight, 16)),
        ("default_look_16", picture(Kind::default(), Look::Studio, 16)),
        ("default_look_16_certified", certified),
        ("incoherent_rays", Case::Rays),
        ("pkd_build", Case::Build(pkd)),
        ("pkd_headlight_1", picture(pkd, Look::Headlight, 1)),
    ]
}

fn main() {
    // The only worker is this thread, so that all that is done inside `measured` is counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("nothing has used the pool before");
    let word = std::env::args().nth(1).filter(|word| word != "--bench" && word != "--test");
    for law in LAWS {
        for (what, case) in cases() {
            let name = format!("{law}/{what}");
            match word.as_deref() {
                Some("--list") => println!("{name}"),
                Some(chosen) if chosen != name => {}
                _ => perform(law, case),
            }
        }
    }
}

fn perform(law: &str, case: Case) {
    let particles = synthetic::generate(&format!("{law}?n=1e5&seed=1"), &()).expect("a known law");
    match case {
        Case::Build(kind) => measured(|| drop(black_box(cube::arranged(particles, kind)))),
        Case::Picture { kind, look, samples, culling } => {
            let settings = Settings { width: EDGE, height: EDGE, samples, seed: 1, culling };
            for projection in [ORTHOGRAPHIC, PERSPECTIVE] {
                let camera = cube::camera(projection);
                let scene = cube::scene(cube::arranged(particles.clone(), kind), &camera, look);
                measured(|| drop(black_box(render(&scene, &camera, &settings, &()))));
            }
        }
        Case::Rays => {
            let structure = cube::arranged(particles, Kind::default());
            let rays = cube::incoherent_rays(RAYS);
            measured(|| {
                black_box(rays.iter().filter(|ray| structure.intersect(ray, None).is_some()).count());
            });
        }
    }
}

/// What Valgrind counts.
#[inline(never)]
fn measured(work: impl FnOnce()) {
    work();
}
