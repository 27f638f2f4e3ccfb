// The nearest of all hits is looked for, or any.

fn was_met(t: f32, instance: u32, grid: u32, cell: u32) -> bool {
    return false;
}
