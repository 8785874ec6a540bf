// A tile's part of space, and what boxes and spheres cover of it: twin of `Beam` and `Shadow` in render/cpu/tiles.rs, in pixels
// from the tile's middle.

struct Beam {
    across_x: vec3f,
    across_y: vec3f,
    shift: vec2f,
    // Depth along the tile's middle ray: never more than the distance along any of its rays.
    along: vec3f,
    // Largest distance from the eye at which a ray starts, in each coordinate.
    spread: f32,
}

// The beam of the tile of `extent` pixels whose upper left corner is `corner`.
fn beam_of(view: View, corner: vec2f, extent: vec2f) -> Beam {
    let scale = 1.0 / view.pixel;
    let half = 0.5 * extent;
    let middle = vec2f(view.left + (corner.x + half.x) * view.pixel, view.top - (corner.y + half.y) * view.pixel);
    let right = view.right * scale;
    let down = -view.up * scale;
    let shift = vec2f(middle.x * scale, -middle.y * scale);
    if PERSPECTIVE {
        let along = normalize(view.forward + view.right * middle.x + view.up * middle.y);
        return Beam(right - shift.x * view.forward, down - shift.y * view.forward, vec2f(0.0), along, 0.0);
    }
    let reach = abs(middle.x) + abs(middle.y) + (extent.x + extent.y) * view.pixel;
    return Beam(right, down, shift, view.forward, reach);
}

// What something covers: pixels across and down, and where it starts.
struct Shadow {
    low: vec2f,
    high: vec2f,
    near: f32,
    // Where it ends along the view's axis; at or below zero it lies behind the eye.
    far: f32,
}

// How far something reaches to both sides along the beam's axes.
struct Reach {
    along: f32,
    across: vec2f,
    forward: f32,
}

// Of half extents.
fn reach_of_box(view: View, beam: Beam, half: vec3f) -> Reach {
    let across = vec2f(dot(half, abs(beam.across_x)), dot(half, abs(beam.across_y)));
    return Reach(dot(half, abs(beam.along)), across, dot(half, abs(view.forward)));
}

// Of a radius.
fn reach_of_ball(view: View, beam: Beam, radius: f32) -> Reach {
    let across = vec2f(radius * length(beam.across_x), radius * length(beam.across_y));
    return Reach(radius * length(beam.along), across, radius * length(view.forward));
}

// A radius grown by what the rounding of enter_sphere can add to a sphere at `center`, measured from the rays' origins give or
// take `spread`.
fn grown(radius: f32, center: vec3f, spread: f32) -> f32 {
    let distance = abs(center.x) + abs(center.y) + abs(center.z);
    return radius + ((distance + radius) * HIT_ROUNDING + HIT_ROUNDING * spread);
}

// Projects something at `center`, measured from the eye.
fn project(view: View, beam: Beam, center: vec3f, reach: Reach) -> Shadow {
    let near = dot(center, beam.along) - reach.along;
    let middle = vec2f(dot(center, beam.across_x), dot(center, beam.across_y)) - beam.shift;
    let low = middle - reach.across;
    let high = middle + reach.across;
    if !PERSPECTIVE {
        return Shadow(low, high, near, 1.0);
    }
    // The sides that face the axis are divided by the far end, the others by the near one.
    let forward = dot(center, view.forward);
    let front = forward - reach.forward;
    let back = forward + reach.forward;
    if front <= 0.0 {
        return Shadow(vec2f(-FAR), vec2f(FAR), near, back);
    }
    let by_low = select(vec2f(front), vec2f(back), low >= vec2f(0.0));
    let by_high = select(vec2f(back), vec2f(front), high >= vec2f(0.0));
    return Shadow(low / by_low, high / by_high, near, back);
}

// Which quarters of a tile that reaches `half` pixels to both sides a shadow touches, a bit each.
fn quads_of(shadow: Shadow, half: vec2f) -> u32 {
    if any(shadow.low > half) || any(shadow.high < -half) || shadow.far <= 0.0 {
        return 0u;
    }
    let left = select(0u, 5u, shadow.low.x <= 0.0);
    let right = select(0u, 10u, shadow.high.x >= 0.0);
    let upper = select(0u, 3u, shadow.low.y <= 0.0);
    let lower = select(0u, 12u, shadow.high.y >= 0.0);
    return (left | right) & (upper | lower);
}
