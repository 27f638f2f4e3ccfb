//! Rust mirrors of the structs in `layout.wgsl`, in the layout of a storage buffer.
//!
//! Bytes that WGSL leaves as padding are named `_pad` here, so that the mirrors are plain old data
//! and can be cast to bytes. Spaces and units are those of the WGSL text.

use bytemuck::{Pod, Zeroable};

/// The WGSL text that declares the structs of this module.
pub const SOURCE: &str = include_str!("wgsl/layout.wgsl");

/// One micropolygon grid of a diced mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct GridHeader {
    /// Number of the grid's first lattice vertex.
    pub first_vertex: u32,
    /// Authored face that the grid lies on.
    pub element: u32,
    /// Micropolygons along u in the low 16 bits, along v in the high 16; each 1 to 16.
    pub rates: u32,
}

/// A ray at one instant, world space relative to the world's origin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: [f32; 3],
    /// Hits nearer than this are ignored; `t` is in units of `dir`'s length.
    pub t_min: f32,
    /// Need not be unit length.
    pub dir: [f32; 3],
    /// Hits farther than this are ignored; finite on the GPU.
    pub t_max: f32,
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// Where its hit goes.
    pub number: u32,
    /// Filter weight of its sample, mean 1.
    pub weight: f32,
    /// Squared distance of its sample from the pixel's centre, pixels.
    pub distance2: f32,
}

/// The nearest micropolygon along a ray.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Distance in units of the ray's `dir`; means nothing for a miss.
    pub t: f32,
    /// Position inside the cell along u, 0 to 1.
    pub u: f32,
    /// Position inside the cell along v, 0 to 1.
    pub v: f32,
    /// Instance in the world; `u32::MAX` for a miss.
    pub instance: u32,
    /// Grid of the instance's object.
    pub grid: u32,
    /// Cell of the grid.
    pub cell: u32,
}

/// One object: where its parts are in the buffers of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Object {
    /// Reference to the root of its tree, as `slabs.wgsl` has it.
    pub root: u32,
    /// First word of its [`GridHeader`]s.
    pub grids: u32,
    /// First float of its vertices.
    pub planes: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys.
    pub key_count: u32,
    /// Largest magnitude of any coordinate or bound.
    pub radius: f32,
    /// First word of the numbers that its grids have in the whole object, where a page has only some of them;
    /// `u32::MAX` where they are all there. They ascend.
    pub numbers: u32,
    /// How many grids it has here.
    pub grid_count: u32,
}

/// One instance of an object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Instance {
    /// Its number in the world.
    pub number: u32,
    /// Number of its object in the page.
    pub object: u32,
    /// First of its rows of matrices: 1 of a translation, 3 of a fixed matrix, 3 a key of moving ones.
    pub matrices: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys; 0 for a translation, 1 for a fixed matrix.
    pub key_count: u32,
}

/// What a launch of the stage `trace` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TraceLaunch {
    /// Reference to the root of the tree over instances.
    pub root: u32,
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Number of the page; from the second on there are hits already.
    pub page: u32,
    /// Bounds the magnitude of every coordinate of every instance.
    pub radius: f32,
    /// Pad of slab tests against the tree over instances, per unit of distance from the world's origin.
    pub pad: f32,
}

/// Where rays leave a first hit, world space relative to the world's origin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Site {
    /// Off the surface.
    pub origin: [f32; 3],
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// Unit length, on the side that the first ray came from; 0 where there is no site.
    pub normal: [f32; 3],
    /// How far the origin is off the surface.
    pub offset: f32,
}

/// What a launch of the stage `site` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SiteLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Number of the page.
    pub page: u32,
    /// Instances on it.
    pub instances: u32,
    /// First word of their numbers, which ascend, and after these of the place of each; `u32::MAX` where they are their places.
    pub places: u32,
}

/// What a launch of the stage `scatter` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ScatterLaunch {
    /// Of all patterns; the lower word first.
    pub seed: [u32; 2],
    /// Digits of a net's numbers.
    pub digits: u32,
    /// Rays of a site.
    pub samples: u32,
    /// Rays of all sites.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// What is added to the numbers of sites, for their patterns.
    pub first: u32,
    /// What is farther occludes nothing; scene units.
    pub reach: f32,
}

