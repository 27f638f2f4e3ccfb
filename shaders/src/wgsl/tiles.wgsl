// Pixels of tiles, and the numbers of their rays: as core's render/generate.rs orders them, by tile, block, sample and
// pixel. A workgroup takes 8 by 8 pixels of a tile, an invocation one.

@group(1) @binding(0) var<storage, read> tiles: array<TileSamples>;
@group(1) @binding(1) var<uniform> launch: TilesLaunch;

// Side of the pixels of a workgroup, and of a tile in workgroups.
const SIDE: u32 = 8u;
const ACROSS: u32 = 2u;

struct TilePixel {
    // False beyond the tile, or all tiles.
    is_there: bool,
    tile: u32,
    x: u32,
    y: u32,
    // Number of its first ray, and from one sample to the next.
    first_ray: u32,
    step: u32,
}

fn tile_pixel(group: vec3<u32>, lane: u32) -> TilePixel {
    var out: TilePixel;
    let part = group.y * launch.row + group.x;
    out.tile = part / (ACROSS * ACROSS);
    if out.tile >= launch.tile_count {
        return out;
    }
    let own = tiles[out.tile];
    out.x = part % ACROSS * SIDE + lane % SIDE;
    out.y = part / ACROSS % ACROSS * SIDE + lane / SIDE;
    out.is_there = out.x < own.width && out.y < own.height;
    // The block: pixels before it, its own, and which of them this is.
    let left = out.x / own.block * own.block;
    let top = out.y / own.block * own.block;
    let wide = min(own.block, own.width - min(left, own.width));
    let high = min(own.block, own.height - min(top, own.height));
    out.step = wide * high;
    out.first_ray = own.first_ray + own.count * (top * own.width + left * high) + (out.y - top) * wide + (out.x - left);
    return out;
}
