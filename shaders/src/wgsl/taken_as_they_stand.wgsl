// Rays are taken as they stand.

fn taken(index: u32) -> u32 {
    return index;
}