/// What a launch of the stage `order` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct OrderLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Bits of a ray's number in its run.
    pub run_bits: u32,
    /// Bits of each axis of a direction.
    pub direction_bits: u32,
    /// Bits of a time.
    pub time_bits: u32,
}

/// What a launch of the stage `share` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ShareLaunch {
    /// Hits there are.
    pub hit_count: u32,
    /// Hits of one row of workgroups.
    pub row: u32,
    /// Rays of a hit.
    pub samples: u32,
}

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
    /// To the next multiple of 16 bytes; its content means nothing.
    pub _pad: [u32; 3],
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

/// How an instance looks. Places are words of a scene's paints.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Look {
    /// 1: it takes rays away, and gives nothing.
    pub matte: u32,
    /// Of its colour: 0 one for all, 1 one a face, 2 one a vertex.
    pub kind: u32,
    /// First word of its colours, or of its own.
    pub paint: u32,
    /// Faces that have one.
    pub items: u32,
    /// Words from one colour to the next.
    pub stride: u32,
    /// Words of a colour at one key.
    pub lanes: u32,
    /// Its key times.
    pub paint_times: u32,
    /// How many; 0 where nothing changes.
    pub paint_keys: u32,
    /// Octahedral normals of its vertices.
    pub normals: u32,
    /// How many keys they have; 0 without any.
    pub normal_keys: u32,
}

/// What a launch of the stage `shade` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ShadeLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Radiance of a white surface that looks along the axis of view.
    pub light: f32,
    /// Number of the page.
    pub page: u32,
    /// Instances on it.
    pub instances: u32,
    /// First word of their numbers, which ascend, and after these of the place of each; `u32::MAX` where they are their places.
    pub places: u32,
}

/// What one camera sample brings home.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sample {
    /// Premultiplied radiance, and coverage.
    pub color: [f32; 4],
    /// Filter weight, mean 1.
    pub weight: f32,
    /// Squared distance from the pixel's centre, pixels.
    pub distance2: f32,
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// To the next multiple of 16 bytes; its content means nothing.
    pub _pad: f32,
}

/// What samples of a pixel add up to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Pixel {
    /// Weighted.
    pub red: f32,
    /// Weighted.
    pub green: f32,
    /// Weighted.
    pub blue: f32,
    /// Weighted coverage.
    pub alpha: f32,
    /// Of all weights.
    pub weight: f32,
    /// Of the sample nearest to the pixel's centre.
    pub distance2: f32,
    /// Its time.
    pub time: f32,
    /// What it met first.
    pub hit: Hit,
}

/// An object whose tree is made on the device.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildObject {
    /// Its first grid, among the grids of all such objects.
    pub first_grid: u32,
    /// First word of its [`GridHeader`]s.
    pub grids: u32,
    /// First float of its vertices.
    pub planes: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys.
    pub key_count: u32,
}

/// What a dispatch of the stages that make trees works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildLaunch {
    /// Items of all objects.
    pub items: u32,
    /// Objects.
    pub objects: u32,
    /// Grids of all objects.
    pub grids: u32,
    /// Bits of an axis of a Morton number.
    pub bits: u32,
    /// Workgroups that items are sorted by.
    pub tiles: u32,
    /// Place of the first unit of the bound buffer of nodes.
    pub base: u32,
    /// Place of the first block.
    pub blocks: u32,
    /// Place of the first node.
    pub nodes: u32,
    /// First word of the blocks' frames.
    pub frames: u32,
    /// The first item or node of this dispatch, or the lowest bit of a digit.
    pub first: u32,
    /// The one after the last.
    pub end: u32,
}

