// Stage `film`: what the samples of each pixel add up to, in their order; the twin of core's film/tile.rs. The host adds
// the sums to those that there are.

@group(0) @binding(0) var<storage, read> samples: array<Sample>;
@group(0) @binding(1) var<storage, read> hits: array<Hit>;
@group(0) @binding(2) var<storage, read_write> pixels: array<Pixel>;

// Instance of a miss.
const NONE: u32 = 0xffffffffu;
// Farther from its centre than a pixel's filter reaches.
const FAR: f32 = 3.0e38;

@compute @workgroup_size(64)
fn film(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pixel = tile_pixel(group, lane);
    if !pixel.is_there {
        return;
    }
    let own = tiles[pixel.tile];
    var color = vec4<f32>(0.0);
    var means: Means;
    var out: Pixel;
    out.distance2 = FAR;
    out.hit.instance = NONE;
    for (var i = 0u; i < own.count; i += 1u) {
        let number = pixel.first_ray + i * pixel.step;
        let sample = samples[number];
        let hit = hits[number];
        let sees = hit.instance != NONE && is_seen(sample);
        take_in(&means, number, sees);
        color += sample.weight * sample.color;
        out.weight += sample.weight;
        if sample.distance2 < out.distance2 {
            out.distance2 = sample.distance2;
            out.time = sample.time;
            out.hit = hit;
            if !sees {
                out.hit.instance = NONE;
            }
        }
    }
    out.red = color.x;
    out.green = color.y;
    out.blue = color.z;
    out.alpha = color.w;
    let place = own.first_pixel + pixel.y * own.width + pixel.x;
    pixels[place] = out;
    put(&means, place);
}
