// Rays that go on behind what they meet.

struct Veils {
    // Rays that go on to each layer from the second on; the first is for all.
    counts: array<atomic<u32>, 65>,
    // By the numbers of rays.
    each: array<Veil>,
}

// Where hits are: in one buffer, by the numbers of rays, first what of each is seen first, then what it meets in layers of even
// numbers, then in those of odd numbers.
fn hit_place(layer: u32, number: u32) -> u32 {
    return launch.ray_count * (1u + (layer & 1u)) + number;
}

// The place in the buffer of rays of the ray that is the `index`th to go on to this layer; NONE behind the last. Rays stand there
// in any order: none hears of another.
fn going_on(index: u32) -> u32 {
    if launch.layer == 0u {
        return select(NONE, index, index < launch.ray_count);
    }
    if index >= atomicLoad(&veils.counts[launch.layer]) {
        return NONE;
    }
    return veils.each[index].going[launch.layer & 1u];
}
