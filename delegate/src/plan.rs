//! Which renders a view and the render products beside it make, and what is written of each.
//!
//! Images that agree in camera and settings share one render; their AOVs are rendered together. Of a
//! product that cannot be there is one warning, and the rest is rendered.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf, absolute};

use hdtrapeze_core::scene::{PrimId, RenderSettings, WindowPolicy};

use crate::error::Error;
use crate::file::{FileType, ImageOptions};
use crate::frame_name;
use crate::image::{ExrOptions, PngColor};
use crate::product::RenderVar;
use crate::render_loop::{Job, Output, View};
use crate::session::Session;
use crate::status::lock;

/// Largest width and height of an image, and of it with overscan, pixels.
const LARGEST_RESOLUTION: i32 = 65_536;

/// The data window that is the image.
const WHOLE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

/// What a RenderSettings or RenderProduct prim says of the shape of its image.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Width and height.
    pub resolution: [i32; 2],
    /// pixelAspectRatio.
    pub pixel_aspect: f32,
    /// aspectRatioConformPolicy.
    pub conform: String,
    /// dataWindowNDC: xmin, ymin, xmax, ymax, y up; 0 to 1 is the image.
    pub data_window: [f32; 4],
}

/// What a host knows of the shape that a RenderSettings prim says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownShape {
    /// Width and height.
    pub resolution: Option<[i32; 2]>,
    /// pixelAspectRatio.
    pub pixel_aspect: Option<f32>,
    /// aspectRatioConformPolicy.
    pub conform: Option<String>,
    /// dataWindowNDC.
    pub data_window: Option<[f32; 4]>,
}

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
    /// The shape of its image.
    pub shape: Shape,
    /// All but the image's shape and the AOVs.
    pub settings: RenderSettings,
    /// How an EXR is written.
    pub exr: ExrOptions,
    /// Those of orderedVars that are vars.
    pub vars: Vec<RenderVar>,
    /// How many prims orderedVars names; where it names none, color is written.
    pub var_targets: usize,
}

/// What a host asks for at one time.
#[derive(Clone, Debug)]
pub struct Request {
    /// The host's own image, rendered last, so that it can be read.
    pub view: View,
    /// Width over height of the film back of its camera; 0 where that is not known.
    pub camera_aspect: f64,
    /// Where the host writes it by itself; empty for nowhere.
    pub path: String,
    /// The frame; none at the default time.
    pub frame: Option<f64>,
    /// Path of the RenderSettings prim; empty for none.
    pub settings_path: String,
    /// Its shape, of which products take what they say themselves, but cannot be. What cannot be of this
    /// either is as the schema has it, and what is not known is the view's.
    pub shape: KnownShape,
    /// The view takes its resolution, pixel aspect and policy.
    pub shapes_view: bool,
    /// The view takes its data window.
    pub windows_view: bool,
    /// Products to write.
    pub products: Vec<Product>,
}

/// What is made of a request.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The renders, the host's own at the end.
    pub jobs: Vec<Job>,
    /// What becomes of each product; why it is not written has been told.
    pub products: Vec<Result<Planned, Error>>,
    /// Why the host's own image cannot be, or not be written where it is to be.
    pub own: Result<(), Error>,
}

/// Whose the files of plans so far were, and at which frame.
pub(crate) type PlannedFiles = BTreeMap<PathBuf, (String, Option<u64>)>;

/// Where a product's file is among the jobs of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planned {
    /// The render.
    pub job: usize,
    /// Which of its files.
    pub file: usize,
}

