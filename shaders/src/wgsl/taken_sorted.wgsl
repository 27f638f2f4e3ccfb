// Rays are taken in this order.

@group(2) @binding(0) var<storage, read> order: array<u32>;

fn taken(index: u32) -> u32 {
    return order[index];
}
