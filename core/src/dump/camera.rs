//! The camera of a dump.

use super::text::{Page, array, at, matrix, number, numbers, pair};
use crate::motion::{Hierarchy, Shutter, Timeline};
use crate::scene::{ApertureDesc, CameraDesc, LensSample, ShutterCurveKind};

/// The active camera, with its lens and its matrices at the keys of their own samples.
pub(super) fn write(page: &mut Page, camera: &CameraDesc, shutter: Shutter) {
    page.line(&format!("camera {}", camera.path));
    page.indented(|page| {
        page.line(&format!("projection {:?}", camera.projection));
        let lenses = lenses(camera, shutter);
        match lenses.as_slice() {
            [(_, lens)] => write_lens(page, lens),
            many => {
                for (time, lens) in many {
                    page.line(&format!("lens{}", at(many.len(), *time)));
                    page.indented(|page| write_lens(page, lens));
                }
            }
        }
        page.line(&format!("clipping {}", pair(camera.clipping)));
        for plane in &camera.clipping_planes {
            page.line(&format!("clipping plane {}", numbers(plane)));
        }
        let aperture = &camera.aperture;
        if *aperture != ApertureDesc::default() {
            page.line(&format!(
                "blades {}, turned {}, ratio {}, roundness {}",
                aperture.blades,
                number(aperture.rotation),
                number(aperture.ratio),
                number(aperture.roundness)
            ));
        }
        if !camera.shutter_curve.points.is_empty() {
            let kind = match camera.shutter_curve.kind {
                ShutterCurveKind::Linear => "",
                ShutterCurveKind::Bezier => " by Bezier segments",
            };
            let points = array(camera.shutter_curve.points.as_flattened(), 2);
            page.line(&format!("shutter curve{kind} {points}"));
        }
        match Hierarchy::new(&camera.transform, shutter) {
            Ok(hierarchy) => {
                let times = hierarchy.key_times();
                for &time in &times {
                    let text = matrix(&hierarchy.matrix(time));
                    page.line(&format!("transform{}: {text}", at(times.len(), time)));
                }
            }
            Err(error) => page.line(&format!("transform: {error}")),
        }
    });
}

/// The lens at each of its keys; one where it does not change.
fn lenses(camera: &CameraDesc, shutter: Shutter) -> Vec<(f64, LensSample)> {
    let samples = &camera.lens_samples;
    let times: Vec<f64> = samples.iter().map(|s| s.time).collect();
    let Some(timeline) = Timeline::new(&times, shutter) else {
        return vec![(0.0, camera.lens())];
    };
    let lens_at = |time: f64| {
        let blend = timeline.blend(time);
        let lens = samples[blend.a].lerp(&samples[blend.b], blend.f);
        (time, LensSample { time: 0.0, ..lens })
    };
    let keys = timeline.key_times(shutter.is_still());
    let mut lenses: Vec<_> = keys.into_iter().map(lens_at).collect();
    if lenses.iter().all(|(_, lens)| *lens == lenses[0].1) {
        lenses.truncate(1);
    }
    lenses
}

fn write_lens(page: &mut Page, lens: &LensSample) {
    let aperture = [
        lens.horizontal_aperture,
        lens.vertical_aperture,
        lens.horizontal_aperture_offset,
        lens.vertical_aperture_offset,
    ];
    page.line(&format!("aperture and offset {}", numbers(&aperture)));
    page.line(&format!("focal length {}", number(lens.focal_length)));
    page.line(&format!("focus distance {}", number(lens.focus_distance)));
    page.line(&format!("f-stop {}", number(lens.f_stop)));
    page.line(&format!("exposure scale {}", number(lens.exposure_scale)));
}
