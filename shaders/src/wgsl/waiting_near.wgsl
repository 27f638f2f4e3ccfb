// What waits on a ray's stack: a reference, and where the ray enters it.

alias Waiting = vec2<u32>;

fn waiting(child: u32, near: f32) -> Waiting {
    return Waiting(child, bitcast<u32>(near));
}

fn child_of(entry: Waiting) -> u32 {
    return entry.x;
}

fn near_of(entry: Waiting) -> f32 {
    return bitcast<f32>(entry.y);
}
