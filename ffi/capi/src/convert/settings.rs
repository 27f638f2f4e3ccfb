//! Render settings: every field has a range.

use hdtrapeze_core::scene::{Backend, Cull, CurveForm, FilterKind, RenderSettings, WindowPolicy};

use hdtrapeze_delegate::backend;

use super::scene::curve_form;
use super::{output, pick, refuse};
use crate::constants::*;
use crate::fault::Fault;
use crate::input::flag;
use crate::types::*;

/// Largest width and height of an image, pixels.
const LARGEST_RESOLUTION: u32 = 65_536;
/// Most samples a pixel: the film counts them in f32, which is exact up to 2^24.
const MOST_SAMPLES: u32 = 1 << 20;
/// Most worker threads.
const MOST_THREADS: u32 = 4096;
/// Widest filter, pixels.
const WIDEST_FILTER: f32 = 64.0;

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

const BACKENDS: [Backend; 3] = [Backend::Auto, Backend::Cpu, Backend::Gpu];

const CULLS: [Cull; 4] = [
    Cull::None,
    Cull::Back,
    Cull::Front,
    Cull::BackUnlessDoubleSided,
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
    let chosen = pick(&BACKENDS, from.backend, "backend")?;
    let backend = backend::resolved(chosen)?;
    // A mistake in it is told before it matters.
    backend::gpu_options()?;
    output::exr(from.pixel_type, from.compression)?;
    let told = from.time_codes_per_second;
    if !(told.is_finite() && told >= 0.0) {
        return refuse("time_codes_per_second", told, "is below 0, or not finite");
    }
    let defaults = RenderSettings::default();
    Ok(RenderSettings {
        resolution: [from.width, from.height],
        data_window: data_window(from)?,
        pixel_aspect: from.pixel_aspect,
        window_policy: pick(&POLICIES, from.window_policy, "window_policy")?,
        samples: from.samples,
        shading_rate: from.shading_rate,
        filter: pick(&FILTERS, from.filter, "filter")?,
        filter_width: from.filter_width,
        seed: from.seed,
        threads: from.threads,
        backend,
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
        curves: curve_form(from.curves, "curves")?.unwrap_or_default(),
        keep_finer: flag(from.keep_finer, "keep_finer")?,
        cull: pick(&CULLS, from.cull, "cull")?,
        occlusion_culling: flag(from.occlusion_culling, "occlusion_culling")?,
        aovs: defaults.aovs,
    })
}

fn data_window(from: &trz_settings) -> Result<Option<[i32; 4]>, Fault> {
    let window @ [x0, y0, x1, y1] = from.data_window;
    if window == [0; 4] {
        return Ok(None);
    }
    let most = LARGEST_RESOLUTION as i32;
    let fits = |from: i32, to: i32, size: u32| {
        let (first, last) = (i64::from(from).min(0), i64::from(to).max(i64::from(size)));
        from < to && last - first <= i64::from(most)
    };
    if !(fits(x0, x1, from.width) && fits(y0, y1, from.height)) {
        return Err(Fault::invalid(format!(
            "data_window {x0} {y0} {x1} {y1} holds no pixel, or spans more than {most} pixels with \
             the image of {} x {}",
            from.width, from.height
        )));
    }
    Ok(Some(window))
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
        data_window: from.data_window.unwrap_or_default(),
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
        backend: number(BACKENDS.iter().position(|&b| b == from.backend)),
        curves: match from.curves {
            CurveForm::Auto => TRZ_CURVES_AUTO,
            CurveForm::Ribbons => TRZ_CURVES_RIBBONS,
            CurveForm::Tubes => TRZ_CURVES_TUBES,
        },
        keep_finer: from.keep_finer.into(),
        cull: number(CULLS.iter().position(|&c| c == from.cull)),
        occlusion_culling: from.occlusion_culling.into(),
        compression: TRZ_COMPRESSION_ZIP,
        pixel_type: TRZ_PIXEL_HALF,
        time_codes_per_second: 0.0,
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
    }

    #[test]
    fn sides_come_back_as_they_went() {
        for cull in CULLS {
            let from = RenderSettings {
                cull,
                ..RenderSettings::default()
            };
            assert_eq!(settings(&settings_to_c(&from)).unwrap(), from);
        }
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
        assert!(code(|s| s.backend = TRZ_BACKEND_CPU));
        assert!(!code(|s| s.backend = 3));
        assert!(!code(|s| s.curves = 4));
        assert!(code(|s| s.curves = TRZ_CURVES_TUBES));
        assert!(!code(|s| s.cull = 4));
        assert!(!code(|s| s.camera_light = 2));
        assert!(!code(|s| s.data_window = [5, 5, 5, 9]));
        assert!(!code(|s| s.data_window = [5, 5, 9, 4]));
        assert!(!code(|s| s.data_window = [-1, 0, 65_536, 9]));
        assert!(!code(|s| s.data_window = [-64_577, 0, 9, 9]));
        assert!(!code(|s| s.data_window = [0, i32::MIN, 9, i32::MAX]));
        assert!(code(|s| s.data_window = [-64_576, -5, 9, 2000]));
        assert!(code(|s| s.data_window = [0, 0, 960, 9]));
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
