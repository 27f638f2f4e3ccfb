//! C structs to the renderer's types and back. Input is copied; enum values, flags, counts and
//! strings are checked, and whether numbers make sense where nothing later would.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::aov::{AovData, AovImage};
use hdtrapeze_core::render::{WorldHit, WorldRay};
use hdtrapeze_core::scene::{
    CameraDesc, FilterKind, GridsDesc, InstancesDesc, Interpolation, PointsSamples, PrimvarDesc,
    Projection, RenderSettings, TransformSamples, WindowPolicy,
};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, FaceVaryingLinear, Orientation, Scheme, TriangleRule,
};
use hdtrapeze_delegate::file::{FileType, ImageOptions};
use hdtrapeze_delegate::image::{ExrCompression, ExrOptions, ExrPixelType, PngColor};
use hdtrapeze_delegate::{AovShape, AuthoredTopology, Progress, State, Statistics};

use crate::constants::*;
use crate::fault::Fault;
use crate::input::{check_slice, copied, flag, slice, texts, times};
use crate::types::*;

/// Largest width and height of an image, pixels.
const LARGEST_RESOLUTION: u32 = 65_536;
/// Most samples a pixel: the film counts them in f32, which is exact up to 2^24.
const MOST_SAMPLES: u32 = 1 << 20;
/// Most worker threads.
const MOST_THREADS: u32 = 4096;
/// Widest filter, pixels.
const WIDEST_FILTER: f32 = 64.0;
/// Most floats of a primvar's value: a matrix.
const WIDEST_PRIMVAR: u32 = 16;
/// Largest rate of a grid.
const LARGEST_RATE: u16 = 16;

/// The element of `values` that an enum-like field stands for.
fn pick<T: Copy>(values: &[T], number: u32, what: &str) -> Result<T, Fault> {
    let found = usize::try_from(number)
        .ok()
        .and_then(|at| values.get(at).copied());
    found.ok_or_else(|| Fault::invalid(format!("{what} {number} is not known")))
}

fn refuse<T>(what: &str, value: impl std::fmt::Display, why: &str) -> Result<T, Fault> {
    Err(Fault::invalid(format!("{what} {value} {why}")))
}

fn vec3s(floats: &[f32]) -> Result<Vec<Vec3>, Fault> {
    let (points, _) = floats.as_chunks::<3>();
    copied(points, |&p| Vec3::from_array(p))
}

fn matrices(doubles: &[f64]) -> Result<Vec<DMat4>, Fault> {
    let (matrices, _) = doubles.as_chunks::<16>();
    copied(matrices, DMat4::from_cols_array)
}

/// Safety, here and below: pointers in the struct are null or as the header says.
pub(crate) unsafe fn topology<'a>(from: &trz_topology) -> Result<AuthoredTopology<'a>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        Ok(AuthoredTopology {
            scheme: pick(
                &[
                    Scheme::CatmullClark,
                    Scheme::Loop,
                    Scheme::Bilinear,
                    Scheme::None,
                ],
                from.scheme,
                "scheme",
            )?,
            boundary: pick(
                &[
                    BoundaryInterpolation::None,
                    BoundaryInterpolation::EdgeOnly,
                    BoundaryInterpolation::EdgeAndCorner,
                ],
                from.boundary,
                "boundary",
            )?,
            face_varying: pick(
                &[
                    FaceVaryingLinear::None,
                    FaceVaryingLinear::CornersOnly,
                    FaceVaryingLinear::CornersPlus1,
                    FaceVaryingLinear::CornersPlus2,
                    FaceVaryingLinear::Boundaries,
                    FaceVaryingLinear::All,
                ],
                from.face_varying,
                "face_varying",
            )?,
            triangles: pick(
                &[TriangleRule::CatmullClark, TriangleRule::Smooth],
                from.triangles,
                "triangles",
            )?,
            orientation: pick(
                &[Orientation::RightHanded, Orientation::LeftHanded],
                from.orientation,
                "orientation",
            )?,
            face_vertex_counts: slice(
                from.face_vertex_counts,
                from.face_count,
                "face_vertex_counts",
            )?,
            face_vertex_indices: slice(
                from.face_vertex_indices,
                from.index_count,
                "face_vertex_indices",
            )?,
            holes: slice(from.holes, from.hole_count, "holes")?,
            crease_indices: slice(
                from.crease_indices,
                from.crease_index_count,
                "crease_indices",
            )?,
            crease_lengths: slice(from.crease_lengths, from.crease_count, "crease_lengths")?,
            crease_sharpnesses: slice(
                from.crease_sharpnesses,
                from.crease_sharpness_count,
                "crease_sharpnesses",
            )?,
            corner_indices: slice(from.corner_indices, from.corner_count, "corner_indices")?,
            corner_sharpnesses: slice(
                from.corner_sharpnesses,
                from.corner_sharpness_count,
                "corner_sharpnesses",
            )?,
        })
    }
}

