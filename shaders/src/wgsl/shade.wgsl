// What hits give; the twin of core's trace/shading.rs and shade. shade_first.wgsl and shade_layers.wgsl use it, and what is kept
// beside colours.
//
// A surface is lit by the light that rides on the camera: its colour times how much its normal looks along the axis of
// view, from either side.

// The permutation fixes COLOR (colours are asked for, else only what is covered), TIME (something moves), MOVES (the
// camera does), LENS_CHANGES (its lens does) and NORMALS (these are kept, in whatever space).

@group(1) @binding(0) var<storage, read> looks: array<Look>;
@group(1) @binding(1) var<storage, read> paints: array<u32>;
@group(1) @binding(2) var<uniform> camera: Camera;
@group(1) @binding(3) var<storage, read> tables: array<u32>;
@group(2) @binding(0) var<storage, read> rays: array<Ray>;
@group(2) @binding(2) var<uniform> launch: ShadeLaunch;
@group(2) @binding(3) var<storage, read_write> samples: array<Sample>;

const WORKGROUP: u32 = 64u;
// Instance of a miss.
const NONE: u32 = 0xffffffffu;
// Where the value of a colour, or an opacity, is: one for all, one a grid, one a vertex.
const CONSTANT: u32 = 0u;
const GRIDS: u32 = 1u;
// Marks of a look.
const MATTE: u32 = 1u;

// A unit vector from 16 bits a coordinate: core's octahedral.
fn decoded(bits: u32) -> vec3<f32> {
    let x = (f32(bits & 0xffffu) - 32767.0) / 32767.0;
    let y = (f32(bits >> 16u) - 32767.0) / 32767.0;
    let z = 1.0 - abs(x) - abs(y);
    let fold = max(-z, 0.0);
    return normalize(vec3<f32>(x - select(fold, -fold, x < 0.0), y - select(fold, -fold, y < 0.0), z));
}

// Interpolated between keys and over the cell, in the object's space; any length.
fn smooth_normal(object: Object, look: Look, cell: Cell, time: f32) -> vec3<f32> {
    var place = KeyPlace(0u, 0.0);
    if look.normal_keys == object.key_count {
        place = key_at(object.key_times, object.key_count, time);
    }
    let at = look.normals + cell.first_vertex * look.normal_keys + place.key * cell.count;
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < 4u; i += 1u) {
        if cell.weights[i] != 0.0 {
            var n = decoded(paints[at + cell.corners[i]]);
            if TIME && place.fraction != 0.0 {
                n = mix(n, decoded(paints[at + cell.count + cell.corners[i]]), place.fraction);
            }
            sum += n * cell.weights[i];
        }
    }
    return sum;
}

// A normal, from the object's space to the world's; any length. Where NORMALS
// are asked for fronts stay in front, also where a matrix mirrors that moves.
fn carried_normal(instance: Instance, n: vec3<f32>, time: f32) -> vec3<f32> {
    let at = instance.matrices;
    if instance.key_count == 0u {
        return n;
    }
    if !TIME || instance.key_count == 1u {
        // Columns of the inverse.
        return vec3<f32>(dot(matrices[at].xyz, n), dot(matrices[at + 1u].xyz, n), dot(matrices[at + 2u].xyz, n));
    }
    let place = locate(instance.key_times, instance.key_count, time);
    let a = at + 3u * place.key;
    let x = mix(matrices[a].xyz, matrices[a + 3u].xyz, place.fraction);
    let y = mix(matrices[a + 1u].xyz, matrices[a + 4u].xyz, place.fraction);
    let z = mix(matrices[a + 2u].xyz, matrices[a + 5u].xyz, place.fraction);
    let carried = cross(y, z) * n.x + cross(z, x) * n.y + cross(x, y) * n.z;
    if NORMALS && dot(x, cross(y, z)) < 0.0 {
        return -carried;
    }
    return carried;
}

// Of unit length, in the direction of dP/du x dP/dv of the lattice.
fn geometric_normal(ray: Ray, hit: Hit, instance: Instance, object: Object, cell: Cell) -> vec3<f32> {
    return unit_or_zero(carried_normal(instance, facet_normal(object, cell, hit, ray.time), ray.time));
}

// Of unit length; the geometric one where there are no others, or where these cancel.
fn shading_normal(ray: Ray, hit: Hit, look: Look, instance: Instance, object: Object, cell: Cell) -> vec3<f32> {
    if look.normal_keys != 0u {
        let n = unit_or_zero(carried_normal(instance, smooth_normal(object, look, cell, ray.time), ray.time));
        if any(n != vec3<f32>(0.0)) {
            return n;
        }
    }
    return geometric_normal(ray, hit, instance, object, cell);
}

// A normal as the camera sees it, of unit length.
fn to_camera(n: vec3<f32>, time: f32) -> vec3<f32> {
    let pose = pose_at(time);
    return unit_or_zero(vec3<f32>(dot(pose.x, n), dot(pose.y, n), dot(pose.z, n)));
}

// The value at a key; what it does not have is 0.
fn paint_at(look: Look, cell: Cell, key: u32) -> vec4<f32> {
    var out = vec4<f32>(0.0);
    let first = look.paint + key * look.lanes;
    for (var c = 0u; c < min(look.lanes, 4u); c += 1u) {
        if look.kind == CONSTANT {
            out[c] = bitcast<f32>(paints[first + c]);
        } else if look.kind == GRIDS {
            out[c] = bitcast<f32>(paints[first + cell.grid * look.stride + c]);
        } else {
            for (var i = 0u; i < 4u; i += 1u) {
                if cell.weights[i] != 0.0 {
                    let vertex = cell.first_vertex + cell.corners[i];
                    out[c] += cell.weights[i] * bitcast<f32>(paints[first + vertex * look.stride + c]);
                }
            }
        }
    }
    return out;
}

// The value at a time.
fn painted(look: Look, cell: Cell, time: f32) -> vec4<f32> {
    if !TIME || look.paint_keys < 2u {
        return paint_at(look, cell, 0u);
    }
    var key = 0u;
    while key + 2u < look.paint_keys && bitcast<f32>(paints[look.paint_times + key + 1u]) <= time {
        key += 1u;
    }
    let a = bitcast<f32>(paints[look.paint_times + key]);
    let b = bitcast<f32>(paints[look.paint_times + key + 1u]);
    let fraction = clamp((time - a) / (b - a), 0.0, 1.0);
    let at = paint_at(look, cell, key);
    return at + (paint_at(look, cell, key + 1u) - at) * fraction;
}

// Radiance of a surface that has this normal.
fn radiance(look: Look, cell: Cell, n: vec3<f32>, time: f32) -> vec3<f32> {
    var light = launch.light * abs(to_camera(n, time).z);
    if LENS_CHANGES {
        light *= lens_at(time).exposure;
    }
    return painted(look, cell, time).xyz * light;
}
