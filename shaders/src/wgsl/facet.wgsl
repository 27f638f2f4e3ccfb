// The micropolygon that a ray hit: its corners at the ray's time, and its normal; the twin of core's trace/shading.rs. The
// permutation fixes TIME: something moves.

@group(0) @binding(0) var<storage, read> vertices: array<f32>;
@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> objects: array<Object>;
@group(0) @binding(3) var<storage, read> instances: array<Instance>;
@group(0) @binding(4) var<storage, read> matrices: array<vec4<f32>>;

// A hit cell: its grid, and its corners (i,j) (i+1,j) (i+1,j+1) (i,j+1) among the grid's vertices.
struct Cell {
    // Its place on the page.
    grid: u32,
    first_vertex: u32,
    // Vertices of the grid.
    count: u32,
    // Vertices of a row of it.
    columns: u32,
    corners: vec4<u32>,
    // One of them is 0.
    weights: vec4<f32>,
}

// The grid of the hit is its place on the page.
fn cell_of(object: Object, hit: Hit) -> Cell {
    let header = object.grids + 2u * hit.grid;
    let rates = words[header + 1u];
    let nu = rates & 0xffffu;
    let a = hit.cell / nu * (nu + 1u) + hit.cell % nu;
    var out: Cell;
    out.first_vertex = words[header];
    out.grid = hit.grid;
    out.count = (nu + 1u) * ((rates >> 16u) + 1u);
    out.columns = nu + 1u;
    out.corners = vec4<u32>(a, a + 1u, a + nu + 2u, a + nu + 1u);
    if hit.u >= hit.v {
        out.weights = vec4<f32>(1.0 - hit.u, hit.u - hit.v, hit.v, 0.0);
    } else {
        out.weights = vec4<f32>(1.0 - hit.v, 0.0, hit.u, hit.v - hit.u);
    }
    return out;
}

fn key_at(times: u32, count: u32, time: f32) -> KeyPlace {
    if TIME && count > 1u {
        return locate(times, count, time);
    }
    return KeyPlace(0u, 0.0);
}

fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    // Scaled first: squares of small numbers must not vanish.
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    // What is below f32's normal numbers may count as zero, or not.
    if !(largest >= 1.17549435e-38) {
        return vec3<f32>(0.0);
    }
    return normalize(v / largest);
}

fn vertex_at(object: Object, cell: Cell, corner: u32, place: KeyPlace) -> vec3<f32> {
    // A row is all its x, then y, then z.
    let x = corner + 2u * cell.columns * (corner / cell.columns);
    let first = object.vertices + 3u * (cell.first_vertex * object.key_count + place.key * cell.count) + x;
    let p = vec3<f32>(vertices[first], vertices[first + cell.columns], vertices[first + 2u * cell.columns]);
    if !TIME || object.key_count < 2u {
        return p;
    }
    let next = first + 3u * cell.count;
    let q = vec3<f32>(vertices[next], vertices[next + cell.columns], vertices[next + 2u * cell.columns]);
    return p + (q - p) * place.fraction;
}

// In the object's space, of unit length, or 0 for a triangle without area.
fn facet_normal(object: Object, cell: Cell, hit: Hit, time: f32) -> vec3<f32> {
    let place = key_at(object.key_times, object.key_count, time);
    let a = vertex_at(object, cell, cell.corners.x, place);
    let middle = vertex_at(object, cell, cell.corners.z, place) - a;
    if hit.u >= hit.v {
        return unit_or_zero(cross(unit_or_zero(vertex_at(object, cell, cell.corners.y, place) - a), unit_or_zero(middle)));
    }
    return unit_or_zero(cross(unit_or_zero(middle), unit_or_zero(vertex_at(object, cell, cell.corners.w, place) - a)));
}
