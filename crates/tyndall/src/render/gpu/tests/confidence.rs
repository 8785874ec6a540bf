//! The formulas of culling by confidence on both machines, thousands of times.

use glam::DVec3;

use super::super::confidence::Confidence;
use super::super::layout;
use super::super::shader::{Sampling, Tilings};
use super::super::{Gpu, Resident};
use super::formulas::{camera, device, differing, scene, written};
use crate::random::{Stream, hash4, unit_f32};
use crate::render::confidence::{
    Accumulator, DensityGrid, Estimate, Histogram, Interpolation, Options, Pixel, Population, covered,
    expected_unique, population, samples_needed, share,
};
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::structure::Packing;

const COUNT: usize = 4096;
/// A pixel each of what is evaluated.
const SIZE: [u32; 2] = [64, 64];

/// No kernel of these sees more.
const BUFFERS: u64 = 16;

/// Particles on the card, and what is the same for all pixels.
struct Card<'a> {
    resident: &'a Resident,
    confidence: Confidence,
}

impl<'a> Card<'a> {
    fn new(resident: &'a Resident, scene: &Scene, options: Options) -> Self {
        let grid = resident.grid(scene.structure(), options.voxel_count, &()).unwrap();
        Self { resident, confidence: Confidence::new(resident, grid, SIZE, options).unwrap() }
    }

    /// What statements make of each of the inputs `a` to `d`, with room for a histogram at `at`; `alter` is done to the text before.
    fn altered(
        &mut self,
        perspective: bool,
        alter: impl Fn(String) -> String,
        statements: &str,
        inputs: &[[[f32; 4]; 4]],
    ) -> Vec<[f32; 4]> {
        let sampling = Sampling { samples: 4, perspective, tilings: Tilings::of(4, 0) };
        let kernel = format!(
            "struct Inputs {{ a: vec4f, b: vec4f, c: vec4f, d: vec4f }}
            @group(0) @binding(0) var<storage, read> inputs: array<Inputs>;
            @group(0) @binding(1) var<storage, read_write> outputs: array<vec4f>;
            fn value(a: vec4f, b: vec4f, c: vec4f, d: vec4f, at: u32) -> vec4f {{ {statements} }}
            @compute @workgroup_size(64)
            fn evaluate(@builtin(global_invocation_id) thread: vec3u) {{
                if thread.x < arrayLength(&inputs) {{
                    let each = inputs[thread.x];
                    outputs[thread.x] = value(each.a, each.b, each.c, each.d, thread.x);
                }}
            }}"
        );
        let text = alter(self.confidence.text(self.resident, sampling)) + &kernel;
        self.confidence.evaluate(self.resident, text, bytemuck::cast_slice(inputs), inputs.len())
    }

    fn evaluate(&mut self, statements: &str, inputs: &[[[f32; 4]; 4]]) -> Vec<[f32; 4]> {
        self.altered(false, |text| text, statements, inputs)
    }
}

/// Runs with a card of particles of mixed sizes, if there is one.
fn on_card(options: Options, run: impl FnOnce(&Gpu, &Scene, Card)) {
    let Some(gpu) = device() else { return };
    if gpu.storage_buffers() < BUFFERS {
        println!("skipped: a kernel has too few buffers");
        return;
    }
    let scene = scene(Packing::Exact, |stream| 0.03 * (0.2 + stream.unit()));
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let card = Card::new(&resident, &scene, options);
    run(&gpu, &scene, card);
}

const OPTIONS: fn() -> Options = || Options { voxel_count: 12, ..Options::default() };

/// Inputs of one vector each.
fn inputs(of: impl FnMut(usize) -> [f32; 4]) -> Vec<[[f32; 4]; 4]> {
    (0..COUNT).map(of).map(|a| [a, [0.0; 4], [0.0; 4], [0.0; 4]]).collect()
}

/// How many of the values differ by more than a share of their own size.
fn relative(found: &[f32], expected: &[f32], tolerance: f32) -> usize {
    let pairs = found.iter().zip(expected);
    pairs.map(|(&a, &b)| differing(&[a], &[b], tolerance, b.abs().max(1e-30))).sum()
}

