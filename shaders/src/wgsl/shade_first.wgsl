// Stage `shade`: what the first hit of each ray gives, where everything is opaque; the twin of core's render/integrate.rs.
//
// A matte surface takes its ray away and gives nothing, as if nothing were hit. Pages come one after the other; what a ray brings
// home is of the page that its hit is on, and of the first where there is none.

@group(2) @binding(1) var<storage, read> hits: array<Hit>;

// Colour and alpha of a first hit on this instance.
fn surface(ray: Ray, hit: Hit, number: u32) -> vec4<f32> {
    let look = looks[LOOKS * number];
    if (look.marks & MATTE) != 0u {
        return vec4<f32>(0.0);
    }
    if !COLOR && !KEEPS {
        return vec4<f32>(0.0, 0.0, 0.0, 1.0);
    }
    let instance = instances[number];
    let object = objects[instance.object];
    let cell = cell_of(object, hit);
    let n = shading_normal(ray, hit, look, instance, object, cell);
    keep(ray, hit, number, instance, object, cell, n);
    if !COLOR {
        return vec4<f32>(0.0, 0.0, 0.0, 1.0);
    }
    return vec4<f32>(radiance(look, cell, n, ray.time), 1.0);
}

@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.ray_count {
        return;
    }
    let ray = rays[index];
    var hit = hits[ray.number];
    var color = vec4<f32>(0.0);
    if hit.instance == NONE {
        if launch.page != 0u {
            return;
        }
    } else {
        let place = place_of(hit);
        if place.instance == NONE {
            return;
        }
        hit.grid = place.grid;
        color = surface(ray, hit, place.instance);
    }
    samples[ray.number] = Sample(color, ray.weight, ray.distance2, ray.time);
}
