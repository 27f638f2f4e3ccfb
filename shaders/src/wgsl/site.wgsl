// Stage `site`: where rays start that leave the first hits: their places, off the surface on the side that the first ray came
// from, its normal there, and the time.
//
// Micropolygons and normals are those of the facet that was hit. A ray that starts there on the normal's side does not meet
// that facet, nor any that goes on from it in its plane or bends away, where these are no farther from their object's origin.
// What tracing may be off by is derived in slabs.wgsl: in the object's space 160 U (|o| + S), where S is the largest coordinate
// of the facet at its keys, and |o| as large; which facet is hit may be off by no more. Besides, in units of U:
// - the place between vertices and keys, 16 S;
// - a matrix, of condition c (the product of both Frobenius norms): its inverse is off by some 10 c, and so 16 c |M| S
//   is what carrying the place to the world and the ray back from there each are off by; no less for what a CPU rounds;
// - places in the world, 4 (|o| + |t|) for a ray from o, and an object at t.
// In the world all of that is larger by 1 / |M^-T n|: normals n go there by M^-T, and planes move apart as these are
// stretched.

// The permutation fixes TIME (something moves). Pages come one after the other; each site is of the page that its hit is on, and of
// the first where there is none.

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read> hits: array<Hit>;
@group(1) @binding(2) var<uniform> launch: SiteLaunch;
@group(1) @binding(3) var<storage, read_write> sites: array<Site>;

const WORKGROUP: u32 = 64u;
// Instance of a miss.
const NONE: u32 = 0xffffffffu;
const U: f32 = 5.9604644775390625e-8;
// Per unit of the largest coordinate: of tracing, and of the place.
const SURFACE_PAD: f32 = (2.0 * 160.0 + 16.0) * U;
const MATRIX_PAD: f32 = 2.0 * 16.0 * U;
const WORLD_PAD: f32 = 4.0 * U;

// The largest coordinate of a vertex at the keys around a time.
fn vertex_reach(object: Object, cell: Cell, corner: u32, place: KeyPlace) -> f32 {
    let first = longest(vertex_at(object, cell, corner, KeyPlace(place.key, 0.0)));
    if !TIME || object.key_count < 2u {
        return first;
    }
    return max(first, longest(vertex_at(object, cell, corner, KeyPlace(place.key, 1.0))));
}

fn site_of(ray: Ray, hit: Hit, instance: Instance) -> Site {
    let none = Site(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0);
    let object = objects[instance.object];
    let cell = cell_of(object, hit);
    let keys = key_at(object.key_times, object.key_count, ray.time);
    var place = vec3<f32>(0.0);
    var size = 0.0;
    for (var i = 0u; i < 4u; i += 1u) {
        place += cell.weights[i] * vertex_at(object, cell, cell.corners[i], keys);
        size = max(size, vertex_reach(object, cell, cell.corners[i], keys));
    }
    let n = facet_normal(object, cell, hit, ray.time);
    let m = placed(instance, ray.time);
    if !m.sound || all(n == vec3<f32>(0.0)) {
        return none;
    }
    let at = m.x * place.x + m.y * place.y + m.z * place.z + m.origin;
    var offset = SURFACE_PAD * size;
    let world = WORLD_PAD * (longest(at) + m.reach);
    var normal = n;
    if m.plain {
        offset += world;
    } else {
        let x = cross(m.y, m.z);
        let y = cross(m.z, m.x);
        let z = cross(m.x, m.y);
        let det = dot(m.x, x);
        normal = (x * n.x + y * n.y + z * n.z) / det;
        let stretch = sqrt(dot(m.x, m.x) + dot(m.y, m.y) + dot(m.z, m.z));
        let shrink = sqrt(dot(x, x) + dot(y, y) + dot(z, z)) / abs(det);
        offset += shrink * (MATRIX_PAD * shrink * stretch * stretch * size + world);
        offset /= max(length(normal), 1.0e-30);
    }
    normal = unit_or_zero(normal);
    if dot(normal, ray.dir) > 0.0 {
        normal = -normal;
    }
    return Site(at + normal * offset, ray.time, normal, offset);
}

@compute @workgroup_size(64)
fn site(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.ray_count {
        return;
    }
    let ray = rays[index];
    var hit = hits[ray.number];
    if hit.instance == NONE {
        if launch.page == 0u {
            sites[ray.number] = Site(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0);
        }
        return;
    }
    let place = place_of(hit);
    if place.instance == NONE {
        return;
    }
    hit.grid = place.grid;
    sites[ray.number] = site_of(ray, hit, instances[place.instance]);
}
