// Stage `shade` where surfaces may be seen through: takes in one layer of what rays meet, front to back; the twin of core's
// render/integrate.rs.
//
// A matte surface takes its share of the ray away and gives nothing for it: neither colour nor alpha, nor is it what is seen
// first. Rays of which something is left are noted, to be traced and shaded in the next layer. Pages come one after the other; a
// layer is taken in with the page that its hit is on.
//
// An instance has its opacity after how it looks, as if that were a colour.

@group(2) @binding(1) var<storage, read_write> hits: array<Hit>;
@group(2) @binding(4) var<storage, read_write> veils: Veils;

@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if group.x * WORKGROUP + lane >= launch.row {
        return;
    }
    let index = going_on(group.y * launch.row + group.x * WORKGROUP + lane);
    if index == NONE {
        return;
    }
    let ray = rays[index];
    if launch.layer == 0u && launch.page == 0u {
        samples[ray.number] = Sample(vec4<f32>(0.0), ray.weight, ray.distance2, ray.time);
        veils.each[ray.number].transmittance = 1.0;
        veils.each[ray.number].held_out = 0.0;
        veils.each[ray.number].seen = 0u;
        hits[ray.number].instance = NONE;
    }
    let found = hits[hit_place(launch.layer, ray.number)];
    if found.instance == NONE {
        return;
    }
    let place = place_of(found);
    if place.instance == NONE {
        return;
    }
    var hit = found;
    hit.grid = place.grid;
    let look = looks[LOOKS * place.instance];
    let instance = instances[place.instance];
    let object = objects[instance.object];
    let cell = cell_of(object, hit);
    let opacity = clamp(painted(looks[LOOKS * place.instance + 1u], cell, ray.time).x, 0.0, 1.0);
    // What is not there at all changes nothing.
    if opacity > 0.0 {
        let before = veils.each[ray.number].transmittance;
        var after = before * (1.0 - opacity);
        if after < LEAST_TRANSMITTANCE {
            after = 0.0;
        }
        var held_out = veils.each[ray.number].held_out;
        var color = samples[ray.number].color;
        if (look.marks & MATTE) != 0u {
            held_out += before - after;
        } else {
            let is_first = veils.each[ray.number].seen == 0u;
            if is_first {
                hits[ray.number] = found;
            }
            if COLOR || (KEEPS && is_first) {
                let n = shading_normal(ray, hit, look, instance, object, cell);
                if is_first {
                    keep(ray, hit, place.instance, instance, object, cell, n);
                }
                if COLOR {
                    color += vec4<f32>(radiance(look, cell, n, ray.time) * (opacity * before), 0.0);
                }
            }
        }
        color.w = max(1.0 - after - held_out, 0.0);
        samples[ray.number].color = color;
        veils.each[ray.number].transmittance = after;
        veils.each[ray.number].held_out = held_out;
        veils.each[ray.number].seen = 1u;
        if after == 0.0 {
            return;
        }
    }
    let next = launch.layer + 1u;
    veils.each[atomicAdd(&veils.counts[next], 1u)].going[next & 1u] = index;
}