/// How far the stages `cluster` and `collapse` are.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildState {
    /// Clusters.
    pub count: u32,
    /// Nodes of the binary tree.
    pub inner: u32,
    /// Clusters before the last round.
    pub count_before: u32,
    /// Nodes before it.
    pub inner_before: u32,
    /// Nodes that the last round made; 0 where all is done, 1 at first.
    pub made: u32,
    /// 1: the next round takes all areas as equal.
    pub equal: u32,
    /// Level of nodes that is opened next.
    pub level: u32,
    /// First node of each level.
    pub levels: [u32; 256],
}

/// What became of an object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BuildOutcome {
    /// Reference to the root of its tree.
    pub root: u32,
    /// Entries of the stack that a walk through it needs.
    pub need: u32,
    /// Largest magnitude of any coordinate or bound.
    pub radius: f32,
    /// Areas of all nodes, in parts of the root's: about the nodes that a ray opens which meets that.
    pub cost: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use naga::TypeInner;
    use naga::proc::Layouter;
    use std::mem::{align_of, offset_of, size_of};

    /// A struct as one side lays it out.
    #[derive(Debug, PartialEq)]
    struct Layout {
        name: String,
        size: usize,
        /// Name, offset and size in bytes.
        members: Vec<(String, usize, usize)>,
    }

    fn size_of_member<T, M>(_: fn(&T) -> &M) -> usize {
        size_of::<M>()
    }

    macro_rules! rust_layout {
        ($name:ident { $($member:ident),* }) => {{
            // Exhaustive on purpose: a new field that the list lacks does not compile.
            #[allow(clippy::no_effect_underscore_binding, reason = "only its pattern matters")]
            fn _exhaustive($name { $($member: _),* }: $name) {}
            Layout {
                name: stringify!($name).to_owned(),
                size: size_of::<$name>(),
                members: vec![$((
                    stringify!($member).to_owned(),
                    offset_of!($name, $member),
                    size_of_member(|s: &$name| &s.$member),
                )),*],
            }
        }};
    }

    fn rust_layouts() -> Vec<Layout> {
        vec![
            rust_layout!(GridHeader {
                first_vertex,
                element,
                rates
            }),
            rust_layout!(Ray {
                origin,
                t_min,
                dir,
                t_max,
                time,
                number,
                weight,
                distance2
            }),
            rust_layout!(Hit {
                t,
                u,
                v,
                instance,
                grid,
                cell
            }),
            rust_layout!(Object {
                root,
                grids,
                planes,
                key_times,
                key_count,
                radius,
                numbers,
                grid_count
            }),
            rust_layout!(Instance {
                number,
                object,
                matrices,
                key_times,
                key_count
            }),
            rust_layout!(TraceLaunch {
                root,
                ray_count,
                row,
                page,
                radius,
                pad
            }),
            rust_layout!(Site {
                origin,
                time,
                normal,
                offset
            }),
            rust_layout!(SiteLaunch {
                ray_count,
                row,
                page,
                instances,
                places
            }),
            rust_layout!(ScatterLaunch {
                seed,
                digits,
                samples,
                ray_count,
                row,
                first,
                reach
            }),
            rust_layout!(OrderLaunch {
                ray_count,
                row,
                run_bits,
                direction_bits,
                time_bits
            }),
            rust_layout!(ShareLaunch {
                hit_count,
                row,
                samples
            }),
            rust_layout!(Camera {
                column_x,
                column_y,
                column_z,
                place,
                arc,
                arc_along,
                half_axes,
                lens_offset,
                corner,
                window_size,
                resolution,
                clipping,
                time_window,
                seed,
                digits,
                orthographic,
                lens_radius,
                focus_distance,
                blade_start,
                curve_step,
                filter_width,
                filter_weight,
                filter_cells,
                filter_table,
                filter_guide,
                curve,
                curve_pieces,
                blades,
                blade_sides,
                keys,
                key_count,
                planes,
                plane_count,
                _pad
            }),
            rust_layout!(TileSamples {
                x,
                y,
                width,
                height,
                first_sample,
                count,
                first_ray,
                first_pixel,
                block
            }),
            rust_layout!(TilesLaunch {
                row,
                tile_count,
                first_sample
            }),
            rust_layout!(Look {
                matte,
                kind,
                paint,
                items,
                stride,
                lanes,
                paint_times,
                paint_keys,
                normals,
                normal_keys
            }),
            rust_layout!(ShadeLaunch {
                ray_count,
                row,
                light,
                page,
                instances,
                places
            }),
            rust_layout!(Sample {
                color,
                weight,
                distance2,
                time,
                _pad
            }),
            rust_layout!(Pixel {
                red,
                green,
                blue,
                alpha,
                weight,
                distance2,
                time,
                hit
            }),
            rust_layout!(BuildObject {
                first_grid,
                grids,
                planes,
                key_times,
                key_count
            }),
            rust_layout!(BuildLaunch {
                items,
                objects,
                grids,
                bits,
                tiles,
                base,
                blocks,
                nodes,
                frames,
                first,
                end
            }),
            rust_layout!(BuildState {
                count,
                inner,
                count_before,
                inner_before,
                made,
                equal,
                level,
                levels
            }),
            rust_layout!(BuildOutcome {
                root,
                need,
                radius,
                cost
            }),
        ]
    }

    /// The structs of a WGSL text, in its order.
    fn wgsl_layouts(source: &str) -> Vec<Layout> {
        let module = naga::front::wgsl::parse_str(source).expect("layout.wgsl parses");
        let mut layouter = Layouter::default();
        layouter
            .update(module.to_ctx())
            .expect("layout.wgsl has sizes");
        let mut found = Vec::new();
        for (handle, ty) in module.types.iter() {
            let TypeInner::Struct { members, .. } = &ty.inner else {
                continue;
            };
            let members = members
                .iter()
                .map(|m| {
                    let size = layouter[m.ty].size as usize;
                    (m.name.clone().unwrap_or_default(), m.offset as usize, size)
                })
                .collect();
            let name = ty.name.clone().unwrap_or_default();
            found.push(Layout {
                name,
                size: layouter[handle].to_stride() as usize,
                members,
            });
        }
        found
    }

    /// What differs between the two sides; padding needs no partner.
    fn differences(source: &str) -> Vec<String> {
        let rust = rust_layouts();
        let wgsl = wgsl_layouts(source);
        let mut found = Vec::new();
        for Layout {
            name,
            size,
            members,
        } in &wgsl
        {
            let Some(mirror) = rust.iter().find(|l| l.name == *name) else {
                found.push(format!("{name} has no Rust mirror"));
                continue;
            };
            if mirror.size != *size {
                found.push(format!(
                    "{name}: {size} bytes in WGSL, {} in Rust",
                    mirror.size
                ));
            }
            let named = |(name, _, _): &&(String, usize, usize)| !name.starts_with("_pad");
            let mirror: Vec<_> = mirror.members.iter().filter(named).collect();
            let members: Vec<_> = members.iter().filter(named).collect();
            if mirror != members {
                found.push(format!("{name}: {members:?} in WGSL, {mirror:?} in Rust"));
            }
        }
        for mirror in rust {
            if !wgsl.iter().any(|l| l.name == mirror.name) {
                found.push(format!("{} is not in the WGSL", mirror.name));
            }
        }
        found
    }

    #[test]
    fn mirrors_have_the_bytes_of_the_wgsl_structs() {
        assert_eq!(differences(SOURCE), Vec::<String>::new());
        assert_eq!(
            align_of::<Ray>(),
            4,
            "buffers are cast from plain byte vectors"
        );
    }

    #[test]
    fn a_changed_layout_is_noticed() {
        for (from, to) in [
            ("time: f32", "time: f32, late: f32"),
            ("t_min: f32,", ""),
            ("element: u32,", "element: u32, extra: u32,"),
            ("struct Instance", "struct Copy"),
            ("grid: u32", "mesh: u32"),
            ("dir: vec3<f32>", "dir: vec4<f32>"),
        ] {
            let changed = SOURCE.replacen(from, to, 1);
            assert_ne!(changed, SOURCE, "{from} is in the text");
            assert!(!differences(&changed).is_empty(), "{from} -> {to}");
        }
    }
}
