//! Which renders a view and the render products beside it make, and what is written of each.
//!
//! Images that agree in camera and settings share one render; their AOVs are rendered together. Of a
//! product that cannot be there is one warning, and the rest is rendered.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf, absolute};

use hdtrapeze_core::scene::{PrimId, RenderSettings, WindowPolicy};

use crate::file::{FileType, ImageOptions};
use crate::frame_name;
use crate::image::{ExrOptions, PngColor};
use crate::product::RenderVar;
use crate::render_loop::{Job, Output, View};
use crate::session::Session;

/// Largest width and height of an image, and of it with overscan, pixels.
const LARGEST_RESOLUTION: i32 = 65_536;

/// The data window that is the image.
const WHOLE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

/// A render product (UsdRenderProduct) as authored, and what its image is rendered with.
#[derive(Clone, Debug)]
pub struct Product {
    /// Path of the prim.
    pub path: String,
    /// productType.
    pub kind: String,
    /// productName, which may hold the frame.
    pub name: String,
    /// None where there is none at the camera's path.
    pub camera: Option<PrimId>,
    /// Path of the camera; empty where none is authored.
    pub camera_path: String,
    /// Width over height of its film back; 0 where that is not known.
    pub camera_aspect: f64,
    /// Width and height.
    pub resolution: [i32; 2],
    /// pixelAspectRatio.
    pub pixel_aspect: f32,
    /// aspectRatioConformPolicy.
    pub conform: String,
    /// dataWindowNDC: xmin, ymin, xmax, ymax, y up; 0 to 1 is the image.
    pub data_window: [f32; 4],
    /// All but the image's shape and the AOVs.
    pub settings: RenderSettings,
    /// How an EXR is written.
    pub exr: ExrOptions,
    /// orderedVars; none for color.
    pub vars: Vec<RenderVar>,
}

/// What a host asks for at one time.
#[derive(Clone, Debug)]
pub struct Request {
    /// The host's own image, rendered last, so that it can be read.
    pub view: View,
    /// The frame; none at the default time.
    pub frame: Option<f64>,
    /// Path of the RenderSettings prim; empty for none.
    pub settings_path: String,
    /// Its resolution, which products take whose own cannot be; where this cannot be either, the view's.
    pub resolution: [i32; 2],
    /// The same of its dataWindowNDC; where this cannot be either, the whole image.
    pub data_window: [f32; 4],
    /// Products to write.
    pub products: Vec<Product>,
}

impl Session {
    /// The renders of products, and the host's own at the end; what agrees with that shares it.
    pub fn plan(&self, request: &Request) -> Vec<Job> {
        let own = Job {
            view: request.view.clone(),
            files: Vec::new(),
        };
        let mut jobs = vec![own];
        let mut taken = BTreeMap::new();
        for product in &request.products {
            match self.plan_product(product, request, &mut taken) {
                Ok((view, file)) => add(&mut jobs, view, file),
                Err(why) => self.say_once(&product.path, &format!("{why}; it is not written")),
            }
        }
        jobs.rotate_left(1);
        jobs
    }

    /// The image of a product and its file; why it cannot be. `taken` are the places of files so far,
    /// and whose they are.
    fn plan_product(
        &self,
        product: &Product,
        request: &Request,
        taken: &mut BTreeMap<PathBuf, String>,
    ) -> Result<(View, Output), String> {
        if product.kind != "raster" {
            let kind = &product.kind;
            return Err(format!("productType {kind} is not supported, only raster"));
        }
        let path = frame_name::expand(&product.name, request.frame.unwrap_or_default());
        let file = file_type(&path, product)?;
        if let Some(other) = taken.get(&place(&path)) {
            return Err(format!("{path} is already written by {other}"));
        }
        taken.insert(place(&path), product.path.clone());
        if product.camera.is_none() {
            return Err(match product.camera_path.as_str() {
                "" => "it has no camera".to_owned(),
                camera => format!("its camera {camera} is no camera"),
            });
        }
        let (shape, why) = shape(product, request);
        let mut settings = image(&shape)?;
        for text in why.into_iter().chain(unusable(&shape, &settings)) {
            self.say_once(&product.path, &text);
        }
        let vars = self.vars(product, &mut settings.aovs)?;
        if file == FileType::Png && vars.len() > 1 {
            let text = "a PNG holds only color: its other vars are left out";
            self.say_once(&product.path, text);
        }
        let image = ImageOptions {
            file,
            color: match file {
                FileType::Png => PngColor::Srgb,
                FileType::Exr(_) => PngColor::Linear,
            },
            aovs: match vars.is_empty() {
                true => settings.aovs.clone(),
                false => Vec::new(),
            },
            vars,
            metadata: match file {
                FileType::Exr(_) => facts(product, request),
                FileType::Png => Vec::new(),
            },
        };
        let view = View {
            camera: product.camera,
            settings,
        };
        let output = Output {
            owner: product.path.clone(),
            path: path.into(),
            image,
        };
        Ok((view, output))
    }