impl Session {
    /// The renders of products, and the host's own at the end; what agrees with that shares it.
    pub fn plan(&self, request: &Request) -> Plan {
        let (known, texts) = settings_shape(request);
        for text in texts {
            self.say_once(&request.settings_path, &text);
        }
        let view = own_view(request, &known);
        if let Err(why) = &view {
            let text = format!("its {why}; the host's own image is not written");
            self.say_once(&request.settings_path, &text);
        }
        let mut jobs = vec![Job {
            view: view.clone().unwrap_or_else(|_| request.view.clone()),
            files: Vec::new(),
        }];
        let mut taken = BTreeMap::new();
        let mut products = Vec::with_capacity(request.products.len());
        for product in &request.products {
            let planned =
                self.plan_product(product, request, &known, &taken)
                    .map(|(view, file)| {
                        taken.insert(place(&file.path), product.path.clone());
                        add(&mut jobs, view, file)
                    });
            if let Err(why) = &planned {
                self.say_once(&product.path, &format!("{why}; it is not written"));
            }
            products.push(planned);
        }
        let own = view.and_then(|_| match taken.get(&place(request.path.as_ref())) {
            Some(other) if !request.path.is_empty() => {
                let why = format!("{} is already written by {other}", request.path);
                self.say_once("", &format!("{why}, and the host's own image is not"));
                Err(Error::InvalidArgument(why))
            }
            _ => Ok(()),
        });
        jobs.rotate_left(1);
        for planned in products.iter_mut().flatten() {
            planned.job = (planned.job + jobs.len() - 1) % jobs.len();
        }
        Plan {
            jobs,
            products,
            own,
        }
    }

