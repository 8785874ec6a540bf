// Left-balanced heaps: twin of structure/heap. `spheres`, `heaps`, `axes` and `ids` read sixteen bytes each of their arrays. A sphere
// is one element: a ray's thread takes center and radius at once.

struct Outline {
    particles: u32,
    slack: f32,
    // By what the radii of spheres and heaps are scaled.
    radius_scale: f32,
    unused: u32,
}

@group(1) @binding(0) var<uniform> outline: Outline;

fn particle_count() -> u32 {
    return outline.particles;
}

// The id of the particle at `node`.
fn id_of(node: u32) -> u32 {
    return ids(node >> 2u)[node & 3u];
}

// Center and radius of the particle at `node`.
fn sphere_of(node: u32) -> vec4f {
    return bitcast<vec4f>(spheres(node)) * vec4f(1.0, 1.0, 1.0, outline.radius_scale);
}

// A run of particles that is one heap.
struct Heap {
    // The box of its centers.
    low: vec3f,
    // The largest radius in it.
    radius: f32,
    high: vec3f,
    first: u32,
    count: u32,
}

fn heap_of(place: u32) -> Heap {
    let a = heaps(2u * place);
    let b = heaps(2u * place + 1u);
    let end = heaps(2u * place + 3u).w;
    return Heap(bitcast<vec3f>(a.xyz), bitcast<f32>(a.w), bitcast<vec3f>(b.xyz), b.w, end - b.w);
}

// The axis that a heap's node splits.
fn axis_of(first: u32, node: u32) -> u32 {
    let at = (first >> 3u) + node;
    return (axes(at >> 4u)[(at >> 2u) & 3u] >> (8u * (at & 3u))) & 255u;
}

// Where the ray is in the box of a heap, and by how much its planes give way.
struct Through {
    t_near: f32,
    t_far: f32,
    give: vec3f,
}

fn through(ray: Ray, inverse: vec3f, heap: Heap) -> Through {
    let far = abs(0.5 * heap.low + 0.5 * heap.high - ray.origin) + (heap.high - heap.low);
    let farthest = max(far.x, max(far.y, far.z));
    let margin = outline.radius_scale * heap.radius * (1.0 + HIT_ROUNDING) + HIT_ROUNDING * farthest + outline.slack;
    let to_low = (heap.low - margin - ray.origin) * inverse;
    let to_high = (heap.high + margin - ray.origin) * inverse;
    let enter = min(to_low, to_high);
    let leave = max(to_low, to_high);
    return Through(
        max(max(enter.x, enter.y), max(enter.z, ray.t_min)), min(leave.x, min(leave.y, leave.z)), abs(margin * inverse));
}

// The nearer of what was met and the particle at `node`.
fn try_one(ray: Ray, met: Met, node: u32, except: u32) -> Met {
    let sphere = sphere_of(node);
    let t = enter_sphere(ray, sphere.xyz, sphere.w);
    if t < ray.t_max && (!HIDES || shows(node)) {
        return nearer(met, t, node, except);
    }
    return met;
}

// Tries the four levels below the node at place `node` of a heap.
fn try_lowest(ray: Ray, heap: Heap, node: u32, before: Met, except: u32) -> Met {
    var met = before;
    var start = node;
    for (var width = 1u; width <= 8u; width *= 2u) {
        let end = min(start + width, heap.count);
        for (var at = start; at < end; at++) {
            met = try_one(ray, met, heap.first + at, except);
        }
        start = 2u * start + 1u;
    }
    return met;
}

// Whether the node at place `node` of a heap shows anything. Places of the lowest levels may lie behind the last particle.
fn shows_below(heap: Heap, node: u32) -> bool {
    return !HIDES || node >= heap.count || shows_any(heap.first + node);
}

// The nearest of `before` and what the ray meets in a heap; with `any` the first that it finds.
fn search_heap(ray: Ray, inverse: vec3f, heap: Heap, before: Met, except: u32, any: bool) -> Met {
    if HEAP_WALK == STACK_FREE {
        return search_without_stack(ray, inverse, heap, before, except, any);
    }
    return search_with_stack(ray, inverse, heap, before, except, any);
}