#[test]
fn random_words_are_those_of_the_cpu() {
    on_card(OPTIONS(), |_, _, mut card| {
        let mut stream = Stream::new(41, 0);
        // Whole numbers that floats hold exactly.
        let keys = inputs(|_| std::array::from_fn(|_| stream.below(1 << 24) as f32));
        for word in 0..4 {
            let text = format!(
                "let word = hash4(vec4u(a) * 977u + 13u)[{word}];
                return vec4f(f32(word >> 16u), f32(word & 0xffffu), unit_f32(word), 0.0);"
            );
            for (key, found) in keys.iter().zip(card.evaluate(&text, &keys)) {
                let expected =
                    hash4(key[0].map(|part| (part as u32).wrapping_mul(977).wrapping_add(13)))[word];
                let halves = [(expected >> 16) as f32, (expected & 0xffff) as f32, unit_f32(expected)];
                assert_eq!(found[..3], halves, "seed 41: {key:?}");
            }
        }
    });
}

#[test]
fn exponentials_and_logarithms_do_not_cancel() {
    on_card(OPTIONS(), |_, _, mut card| {
        let mut stream = Stream::new(42, 0);
        let numbers = inputs(|k| {
            let small = 10_f32.powf(-8.0 * stream.unit());
            let near_one = 1.0 - 10_f32.powf(-7.0 * stream.unit());
            [100.0 * stream.unit() * small, if k % 2 == 0 { small } else { near_one.max(0.0) }, 0.0, 0.0]
        });
        let found =
            card.evaluate("return vec4f(exp_minus(a.x), exp_m1(-a.x), ln_1p(-a.y), ln_1p(-1.0));", &numbers);
        for ([[x, y, ..], ..], [minus, m1, ln, least]) in numbers.iter().zip(found) {
            let (x, y) = (f64::from(*x), f64::from(*y));
            let near = |found: f32, expected: f64| {
                (f64::from(found) - expected).abs() <= 1e-7 * (6.0 + x) * expected.abs() + 1e-37
            };
            assert!(near(minus, if x < 87.0 { (-x).exp() } else { 0.0 }), "seed 42: e^-{x}: {minus}");
            assert!(near(m1, (-x).exp_m1()), "seed 42: e^-{x} - 1: {m1}");
            assert!(near(ln, (-y).ln_1p()), "seed 42: ln(1 - {y}): {ln}");
            assert_eq!(least, -104.0);
        }
    });
}

#[test]
fn footprints_are_those_of_the_cpu() {
    on_card(OPTIONS(), |_, scene, mut card| {
        let grid = DensityGrid::new(scene.structure(), 12).unwrap();
        let mut stream = Stream::new(43, 0);
        let radii = inputs(|_| [10_f32.powf(6.0 - 10.0 * stream.unit()), 0.0, 0.0, 0.0]);
        let text = "return vec4f(share_of(a.x), drawn_from(a.x), 0.0, 0.0);";
        let expected: Vec<[f32; 2]> =
            radii.iter().map(|[[x, ..], ..]| [share(*x), population(grid.mean_radius(), *x)]).collect();
        let differs = |found: &[[f32; 4]]| {
            let count = |at: usize| {
                let found: Vec<f32> = found.iter().map(|it| it[at]).collect();
                relative(&found, &expected.iter().map(|it| it[at]).collect::<Vec<_>>(), 1e-5)
            };
            [count(0), count(1)]
        };
        assert_eq!(differs(&card.evaluate(text, &radii)), [0, 0], "seed 43");
        // A changed constant is seen.
        let alter = |text: String| text.replace("0.00773", "0.00873");
        let [shares, populations] = differs(&card.altered(false, alter, text, &radii));
        assert!(shares > 20 && populations > 20, "{shares} {populations}");
    });
}

