//! Views and render products.

use std::ffi::c_char;

use hdtrapeze_core::scene::{PrimId, RenderSettings};
use hdtrapeze_delegate::Session;
use hdtrapeze_delegate::buffer::{Component, Layout};
use hdtrapeze_delegate::plan::{KnownShape, Product, Request, Shape};
use hdtrapeze_delegate::render_loop::View;

use super::primvar::numbers;
use super::{exr, pick, refuse, render_vars};
use crate::constants::*;
use crate::fault::Fault;
use crate::input::{flag, read, text, text_or_empty, texts};
use crate::types::*;

/// Safety: pointers are null or as the header says.
pub(crate) unsafe fn request(
    session: &Session,
    from: &trz_view,
    products: &[*const trz_product],
) -> Result<Request, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let (settings, _) = settings(session, from.settings)?;
        let aovs = texts(from.aovs, from.aov_count as usize, "aovs")?;
        let products: Result<_, Fault> = products
            .iter()
            .map(|&at| product(session, &read(at, "product")?))
            .collect();
        Ok(Request {
            view: View {
                camera: camera(from.camera),
                settings: RenderSettings { aovs, ..settings },
            },
            camera_aspect: from.camera_aspect,
            path: text_or_empty(from.path, "path")?,
            frame: Some(from.frame).filter(|frame| frame.is_finite()),
            settings_path: text_or_empty(from.settings_path, "settings_path")?,
            shape: KnownShape {
                resolution: flag(from.has_resolution, "has_resolution")?.then_some(from.resolution),
                pixel_aspect: flag(from.has_pixel_aspect, "has_pixel_aspect")?
                    .then_some(from.pixel_aspect),
                conform: conform(from.conform)?,
                data_window: flag(from.has_data_window, "has_data_window")?
                    .then_some(from.data_window),
            },
            shapes_view: flag(from.shapes_view, "shapes_view")?,
            windows_view: flag(from.windows_view, "windows_view")?,
            products: products?,
        })
    }
}

/// Safety: pointers in the struct are null or as the header says.
unsafe fn product(session: &Session, from: &trz_product) -> Result<Product, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let (settings, authored) = settings(session, from.settings)?;
        Ok(Product {
            path: text(from.path, "path")?.to_owned(),
            kind: text_or_empty(from.r#type, "type")?,
            name: text_or_empty(from.name, "name")?,
            camera: camera(from.camera),
            camera_path: text_or_empty(from.camera_path, "camera_path")?,
            camera_aspect: from.camera_aspect,
            shape: Shape {
                resolution: from.resolution,
                pixel_aspect: from.pixel_aspect,
                conform: conform(from.conform)?.unwrap_or_else(|| Shape::of_schema().conform),
                data_window: from.data_window,
            },
            settings,
            exr: exr(authored.pixel_type, authored.compression)?,
            vars: render_vars(from.vars, from.var_count)?,
            var_targets: from.var_target_count,
        })
    }
}

/// An aspectRatioConformPolicy, none where there is no text.
/// Safety: the pointer is null or to a text.
unsafe fn conform(from: *const c_char) -> Result<Option<String>, Fault> {
    match from.is_null() {
        true => Ok(None),
        // SAFETY: as the caller promises.
        false => Ok(Some(unsafe { text(from, "conform") }?.to_owned())),
    }
}

fn camera(id: trz_id) -> Option<PrimId> {
    (id != 0).then_some(PrimId(id))
}

/// Settings, and what was authored; the backend auto, after a warning, where the one asked for is not
/// there.
/// Safety: the pointer is null or as the header says.
unsafe fn settings(
    session: &Session,
    from: *const trz_settings,
) -> Result<(RenderSettings, trz_settings), Fault> {
    // SAFETY: as the caller promises.
    let mut from = unsafe { read(from, "settings") }?;
    let refused = super::settings(&from).err();
    if let Some(why) = refused.filter(|fault| fault.code() == TRZ_ERROR_UNSUPPORTED) {
        session.say_once("", &format!("{}; the backend auto is used", why.message()));
        from.backend = TRZ_BACKEND_AUTO;
    }
    Ok((super::settings(&from)?, from))
}

/// What a buffer is like, and its size in bytes, which its data has.
/// Safety: the clear value is null or as the header says.
pub(crate) unsafe fn buffer(from: &trz_buffer) -> Result<(Layout, usize), Fault> {
    let components = [
        Component::Float32,
        Component::Float16,
        Component::Int32,
        Component::Unorm8,
        Component::Snorm8,
    ];
    if !(1..=4).contains(&from.components) {
        return refuse("components", from.components, "are not 1 to 4");
    }
    // SAFETY: as the caller promises.
    let clear = unsafe {
        numbers(
            from.clear_type,
            from.clear,
            from.clear_count as usize,
            "clear",
        )
    }?;
    let layout = Layout {
        width: from.width,
        height: from.height,
        components: from.components as usize,
        component: pick(&components, from.component, "component")?,
        bottom_up: flag(from.bottom_up, "bottom_up")?,
        origin: from.origin,
        clear: clear.to_f64(),
    };
    match layout.bytes().filter(|&bytes| bytes <= from.bytes) {
        Some(bytes) => Ok((layout, bytes)),
        None => Err(Fault::new(
            TRZ_ERROR_BUFFER_TOO_SMALL,
            format!("{} bytes do not hold all pixels", from.bytes),
        )),
    }
}
