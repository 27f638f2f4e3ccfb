//! The translated scene as text: what every host must agree on, to the character.
//!
//! Raw samples are resolved to the shutter first (keys in [0, 1], rates applied, levels of transforms
//! multiplied), so that two hosts which sample differently but mean the same print the same. Nothing
//! is diced. Prims come in the order of their paths, then instancers in that of theirs; numbers have six significant digits, and what is
//! nothing beside its neighbours is 0 (see [`text`]). Warnings of the translation follow their prim.
//!
//! Matrices are printed as USD prints them: row vectors, four rows.

mod camera;
mod geometry;
mod instancer;
mod prim;
mod text;

use std::sync::Arc;

use crate::diagnostics::Warning;
use crate::motion::{Hierarchy, Shutter};
use crate::render::resolve_shutter;
use crate::scene::{
    CameraDesc, Cull, InstancerDesc, PrimDesc, RenderSettings, Scene, TransformSamples,
};
use text::{Page, at, matrix, number, pair};

/// Version of the format; the first line of every dump tells it.
pub const VERSION: u32 = 1;

/// The scene as its active camera sees it; without one, at the frame's own time.
pub fn dump(scene: &Scene) -> String {
    let mut page = Page::default();
    page.line(&format!("hdtrapeze dump {VERSION}"));
    let settings = &scene.settings;
    let none = CameraDesc::default();
    let camera = scene.active_camera.and_then(|id| scene.cameras.get(&id));
    let mut warnings = Vec::new();
    let shutter = resolve_shutter(camera.map_or(&none, Arc::as_ref), settings, &mut warnings);
    page.line("");
    let ends = pair([shutter.open, shutter.close]);
    page.line(&format!(
        "shutter {ends} in time codes relative to the frame"
    ));
    if !shutter.is_still() {
        page.line("at shutter 0: as it opens; at shutter 1: as it closes");
    }
    write_warnings(&mut page, &warnings);
    page.line("");
    write_settings(&mut page, settings);
    page.line("");
    match camera {
        Some(camera) => camera::write(&mut page, camera, shutter),
        None => page.line("no camera"),
    }
    let mut prims: Vec<&Arc<PrimDesc>> = scene.prims.values().collect();
    // Stable: prims that share a path stay in the order of their creation.
    prims.sort_by(|a, b| a.common.path.cmp(&b.common.path));
    for desc in prims {
        page.line("");
        prim::write(&mut page, desc, scene, shutter);
    }
    let mut instancers: Vec<&Arc<InstancerDesc>> = scene.instancers.values().collect();
    instancers.sort_by(|a, b| a.path.cmp(&b.path));
    for desc in instancers {
        page.line("");
        instancer::write(&mut page, desc, scene, shutter);
    }
    page.finish()
}

/// What UsdGeomMotionAPI says of a prim.
fn write_motion(page: &mut Page, blur_scale: f64, nonlinear_samples: Option<u32>) {
    if blur_scale != 1.0 {
        page.line(&format!("blur scale {}", number(blur_scale)));
    }
    if let Some(count) = nonlinear_samples {
        page.line(&format!("nonlinear samples {count}"));
    }
}

/// Matrices at the keys of the samples, all levels multiplied.
fn write_transform(page: &mut Page, levels: &[TransformSamples], shutter: Shutter) {
    match Hierarchy::new(levels, shutter) {
        Ok(hierarchy) => {
            let times = hierarchy.key_times();
            for &time in &times {
                let text = matrix(&hierarchy.matrix(time));
                page.line(&format!("transform{}: {text}", at(times.len(), time)));
            }
            if hierarchy.turns() {
                page.line("transform turns between samples");
            }
        }
        Err(error) => page.line(&format!("transform: {error}")),
    }
}

fn write_settings(page: &mut Page, settings: &RenderSettings) {
    page.line("settings");
    page.indented(|page| {
        let [width, height] = settings.resolution;
        page.line(&format!("resolution {width} {height}"));
        page.line(&format!("pixel aspect {}", number(settings.pixel_aspect)));
        page.line(&format!("window policy {:?}", settings.window_policy));
        if let Some([x0, y0, x1, y1]) = settings.data_window {
            page.line(&format!("data window {x0} {y0} {x1} {y1}"));
        }
        page.line(&format!("samples {}", settings.samples));
        page.line(&format!("shading rate {}", number(settings.shading_rate)));
        let width = match settings.filter_width > 0.0 {
            true => settings.filter_width,
            false => settings.filter.default_width(),
        };
        page.line(&format!("filter {:?} {}", settings.filter, number(width)));
        page.line(&format!("seed {}", settings.seed));
        let switched = [
            (settings.disable_motion_blur, "no motion blur"),
            (settings.disable_defocus, "no defocus"),
            (!settings.camera_light, "no camera light"),
            (settings.cull == Cull::Back, "backs culled"),
            (settings.cull == Cull::Front, "fronts culled"),
            (
                settings.cull == Cull::BackUnlessDoubleSided,
                "backs culled unless double sided",
            ),
        ];
        for (on, text) in switched {
            if on {
                page.line(text);
            }
        }
        page.line(&format!("aovs {}", settings.aovs.join(" ")));
    });
}

fn write_warnings(page: &mut Page, warnings: &[Warning]) {
    for warning in warnings {
        page.line(&format!(
            "warning {}: {}",
            warning.code.name(),
            warning.text
        ));
    }
}

#[cfg(test)]
mod tests;