    /// The vars of a product that can be written, and the AOVs that they are written from.
    fn vars(&self, product: &Product, aovs: &mut Vec<String>) -> Result<Vec<RenderVar>, String> {
        if product.vars.is_empty() {
            self.say_once(&product.path, "its orderedVars is empty; color is written");
            *aovs = vec!["color".to_owned()];
            return Ok(Vec::new());
        }
        aovs.clear();
        let mut vars = Vec::with_capacity(product.vars.len());
        for var in &product.vars {
            if let Ok(aov) = self.render_var_aov(var) {
                add_aov(aovs, aov);
                vars.push(var.clone());
            }
        }
        match vars.is_empty() {
            true => Err("none of its vars can be written".to_owned()),
            false => Ok(vars),
        }
    }
}

fn add(jobs: &mut Vec<Job>, view: View, file: Output) {
    let same = |job: &&mut Job| {
        let aovs = job.view.settings.aovs.clone();
        let settings = RenderSettings {
            aovs,
            ..view.settings.clone()
        };
        job.view.camera == view.camera && job.view.settings == settings
    };
    if let Some(job) = jobs.iter_mut().find(same) {
        for aov in view.settings.aovs {
            add_aov(&mut job.view.settings.aovs, aov);
        }
        job.files.push(file);
    } else {
        let files = vec![file];
        jobs.push(Job { view, files });
    }
}

fn add_aov(aovs: &mut Vec<String>, aov: String) {
    if !aovs.contains(&aov) {
        aovs.push(aov);
    }
}

fn file_type(path: &str, product: &Product) -> Result<FileType, String> {
    let suffix = Path::new(path).extension().unwrap_or_default();
    match suffix.to_ascii_lowercase().to_str() {
        Some("exr") => Ok(FileType::Exr(product.exr)),
        Some("png") => Ok(FileType::Png),
        _ if path.is_empty() => Err("it has no productName".to_owned()),
        _ => {
            let name = &product.name;
            Err(format!(
                "its productName {name} must be one that ends in .exr or .png"
            ))
        }
    }
}

/// What a path stands for, however it is written; the folders that there are decide.
fn place(path: &str) -> PathBuf {
    let path = absolute(path).unwrap_or_else(|_| path.into());
    let known = path.ancestors().find_map(|folder| {
        let found = folder.canonicalize().ok()?;
        Some(found.join(path.strip_prefix(folder).ok()?))
    });
    known.unwrap_or(path)
}

/// The product with the settings' resolution and data window in place of those that cannot be, and what
/// there is to say of it.
fn shape(product: &Product, request: &Request) -> (Product, Vec<String>) {
    let mut shape = product.clone();
    let mut texts = Vec::new();
    if let Err(why) = check_resolution(product.resolution) {
        let is_known = check_resolution(request.resolution).is_ok();
        shape.resolution = match is_known {
            true => request.resolution,
            false => request.view.settings.resolution.map(u32::cast_signed),
        };
        let [width, height] = product.resolution;
        texts.push(format!(
            "resolution is ({width}, {height}), which cannot be: {why}; the {} is used",
            if is_known {
                "render settings'"
            } else {
                "host's"
            }
        ));
    }
    if let Err(why) = check_window(product.data_window) {
        let is_known = check_window(request.data_window).is_ok();
        shape.data_window = match is_known {
            true => request.data_window,
            false => WHOLE,
        };
        let [left, bottom, right, top] = product.data_window;
        texts.push(format!(
            "dataWindowNDC is ({left}, {bottom}, {right}, {top}), which cannot be: {why}; {} is used",
            if is_known { "the render settings'" } else { "all of the image" }
        ));
    }
    (shape, texts)
}

fn check_resolution([width, height]: [i32; 2]) -> Result<(), String> {
    for (size, what) in [(width, "width"), (height, "height")] {
        if !(1..=LARGEST_RESOLUTION).contains(&size) {
            return Err(format!(
                "the image {what} must be from 1 to {LARGEST_RESOLUTION} pixels"
            ));
        }
    }
    Ok(())
}

