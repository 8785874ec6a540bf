// Where the eye is, and which ray belongs to a point of the picture: twin of scene/camera.rs.

struct View {
    eye: vec3f,
    left: f32,
    forward: vec3f,
    top: f32,
    right: vec3f,
    pixel: f32,
    up: vec3f,
    unused: f32,
}

// The ray through the point (x, y) of the picture, in pixels from its upper left corner.
fn view_ray(view: View, x: f32, y: f32) -> Ray {
    let u = x * view.pixel + view.left;
    let v = view.top - y * view.pixel;
    let across = u * view.right + v * view.up;
    if PERSPECTIVE {
        let toward = across + view.forward;
        let length_sq = toward.x * toward.x + toward.y * toward.y + toward.z * toward.z;
        return Ray(view.eye, 0.0, toward * (1.0 / sqrt(length_sq)), FAR);
    }
    return Ray(across + view.eye, 0.0, view.forward, FAR);
}