    /// The image of a product and its file; why it cannot be. `known` is the settings' shape, and `taken`
    /// are the places of files so far, and whose they are.
    fn plan_product(
        &self,
        product: &Product,
        request: &Request,
        known: &Shape,
        taken: &BTreeMap<PathBuf, String>,
    ) -> Result<(View, Output), Error> {
        let invalid = Error::InvalidArgument;
        if product.kind != "raster" {
            let kind = &product.kind;
            return Err(Error::Unsupported(format!(
                "productType {kind} is not supported, only raster"
            )));
        }
        let path = frame_name::expand(&product.name, request.frame.unwrap_or_default());
        let file = file_type(&path, product).map_err(invalid)?;
        if let Some(other) = taken.get(&place(path.as_ref())) {
            return Err(invalid(format!("{path} is already written by {other}")));
        }
        if product.camera.is_none() {
            return Err(invalid(match product.camera_path.as_str() {
                "" => "it has no camera".to_owned(),
                camera => format!("its camera {camera} is no camera"),
            }));
        }
        check_writable(path.as_ref())?;
        let mine = product.shape.inherited(&request.shape, known);
        let (shape, texts) = mine.or(known);
        for text in texts {
            self.say_once(&product.path, &text);
        }
        let mut settings = image(&shape, product.camera_aspect, &product.settings)
            .map_err(|why| invalid(format!("its {why}")))?;
        let vars = self.vars(product, &mut settings.aovs).map_err(invalid)?;
        if file == FileType::Png && vars.len() > 1 {
            let text = "a PNG holds only color: its other vars are left out";
            self.say_once(&product.path, text);
        }
        self.check_frame(product, &path, request.frame);
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
            partial: false,
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

    /// Says so where each frame of a product replaces the one before.
    fn check_frame(&self, product: &Product, path: &str, frame: Option<f64>) {
        let frame = frame.map(f64::to_bits);
        let mine = (product.path.clone(), frame);
        let before = lock(&self.planned).insert(place(path.as_ref()), mine);
        if before.is_some_and(|(owner, other)| owner == product.path && other != frame) {
            let text = format!(
                "each frame replaces {path}: put the frame into productName, as #### or <F4>"
            );
            self.say_once(&product.path, &text);
        }
    }

    /// The vars of a product that can be written, and the AOVs that they are written from.
    fn vars(&self, product: &Product, aovs: &mut Vec<String>) -> Result<Vec<RenderVar>, String> {
        if product.vars.is_empty() && product.var_targets == 0 {
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

/// Adds a file to the render that its image agrees with, or to one of its own.
fn add(jobs: &mut Vec<Job>, view: View, file: Output) -> Planned {
    let same = |job: &Job| {
        let aovs = job.view.settings.aovs.clone();
        let settings = RenderSettings {
            aovs,
            ..view.settings.clone()
        };
        job.view.camera == view.camera && job.view.settings == settings
    };
    let job = jobs.iter().position(same).unwrap_or(jobs.len());
    match jobs.get_mut(job) {
        Some(job) => {
            for aov in view.settings.aovs {
                add_aov(&mut job.view.settings.aovs, aov);
            }
            job.files.push(file);
        }
        None => jobs.push(Job {
            view,
            files: vec![file],
        }),
    }
    Planned {
        job,
        file: jobs[job].files.len() - 1,
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
fn place(path: &Path) -> PathBuf {
    let path = absolute(path).unwrap_or_else(|_| path.into());
    let known = path.ancestors().find_map(|folder| {
        let found = folder.canonicalize().ok()?;
        Some(found.join(path.strip_prefix(folder).ok()?))
    });
    known.unwrap_or(path)
}

/// Why no file can be there, as far as that shows before there is one.
fn check_writable(path: &Path) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let folder = folder.display();
        return Err(Error::Io(format!("the folder {folder} does not exist")));
    }
    if path.is_dir() {
        return Err(Error::Io(format!("{} is a folder", path.display())));
    }
    // A file without a name, which is gone at once.
    if tempfile::tempfile_in(folder).is_err() {
        let folder = folder.display();
        return Err(Error::Io(format!("the folder {folder} is not writable")));
    }
    Ok(())
}

impl Shape {
    /// What the schema of RenderSettings says where nobody does.
    pub fn of_schema() -> Self {
        Self {
            resolution: [2048, 1080],
            pixel_aspect: 1.0,
            conform: "expandAperture".to_owned(),
            data_window: WHOLE,
        }
    }

    /// The shape with the settings' values as they are `known` in place of those that it has of the
    /// settings, `raw`: what cannot be of them has been told.
    fn inherited(&self, raw: &KnownShape, known: &Self) -> Self {
        let mut shape = self.clone();
        if Some(self.resolution) == raw.resolution {
            shape.resolution = known.resolution;
        }
        if Some(self.pixel_aspect.to_bits()) == raw.pixel_aspect.map(f32::to_bits) {
            shape.pixel_aspect = known.pixel_aspect;
        }
        if Some(&self.conform) == raw.conform.as_ref() {
            shape.conform.clone_from(&known.conform);
        }
        let bits = |window: [f32; 4]| window.map(f32::to_bits);
        if Some(bits(self.data_window)) == raw.data_window.map(bits) {
            shape.data_window = known.data_window;
        }
        shape
    }

    /// The shape with another's values in place of those that cannot be, and what there is to say of it.
    fn or(&self, other: &Self) -> (Self, Vec<String>) {
        let mut shape = self.clone();
        let mut texts = Vec::new();
        let mut tell = |name: &str, value: String, why: &str, used: String| {
            texts.push(format!(
                "{name} is {value}, which cannot be: {why}; {used} is used"
            ));
        };
        if let Err(why) = check_resolution(self.resolution) {
            shape.resolution = other.resolution;
            let [mine, others] = [self, other].map(|of| shown(of.resolution));
            tell("resolution", mine, &why, others);
        }
        let policy = policy(&self.conform);
        if policy.is_none() {
            shape.conform.clone_from(&other.conform);
            let why = format!("known are {}", POLICIES.map(|known| known.0).join(", "));
            let mine = match self.conform.as_str() {
                "" => "empty",
                word => word,
            };
            tell(
                "aspectRatioConformPolicy",
                mine.to_owned(),
                &why,
                other.conform.clone(),
            );
        }
        // What the window does not conform to the image, the pixels' shape makes up for.
        let is_made_up = policy == Some(WindowPolicy::DontConform);
        if !(0.001..=1000.0).contains(&self.pixel_aspect) {
            shape.pixel_aspect = other.pixel_aspect;
            if !is_made_up {
                let [mine, others] = [self, other].map(|of| of.pixel_aspect.to_string());
                let why = "it must be from 0.001 to 1000";
                tell("pixelAspectRatio", mine, why, others);
            }
        }
        if let Err(why) = check_window(self.data_window) {
            shape.data_window = other.data_window;
            let [mine, others] = [self, other].map(|of| shown(of.data_window));
            tell("dataWindowNDC", mine, why, others);
        }
        (shape, texts)
    }
}

fn shown<T: ToString, const N: usize>(values: [T; N]) -> String {
    format!("({})", values.map(|value| value.to_string()).join(", "))
}

/// The settings' shape, complete: what is not known is the view's, what cannot be is as the schema has it.
fn settings_shape(request: &Request) -> (Shape, Vec<String>) {
    let schema = Shape::of_schema();
    let authored = request.shape.clone();
    let shape = Shape {
        resolution: authored
            .resolution
            .unwrap_or_else(|| request.view.settings.resolution.map(u32::cast_signed)),
        pixel_aspect: authored.pixel_aspect.unwrap_or(schema.pixel_aspect),
        conform: authored.conform.unwrap_or_else(|| schema.conform.clone()),
        data_window: authored.data_window.unwrap_or(schema.data_window),
    };
    shape.or(&schema)
}

/// The host's own image with what it takes of the settings' shape.
fn own_view(request: &Request, known: &Shape) -> Result<View, Error> {
    let mut view = request.view.clone();
    let given = &request.view.settings;
    if request.shapes_view {
        let whole = Shape {
            data_window: WHOLE,
            ..known.clone()
        };
        view.settings =
            image(&whole, request.camera_aspect, given).map_err(Error::InvalidArgument)?;
        view.settings.data_window = given.data_window;
    }
    if request.windows_view {
        let size = view.settings.resolution.map(u32::cast_signed);
        view.settings.data_window =
            data_window(known.data_window, size).map_err(Error::InvalidArgument)?;
    }
    Ok(view)
}

/// Whether a resolution and a data window can be; why not.
pub fn check(resolution: [i32; 2], window: [f32; 4]) -> Result<(), String> {
    check_resolution(resolution)?;
    Ok(check_window(window)?)
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

/// aspectRatioConformPolicies, and what they make of the window.
const POLICIES: [(&str, WindowPolicy); 5] = [
    ("expandAperture", WindowPolicy::Fit),
    ("cropAperture", WindowPolicy::Crop),
    ("adjustApertureWidth", WindowPolicy::MatchVertically),
    ("adjustApertureHeight", WindowPolicy::MatchHorizontally),
    ("adjustPixelAspectRatio", WindowPolicy::DontConform),
];

/// What a policy makes of the window.
fn policy(conform: &str) -> Option<WindowPolicy> {
    let found = POLICIES.iter().find(|known| known.0 == conform);
    found.map(|known| known.1)
}

/// Settings with the shape of an image, of which each part can be.
fn image(
    shape: &Shape,
    camera_aspect: f64,
    settings: &RenderSettings,
) -> Result<RenderSettings, String> {
    let [width, height] = shape.resolution;
    let window_policy = policy(&shape.conform).unwrap_or(WindowPolicy::Fit);
    let is_known = camera_aspect.is_finite() && camera_aspect > 0.0;
    let pixel_aspect = match window_policy {
        WindowPolicy::DontConform if is_known => {
            (camera_aspect * f64::from(height) / f64::from(width)) as f32
        }
        _ => shape.pixel_aspect,
    };
    Ok(RenderSettings {
        resolution: [width, height].map(i32::unsigned_abs),
        pixel_aspect,
        window_policy,
        data_window: data_window(shape.data_window, [width, height])?,
        ..settings.clone()
    })
}

/// The pixels of a data window in NDC, whose y goes up: those whose centres are inside. None for all.
///
/// # Errors
/// Why there are none: the window cannot be, holds no pixel, or too many.
pub fn data_window(
    window: [f32; 4],
    [width, height]: [i32; 2],
) -> Result<Option<[i32; 4]>, String> {
    if window == WHOLE {
        return Ok(None);
    }
    check_window(window)?;
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
        let text = "data window holds no pixel of an image of";
        return Err(format!("{text} {width} x {height}"));
    }
    let span = |first: i32, last: i32, size: i32| last.max(size) - first.min(0);
    if span(x0, x1, width).max(span(y0, y1, height)) > LARGEST_RESOLUTION {
        return Err("image and overscan span more than 65536 pixels".to_owned());
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

    fn shape(conform: &str, pixel_aspect: f32) -> Shape {
        Shape {
            resolution: [200, 100],
            pixel_aspect,
            conform: conform.to_owned(),
            data_window: WHOLE,
        }
    }

    #[test]
    fn pixels_make_up_for_windows_that_do_not_conform() {
        let made = |conform, pixel_aspect, camera_aspect| {
            let (shape, _) = shape(conform, pixel_aspect).or(&Shape::of_schema());
            let settings = image(&shape, camera_aspect, &RenderSettings::default()).unwrap();
            (settings.window_policy, settings.pixel_aspect)
        };
        assert_eq!(made("expandAperture", 2.0, 1.5), (WindowPolicy::Fit, 2.0));
        assert_eq!(
            made("cropAperture", f32::NAN, 1.5),
            (WindowPolicy::Crop, 1.0)
        );
        assert_eq!(
            made("adjustApertureWidth", 0.0, 1.5),
            (WindowPolicy::MatchVertically, 1.0)
        );
        assert_eq!(
            made("adjustApertureHeight", 1.0, 1.5),
            (WindowPolicy::MatchHorizontally, 1.0)
        );
        let stretched = "adjustPixelAspectRatio";
        assert_eq!(made(stretched, 2.0, 1.5), (WindowPolicy::DontConform, 0.75));
        for unknown in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(
                made(stretched, 2.0, unknown),
                (WindowPolicy::DontConform, 2.0)
            );
        }
    }

    #[test]
    fn what_cannot_be_is_another_shapes() {
        let other = Shape {
            data_window: [0.0, 0.0, 0.5, 1.0],
            ..shape("cropAperture", 2.0)
        };
        let wrong = Shape {
            resolution: [0, 4],
            data_window: [0.5, 0.0, f32::NAN, 1.0],
            ..shape("stretch", -1.0)
        };
        let (made, told) = wrong.or(&other);
        assert_eq!(made, other);
        let expected = [
            "resolution is (0, 4), which cannot be: the image width must be from 1 to 65536 pixels; \
             (200, 100) is used",
            "aspectRatioConformPolicy is stretch, which cannot be: known are expandAperture, cropAperture, \
             adjustApertureWidth, adjustApertureHeight, adjustPixelAspectRatio; cropAperture is used",
            "pixelAspectRatio is -1, which cannot be: it must be from 0.001 to 1000; 2 is used",
            "dataWindowNDC is (0.5, 0, NaN, 1), which cannot be: the data window must have xmin < xmax \
             and ymin < ymax; (0, 0, 0.5, 1) is used",
        ];
        assert_eq!(told, expected);
        let (made, told) = shape("", 2.0).or(&other);
        assert_eq!(made.conform, "cropAperture");
        assert!(
            told[0].starts_with("aspectRatioConformPolicy is empty, which cannot be: known are")
        );
        for fine in [
            shape("expandAperture", 2.0),
            shape("adjustPixelAspectRatio", -1.0),
        ] {
            let (made, told) = fine.or(&other);
            assert_eq!(told, [""; 0]);
            assert_eq!(made.resolution, fine.resolution);
        }
    }

    #[test]
    fn places_are_the_same_however_they_are_written() {
        let here = std::env::current_dir().unwrap();
        let whole = here.join("none.exr");
        let place = |path: &str| place(path.as_ref());
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
