// Tests of a ray against groups of up to 4x2 micropolygons: the twin of core's trace/cell.rs (Woop, Benthin, Wald,
// "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013).
//
// Vertices are interpolated to the ray's time, translated and sheared, so that the ray becomes the z axis; a triangle is
// hit where its three edge functions do not differ in sign. Without f64, and where products and sums may be fused, an edge
// function near zero may have either sign. So each is computed from its corners in one order, by their coordinates, whichever
// triangle asks: both triangles of an edge get one number with opposite signs, zero counts on both sides, and no ray
// slips through between them.

// A ray prepared for the micropolygons of one object.
struct CellRay {
    origin: vec3<f32>,
    // Axes of the sheared space; the last is the one the ray is longest on.
    axes: vec3<u32>,
    slope: vec2<f32>,
    dir_z: f32,
    key: u32,
    fraction: f32,
}

// Micropolygons of a grid.
struct Rect {
    grid: u32,
    i: u32,
    j: u32,
    w: u32,
    h: u32,
}

// Where the vertices of a grid are.
struct Lattice {
    // First x coordinate at the ray's key, and at the next.
    at_key: u32,
    at_next: u32,
    // Vertices of a row, which is all its x, then y, then z.
    columns: u32,
}

fn cell_ray(origin: vec3<f32>, dir: vec3<f32>, time: f32, object: Object) -> CellRay {
    var out: CellRay;
    let d = abs(dir);
    if d.x >= d.y && d.x >= d.z {
        out.axes = vec3<u32>(1u, 2u, 0u);
    } else if d.y >= d.z {
        out.axes = vec3<u32>(2u, 0u, 1u);
    } else {
        out.axes = vec3<u32>(0u, 1u, 2u);
    }
    out.origin = vec3<f32>(origin[out.axes.x], origin[out.axes.y], origin[out.axes.z]);
    out.dir_z = dir[out.axes.z];
    out.slope = vec2<f32>(dir[out.axes.x], dir[out.axes.y]) / out.dir_z;
    out.key = 0u;
    out.fraction = 0.0;
    if TIME && object.key_count > 1u {
        let place = locate(object.key_times, object.key_count, time);
        out.key = place.key;
        out.fraction = place.fraction;
    }
    return out;
}

// A vertex as the ray sees it, given by where its x is.
fn sheared(ray: CellRay, lattice: Lattice, x: u32) -> vec3<f32> {
    let by = ray.axes * lattice.columns + vec3<u32>(x);
    let a = by + vec3<u32>(lattice.at_key);
    var p = vec3<f32>(vertices[a.x], vertices[a.y], vertices[a.z]);
    if TIME && lattice.at_next != lattice.at_key {
        let b = by + vec3<u32>(lattice.at_next);
        let next = vec3<f32>(vertices[b.x], vertices[b.y], vertices[b.z]);
        p = p + (next - p) * ray.fraction;
    }
    p = p - ray.origin;
    return vec3<f32>(p.xy - p.z * ray.slope, p.z);
}

// Twice the area that the ray sees of the triangle between itself and an edge, with its sign.
fn edge(p: vec3<f32>, q: vec3<f32>) -> f32 {
    let swapped = q.x < p.x || (q.x == p.x && q.y < p.y);
    let a = select(p.xy, q.xy, swapped);
    let b = select(q.xy, p.xy, swapped);
    let area = a.x * b.y - a.y * b.x;
    return select(area, -area, swapped);
}

// True where a hit comes before the best, in the order of hits.
fn is_before(t: f32, instance: u32, grid: u32, cell: u32, best: Hit) -> bool {
    if t != best.t {
        return t < best.t;
    }
    if instance != best.instance {
        return instance < best.instance;
    }
    if grid != best.grid {
        return grid < best.grid;
    }
    return cell < best.cell;
}

// Takes in one triangle of a cell, where that is nearer than the best hit so far (`t` is as far as the ray goes where
// there is none): its edge functions, opposite corner by corner, and the depths of these.
fn offer(best: ptr<function, Hit>, w: vec3<f32>, z: vec3<f32>, second: bool, ray: CellRay, t_min: f32,
         instance: u32, grid: u32, cell: u32) {
    let least = min(w.x, min(w.y, w.z));
    let most = max(w.x, max(w.y, w.z));
    let det = w.x + w.y + w.z;
    if (least < 0.0 && most > 0.0) || det == 0.0 || passes_side(det, ray.dir_z) {
        return;
    }
    // Weights of the second and third corner; their own quotients, so that none is beyond 1.
    let b = w.y / det;
    let c = w.z / det;
    let depth = (w.x / det) * z.x + b * z.y + c * z.z;
    let t = depth / ray.dir_z;
    if t < t_min || !is_before(t, instance, grid, cell, *best) || was_met(t, instance, grid, cell) {
        return;
    }
    let u = select(b + c, b, second);
    let v = select(c, b + c, second);
    *best = Hit(t, min(u, 1.0), min(v, 1.0), instance, grid, cell);
}

// Tests one group.
fn test_group(best: ptr<function, Hit>, rect: Rect, object: Object, ray: CellRay, t_min: f32, instance: u32) {
    var grid = rect.grid;
    if object.numbers != 0xffffffffu {
        grid = words[object.numbers + grid];
    }
    let header = object.grids + 2u * rect.grid;
    let first_vertex = words[header];
    let rates = words[header + 1u];
    let nu = rates & 0xffffu;
    let nv = rates >> 16u;
    let n = (nu + 1u) * (nv + 1u);
    var lattice: Lattice;
    lattice.columns = nu + 1u;
    lattice.at_key = object.vertices + 3u * (first_vertex * object.key_count + ray.key * n);
    lattice.at_next = lattice.at_key;
    if TIME && object.key_count > 1u {
        lattice.at_next = lattice.at_key + 3u * n;
    }
    for (var r = 0u; r < rect.h; r++) {
        let row = 3u * (rect.j + r) * lattice.columns + rect.i;
        let next = row + 3u * lattice.columns;
        var a = sheared(ray, lattice, row);
        var d = sheared(ray, lattice, next);
        var left = edge(d, a);
        for (var c = 0u; c < rect.w; c++) {
            // Corners in turn: a, b, e, d; the diagonal goes from a to e.
            let b = sheared(ray, lattice, row + c + 1u);
            let e = sheared(ray, lattice, next + c + 1u);
            let right = edge(b, e);
            let diagonal = edge(e, a);
            let bottom = edge(a, b);
            let top = edge(e, d);
            let cell = (rect.j + r) * nu + rect.i + c;
            offer(best, vec3<f32>(right, diagonal, bottom), vec3<f32>(a.z, b.z, e.z), false, ray, t_min,
                  instance, grid, cell);
            offer(best, vec3<f32>(top, left, -diagonal), vec3<f32>(a.z, e.z, d.z), true, ray, t_min,
                  instance, grid, cell);
            a = b;
            d = e;
            left = -right;
        }
    }
}