fn check_window(window @ [left, bottom, right, top]: [f32; 4]) -> Result<(), &'static str> {
    // Both also where an edge is no number.
    if !(left < right && bottom < top) {
        return Err("the data window must have xmin < xmax and ymin < ymax");
    }
    match window.iter().all(|edge| edge.abs() <= 100.0) {
        true => Ok(()),
        false => Err("the data window reaches absurdly far out of the image"),
    }
}

/// The settings of a product with the shape of its image.
fn image(product: &Product) -> Result<RenderSettings, String> {
    let [width, height] = product.resolution;
    let window_policy = match product.conform.as_str() {
        "cropAperture" => WindowPolicy::Crop,
        "adjustApertureWidth" => WindowPolicy::MatchVertically,
        "adjustApertureHeight" => WindowPolicy::MatchHorizontally,
        "adjustPixelAspectRatio" => WindowPolicy::DontConform,
        _ => WindowPolicy::Fit,
    };
    let is_known = product.camera_aspect.is_finite() && product.camera_aspect > 0.0;
    let pixel_aspect = match product.pixel_aspect {
        // What the window does not conform to the image, the pixels' shape makes up for.
        _ if window_policy == WindowPolicy::DontConform && is_known => {
            (product.camera_aspect * f64::from(height) / f64::from(width)) as f32
        }
        aspect if (0.001..=1000.0).contains(&aspect) => aspect,
        _ => 1.0,
    };
    Ok(RenderSettings {
        resolution: [width, height].map(i32::unsigned_abs),
        pixel_aspect,
        window_policy,
        data_window: data_window(product.data_window, [width, height])?,
        ..product.settings.clone()
    })
}

/// What of a product's shape is not used, and what is in its place.
fn unusable(product: &Product, used: &RenderSettings) -> Vec<String> {
    let mut texts = Vec::new();
    let conform = product.conform.as_str();
    if used.window_policy == WindowPolicy::Fit && !["", "expandAperture"].contains(&conform) {
        texts.push(format!(
            "aspectRatioConformPolicy is {conform}, which is none; expandAperture is used"
        ));
    }
    let aspect = product.pixel_aspect;
    if used.window_policy != WindowPolicy::DontConform
        && aspect.to_bits() != used.pixel_aspect.to_bits()
    {
        texts.push(format!(
            "pixelAspectRatio is {aspect}, which cannot be; {} is used",
            used.pixel_aspect
        ));
    }
    texts
}

/// The pixels of a data window in NDC that can be, whose y goes up: those whose centres are inside. None for
/// all.
fn data_window(window: [f32; 4], [width, height]: [i32; 2]) -> Result<Option<[i32; 4]>, String> {
    if window == WHOLE {
        return Ok(None);
    }
    let [left, bottom, right, top] = window.map(f64::from);
    let pixel = |edge: f64, size: i32| (edge * f64::from(size) - 0.5).ceil() as i32;
    let pixels = [
        pixel(left, width),
        height - pixel(top, height),
        pixel(right, width),
        height - pixel(bottom, height),
    ];
    let [x0, y0, x1, y1] = pixels;
    if x0 >= x1 || y0 >= y1 {
        let text = "its data window holds no pixel of an image of";
        return Err(format!("{text} {width} x {height}"));
    }
    let span = |first: i32, last: i32, size: i32| last.max(size) - first.min(0);
    if span(x0, x1, width).max(span(y0, y1, height)) > LARGEST_RESOLUTION {
        return Err("its image and overscan span more than 65536 pixels".to_owned());
    }
    Ok((pixels != [0, 0, width, height]).then_some(pixels))
}

/// What an EXR says about its making, besides what every file of a session says.
fn facts(product: &Product, request: &Request) -> Vec<(String, String)> {
    let frame = request
        .frame
        .map_or_else(|| "default".to_owned(), ten_digits);
    [
        ("version", env!("CARGO_PKG_VERSION")),
        ("camera", &product.camera_path),
        ("frame", &frame),
        ("renderSettings", &request.settings_path),
        ("renderProduct", &product.path),
        ("complete", "true"),
    ]
    .map(|(name, value)| (format!("hdtrapeze/{name}"), value.to_owned()))
    .into()
}

