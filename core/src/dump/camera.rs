//! The camera of a dump.

use super::text::{Page, matrix, number, numbers, pair};
use crate::motion::{Hierarchy, Shutter};
use crate::scene::CameraDesc;

/// The active camera, with its matrices at the keys of its own samples.
pub(super) fn write(page: &mut Page, camera: &CameraDesc, shutter: Shutter) {
    page.line(&format!("camera {}", camera.path));
    page.indented(|page| {
        page.line(&format!("projection {:?}", camera.projection));
        let aperture = [
            camera.horizontal_aperture,
            camera.vertical_aperture,
            camera.horizontal_aperture_offset,
            camera.vertical_aperture_offset,
        ];
        page.line(&format!("aperture and offset {}", numbers(&aperture)));
        page.line(&format!("focal length {}", number(camera.focal_length)));
        page.line(&format!("focus distance {}", number(camera.focus_distance)));
        page.line(&format!("f-stop {}", number(camera.f_stop)));
        page.line(&format!("clipping {}", pair(camera.clipping)));
        page.line(&format!("exposure scale {}", number(camera.exposure_scale)));
        match Hierarchy::new(&camera.transform, shutter) {
            Ok(hierarchy) => {
                for time in hierarchy.key_times() {
                    let text = matrix(&hierarchy.matrix(time));
                    page.line(&format!("at {}: {text}", number(time)));
                }
            }
            Err(error) => page.line(&format!("transform: {error}")),
        }
    });
}
