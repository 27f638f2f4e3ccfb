// Structs that CPU and GPU share, byte for byte. Rust mirrors: src/layout; a test there compares
// size and offset of every member with what naga reads here.

// One micropolygon grid of a diced mesh.
struct GridHeader {
    // Number of the grid's first lattice vertex.
    first_vertex: u32,
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
    // Where its hit goes.
    number: u32,
    // Filter weight of its sample, mean 1.
    weight: f32,
    // Squared distance of its sample from the pixel's centre, pixels.
    distance2: f32,
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

// One object: where its parts are in the buffers of a scene.
struct Object {
    // Reference to the root of its tree; see slabs.wgsl.
    root: u32,
    // First word of its grids in `words`, a GridHeader each.
    grids: u32,
    // First float of its vertices in `vertices`.
    vertices: u32,
    // First of its key times in `words`.
    key_times: u32,
    // Number of keys.
    key_count: u32,
    // Largest magnitude of any coordinate or bound.
    radius: f32,
    // First word of the numbers that its grids have in the whole object, where a page has only some of them; 0xffffffff
    // where they are all there. They ascend.
    numbers: u32,
    // How many grids it has here.
    grid_count: u32,
}

// One instance of an object.
struct Instance {
    // Its number in the world.
    number: u32,
    // Number of its object in the page.
    object: u32,
    // First of its rows in `matrices`: 1 of a translation, 3 of a fixed matrix, 3 a key of moving ones.
    matrices: u32,
    // First of its key times in `words`.
    key_times: u32,
    // Number of keys; 0 for a translation, 1 for a fixed matrix.
    key_count: u32,
}

// What a launch of the stage `trace` works on.
struct TraceLaunch {
    // Reference to the root of the tree over instances.
    root: u32,
    // Rays in the buffer.
    ray_count: u32,
    // Rays of one row of workgroups: launches wider than a device allows have several rows.
    row: u32,
    // Number of the page; from the second on there are hits already.
    page: u32,
    // Bounds the magnitude of every coordinate of every instance.
    radius: f32,
    // Pad of slab tests against the tree over instances, per unit of distance from the world's origin.
    pad: f32,
    // Number of the layer, where rays go on behind what they meet.
    layer: u32,
    // First word of the sides of instances, where some are passed through; see sides_some.wgsl.
    sides: u32,
    // The first ray that is traced.
    first: u32,
    // One past the last.
    end: u32,
}

// Where rays leave a first hit, world space relative to the world's origin.
struct Site {
    // Off the surface.
    origin: vec3<f32>,
    // In [0, 1] across the shutter.
    time: f32,
    // Unit length, on the side that the first ray came from; 0 where there is no site.
    normal: vec3<f32>,
    // How far the origin is off the surface.
    offset: f32,
}

// What a launch of the stage `site` works on.
struct SiteLaunch {
    ray_count: u32,
    // Rays of one row of workgroups.
    row: u32,
    // Number of the page.
    page: u32,
    // Instances on it.
    instances: u32,
    // First of their numbers in `words`, which ascend, and after these the place of each; 0xffffffff where they are their places.
    places: u32,
}

// What a launch of the stage `scatter` works on.
struct ScatterLaunch {
    // Of all patterns; the lower word first.
    seed: vec2<u32>,
    // Digits of a net's numbers.
    digits: u32,
    // Rays of a site, and of all.
    samples: u32,
    ray_count: u32,
    // Rays of one row of workgroups.
    row: u32,
    // What is added to the numbers of sites, for their patterns.
    first: u32,
    // What is farther occludes nothing; scene units.
    reach: f32,
}

// What a launch of the stage `order` works on.
struct OrderLaunch {
    ray_count: u32,
    // Rays of one row of workgroups.
    row: u32,
    // Bits of a ray's number in its run, of each axis of a direction, and of a time.
    run_bits: u32,
    direction_bits: u32,
    time_bits: u32,
}

// What a launch of the stage `share` works on.
struct ShareLaunch {
    hit_count: u32,
    // Hits of one row of workgroups.
    row: u32,
    // Rays of a hit.
    samples: u32,
}

// A camera and what is drawn for it, as camera.wgsl uses it. Places are words of `tables`.
struct Camera {
    // Camera to world, of one that stands still.
    column_x: vec4<f32>,
    column_y: vec4<f32>,
    column_z: vec4<f32>,
    place: vec4<f32>,
    // Of bent blades: 1 - eccentricity, eccentricity, half angle, half area. The half angle of straight ones is 0.
    arc: vec4<f32>,
    // Radius of the arc over the distance of the side's middle, and over half its length.
    arc_along: vec2<f32>,
    // Of the lens' opening, in units of its radius; and what is added.
    half_axes: vec2<f32>,
    lens_offset: vec2<f32>,
    // Top left corner of the window, and its size.
    corner: vec2<f32>,
    window_size: vec2<f32>,
    // Pixels.
    resolution: vec2<f32>,
    // Near and far.
    clipping: vec2<f32>,
    // The part of [0, 1] that times are in.
    time_window: vec2<f32>,
    // Of all patterns; the lower word first.
    seed: vec2<u32>,
    // Digits of a net's numbers.
    digits: u32,
    // 1: rays leave side by side.
    orthographic: u32,
    lens_radius: f32,
    focus_distance: f32,
    // Where the first blade begins, in turns.
    blade_start: f32,
    // Share of the shutter's opening that 2^-24 of a number is.
    curve_step: f32,
    // Pixels.
    filter_width: f32,
    // Magnitude of the weight along one axis.
    filter_weight: f32,
    // 0 for the box.
    filter_cells: u32,
    // Cells, and the cell in which each share begins.
    filter_table: u32,
    filter_guide: u32,
    // Pieces of the shutter's curve; none where it is open evenly.
    curve: u32,
    curve_pieces: u32,
    // Blades, and the two vectors of each.
    blades: u32,
    blade_sides: u32,
    // Keys of the path.
    keys: u32,
    key_count: u32,
    // Clipping planes in camera space: normals and offsets.
    planes: u32,
    plane_count: u32,
    // Of a lens that changes: what lens.wgsl has, and how many keys.
    lens_path: u32,
    lens_keys: u32,
}

// Samples of the pixels of a tile.
struct TileSamples {
    // Left and top pixel.
    x: i32,
    y: i32,
    width: u32,
    height: u32,
    // Number of the first sample, and how many there are.
    first_sample: u32,
    count: u32,
    // Number of the first ray, and of the first pixel.
    first_ray: u32,
    first_pixel: u32,
    // Side of the blocks of pixels that rays are numbered by.
    block: u32,
}

// What a launch of a stage that goes by pixel works on.
struct TilesLaunch {
    // Workgroups in a row: launches wider than a device allows have several rows.
    row: u32,
    tile_count: u32,
    // The sample that the first words of samples are of.
    first_sample: u32,
}

// How an instance looks. Places are words of `paints`.
struct Look {
    // 1: it takes rays away, and gives nothing. 2: its fronts are the backs of its lattices. 4: normals are told for the side that
    // is seen. Of a primvar: the floats that are kept of it.
    marks: u32,
    // Of its colour: 0 one for all, 1 one a grid, 2 one a vertex.
    kind: u32,
    // First word of its colours, or of its own.
    paint: u32,
    // Words from one to the next, and of one at a key.
    stride: u32,
    lanes: u32,
    // Its key times, and how many; 0 where nothing changes.
    paint_times: u32,
    paint_keys: u32,
    // Octahedral normals of its vertices, and how many keys they have; 0 without any.
    normals: u32,
    normal_keys: u32,
}

// What a launch of the stage `shade` works on.
struct ShadeLaunch {
    ray_count: u32,
    // Rays of one row of workgroups.
    row: u32,
    // Radiance of a white surface that looks along the axis of view.
    light: f32,
    // Number of the page.
    page: u32,
    // Instances on it.
    instances: u32,
    // First of their numbers in `words`, which ascend, and after these the place of each; 0xffffffff where they are their places.
    places: u32,
    // Number of the layer, where rays go on behind what they meet.
    layer: u32,
}

// What is left of a ray behind the layers that it has met.
struct Veil {
    // Share that goes on.
    transmittance: f32,
    // Share that matte surfaces took.
    held_out: f32,
    // 1 once something was met that is not wholly transparent.
    seen: u32,
    // Not of this ray: places in the buffer of rays, those that go on to layers of even numbers, and of odd ones.
    going: array<u32, 2>,
}

// What one camera sample brings home.
struct Sample {
    // Premultiplied radiance, and coverage.
    color: vec4<f32>,
    weight: f32,
    distance2: f32,
    time: f32,
}

// What samples of a pixel add up to.
struct Pixel {
    // Weighted.
    red: f32,
    green: f32,
    blue: f32,
    alpha: f32,
    // Of all weights.
    weight: f32,
    // Of the sample nearest to the pixel's centre.
    distance2: f32,
    time: f32,
    hit: Hit,
}

// An object whose tree is made on the device.
struct BuildObject {
    // Its first grid, among the grids of all such objects.
    first_grid: u32,
    // First word of its grids in `words`, a GridHeader each.
    grids: u32,
    // First float of its vertices in `vertices`.
    vertices: u32,
    // First of its key times in `words`.
    key_times: u32,
    // Number of keys.
    key_count: u32,
}

// What a dispatch of the stages that make trees works on.
struct BuildLaunch {
    // Items of all objects.
    items: u32,
    // Objects.
    objects: u32,
    // Grids of all objects.
    grids: u32,
    // Bits of an axis of a Morton number.
    bits: u32,
    // Workgroups that items are sorted by.
    tiles: u32,
    // Place of the first unit of the bound buffer of nodes, of the first block, and of the first node.
    base: u32,
    blocks: u32,
    nodes: u32,
    // First word of the blocks' frames.
    frames: u32,
    // What this dispatch is about: the first item or node and the one after the last, or the lowest bit of a digit.
    first: u32,
    end: u32,
}

// How far the stages `cluster` and `collapse` are.
struct BuildState {
    // Clusters.
    count: u32,
    // Nodes of the binary tree.
    inner: u32,
    // Both as they were before the last round.
    count_before: u32,
    inner_before: u32,
    // Nodes that the last round made; 0 where all is done, 1 at first.
    made: u32,
    // 1: the next round takes all areas as equal.
    equal: u32,
    // Level of nodes that is opened next.
    level: u32,
    // First node of each level.
    levels: array<u32, 256>,
}

// What became of an object.
struct BuildOutcome {
    // Reference to the root of its tree.
    root: u32,
    // Entries of the stack that a walk through it needs.
    need: u32,
    // Largest magnitude of any coordinate or bound.
    radius: f32,
    // Areas of all nodes, in parts of the root's: about the nodes that a ray opens which meets that.
    cost: f32,
}
