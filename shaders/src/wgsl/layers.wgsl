// Where hits are, where rays go on behind what they meet: in one buffer, by the numbers of rays, first what of each is seen first,
// then what it meets in layers of even numbers, then in those of odd numbers.

fn hit_place(layer: u32, number: u32) -> u32 {
    return launch.ray_count * (1u + (layer & 1u)) + number;
}
