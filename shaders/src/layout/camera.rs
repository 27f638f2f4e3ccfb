//! What draws camera rays.

use bytemuck::{Pod, Zeroable};

/// A camera and what is drawn for it, as `camera.wgsl` uses it. Places are words of its tables.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Camera {
    /// Camera to world, of one that stands still.
    pub column_x: [f32; 4],
    /// Its second column.
    pub column_y: [f32; 4],
    /// Its third column.
    pub column_z: [f32; 4],
    /// Where it is.
    pub place: [f32; 4],
    /// Of bent blades: 1 - eccentricity, eccentricity, half angle, half area. The half angle of straight ones is 0.
    pub arc: [f32; 4],
    /// Radius of the arc over the distance of the side's middle, and over half its length.
    pub arc_along: [f32; 2],
    /// Of the lens' opening, in units of its radius.
    pub half_axes: [f32; 2],
    /// Added to points of the opening.
    pub lens_offset: [f32; 2],
    /// Top left corner of the window.
    pub corner: [f32; 2],
    /// Width and height of the window.
    pub window_size: [f32; 2],
    /// Pixels.
    pub resolution: [f32; 2],
    /// Near and far.
    pub clipping: [f32; 2],
    /// The part of [0, 1] that times are in.
    pub time_window: [f32; 2],
    /// Of all patterns; the lower word first.
    pub seed: [u32; 2],
    /// Digits of a net's numbers.
    pub digits: u32,
    /// 1: rays leave side by side.
    pub orthographic: u32,
    /// Scene units.
    pub lens_radius: f32,
    /// Depth in focus, scene units.
    pub focus_distance: f32,
    /// Where the first blade begins, in turns.
    pub blade_start: f32,
    /// Share of the shutter's opening that 2^-24 of a number is.
    pub curve_step: f32,
    /// Pixels.
    pub filter_width: f32,
    /// Magnitude of the weight along one axis.
    pub filter_weight: f32,
    /// 0 for the box.
    pub filter_cells: u32,
    /// Cells: share, start, slope and sign.
    pub filter_table: u32,
    /// For each share, the cell in which it begins.
    pub filter_guide: u32,
    /// Pieces of the shutter's curve; none where it is open evenly.
    pub curve: u32,
    /// How many.
    pub curve_pieces: u32,
    /// Number of blades.
    pub blades: u32,
    /// The two vectors of each side.
    pub blade_sides: u32,
    /// Keys of the path.
    pub keys: u32,
    /// How many.
    pub key_count: u32,
    /// Clipping planes in camera space: normals and offsets.
    pub planes: u32,
    /// How many.
    pub plane_count: u32,
    /// Of a lens that changes: what `lens.wgsl` has.
    pub lens_path: u32,
    /// How many keys.
    pub lens_keys: u32,
    /// To the next multiple of 16 bytes; its content means nothing.
    pub _pad: u32,
}

/// Samples of the pixels of a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TileSamples {
    /// Left pixel.
    pub x: i32,
    /// Top pixel.
    pub y: i32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
    /// Number of the first sample.
    pub first_sample: u32,
    /// How many there are.
    pub count: u32,
    /// Number of the first ray.
    pub first_ray: u32,
    /// Number of the first pixel.
    pub first_pixel: u32,
    /// Side of the blocks of pixels that rays are numbered by.
    pub block: u32,
}

/// What a launch of a stage that goes by pixel works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TilesLaunch {
    /// Workgroups in a row.
    pub row: u32,
    /// Number of tiles.
    pub tile_count: u32,
    /// The sample that the first words of samples are of.
    pub first_sample: u32,
}
