//! Progress, statistics, AOVs, image files, rays and hits.

use glam::{DVec3, Vec3};
use hdtrapeze_core::aov::{AovData, AovImage};
use hdtrapeze_core::render::{WorldHit, WorldRay};
use hdtrapeze_delegate::file::{FileType, ImageOptions};
use hdtrapeze_delegate::image::{ExrCompression, ExrOptions, ExrPixelType, PngColor};
use hdtrapeze_delegate::product::RenderVar;
use hdtrapeze_delegate::render_loop::LoopProgress;
use hdtrapeze_delegate::{AovShape, Edits, Progress, State, Statistics};

use super::{pick, refuse};
use crate::constants::*;
use crate::fault::Fault;
use crate::input::{check_slice, flag, slice, text, text_or_empty, texts};
use crate::types::*;

pub(crate) fn progress_to_c(
    from: &Progress,
    edits: Edits,
    render_loop: LoopProgress,
) -> trz_progress {
    trz_progress {
        struct_size: 0,
        state: match from.state {
            State::Idle => TRZ_STATE_IDLE,
            State::Preparing => TRZ_STATE_PREPARING,
            State::Rendering => TRZ_STATE_RENDERING,
            State::Paused => TRZ_STATE_PAUSED,
            State::Finished => TRZ_STATE_FINISHED,
            State::Cancelled => TRZ_STATE_CANCELLED,
            State::Failed => TRZ_STATE_FAILED,
        },
        fraction: from.fraction,
        samples_done: from.samples_done,
        samples_total: from.samples_total,
        seconds: from.seconds,
        seconds_left: from.seconds_left.unwrap_or(-1.0),
        edits: edits.all,
        camera_edits: edits.of_cameras,
        view_starts: render_loop.starts,
        view_readable: render_loop.readable,
        view_converged: render_loop.converged.into(),
        view_stopped: render_loop.stopped.into(),
    }
}

pub(crate) fn statistics_to_c(from: &Statistics) -> trz_statistics {
    trz_statistics {
        struct_size: 0,
        prims: from.prims,
        instances: from.instances,
        objects: from.objects,
        grids: from.grids,
        micropolygons: from.micropolygons,
        limit_evaluations: from.limit_evaluations,
        geometry_bytes: from.geometry_bytes,
        bvh_bytes: from.bvh_bytes,
        bvh_nodes: from.bvh_nodes,
        film_bytes: from.film_bytes,
        peak_bytes: from.peak_bytes,
        translate_seconds: from.translate_seconds,
        dice_seconds: from.dice_seconds,
        build_seconds: from.build_seconds,
        trace_seconds: from.trace_seconds,
        total_seconds: from.total_seconds,
        rays: from.rays,
        node_tests: from.node_tests,
        cell_tests: from.cell_tests,
        objects_diced: from.objects_diced,
        objects_reused: from.objects_reused,
        objects_placed: from.objects_placed,
        clusters: from.clusters,
        clusters_culled: from.clusters_culled,
        micropolygons_culled: from.micropolygons_culled,
    }
}

pub(crate) fn aov_to_c(from: &AovShape) -> trz_aov_desc {
    trz_aov_desc {
        struct_size: 0,
        width: from.width,
        height: from.height,
        components: from.components,
        format: match from.integer {
            true => TRZ_FORMAT_INT32,
            false => TRZ_FORMAT_FLOAT32,
        },
        origin_x: from.origin[0],
        origin_y: from.origin[1],
    }
}

/// The bytes of an AOV's values, in the machine's order.
pub(crate) fn aov_bytes(image: &AovImage) -> &[u8] {
    match &image.data {
        AovData::F32(values) => bytemuck::cast_slice(values),
        AovData::I32(values) => bytemuck::cast_slice(values),
    }
}

pub(crate) fn exr(pixel_type: u32, compression: u32) -> Result<ExrOptions, Fault> {
    let pixels = [ExrPixelType::Half, ExrPixelType::Float];
    let compressions = [
        ExrCompression::None,
        ExrCompression::Rle,
        ExrCompression::Zips,
        ExrCompression::Zip,
        ExrCompression::Piz,
    ];
    Ok(ExrOptions {
        pixel_type: pick(&pixels, pixel_type, "pixel_type")?,
        compression: pick(&compressions, compression, "compression")?,
    })
}

/// Safety: pointers in the struct are null or as the header says.
pub(crate) unsafe fn image(from: &trz_image) -> Result<ImageOptions, Fault> {
    let colors = [PngColor::Linear, PngColor::Srgb];
    if !from.metadata_count.is_multiple_of(2) {
        return refuse("metadata_count", from.metadata_count, "is odd");
    }
    check_slice(from.metadata, from.metadata_count, "metadata")?;
    // SAFETY: as the caller promises.
    let (aovs, metadata, vars) = unsafe {
        (
            texts(from.aovs, from.aov_count, "aovs")?,
            texts(from.metadata, from.metadata_count, "metadata")?,
            render_vars(from.vars, from.var_count)?,
        )
    };
    let (metadata, _) = metadata.as_chunks::<2>();
    let exr = exr(from.pixel_type, from.compression)?;
    Ok(ImageOptions {
        file: pick(&[FileType::Exr(exr), FileType::Png], from.r#type, "type")?,
        color: pick(&colors, from.color, "color")?,
        aovs,
        vars,
        metadata: metadata
            .iter()
            .map(|[name, value]| (name.clone(), value.clone()))
            .collect(),
        partial: flag(from.partial, "partial")?,
    })
}

/// Safety: pointers are null or as the header says.
pub(crate) unsafe fn render_vars(
    first: *const trz_render_var,
    count: usize,
) -> Result<Vec<RenderVar>, Fault> {
    // SAFETY: as the caller promises.
    let vars = unsafe { slice(first, count, "vars") }?;
    vars.iter()
        // SAFETY: as the caller promises.
        .map(|var| unsafe { render_var(var) })
        .collect()
}

/// Safety: pointers in the struct are null or as the header says.
pub(crate) unsafe fn render_var(from: &trz_render_var) -> Result<RenderVar, Fault> {
    // SAFETY: as the caller promises.
    let or_empty = |at, what| unsafe { text_or_empty(at, what) };
    let prefix = or_empty(from.channel_prefix, "channel_prefix")?;
    Ok(RenderVar {
        // SAFETY: as the caller promises.
        path: unsafe { text(from.path, "path") }?.to_owned(),
        source_name: or_empty(from.source_name, "source_name")?,
        source_type: or_empty(from.source_type, "source_type")?,
        data_type: or_empty(from.data_type, "data_type")?,
        format: or_empty(from.format, "format")?,
        name: or_empty(from.name, "name")?,
        channel_prefix: (!from.channel_prefix.is_null()).then_some(prefix),
    })
}

pub(crate) fn ray(from: &trz_ray) -> WorldRay {
    WorldRay {
        origin: DVec3::from_array(from.origin.map(f64::from)),
        dir: Vec3::from_array(from.dir),
        time: from.time,
        t_min: from.t_min,
        t_max: from.t_max,
    }
}

pub(crate) fn hit_to_c(from: &WorldHit) -> trz_hit {
    trz_hit {
        t: from.t,
        u: from.u,
        v: from.v,
        normal: from.normal.to_array(),
        prim_id: from.prim_id,
        instance_id: from.instance_id,
        element_id: from.element_id,
        grid: from.grid,
        cell: from.cell,
    }
}