// The first node that has at most four levels below it.
fn lowest_of(count: u32) -> u32 {
    return max(1u, (1u << firstLeadingBit(count)) >> 3u) - 1u;
}

struct HeapEntry {
    node: u32,
    t_near: f32,
    t_far: f32,
}

var<private> heap_stack: array<HeapEntry, HEAP_STACK>;

fn search_with_stack(ray: Ray, inverse: vec3f, heap: Heap, before: Met, except: u32, any: bool) -> Met {
    var met = before;
    let whole = through(ray, inverse, heap);
    let lowest = lowest_of(heap.count);
    var region = HeapEntry(0u, whole.t_near, whole.t_far);
    var size = 0u;
    while true {
        if region.t_near <= region.t_far && region.t_near <= met.t && shows_below(heap, region.node) {
            let node = region.node;
            if node >= lowest {
                met = try_lowest(ray, heap, node, met, except);
            } else {
                met = try_one(ray, met, heap.first + node, except);
            }
            if any && met.node != NONE {
                return met;
            }
            if node < lowest {
                let axis = axis_of(heap.first, node);
                let t_split = (sphere_of(heap.first + node)[axis] - ray.origin[axis]) * inverse[axis];
                let near_is_right = u32(inverse[axis] < 0.0);
                // The near side ends a margin behind the plane, the far side begins a margin before it.
                let far = HeapEntry(2u * node + 2u - near_is_right, max(region.t_near, t_split - whole.give[axis]), region.t_far);
                region = HeapEntry(2u * node + 1u + near_is_right, region.t_near, min(region.t_far, t_split + whole.give[axis]));
                if far.t_near <= far.t_far && far.t_near <= met.t {
                    heap_stack[size] = far;
                    size++;
                }
                continue;
            }
        }
        if size == 0u {
            return met;
        }
        size--;
        region = heap_stack[size];
    }
    return met;
}

// The same by going from node to node, up and down: nothing is kept but where it came from. So no more is known of a subtree than that
// the plane above it, not all planes above it, leaves it on the ray.
fn search_without_stack(ray: Ray, inverse: vec3f, heap: Heap, before: Met, except: u32, any: bool) -> Met {
    var met = before;
    let whole = through(ray, inverse, heap);
    if whole.t_near > min(whole.t_far, met.t) {
        return met;
    }
    let lowest = lowest_of(heap.count);
    var node = 0u;
    // The child that was left, or none on the way down.
    var left = NONE;
    while true {
        // What was left was shown.
        let is_shown = left != NONE || shows_below(heap, node);
        if left == NONE && is_shown {
            if node >= lowest {
                met = try_lowest(ray, heap, node, met, except);
            } else {
                met = try_one(ray, met, heap.first + node, except);
            }
            if any && met.node != NONE {
                return met;
            }
        }
        var next = NONE;
        if node < lowest && is_shown {
            let axis = axis_of(heap.first, node);
            let t_split = (sphere_of(heap.first + node)[axis] - ray.origin[axis]) * inverse[axis];
            let near = 2u * node + 1u + u32(inverse[axis] < 0.0);
            let far = 4u * node + 3u - near;
            if left == NONE && t_split + whole.give[axis] >= whole.t_near {
                next = near;
            } else if left != far && t_split - whole.give[axis] <= min(whole.t_far, met.t) {
                next = far;
            }
        }
        if next != NONE {
            node = next;
            left = NONE;
        } else if node == 0u {
            return met;
        } else {
            left = node;
            node = (node - 1u) >> 1u;
        }
    }
    return met;
}

// The particle that the ray enters first, not counting the one at node `except`.
fn intersect(ray: Ray, except: u32) -> Met {
    return search(ray, except, false);
}

// Whether the ray enters any particle but the one at node `except`.
fn occluded(ray: Ray, except: u32) -> bool {
    return search(ray, except, true).node != NONE;
}
