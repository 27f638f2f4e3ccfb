// What waits on a ray's stack: a reference alone, since no hit makes the ray shorter.

alias Waiting = u32;

fn waiting(child: u32, near: f32) -> Waiting {
    return child;
}

fn child_of(entry: Waiting) -> u32 {
    return entry;
}

// Nearer than any hit.
fn near_of(entry: Waiting) -> f32 {
    return -3.0e38;
}
