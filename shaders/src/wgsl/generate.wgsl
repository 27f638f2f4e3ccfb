// Stage `generate`: the camera rays of samples of tiles, into the buffer that `trace` reads; the twin of core's
// render/generate.rs.
//
// An invocation draws all samples of a pixel. Rays are numbered as core numbers them; hits come back by number. Where
// samples have times, the rays of a block stand in another order: first the earliest of each pixel, then the next, since
// those that go through the tree together should see it at nearly one instant.

// The permutation fixes NET, LENS and TIME, as sample.wgsl has them, MOVES: the camera does, and LENS_CHANGES: its lens does.

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> tables: array<u32>;
@group(1) @binding(2) var<storage, read> words: array<u32>;
@group(1) @binding(3) var<storage, read_write> rays: array<Ray>;

// Samples of a pixel that are ordered by time, at most.
const MOST_ORDERED: u32 = 64u;

// The lowest set bit of two words; there is one.
fn lowest(bits: vec2<u32>) -> u32 {
    return select(32u + firstTrailingBit(bits.y), firstTrailingBit(bits.x), bits.x != 0u);
}

// Bits from `n` on.
fn from_bit(n: u32) -> vec2<u32> {
    if n < 32u {
        return vec2<u32>(0xffffffffu << n, 0xffffffffu);
    }
    return vec2<u32>(0u, 0xffffffffu << (n & 31u));
}

// Takes the first of `free` places at `wanted` or after it, else the first of all.
fn take_place(free: ptr<function, vec2<u32>>, wanted: u32) -> u32 {
    var choice = *free & from_bit(wanted);
    if all(choice == vec2<u32>(0u)) {
        choice = *free;
    }
    let place = lowest(choice);
    if place < 32u {
        (*free).x &= ~(1u << place);
    } else {
        (*free).y &= ~(1u << (place & 31u));
    }
    return place;
}

@compute @workgroup_size(64)
fn generate(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let at = tile_pixel(group, lane);
    if !at.is_there {
        return;
    }
    let own = tiles[at.tile];
    let pixel = vec2<i32>(own.x + i32(at.x), own.y + i32(at.y));
    let pattern = pattern_of(camera.seed, camera.digits, pixel);
    var free = ~vec2<u32>(0u);
    if own.count < MOST_ORDERED {
        free = ~from_bit(own.count);
    }
    for (var i = 0u; i < own.count; i += 1u) {
        let drawn = sample_of(pattern, 5u * (own.first_sample + i - launch.first_sample));
        let across = filter_axis(drawn.pixel.x);
        let down = filter_axis(drawn.pixel.y);
        let offset = vec2<f32>(across.x, down.x);
        var time = 0.0;
        var place = i;
        if TIME {
            time = time_of(drawn.time);
            if own.count <= MOST_ORDERED {
                place = take_place(&free, (drawn.time * own.count) >> 24u);
            }
        }
        var point = vec2<f32>(0.0);
        if LENS != PINHOLE {
            point = lens_point(drawn.lens);
        }
        var ray = camera_ray(vec2<f32>(pixel) + 0.5 + offset, point, time);
        ray.number = at.first_ray + i * at.step;
        ray.weight = across.y * down.y;
        ray.distance2 = dot(offset, offset);
        rays[at.first_ray + place * at.step] = ray;
    }
}
