// The next hit after the last is looked for, in the order of hits: also where surfaces coincide. The same code finds the
// distance of a hit each time that it is met, so that it has the same bits and no hit comes twice.

var<private> last: Hit;

fn was_met(t: f32, instance: u32, grid: u32, cell: u32) -> bool {
    return !is_before(last.t, last.instance, last.grid, last.cell, Hit(t, 0.0, 0.0, instance, grid, cell));
}
