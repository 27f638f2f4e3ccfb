// Filter, shutter and lens: twins of core's film/filter.rs and of its camera, in f32.
//
// Core computes shutter curves and arcs of blades in f64. Here each is put so that nothing cancels, with what the host
// rounds once: a result is off by a few roundings of its own size.

// Farther than any range that is clipped.
const FAR: f32 = 2.0e30;

// One axis of the filter: the offset from the pixel's centre, and the weight.
fn filter_axis(u: f32) -> vec2<f32> {
    let s = 2.0 * u - 1.0;
    if camera.filter_cells == 0u {
        return vec2<f32>(0.5 * camera.filter_width * s, 1.0);
    }
    let share = abs(s);
    let last = camera.filter_cells - 1u;
    var k = tables[camera.filter_guide + min(u32(share * f32(camera.filter_cells)), last)];
    while k < last && number_at(camera.filter_table + 4u * (k + 1u)) <= share {
        k += 1u;
    }
    // Share, start, slope and sign.
    let cell = quadruple_at(camera.filter_table + 4u * k);
    var end = 0.5 * camera.filter_width;
    if k < last {
        end = number_at(camera.filter_table + 4u * (k + 1u) + 1u);
    }
    let x = min(cell.y + (share - cell.x) * cell.z, end);
    return vec2<f32>(select(x, -x, s < 0.0), cell.w * camera.filter_weight);
}

// Words of a piece of the shutter's curve.
const PIECE: u32 = 7u;

// The time of a number in units of 2^-24.
fn time_of(number: u32) -> f32 {
    let open = camera.time_window.x;
    let close = camera.time_window.y;
    if camera.curve_pieces == 0u {
        return open + (close - open) * unit(number);
    }
    // The last piece that begins at the number or before it.
    var low = 0u;
    var high = camera.curve_pieces;
    while low + 1u < high {
        let middle = (low + high) / 2u;
        if tables[camera.curve + PIECE * middle] <= number {
            low = middle;
        } else {
            high = middle;
        }
    }
    // A piece is told from its end that is less open: where that end is, among the numbers and in time; which way
    // the piece goes from there; how open it is there, and how fast it opens. Its area up to a number is then a sum of what
    // does not cancel, and so is the root.
    let at = camera.curve + PIECE * low;
    let steps = f32(i32(number) - i32(tables[at + 1u])) - number_at(at + 2u);
    let direction = number_at(at + 4u);
    let area = max(steps * direction, 0.0) * camera.curve_step;
    let openness = number_at(at + 5u);
    let slope = number_at(at + 6u);
    let root = sqrt(openness * openness + 2.0 * slope * area);
    let divisor = openness + root;
    let passed = select(0.0, 2.0 * area / max(divisor, 1.0e-37), divisor > 0.0);
    return clamp(number_at(at + 3u) + direction * passed, open, close);
}

// A point of the disk as `disk` has it, in polar form: radius, and angle in turns from -1/8 to 7/8.
fn disk_polar(at: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * at - 1.0;
    let size = abs(p);
    if p.x == 0.0 && p.y == 0.0 {
        return vec2<f32>(0.0);
    }
    if size.x > size.y {
        let turn = 0.125 * (p.y / p.x);
        return vec2<f32>(size.x, select(turn + 0.5, turn, p.x > 0.0));
    }
    let turn = 0.25 - 0.125 * (p.x / p.y);
    return vec2<f32>(size.y, select(turn + 0.5, turn, p.y > 0.0));
}

// Newton steps for a point of an arc.
const ARC_STEPS: u32 = 4u;

// The point of a bent side below which `share` of its area lies, as factors of its two vectors.
fn arc_point(share: f32) -> vec2<f32> {
    // 1 - eccentricity and eccentricity: (1 - e) x + e (x - sin(x)) and (1 - e) - (1 - cos(x)) do not cancel.
    let straight = camera.arc.x;
    let e = camera.arc.y;
    let target_area = abs(share) * camera.arc.w;
    var angle = abs(share) * camera.arc.z;
    for (var i = 0u; i < ARC_STEPS; i += 1u) {
        let miss = straight * angle + e * less_sine(angle) - target_area;
        angle -= miss / (straight + e * less_cosine(angle));
    }
    angle = clamp(angle, 0.0, camera.arc.z);
    let at = vec2<f32>(straight - less_cosine(angle), select(sine(angle), -sine(angle), share < 0.0));
    return at * camera.arc_along;
}

// The point of the lens' opening, in units of its radius.
fn lens_point(at: vec2<f32>) -> vec2<f32> {
    if LENS == ROUND {
        return disk(at) * camera.half_axes + camera.lens_offset;
    }
    let polar = disk_polar(at);
    let turn = polar.y - camera.blade_start;
    let place = (turn - floor(turn)) * f32(camera.blades);
    let side = min(u32(place), camera.blades - 1u);
    let share = clamp(2.0 * (place - f32(side)) - 1.0, -1.0, 1.0);
    let vectors = quadruple_at(camera.blade_sides + 4u * side);
    var along = vec2<f32>(1.0, share);
    if camera.arc.z > 0.0 {
        along = arc_point(share);
    }
    return (vectors.xy * along.x + vectors.zw * along.y) * polar.x;
}

// What clipping planes leave of a range; one that begins after its end where nothing is left.
fn clipped(origin: vec3<f32>, dir: vec3<f32>, range: vec2<f32>) -> vec2<f32> {
    var near = range.x;
    var far = range.y;
    for (var i = 0u; i < camera.plane_count; i += 1u) {
        let plane = quadruple_at(camera.planes + 4u * i);
        let at = dot(plane.xyz, origin) + plane.w;
        let slope = dot(plane.xyz, dir);
        // Shaders may assume that no infinity occurs.
        let is_far = abs(slope) * FAR <= abs(at);
        let met = select(-at / select(slope, 1.0, is_far), select(-FAR, FAR, (at > 0.0) != (slope > 0.0)), is_far);
        if slope > 0.0 {
            near = max(near, met);
        } else if slope < 0.0 {
            far = min(far, met);
        } else if at < 0.0 {
            far = -FAR;
        }
    }
    return select(vec2<f32>(1.0, 0.0), vec2<f32>(near, far), near <= far);
}

// The ray through a place of the image and of the lens' opening: core's Camera::ray.
fn camera_ray(raster: vec2<f32>, point: vec2<f32>, time: f32) -> Ray {
    let now = lens_at(time);
    let by = raster / camera.resolution;
    let at = vec2<f32>(now.corner.x + now.window_size.x * by.x, now.corner.y - now.window_size.y * by.y);
    let orthographic = camera.orthographic != 0u;
    var origin = vec3<f32>(select(vec2<f32>(0.0), at, orthographic), 0.0);
    var dir = vec3<f32>(select(at, vec2<f32>(0.0), orthographic), -1.0);
    if LENS != PINHOLE {
        let lens = point * now.radius;
        origin += vec3<f32>(lens, 0.0);
        dir -= vec3<f32>(lens / now.focus_distance, 0.0);
    }
    var range = camera.clipping;
    if camera.plane_count != 0u {
        range = clipped(origin, dir, range);
    }
    let pose = pose_at(time);
    var out: Ray;
    out.origin = pose.x * origin.x + pose.y * origin.y + pose.z * origin.z + pose.place;
    out.dir = pose.x * dir.x + pose.y * dir.y + pose.z * dir.z;
    out.t_min = range.x;
    out.t_max = range.y;
    out.time = time;
    return out;
}
