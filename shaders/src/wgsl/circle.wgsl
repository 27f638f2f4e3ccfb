// Sines and cosines, and the disk: what WGSL asks of its own functions is too little for a ray.

const QUARTER_PI: f32 = 0.7853981633974483;

// x - sin(x), for x from -pi/2 to pi/2.
fn less_sine(x: f32) -> f32 {
    let s = x * x;
    return x * s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s * (1.0 / 362880.0 - s * (1.0 / 39916800.0 - s / 6227020800.0)))));
}

fn sine(x: f32) -> f32 {
    return x - less_sine(x);
}

// 1 - cos(x), likewise.
fn less_cosine(x: f32) -> f32 {
    let half = sine(0.5 * x);
    return 2.0 * half * half;
}

fn cosine(x: f32) -> f32 {
    return 1.0 - less_cosine(x);
}

// Unit square to unit disk: core's concentric_disk.
fn disk(at: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * at - 1.0;
    if p.x == 0.0 && p.y == 0.0 {
        return vec2<f32>(0.0);
    }
    if abs(p.x) > abs(p.y) {
        let angle = QUARTER_PI * (p.y / p.x);
        return vec2<f32>(cosine(angle), sine(angle)) * p.x;
    }
    let angle = QUARTER_PI * (p.x / p.y);
    return vec2<f32>(sine(angle), cosine(angle)) * p.y;
}