pub(crate) unsafe fn points(from: &trz_points) -> Result<PointsSamples, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let times_of = slice(from.times, from.sample_count, "times")?;
        let arrays = slice(from.points, from.sample_count, "points")?;
        let counts = slice(from.counts, from.sample_count, "counts")?;
        let samples = arrays.iter().zip(counts).enumerate();
        Ok(PointsSamples {
            times: copied(times_of, |&t| t)?,
            points: samples
                .map(|(i, (&array, &count))| {
                    let what = format!("points[{i}]");
                    let floats = slice(array, times(count, 3, &what)?, &what)?;
                    Ok(Arc::new(vec3s(floats)?))
                })
                .collect::<Result<_, Fault>>()?,
        })
    }
}

pub(crate) unsafe fn grids(from: &trz_grids) -> Result<GridsDesc, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let key_times = slice(from.times, from.key_count, "times")?;
        let rates = slice(from.rates, times(from.grid_count, 2, "rates")?, "rates")?;
        let (rates, _) = rates.as_chunks::<2>();
        let elements = match from.elements.is_null() {
            true => None,
            false => Some(slice(from.elements, from.grid_count, "elements")?),
        };
        let floats = times(from.position_count, 3, "positions")?;
        let positions = slice(from.positions, floats, "positions")?;
        if from.key_count == 0 && from.grid_count > 0 {
            return Err(Fault::invalid("grids need at least one key"));
        }
        let mut expected = 0usize;
        for (grid, &[nu, nv]) in rates.iter().enumerate() {
            if ![nu, nv]
                .iter()
                .all(|rate| (1..=LARGEST_RATE).contains(rate))
            {
                return Err(Fault::invalid(format!(
                    "rates of grid {grid} are {nu} x {nv}, not 1 to {LARGEST_RATE}"
                )));
            }
            let vertices = (usize::from(nu) + 1) * (usize::from(nv) + 1);
            expected = expected.saturating_add(vertices.saturating_mul(from.key_count));
        }
        if expected != from.position_count {
            return Err(Fault::invalid(format!(
                "position_count is {}, but rates and keys add up to {expected}",
                from.position_count
            )));
        }
        let mut grids = copied(rates, |&[nu, nv]| (nu, nv, 0))?;
        for (at, grid) in grids.iter_mut().enumerate() {
            grid.2 = elements.map_or(at as u32, |elements| elements[at]);
        }
        Ok(GridsDesc {
            times: copied(key_times, |&t| t)?,
            grids,
            positions: Arc::new(vec3s(positions)?),
        })
    }
}

pub(crate) unsafe fn transform(
    levels: &[trz_transform_samples],
) -> Result<Vec<TransformSamples>, Fault> {
    let convert = |(i, level): (usize, &trz_transform_samples)| {
        if level.count == 0 {
            return refuse("levels", i, "has no samples");
        }
        let doubles = times(level.count, 16, "matrices")?;
        // SAFETY: as the caller promises.
        unsafe {
            Ok(TransformSamples {
                times: copied(slice(level.times, level.count, "times")?, |&t| t)?,
                matrices: matrices(slice(level.matrices, doubles, "matrices")?)?,
            })
        }
    };
    levels.iter().enumerate().map(convert).collect()
}

pub(crate) unsafe fn primvar(from: &trz_primvar) -> Result<PrimvarDesc, Fault> {
    let kinds = [
        Interpolation::Constant,
        Interpolation::Uniform,
        Interpolation::Varying,
        Interpolation::Vertex,
        Interpolation::FaceVarying,
    ];
    let interpolation = pick(&kinds, from.interpolation, "interpolation")?;
    if !(1..=WIDEST_PRIMVAR).contains(&from.width) {
        return refuse("width", from.width, "is not 1 to 16");
    }
    let width = from.width as usize;
    let floats = times(from.value_count, width, "values")?;
    // SAFETY: as the caller promises.
    unsafe {
        let values = slice(from.values, floats, "values")?;
        let indices = slice(from.indices, from.index_count, "indices")?;
        Ok(PrimvarDesc {
            interpolation,
            width,
            values: Arc::new(copied(values, |&v| v)?),
            indices: Arc::new(copied(indices, |&i| i)?),
        })
    }
}