/// A number with at most ten significant digits.
fn ten_digits(number: f64) -> String {
    let rounded: f64 = format!("{number:.9e}").parse().unwrap_or(number);
    rounded.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_windows_are_pixels_whose_centres_are_inside() {
        let window = |window| data_window(window, [100, 50]);
        assert_eq!(window([0.0, 0.0, 1.0, 1.0]), Ok(None));
        assert_eq!(window([0.001, 0.0, 1.004, 1.0]), Ok(None));
        // y goes up there, and down here.
        assert_eq!(window([0.25, 0.5, 0.75, 1.5]), Ok(Some([25, -25, 75, 25])));
        assert_eq!(window([0.006, 0.0, 1.0, 1.0]), Ok(Some([1, 0, 100, 50])));
        for wrong in [
            [0.5, 0.5, 0.5, 0.6],
            [0.6, 0.0, 0.5, 1.0],
            [0.0, 0.0, f32::NAN, 1.0],
            [f32::NEG_INFINITY, 0.0, 1.0, 1.0],
            [-101.0, 0.0, 1.0, 1.0],
        ] {
            assert!(check_window(wrong).is_err(), "{wrong:?}");
        }
        assert!(window([0.5, 0.5, 0.504, 0.6]).is_err(), "no pixel");
        assert_eq!(check_window([0.5, 0.5, 0.504, 0.6]), Ok(()));
        assert!(data_window([-99.0, 0.0, 1.0, 1.0], [65_536, 8]).is_err());
    }

    #[test]
    fn pixels_make_up_for_windows_that_do_not_conform() {
        let product = |conform: &str, pixel_aspect, camera_aspect| Product {
            path: "/p".to_owned(),
            kind: "raster".to_owned(),
            name: "a.exr".to_owned(),
            camera: Some(PrimId(1)),
            camera_path: "/c".to_owned(),
            camera_aspect,
            resolution: [200, 100],
            pixel_aspect,
            conform: conform.to_owned(),
            data_window: [0.0, 0.0, 1.0, 1.0],
            settings: RenderSettings::default(),
            exr: ExrOptions::default(),
            vars: Vec::new(),
        };
        let shape = |conform, pixel, camera| {
            let settings = image(&product(conform, pixel, camera)).unwrap();
            (settings.window_policy, settings.pixel_aspect)
        };
        assert_eq!(shape("", 2.0, 1.5), (WindowPolicy::Fit, 2.0));
        assert_eq!(
            shape("cropAperture", f32::NAN, 1.5),
            (WindowPolicy::Crop, 1.0)
        );
        assert_eq!(
            shape("adjustApertureWidth", 0.0, 1.5),
            (WindowPolicy::MatchVertically, 1.0)
        );
        assert_eq!(
            shape("adjustApertureHeight", 1.0, 1.5),
            (WindowPolicy::MatchHorizontally, 1.0)
        );
        let told = |conform, pixel| {
            let product = product(conform, pixel, 1.5);
            unusable(&product, &image(&product).unwrap()).join("; ")
        };
        assert_eq!(told("expandAperture", 2.0), "");
        assert_eq!(told("cropAperture", 1.0), "");
        assert_eq!(told("adjustPixelAspectRatio", -1.0), "");
        assert!(told("xx", 1.0).contains("xx, which is none; expandAperture is used"));
        assert!(told("", -2.0).contains("-2, which cannot be; 1 is used"));
        assert!(told("", f32::NAN).contains("NaN, which cannot be; 1 is used"));
        let stretched = "adjustPixelAspectRatio";
        assert_eq!(
            shape(stretched, 2.0, 1.5),
            (WindowPolicy::DontConform, 0.75)
        );
        for unknown in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(
                shape(stretched, 2.0, unknown),
                (WindowPolicy::DontConform, 2.0)
            );
        }
    }

    #[test]
    fn places_are_the_same_however_they_are_written() {
        let here = std::env::current_dir().unwrap();
        let whole = here.join("none.exr");
        assert_eq!(place("none.exr"), place(whole.to_str().unwrap()));
        assert_eq!(place("./src/../none.exr"), place("none.exr"));
        assert_ne!(place("no/such/none.exr"), place("none.exr"));
    }

    #[test]
    fn frames_have_no_superfluous_digits() {
        assert_eq!(ten_digits(3.0), "3");
        assert_eq!(ten_digits(1.0 / 3.0), "0.3333333333");
        assert_eq!(ten_digits(-1234.5), "-1234.5");
    }
}