#[test]
fn samples_and_confidences_are_those_of_the_cpu() {
    for budget in [25, 100] {
        let options = Options { sample_budget: budget, ..OPTIONS() };
        on_card(options, |_, _, mut card| {
            let accumulator = Accumulator::new(budget, Population::Frustum);
            let mut stream = Stream::new(44, 0);
            let cases = inputs(|k| {
                let population = if k % 9 == 0 { 1.0 } else { 1.0 + 10_f32.powf(9.0 * stream.unit() - 2.0) };
                let share = 0.999 * stream.unit().powi(3) + 1e-9;
                [population, share, 1.2 * stream.unit(), (1 + stream.below(200)) as f32]
            });
            let text = "return vec4f(
                expected_unique(a.x, u32(a.w)), covered(min(a.z, 0.9), a.y, a.w), f32(samples_needed(a.z, a.y, a.x)),
                at_least(u32(a.w) % 30u, min(a.z, 1.0)));";
            let found = card.evaluate(text, &cases);
            let mut other_counts = 0;
            for ([[population, share, wanted, count], ..], found) in cases.iter().zip(found) {
                let case = format!("seed 44: N {population}, a {share}, C {wanted}, k {count}: {found:?}");
                let samples = *count as u32;
                let unique = expected_unique(*population, samples);
                assert_eq!(relative(&found[..1], &[unique], 1e-5), 0, "{case} {unique}");
                let confidence = covered(wanted.min(0.9), *share, *count);
                assert_eq!(relative(&found[1..2], &[confidence], 1e-5), 0, "{case} {confidence}");
                let needed = samples_needed(*wanted, *share, *population).unwrap_or(0);
                // Rounding decides where a whole number of samples is just enough, or as many as there are particles.
                let is_near = found[2] as u32 == needed
                    || (found[2] - needed as f32).abs() <= 1e-5 * needed as f32
                    || (found[2] > 1e9 && needed > 1_000_000_000);
                other_counts += usize::from(!is_near);
                let enough = accumulator.at_least(samples % 30, wanted.min(1.0));
                assert_eq!(differing(&found[3..], &[enough], 1e-5, 1.0), 0, "{case} {enough}");
            }
            assert!(other_counts * 500 < COUNT, "seed 44: {other_counts} of {COUNT}");
        });
    }
}

/// A histogram of the CPU for each of some rays, through a view's pixels, that end somewhere.
fn marches(view: &View, grid: &DensityGrid, interpolation: Interpolation, stream: &mut Stream) -> Vec<March> {
    let march = |number: usize| {
        let [x, y] = [0, 1].map(|_| 0.5 + stream.below(64) as f32);
        let mut ray = view.ray(x, y);
        ray.t_max = if number.is_multiple_of(3) { 2.0 + 2.0 * stream.unit() } else { f32::MAX };
        let mut histogram = Histogram::default();
        histogram.march(grid, view, &ray, interpolation);
        March { x, y, t_max: ray.t_max, depth: 1.0 + 4.0 * stream.unit(), histogram }
    };
    (0..COUNT).map(march).collect()
}

/// A view of the unit cube, which holds the particles.
fn view_of_grid(number: usize, stream: &mut Stream) -> View {
    let mut camera = camera(number, stream);
    camera.eye += 0.5;
    camera.look_at += 0.5;
    camera.view(DVec3::ZERO, SIZE[0], SIZE[1]).unwrap()
}

struct March {
    x: f32,
    y: f32,
    t_max: f32,
    depth: f32,
    histogram: Histogram,
}

#[test]
fn marches_through_the_grid_are_those_of_the_cpu() {
    for (number, interpolation) in
        [Interpolation::Nearest, Interpolation::Trilinear].into_iter().cycle().take(6).enumerate()
    {
        let options = Options { density_interpolation: interpolation, ..OPTIONS() };
        on_card(options, |_, scene, mut card| {
            let grid = DensityGrid::new(scene.structure(), options.voxel_count).unwrap();
            let mut stream = Stream::new(45, number as u64);
            let view = view_of_grid(number / 2, &mut stream);
            let marches = marches(&view, &grid, interpolation, &mut stream);
            let inputs: Vec<_> = marches
                .iter()
                .map(|of| [[of.x, of.y, of.t_max, of.depth], [0.0; 4], [0.0; 4], [0.0; 4]])
                .collect();
            let text = format!(
                "let view = {};
                var ray = view_ray(view, a.x, a.y);
                ray.t_max = a.z;
                let histogram = march(view, ray, at);
                return vec4f(histogram.total, before(histogram, a.w), behind(histogram, a.w), back_of_slab(histogram, a.w));",
                written(&layout::View::of(&view))
            );
            let found = card.altered(view.perspective, |text| text, &text, &inputs);
            let (mut differs, mut filled) = (0, 0);
            for (of, found) in marches.iter().zip(found) {
                let March { histogram, depth, .. } = of;
                let total = histogram.total();
                filled += usize::from(total > 0.0);
                let counts = [total, histogram.before(*depth), histogram.behind(*depth)];
                let other_counts = differing(&found[..3], &counts, 2e-4, total.max(1e-6));
                let other_back = differing(&found[3..], &[histogram.back_of_slab(*depth)], 1e-4, 4.0);
                differs += usize::from(other_counts + other_back > 0);
            }
            println!("camera {number}: {differs} of {filled} differ");
            // A sample on the border of two voxels, or a depth on that of two slabs, may fall into either.
            assert!(filled > COUNT / 10 && differs * 100 < filled, "camera {number}: {differs} of {filled}");
        });
    }
}

