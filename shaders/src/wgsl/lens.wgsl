// The lens and the film back: the twin of core's camera/lens.rs. The permutation fixes LENS_CHANGES: they do while the shutter is
// open. What is authored is interpolated, and what rays need is computed from that, as core does.

struct Lens {
    // Top left corner of the window, and its size.
    corner: vec2<f32>,
    window_size: vec2<f32>,
    radius: f32,
    focus_distance: f32,
    // Factor on radiance, where it is not that of all samples.
    exposure: f32,
}

// Words before the keys of a lens: width over height of the image, and how the film back is made to have it.
const LENS_HEAD: u32 = 2u;
// Words of a key: time; half the film back's size, its middle, how far it is; focal length, f-number, distance in focus,
// exposure, radius; 1 where that goes straight to the next key.
const LENS_KEY: u32 = 12u;
// How: the width stays, the height, all is seen, all of the image is filled; or else it is stretched.
const KEEP_WIDTH: u32 = 0u;
const KEEP_HEIGHT: u32 = 1u;
const FIT: u32 = 2u;
const CROP: u32 = 3u;

// Half the window's size, with the image's aspect ratio.
fn conformed(half: vec2<f32>) -> vec2<f32> {
    let aspect = number_at(camera.lens_path);
    let policy = tables[camera.lens_path + 1u];
    let wide = half.x / half.y > aspect;
    if policy == KEEP_WIDTH || (policy == FIT && wide) || (policy == CROP && !wide) {
        return vec2<f32>(half.x, half.x / aspect);
    }
    if policy <= CROP {
        return vec2<f32>(half.y * aspect, half.y);
    }
    return half;
}

fn lens_at(time: f32) -> Lens {
    if !LENS_CHANGES {
        return Lens(camera.corner, camera.window_size, camera.lens_radius, camera.focus_distance, 1.0);
    }
    let first = camera.lens_path + LENS_HEAD;
    var low = 0u;
    while low + 2u < camera.lens_keys && number_at(first + LENS_KEY * (low + 1u)) <= time {
        low += 1u;
    }
    let a = first + LENS_KEY * low;
    let b = a + LENS_KEY;
    let start = number_at(a);
    let f = clamp((time - start) / (number_at(b) - start), 0.0, 1.0);
    // What is the same at both ends stays the same.
    var now: array<f32, 10>;
    for (var i = 0u; i < 10u; i += 1u) {
        let from_key = number_at(a + 1u + i);
        now[i] = from_key + (number_at(b + 1u + i) - from_key) * f;
    }
    let half = conformed(vec2<f32>(now[0], now[1]) / now[4]);
    let centre = vec2<f32>(now[2], now[3]) / now[4];
    var radius = now[9];
    if number_at(a + 11u) == 0.0 {
        radius = now[5] / (2.0 * now[6]);
    }
    return Lens(vec2<f32>(centre.x - half.x, centre.y + half.y), 2.0 * half, radius, now[7], now[8]);
}
