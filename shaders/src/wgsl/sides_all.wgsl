// Both sides of all surfaces are there.

fn come_to(instance: u32) {}

fn passes_side(det: f32, dir_z: f32) -> bool {
    return false;
}