#[test]
fn a_sample_leads_to_what_it_leads_to_on_the_cpu() {
    for (number, options) in [
        OPTIONS(),
        Options { population: Population::UpToDepth, ..OPTIONS() },
        Options { sample_budget: 90, ..OPTIONS() },
    ]
    .into_iter()
    .enumerate()
    {
        on_card(options, |_, scene, mut card| {
            let grid = DensityGrid::new(scene.structure(), options.voxel_count).unwrap();
            let mut stream = Stream::new(46, number as u64);
            let view = view_of_grid(number, &mut stream);
            let marches = marches(&view, &grid, Interpolation::Nearest, &mut stream);
            let accumulator = Accumulator::new(options.sample_budget, options.population);
            let mut inputs = Vec::new();
            let mut expected: Vec<[f32; 8]> = Vec::new();
            for March { x, y, t_max, depth, histogram } in &marches {
                let mut estimate = |depth: f32| Estimate {
                    depth: if stream.below(8) == 0 { f32::INFINITY } else { depth },
                    confidence: stream.unit(),
                    next: 1 + stream.below(60) as u32,
                    unique: 3.0 * stream.unit(),
                };
                let (accumulation, cull) = (estimate(depth * 1.2), estimate(depth * 1.1));
                let mut pixel = Pixel { accumulation, cull, ..Pixel::NEW };
                let share = 0.5 * stream.unit();
                let depth =
                    if stream.below(4) == 0 { cull.depth.min(9.0) } else { depth * stream.range(0.9, 1.3) };
                let written =
                    |of: Estimate| [of.depth.min(f32::MAX), of.confidence, of.next as f32, of.unique];
                inputs.push([
                    [*x, *y, *t_max, depth],
                    written(accumulation),
                    written(cull),
                    [share, expected.len() as f32, 0.0, 0.0],
                ]);
                let chance = || unit_f32(hash4([*x as u32, expected.len() as u32, 0, 5])[0]);
                accumulator.add(&mut pixel, histogram, depth, share, chance);
                let after = [pixel.accumulation, pixel.cull].map(written);
                expected.push(std::array::from_fn(|at| after[at / 4][at % 4]));
            }
            let of = |field: &str| {
                format!(
                    "let view = {};
                    var ray = view_ray(view, a.x, a.y);
                    ray.t_max = a.z;
                    let histogram = march(view, ray, at);
                    let pixel = Pixel(Estimate(b.x, b.y, u32(b.z), b.w), Estimate(c.x, c.y, u32(c.z), c.w), FAR, 0u);
                    let key = vec4u(u32(a.x), u32(d.y), 0u, culling.seed);
                    let after = add_sample(pixel, histogram, a.w, d.x, key).{field};
                    return vec4f(after.depth, after.confidence, f32(after.next), after.unique);",
                    written(&layout::View::of(&view))
                )
            };
            let [accumulation, cull] = ["accumulation", "cull"]
                .map(|field| card.altered(view.perspective, |text| text, &of(field), &inputs));
            let mut differs = 0;
            for (k, expected) in expected.iter().enumerate() {
                let others = relative(&accumulation[k], &expected[..4], 1e-3)
                    + relative(&cull[k], &expected[4..], 1e-3);
                differs += usize::from(others > 0);
            }
            println!("options {number}: {differs} of {COUNT} differ");
            // Where a voxel is another, or a random number lies at the acceptance probability.
            assert!(differs * 100 < COUNT, "seed 46, options {number}: {differs} of {COUNT}");
        });
    }
}