pub(crate) unsafe fn instances(from: &trz_instances) -> Result<InstancesDesc, Fault> {
    let count = from.instance_count;
    let all = times(from.sample_count, count, "matrices")?;
    let doubles = times(all, 16, "matrices")?;
    if count > 0 && from.sample_count == 0 {
        return Err(Fault::invalid("instances need at least one sample"));
    }
    // SAFETY: as the caller promises.
    unsafe {
        let ids = match from.ids.is_null() {
            true => &[][..],
            false => slice(from.ids, count, "ids")?,
        };
        Ok(InstancesDesc {
            times: copied(slice(from.times, from.sample_count, "times")?, |&t| t)?,
            matrices: matrices(slice(from.matrices, doubles, "matrices")?)?,
            instance_count: count,
            ids: copied(ids, |&id| id)?,
        })
    }
}

/// Numbers of a camera are checked at commit: scenes author them.
pub(crate) fn camera(from: &trz_camera) -> Result<CameraDesc, Fault> {
    let kinds = [Projection::Perspective, Projection::Orthographic];
    Ok(CameraDesc {
        projection: pick(&kinds, from.projection, "projection")?,
        horizontal_aperture: from.horizontal_aperture,
        vertical_aperture: from.vertical_aperture,
        horizontal_aperture_offset: from.horizontal_aperture_offset,
        vertical_aperture_offset: from.vertical_aperture_offset,
        focal_length: from.focal_length,
        focus_distance: from.focus_distance,
        f_stop: from.f_stop,
        clipping: [from.clipping_near, from.clipping_far],
        shutter: [from.shutter_open, from.shutter_close],
        exposure_scale: from.exposure_scale,
        ..CameraDesc::default()
    })
}

pub(crate) fn camera_to_c(from: &CameraDesc) -> trz_camera {
    trz_camera {
        struct_size: 0,
        projection: match from.projection {
            Projection::Perspective => TRZ_PROJECTION_PERSPECTIVE,
            Projection::Orthographic => TRZ_PROJECTION_ORTHOGRAPHIC,
        },
        horizontal_aperture: from.horizontal_aperture,
        vertical_aperture: from.vertical_aperture,
        horizontal_aperture_offset: from.horizontal_aperture_offset,
        vertical_aperture_offset: from.vertical_aperture_offset,
        focal_length: from.focal_length,
        focus_distance: from.focus_distance,
        f_stop: from.f_stop,
        clipping_near: from.clipping[0],
        clipping_far: from.clipping[1],
        shutter_open: from.shutter[0],
        shutter_close: from.shutter[1],
        exposure_scale: from.exposure_scale,
    }
}

const FILTERS: [FilterKind; 4] = [
    FilterKind::Box,
    FilterKind::Gaussian,
    FilterKind::Mitchell,
    FilterKind::BlackmanHarris,
];

const POLICIES: [WindowPolicy; 5] = [
    WindowPolicy::MatchHorizontally,
    WindowPolicy::MatchVertically,
    WindowPolicy::Fit,
    WindowPolicy::Crop,
    WindowPolicy::DontConform,
];

pub(crate) fn settings(from: &trz_settings) -> Result<RenderSettings, Fault> {
    for (size, what) in [(from.width, "width"), (from.height, "height")] {
        if !(1..=LARGEST_RESOLUTION).contains(&size) {
            return refuse(what, size, "is not 1 to 65536 pixels");
        }
    }
    if !(from.pixel_aspect.is_finite() && from.pixel_aspect > 0.0) {
        return refuse("pixel_aspect", from.pixel_aspect, "is not above 0");
    }
    if !(1..=MOST_SAMPLES).contains(&from.samples) {
        return refuse("samples", from.samples, "is not 1 to 1048576");
    }
    if !(from.shading_rate.is_finite() && from.shading_rate > 0.0) {
        return refuse("shading_rate", from.shading_rate, "is not above 0");
    }
    if !(0.0..=WIDEST_FILTER).contains(&from.filter_width) {
        return refuse(
            "filter_width",
            from.filter_width,
            "is not from 0 to 64 pixels",
        );
    }
    if from.threads > MOST_THREADS {
        return refuse("threads", from.threads, "is above 4096");
    }
    match pick(&["auto", "cpu", "gpu"], from.backend, "backend")? {
        "gpu" => Err(Fault::new(
            TRZ_ERROR_UNSUPPORTED,
            "this version renders on the CPU only; ask for TRZ_BACKEND_AUTO or TRZ_BACKEND_CPU",
        )),
        _ => Ok(()),
    }?;
    let defaults = RenderSettings::default();
    Ok(RenderSettings {
        resolution: [from.width, from.height],
        crop: crop(from)?,
        pixel_aspect: from.pixel_aspect,
        window_policy: pick(&POLICIES, from.window_policy, "window_policy")?,
        samples: from.samples,
        shading_rate: from.shading_rate,
        filter: pick(&FILTERS, from.filter, "filter")?,
        filter_width: from.filter_width,
        seed: from.seed,
        threads: from.threads,
        shutter: shutter(from)?,
        disable_motion_blur: flag(from.disable_motion_blur, "disable_motion_blur")?,
        disable_defocus: flag(from.disable_defocus, "disable_defocus")?,
        camera_light: flag(from.camera_light, "camera_light")?,
        time_window: time_window(from)?,
        lens_point: lens_point(from)?,
        max_micropolygons: match from.max_micropolygons {
            0 => defaults.max_micropolygons,
            some => some,
        },
        aovs: defaults.aovs,
    })
}

