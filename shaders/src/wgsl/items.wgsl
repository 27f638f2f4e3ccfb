// What trees are made over: blocks, and loose groups. Which there are follows from the rates of grids alone: core's
// bvh/block.rs, but that nothing is halved and that all strips are loose, two micropolygons a part.

@group(0) @binding(2) var<storage, read> objects: array<BuildObject>;
// First item of each grid, and the place of its first block. Grids that are not sound have none.
@group(0) @binding(3) var<storage, read> starts: array<vec2<u32>>;
// For each object the least and the most of its items' centres, and the largest magnitude of a bound; then a bit
// for each grid, set where it cannot be traced.
@group(0) @binding(4) var<storage, read_write> facts: array<atomic<i32>>;

const FACTS: u32 = 7u;

// An item, and where it is.
struct Item {
    object: u32,
    // Among the grids of all objects, and of its own.
    number: u32,
    grid: u32,
    // Among the items of the grid.
    slot: u32,
}

fn item_at(i: u32) -> Item {
    // The last grid that begins no later; of those that begin there, all but the last have no items.
    var grid = 0u;
    var end = launch.grids;
    while end - grid > 1u {
        let middle = (grid + end) / 2u;
        if starts[middle].x <= i {
            grid = middle;
        } else {
            end = middle;
        }
    }
    var object = 0u;
    end = launch.objects;
    while end - object > 1u {
        let middle = (object + end) / 2u;
        if objects[middle].first_grid <= grid {
            object = middle;
        } else {
            end = middle;
        }
    }
    return Item(object, grid, grid - objects[object].first_grid, i - starts[grid].x);
}

// The word and the bit that say whether a grid cannot be traced.
fn drop_word(number: u32) -> u32 {
    return FACTS * launch.objects + (number >> 5u);
}

fn drop_bit(number: u32) -> i32 {
    return i32(1u << (number & 31u));
}
