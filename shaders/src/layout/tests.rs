//! Mirrors have the bytes that naga reads in the WGSL.

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
            vertices,
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
            pad,
            layer,
            sides,
            first,
            end
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
            lens_path,
            lens_keys,
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
            marks,
            kind,
            paint,
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
            places,
            layer
        }),
        rust_layout!(Veil {
            transmittance,
            held_out,
            seen,
            going
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
            vertices,
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
        ("rates: u32,", "rates: u32, extra: u32,"),
        ("struct Instance", "struct Copy"),
        ("grid: u32", "mesh: u32"),
        ("dir: vec3<f32>", "dir: vec4<f32>"),
    ] {
        let changed = SOURCE.replacen(from, to, 1);
        assert_ne!(changed, SOURCE, "{from} is in the text");
        assert!(!differences(&changed).is_empty(), "{from} -> {to}");
    }
}
