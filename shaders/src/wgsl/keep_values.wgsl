// Values of what a ray sees first, whose means AOVs show; the twin of FirstHit in core's render/integrate.rs.
//
// The permutation fixes VALUES (floats that are kept of a ray), and which they are, in this order: NORMAL, NEYE (normals in camera
// space), MOTION (where it goes in the image), and the floats of PRIMVARS, of which each instance has looks, as if they were colours.

@group(3) @binding(0) var<storage, read_write> values: array<f32>;

const KEEPS: bool = true;
// Marks of a look.
const INVERTED: u32 = 2u;
const DOUBLE_SIDED: u32 = 4u;

// A normal on the surface's front, or, of one with two sides, on that which the ray sees.
fn told(ray: Ray, hit: Hit, look: Look, instance: Instance, object: Object, cell: Cell, n: vec3<f32>) -> vec3<f32> {
    let front = select(n, -n, (look.marks & INVERTED) != 0u);
    if (look.marks & DOUBLE_SIDED) == 0u {
        return front;
    }
    let facet = geometric_normal(ray, hit, instance, object, cell);
    return select(front, -front, dot(facet, front) * dot(facet, ray.dir) > 0.0);
}

fn keep(ray: Ray, hit: Hit, number: u32, instance: Instance, object: Object, cell: Cell, n: vec3<f32>) {
    var at = ray.number * VALUES;
    if NORMALS {
        let normal = told(ray, hit, looks[LOOKS * number], instance, object, cell, n);
        if NORMAL {
            for (var i = 0u; i < 3u; i += 1u) {
                values[at + i] = normal[i];
            }
            at += 3u;
        }
        if NEYE {
            let seen = to_camera(normal, ray.time);
            for (var i = 0u; i < 3u; i += 1u) {
                values[at + i] = seen[i];
            }
            at += 3u;
        }
    }
    if MOTION {
        let way = motion(instance, object, cell);
        values[at] = way.x;
        values[at + 1u] = way.y;
        at += 2u;
    }
    // The looks of primvars are the last.
    for (var i = LOOKS - PRIMVARS; i < LOOKS; i += 1u) {
        let look = looks[LOOKS * number + i];
        let value = painted(look, cell, ray.time);
        for (var c = 0u; c < look.marks; c += 1u) {
            values[at + c] = value[c];
        }
        at += look.marks;
    }
}
