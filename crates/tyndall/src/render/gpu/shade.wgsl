// Light on what the samples met, into the film: twin of render/shade.rs and of what render/cpu does with it. A thread is a pixel, so
// that the rays of a workgroup toward a light lie side by side.


// Colors that all particles share, or the linear values of bytes.
@group(1) @binding(1) var<uniform> palette: array<vec4f, 256>;

// By pixel: sum of the light of samples that met a particle, and their number.
@group(0) @binding(3) var<storage, read_write> film_sum: array<vec4f>;
// By pixel: what the sample nearest its center met, as distance's bits and node.
@group(0) @binding(4) var<storage, read_write> film_nearest: array<vec2u>;

fn color_byte(at: u32) -> u32 {
    return (colors(at >> 4u)[(at >> 2u) & 3u] >> (8u * (at & 3u))) & 255u;
}

// The color of the particle at `node`.
fn color_of(node: u32) -> vec3f {
    if COLORS == COLORS_PALETTE {
        return palette[color_byte(node)].xyz;
    }
    if COLORS == COLORS_DIRECT {
        let at = 3u * node;
        return vec3f(palette[color_byte(at)].x, palette[color_byte(at + 1u)].x, palette[color_byte(at + 2u)].x);
    }
    return palette[0].xyz;
}

// Where a ray met a particle.
struct Surface {
    position: vec3f,
    normal: vec3f,
}

fn surface_of(ray: Ray, depth: f32, node: u32) -> Surface {
    let sphere = sphere_of(node);
    let outward = ray.origin + ray.direction * depth - sphere.xyz;
    // A sphere so small that rounding leaves no direction faces the eye.
    let length_sq = outward.x * outward.x + outward.y * outward.y + outward.z * outward.z;
    var normal = -ray.direction;
    if length_sq > 1.17549435e-38 {
        normal = outward * (1.0 / sqrt(length_sq));
    }
    return Surface(sphere.xyz + normal * sphere.w, normal);
}

// Adds a pixel's light, and keeps what the sample nearest its center met.
fn add(pixel: vec2u, sum: vec4f) {
    let at = pixel.y * pass_.size.x + pixel.x;
    var total = sum;
    if pass_.is_first == 0u {
        total += film_sum[at];
    }
    film_sum[at] = total;
    let place = (pixel.y % 8u) * 8u + pixel.x % 8u;
    let nearest = pass_.nearest[place >> 2u][place & 3u];
    if nearest != NONE {
        film_nearest[at] = hits[first_hit(pixel) + nearest];
    }
}

// The ray of a pixel's sample.
fn ray_of(pixel: vec2u, sample: u32) -> Ray {
    let point = samples[first_sample(pixel) + sample] + pattern_corner(pixel);
    return view_ray(pass_.view, point.x, point.y);
}

// A light at the eye, or none.
@compute @workgroup_size(8, 8)
fn shade_open(@builtin(global_invocation_id) place: vec3u) {
    let pixel = vec2u(place.x, place.y + pass_.first_row);
    if any(pixel >= pass_.size) {
        return;
    }
    var sum = vec4f(0.0);
    for (var sample = 0u; sample < SAMPLES; sample++) {
        let hit = hits[first_hit(pixel) + sample];
        if hit.y == NONE {
            continue;
        }
        var brightness = 1.0;
        if pass_.lighting == HEADLIGHT {
            let ray = ray_of(pixel, sample);
            let normal = surface_of(ray, bitcast<f32>(hit.x), hit.y).normal;
            brightness = max(-dot(normal, ray.direction), 0.0);
        }
        sum += vec4f(color_of(hit.y) * brightness, 1.0);
    }
    add(pixel, sum);
}

// A key light and a sky, with a shadow ray to each.
@compute @workgroup_size(8, 8)
fn shade_studio(@builtin(global_invocation_id) place: vec3u) {
    let pixel = vec2u(place.x, place.y + pass_.first_row);
    if any(pixel >= pass_.size) {
        return;
    }
    var sum = vec4f(0.0);
    for (var sample = 0u; sample < SAMPLES; sample++) {
        let hit = hits[first_hit(pixel) + sample];
        if hit.y == NONE {
            continue;
        }
        let surface = surface_of(ray_of(pixel, sample), bitcast<f32>(hit.x), hit.y);
        var brightness = 0.0;
        for (var light = 0u; light < 2u; light++) {
            // Direction and radiance.
            let toward = pass_.lights[2u * sample + light];
            let cosine = dot(surface.normal, toward.xyz);
            if cosine > 0.0 && toward.w > 0.0 {
                if !occluded(Ray(surface.position, 0.0, toward.xyz, FAR), hit.y) {
                    brightness += cosine * toward.w;
                }
            }
        }
        sum += vec4f(color_of(hit.y) * brightness, 1.0);
    }
    add(pixel, sum);
}
