// Rays pass through one side of some surfaces; the twin of core's trace/sides.rs. A word an instance of the page tells which
// side of its lattices that is: none, the front or the back.

const FRONT: u32 = 1u;
const BACK: u32 = 2u;

// Of the instance that the ray is in.
var<private> hidden_side: u32;

fn come_to(instance: u32) {
    hidden_side = words[launch.sides + instance];
}

// True where a triangle of sheared vertices, whose edge functions add up to `det`, shows the ray the side that it passes through.
// Axes were turned in a cycle, and shearing turns nothing over.
fn passes_side(det: f32, dir_z: f32) -> bool {
    return hidden_side == select(FRONT, BACK, (det < 0.0) == (dir_z < 0.0));
}
