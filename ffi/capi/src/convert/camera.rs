//! Cameras. Numbers are checked at commit: scenes author them.

use std::ptr::null;

use hdtrapeze_core::scene::{
    ApertureDesc, CameraDesc, LensSample, Projection, ShutterCurveDesc, ShutterCurveKind,
};

use super::pick;
use crate::constants::*;
use crate::fault::Fault;
use crate::input::{copied, slice, times};
use crate::types::*;

/// Safety: pointers in the struct are null or as the header says.
pub(crate) unsafe fn camera(from: &trz_camera) -> Result<CameraDesc, Fault> {
    let projections = [Projection::Perspective, Projection::Orthographic];
    let curves = [ShutterCurveKind::Linear, ShutterCurveKind::Bezier];
    // SAFETY: as the caller promises.
    let (curve, planes, samples) = unsafe {
        let doubles = times(from.shutter_curve_count, 2, "shutter_curve")?;
        let curve = slice(from.shutter_curve, doubles, "shutter_curve")?;
        let doubles = times(from.clipping_plane_count, 4, "clipping_planes")?;
        let planes = slice(from.clipping_planes, doubles, "clipping_planes")?;
        let samples = slice(from.lens_samples, from.lens_sample_count, "lens_samples")?;
        (curve.as_chunks::<2>().0, planes.as_chunks::<4>().0, samples)
    };
    Ok(CameraDesc {
        projection: pick(&projections, from.projection, "projection")?,
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
        aperture: ApertureDesc {
            blades: from.aperture_blades,
            rotation: from.aperture_rotation,
            ratio: from.aperture_ratio,
            roundness: from.aperture_roundness,
        },
        shutter_curve: ShutterCurveDesc {
            kind: pick(&curves, from.shutter_curve_type, "shutter_curve_type")?,
            points: copied(curve, |&point| point)?,
        },
        clipping_planes: copied(planes, |&plane| plane)?,
        lens_samples: copied(samples, lens_sample)?,
        ..CameraDesc::default()
    })
}

fn lens_sample(from: &trz_lens_sample) -> LensSample {
    LensSample {
        time: from.time,
        horizontal_aperture: from.horizontal_aperture,
        vertical_aperture: from.vertical_aperture,
        horizontal_aperture_offset: from.horizontal_aperture_offset,
        vertical_aperture_offset: from.vertical_aperture_offset,
        focal_length: from.focal_length,
        focus_distance: from.focus_distance,
        f_stop: from.f_stop,
        exposure_scale: from.exposure_scale,
    }
}

/// A camera without arrays.
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
        aperture_blades: from.aperture.blades,
        shutter_curve_type: TRZ_SHUTTER_LINEAR,
        aperture_rotation: from.aperture.rotation,
        aperture_ratio: from.aperture.ratio,
        aperture_roundness: from.aperture.roundness,
        shutter_curve: null(),
        shutter_curve_count: 0,
        clipping_planes: null(),
        clipping_plane_count: 0,
        lens_samples: null(),
        lens_sample_count: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_come_back_as_they_went() {
        let camera_default = CameraDesc::default();
        // SAFETY: its pointers are null.
        let back = unsafe { camera(&camera_to_c(&camera_default)) };
        assert_eq!(back.unwrap(), camera_default);
    }

    #[test]
    fn arrays_are_copied() {
        let curve = [0.0, 0.0, 1.0, 2.0];
        let planes = [1.0, 2.0, 3.0, 4.0];
        let sample = trz_lens_sample {
            time: 0.5,
            horizontal_aperture: 1.0,
            vertical_aperture: 2.0,
            horizontal_aperture_offset: 3.0,
            vertical_aperture_offset: 4.0,
            focal_length: 5.0,
            focus_distance: 6.0,
            f_stop: 7.0,
            exposure_scale: 8.0,
        };
        let mut from = trz_camera {
            aperture_blades: 5,
            shutter_curve_type: TRZ_SHUTTER_BEZIER,
            shutter_curve: curve.as_ptr(),
            shutter_curve_count: 2,
            clipping_planes: planes.as_ptr(),
            clipping_plane_count: 1,
            lens_samples: &sample,
            lens_sample_count: 1,
            ..camera_to_c(&CameraDesc::default())
        };
        // SAFETY: pointers to live arrays of these lengths.
        let found = unsafe { camera(&from) }.unwrap();
        assert_eq!(found.aperture.blades, 5);
        assert_eq!(found.shutter_curve.kind, ShutterCurveKind::Bezier);
        assert_eq!(found.shutter_curve.points, [[0.0, 0.0], [1.0, 2.0]]);
        assert_eq!(found.clipping_planes, [planes]);
        let lens = &found.lens_samples[0];
        assert_eq!((lens.time, lens.focal_length, lens.f_stop), (0.5, 5.0, 7.0));
        from.shutter_curve_type = 2;
        // SAFETY: as above.
        assert!(unsafe { camera(&from) }.is_err());
    }
}
