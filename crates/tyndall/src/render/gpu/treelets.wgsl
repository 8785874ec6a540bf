// Single rays through treelets, a thread each. Twin of structure/treelets/mod.rs. `nodes` reads sixteen bytes of nodes of seven times
// as many: four of boxes, two of what is in them, one with how many they are.

// The bit of a place that is a treelet's.
const TREELET: u32 = 0x80000000u;

// Entries that the deepest hierarchy can leave on the stack when the nearest child is followed at once: seven a level.
const RAY_STACK: u32 = 7u * LEVELS + 1u;

struct RayEntry {
    near: f32,
    place: u32,
}

var<private> ray_stack: array<RayEntry, RAY_STACK>;
var<private> ray_stack_size: u32;

// The child to follow next; the others lie on the stack.
var<private> followed: RayEntry;

// Follows the child at once if it is the nearest so far, else keeps it for later.
fn visit(near: f32, is_met: bool, place: u32) {
    if !is_met {
        return;
    }
    var later = RayEntry(near, place);
    if near < followed.near {
        later = followed;
        followed = RayEntry(near, place);
    }
    if later.place != NONE {
        ray_stack[ray_stack_size] = later;
        ray_stack_size++;
    }
}

// Takes the last entry that begins before `t_far`, if nothing is followed; whether something is.
fn follow(t_far: f32) -> bool {
    while followed.place == NONE && ray_stack_size > 0u {
        ray_stack_size--;
        let entry = ray_stack[ray_stack_size];
        if entry.near <= t_far {
            followed = entry;
        }
    }
    return followed.place != NONE;
}

// Where a ray enters and leaves the first or the second four boxes of the node whose words begin at `at`, between its start and `t_far`.
fn cross_half(ray: Ray, inverse: vec3f, at: u32, half: u32, t_far: f32) -> Slabs {
    let head = nodes(at);
    let steps = steps_of(head.w);
    let to_corner = bitcast<vec3f>(head.xyz) - ray.origin;
    let give = (HIT_ROUNDING * (abs(to_corner) + 256.0 * steps) + vec3f(outline.slack)) * abs(inverse);
    let scale = steps * inverse;
    let shift = to_corner * inverse;
    // The lower and the upper steps along each axis.
    let x = nodes(at + 1u);
    let y = nodes(at + 2u);
    let z = nodes(at + 3u);
    let along_x = cross_axis(x[half], x[half + 2u], scale.x, shift.x, give.x);
    let along_y = cross_axis(y[half], y[half + 2u], scale.y, shift.y, give.y);
    let along_z = cross_axis(z[half], z[half + 2u], scale.z, shift.z, give.z);
    return Slabs(
        max(max(along_x.enter, along_y.enter), max(along_z.enter, vec4f(ray.t_min))),
        min(min(along_x.leave, along_y.leave), min(along_z.leave, vec4f(t_far))));
}

// Meets the eight boxes of a node, and keeps those that the ray is in before `t_far`.
fn visit_children(ray: Ray, inverse: vec3f, place: u32, t_far: f32) {
    let at = 7u * place;
    let count = nodes(at + 6u).x;
    for (var half = 0u; half < 2u; half++) {
        let slabs = cross_half(ray, inverse, at, half, t_far);
        let exists = vec4u(0u, 1u, 2u, 3u) + vec4u(4u * half) < vec4u(count);
        let is_met = (slabs.enter <= slabs.leave) & exists;
        let places = nodes(at + 4u + half);
        visit(slabs.enter.x, is_met.x, places.x);
        visit(slabs.enter.y, is_met.y, places.y);
        visit(slabs.enter.z, is_met.z, places.z);
        visit(slabs.enter.w, is_met.w, places.w);
    }
}

fn search(ray: Ray, except: u32, any: bool) -> Met {
    var met = Met(ray.t_max, NONE);
    let inverse = inv_direction(ray.direction);
    ray_stack_size = 0u;
    var place = 0u;
    var is_on = outline.particles > 0u;
    while is_on {
        followed = RayEntry(FAR, NONE);
        if (place & TREELET) != 0u {
            met = search_heap(ray, inverse, heap_of(place & ~TREELET), met, except, any);
            if any && met.node != NONE {
                return met;
            }
        } else {
            visit_children(ray, inverse, place, met.t);
        }
        // What lies behind the nearest hit is hidden.
        is_on = follow(met.t);
        place = followed.place;
    }
    return met;
}
