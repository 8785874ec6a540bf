// Where a ray meets a sphere: twin of math.rs. Products and sums may be fused here, so that a grazing ray can be decided otherwise.

// Farther than anything: what has met nothing lies there. Neither NaN nor infinity goes into a shader.
const FAR: f32 = 0x1.fffffep+127f;

fn power_of_two(exponent: u32) -> f32 {
    return bitcast<f32>(exponent << 23u);
}

// Three powers of two, of which one word has the biased exponents.
fn steps_of(exponents: u32) -> vec3f {
    return vec3f(
        power_of_two(exponents & 255u), power_of_two((exponents >> 8u) & 255u), power_of_two((exponents >> 16u) & 255u));
}

struct Ray {
    origin: vec3f,
    t_min: f32,
    direction: vec3f,
    t_max: f32,
}

// One over the direction, with nothing near zero.
fn inv_direction(direction: vec3f) -> vec3f {
    let least = select(vec3f(1e-16), vec3f(-1e-16), direction < vec3f(0.0));
    return vec3f(1.0) / select(direction, least, abs(direction) < vec3f(1e-16));
}

fn enter_sphere(ray: Ray, center: vec3f, radius: f32) -> f32 {
    let to_center = center - ray.origin;
    let closest = to_center.x * ray.direction.x + to_center.y * ray.direction.y + to_center.z * ray.direction.z;
    let off_axis = to_center - closest * ray.direction;
    let off_axis_sq = off_axis.x * off_axis.x + off_axis.y * off_axis.y + off_axis.z * off_axis.z;
    let half_chord_sq = radius * radius - off_axis_sq;
    let t = closest - sqrt(max(half_chord_sq, 0.0));
    return select(ray.t_max, t, half_chord_sq > 0.0 && ray.t_min < t && t < ray.t_max);
}
