// Structs that CPU and GPU share, byte for byte. Rust mirrors: src/layout.rs; a test there compares
// size and offset of every member with what naga reads here.

// One micropolygon grid of a diced mesh.
struct GridHeader {
    // Number of the grid's first lattice vertex.
    first_vertex: u32,
    // Authored face that the grid lies on.
    element: u32,
    // Micropolygons along u in the low 16 bits, along v in the high 16; each 1 to 16.
    rates: u32,
}

// A ray at one instant, world space relative to the world's origin.
struct Ray {
    origin: vec3<f32>,
    // Hits nearer than this are ignored; t is in units of dir's length.
    t_min: f32,
    // Need not be unit length.
    dir: vec3<f32>,
    // Hits farther than this are ignored.
    t_max: f32,
    // In [0, 1] across the shutter.
    time: f32,
}

// The nearest micropolygon along a ray.
struct Hit {
    // Distance in units of the ray's dir. A miss is told by `instance`: shaders may assume that no
    // infinity occurs, so that t of a miss means nothing.
    t: f32,
    // Position inside the cell, 0 to 1.
    u: f32,
    v: f32,
    // 0xffffffff for a miss.
    instance: u32,
    // Grid of the instance's object.
    grid: u32,
    // Cell of the grid.
    cell: u32,
}