fn crop(from: &trz_settings) -> Result<Option<[u32; 4]>, Fault> {
    let [x0, y0, x1, y1] = from.crop;
    if from.crop == [0; 4] {
        return Ok(None);
    }
    if x0 >= x1 || y0 >= y1 || x1 > from.width || y1 > from.height {
        return Err(Fault::invalid(format!(
            "crop {x0} {y0} {x1} {y1} holds no pixel, or leaves the image of {} x {}",
            from.width, from.height
        )));
    }
    Ok(Some(from.crop))
}

fn shutter(from: &trz_settings) -> Result<Option<[f64; 2]>, Fault> {
    if !flag(from.override_shutter, "override_shutter")? {
        return Ok(None);
    }
    let [open, close] = [from.shutter_open, from.shutter_close];
    if !(open.is_finite() && close.is_finite()) {
        return Err(Fault::invalid(format!(
            "shutter {open} to {close} is not finite"
        )));
    }
    if close < open {
        return Err(Fault::invalid(format!(
            "the shutter closes at {close}, before it opens at {open}"
        )));
    }
    Ok(Some([open, close]))
}

fn time_window(from: &trz_settings) -> Result<[f32; 2], Fault> {
    let [first, last] = from.time_window;
    if !(0.0 <= first && first <= last && last <= 1.0) {
        return Err(Fault::invalid(format!(
            "time_window {first} to {last} is not a part of 0 to 1"
        )));
    }
    Ok(from.time_window)
}

fn lens_point(from: &trz_settings) -> Result<Option<[f32; 2]>, Fault> {
    if !flag(from.fix_lens, "fix_lens")? {
        return Ok(None);
    }
    let [x, y] = from.lens_point;
    // A point computed on the rim may be beyond it by rounding: two squares and a sum, 3 half ULPs.
    let squared = x * x + y * y;
    if squared.is_nan() || squared > 1.0 + 2.0 * f32::EPSILON {
        return Err(Fault::invalid(format!(
            "lens_point ({x}, {y}) is outside the unit disk"
        )));
    }
    Ok(Some(from.lens_point))
}

pub(crate) fn settings_to_c(from: &RenderSettings) -> trz_settings {
    let [shutter_open, shutter_close] = from.shutter.unwrap_or_default();
    let [width, height] = from.resolution;
    let number = |at: Option<usize>| at.unwrap_or_default() as u32;
    trz_settings {
        struct_size: 0,
        width,
        height,
        crop: from.crop.unwrap_or_default(),
        pixel_aspect: from.pixel_aspect,
        window_policy: number(POLICIES.iter().position(|&p| p == from.window_policy)),
        samples: from.samples,
        shading_rate: from.shading_rate,
        filter: number(FILTERS.iter().position(|&f| f == from.filter)),
        filter_width: from.filter_width,
        seed: from.seed,
        threads: from.threads,
        override_shutter: from.shutter.is_some().into(),
        shutter_open,
        shutter_close,
        disable_motion_blur: from.disable_motion_blur.into(),
        disable_defocus: from.disable_defocus.into(),
        camera_light: from.camera_light.into(),
        time_window: from.time_window,
        fix_lens: from.lens_point.is_some().into(),
        lens_point: from.lens_point.unwrap_or_default(),
        max_micropolygons: from.max_micropolygons,
        backend: TRZ_BACKEND_AUTO,
    }
}

