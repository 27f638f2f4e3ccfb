// Stage `shade` where surfaces may be seen through: takes in one layer of what rays meet, front to back; the twin of core's
// render/integrate.rs.
//
// A matte surface takes its share of the ray away and gives nothing for it: neither colour nor alpha, nor is it what is seen
// first. A ray of which nothing is left loses its hit, so that nothing is looked for behind it. Pages come one after the other;
// a layer is taken in with the page that its hit is on.
//
// An instance has two looks here: how it looks, and after it its opacity, as if that were a colour.

@group(2) @binding(1) var<storage, read_write> hits: array<Hit>;
@group(2) @binding(4) var<storage, read_write> veils: Veils;

struct Veils {
    // One more than the number of the last layer that rays go on behind.
    layers: atomic<u32>,
    // By the numbers of rays.
    each: array<Veil>,
}

@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.ray_count {
        return;
    }
    let ray = rays[index];
    if launch.layer == 0u && launch.page == 0u {
        samples[ray.number] = Sample(vec4<f32>(0.0), ray.weight, ray.distance2, ray.time);
        veils.each[ray.number] = Veil(1.0, 0.0, 0u);
        hits[ray.number].instance = NONE;
    }
    let at = hit_place(launch.layer, ray.number);
    let found = hits[at];
    if found.instance == NONE {
        return;
    }
    let place = place_of(found);
    if place.instance == NONE {
        return;
    }
    var hit = found;
    hit.grid = place.grid;
    let look = looks[2u * place.instance];
    let instance = instances[place.instance];
    let object = objects[instance.object];
    let cell = cell_of(object, hit);
    let opacity = clamp(painted(looks[2u * place.instance + 1u], cell, ray.time).x, 0.0, 1.0);
    // What is not there at all changes nothing.
    if opacity > 0.0 {
        var veil = veils.each[ray.number];
        let before = veil.transmittance;
        veil.transmittance *= 1.0 - opacity;
        if veil.transmittance < LEAST_TRANSMITTANCE {
            veil.transmittance = 0.0;
        }
        var color = samples[ray.number].color;
        if look.matte != 0u {
            veil.held_out += before - veil.transmittance;
        } else {
            if veil.seen == 0u {
                hits[ray.number] = found;
            }
            if COLOR {
                color += vec4<f32>(radiance(ray, hit, look, instance, object, cell) * (opacity * before), 0.0);
            }
        }
        color.w = max(1.0 - veil.transmittance - veil.held_out, 0.0);
        samples[ray.number].color = color;
        veil.seen = 1u;
        veils.each[ray.number] = veil;
        if veil.transmittance == 0.0 {
            hits[at].instance = NONE;
            return;
        }
    }
    // Few have to tell.
    if atomicLoad(&veils.layers) <= launch.layer {
        atomicMax(&veils.layers, launch.layer + 1u);
    }
}