pub(crate) fn progress_to_c(from: &Progress) -> trz_progress {
    trz_progress {
        struct_size: 0,
        state: match from.state {
            State::Idle => TRZ_STATE_IDLE,
            State::Preparing => TRZ_STATE_PREPARING,
            State::Rendering => TRZ_STATE_RENDERING,
            State::Finished => TRZ_STATE_FINISHED,
            State::Cancelled => TRZ_STATE_CANCELLED,
            State::Failed => TRZ_STATE_FAILED,
        },
        fraction: from.fraction,
        samples_done: from.samples_done,
        samples_total: from.samples_total,
        seconds: from.seconds,
        seconds_left: from.seconds_left.unwrap_or(-1.0),
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
    }
}

/// The bytes of an AOV's values, in the machine's order.
pub(crate) fn aov_bytes(image: &AovImage) -> &[u8] {
    match &image.data {
        AovData::F32(values) => bytemuck::cast_slice(values),
        AovData::I32(values) => bytemuck::cast_slice(values),
    }
}

pub(crate) unsafe fn image(from: &trz_image) -> Result<ImageOptions, Fault> {
    let pixels = [ExrPixelType::Half, ExrPixelType::Float];
    let compressions = [
        ExrCompression::None,
        ExrCompression::Rle,
        ExrCompression::Zips,
        ExrCompression::Zip,
        ExrCompression::Piz,
    ];
    let colors = [PngColor::Linear, PngColor::Srgb];
    if !from.metadata_count.is_multiple_of(2) {
        return refuse("metadata_count", from.metadata_count, "is odd");
    }
    check_slice(from.metadata, from.metadata_count, "metadata")?;
    // SAFETY: as the caller promises.
    let (aovs, metadata) = unsafe {
        (
            texts(from.aovs, from.aov_count, "aovs")?,
            texts(from.metadata, from.metadata_count, "metadata")?,
        )
    };
    let (metadata, _) = metadata.as_chunks::<2>();
    let exr = ExrOptions {
        pixel_type: pick(&pixels, from.pixel_type, "pixel_type")?,
        compression: pick(&compressions, from.compression, "compression")?,
    };
    Ok(ImageOptions {
        file: pick(&[FileType::Exr(exr), FileType::Png], from.r#type, "type")?,
        color: pick(&colors, from.color, "color")?,
        aovs,
        metadata: metadata
            .iter()
            .map(|[name, value]| (name.clone(), value.clone()))
            .collect(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn settings_ok() -> trz_settings {
        settings_to_c(&RenderSettings::default())
    }

    fn code(change: impl FnOnce(&mut trz_settings)) -> bool {
        let mut changed = settings_ok();
        change(&mut changed);
        settings(&changed).is_ok()
    }

    #[test]
    fn defaults_come_back_as_they_went() {
        assert_eq!(settings(&settings_ok()).unwrap(), RenderSettings::default());
        let camera_default = CameraDesc::default();
        assert_eq!(
            camera(&camera_to_c(&camera_default)).unwrap(),
            camera_default
        );
    }

    #[test]
    fn every_setting_has_a_range() {
        assert!(!code(|s| s.width = 0));
        assert!(!code(|s| s.height = 65_537));
        assert!(code(|s| s.height = 65_536));
        assert!(!code(|s| s.pixel_aspect = f32::NAN));
        assert!(!code(|s| s.samples = 0));
        assert!(!code(|s| s.shading_rate = 0.0));
        assert!(!code(|s| s.filter = 4));
        assert!(!code(|s| s.filter_width = f32::NAN));
        assert!(!code(|s| s.threads = u32::MAX));
        assert!(!code(|s| s.window_policy = 9));
        assert!(!code(|s| s.backend = TRZ_BACKEND_GPU));
        assert!(!code(|s| s.backend = 3));
        assert!(!code(|s| s.camera_light = 2));
        assert!(!code(|s| s.crop = [5, 5, 5, 9]));
        assert!(!code(|s| s.crop = [0, 0, 961, 9]));
        assert!(code(|s| s.crop = [0, 0, 960, 9]));
        assert!(!code(|s| s.time_window = [0.5, 0.25]));
        assert!(!code(|s| s.time_window = [f32::NAN, 1.0]));
        assert!(code(|s| {
            s.override_shutter = 1;
            s.shutter_open = -0.25;
            s.shutter_close = 0.25;
        }));
        assert!(!code(|s| {
            s.override_shutter = 1;
            s.shutter_open = 0.5;
        }));
        assert!(!code(|s| {
            s.fix_lens = 1;
            s.lens_point = [0.9, 0.9];
        }));
        assert!(code(|s| {
            s.fix_lens = 1;
            s.lens_point = [0.6, 0.8];
        }));
    }
}
