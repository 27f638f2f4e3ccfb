//! Render settings.

use super::CurveForm;

/// Pixel filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FilterKind {
    /// Box.
    Box,
    /// Gaussian (the default), truncated at its width.
    #[default]
    Gaussian,
    /// Mitchell-Netravali, B = C = 1/3.
    Mitchell,
    /// Blackman-Harris window.
    BlackmanHarris,
}

impl FilterKind {
    /// Diameter in pixels that the filter has where none is given.
    pub fn default_width(self) -> f32 {
        match self {
            FilterKind::Box => 1.0,
            FilterKind::Gaussian => 2.0,
            FilterKind::Mitchell => 4.0,
            FilterKind::BlackmanHarris => 3.0,
        }
    }
}

/// How the camera's aspect ratio meets the image's (CameraUtilConformWindowPolicy).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WindowPolicy {
    /// Keep the width, change the height.
    #[default]
    MatchHorizontally,
    /// Keep the height, change the width (usdrecord's).
    MatchVertically,
    /// Show all of the camera's view, and more.
    Fit,
    /// Fill the image with part of the camera's view.
    Crop,
    /// Stretch.
    DontConform,
}

/// Which sides of surfaces rays pass through (Hydra's cull style). Surfaces are meshes, grids,
/// NURBS patches and implicit prims; curves and points have no sides and are always seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cull {
    /// None: both sides are seen.
    #[default]
    None,
    /// Their backs.
    Back,
    /// Their fronts.
    Front,
    /// Their backs, but for prims that are double-sided.
    BackUnlessDoubleSided,
}

/// Micropolygons that one prim may have, in images that it fills so many times over...
const LAYERS: f64 = 64.0;
/// ...in addition so many for each base face...
const CELLS_A_FACE: u64 = 8;
/// ...and so many in any case.
const LEAST_MICROPOLYGONS: u64 = 1_000_000;

/// What renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// What is fastest here, which is the CPU where nothing says otherwise.
    #[default]
    Auto,
    /// What is fastest here, which was found to be a GPU.
    AutoGpu,
    /// The CPU.
    Cpu,
    /// A GPU renders what it knows of, and the CPU the rest.
    Gpu,
}

impl Backend {
    /// True where a GPU is to render.
    pub fn is_gpu(self) -> bool {
        matches!(self, Self::AutoGpu | Self::Gpu)
    }
}

/// Settings of one render.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Image width and height, pixels.
    pub resolution: [u32; 2],
    /// Pixels to render: x0, y0, x1, y1, half open, relative to the image's top left, y down; all of
    /// the image where there is none. Inside the image it is a crop, and the rest stays empty; what
    /// lies outside (below 0, beyond the resolution) is overscan.
    pub data_window: Option<[i32; 4]>,
    /// Pixel width over height.
    pub pixel_aspect: f32,
    /// Window policy.
    pub window_policy: WindowPolicy,
    /// Samples a pixel, at least 1.
    pub samples: u32,
    /// Micropolygon edge in pixels.
    pub shading_rate: f32,
    /// Pixel filter.
    pub filter: FilterKind,
    /// Filter diameter in pixels; 0 for the filter's own default.
    pub filter_width: f32,
    /// Seed of all sample patterns.
    pub seed: u32,
    /// Threads; 0 for all cores.
    pub threads: u32,
    /// What renders.
    pub backend: Backend,
    /// Shutter in place of the camera's, time codes relative to the frame.
    pub shutter: Option<[f64; 2]>,
    /// Render the frame's own time code only, with a shutter of no length (UsdRenderSettings'
    /// disableMotionBlur).
    pub disable_motion_blur: bool,
    /// Treat the lens as a pinhole.
    pub disable_defocus: bool,
    /// Light at the camera when the scene has no light.
    pub camera_light: bool,
    /// Part of the shutter that samples are drawn from, in [0, 1]; dicing still sees all of it.
    pub time_window: [f32; 2],
    /// A fixed point of the lens for every sample, in place of drawing one: in units of the round
    /// lens' radius, whatever the aperture's shape.
    pub lens_point: Option<[f32; 2]>,
    /// Most micropolygons that dicing may make of one prim; beyond it, and beyond what an image of this
    /// size can show (see [`Self::most_micropolygons`]), rates are coarsened with a warning.
    pub max_micropolygons: u64,
    /// What curves without normals are rendered as, unless their prim says so itself.
    pub curves: CurveForm,
    /// Keep the grids of an earlier commit where dicing anew would gain little: those of prims that appear once
    /// while nearly all their micropolygons have at most twice the area that is asked for, and no prim's are far finer. What an edit
    /// does not touch, the camera's too, is rendered sooner; bits then depend on what was rendered before. Those
    /// of hidden prims stay, too, for when they are shown again, and take their memory meanwhile.
    pub keep_finer: bool,
    /// Dice what may be hidden when a ray first comes near it, and not at all where none does. The image
    /// is the same.
    pub occlusion_culling: bool,
    /// Which sides of surfaces are not seen.
    pub cull: Cull,
    /// AOVs to render, by name; unknown names give a warning.
    pub aovs: Vec<String>,
}

impl RenderSettings {
    /// The smallest rectangle around the image and the data window, as [`Self::data_window`].
    pub fn window(&self) -> [i32; 4] {
        let [width, height] = self
            .resolution
            .map(|x| i32::try_from(x).unwrap_or(i32::MAX));
        let image = [0, 0, width, height];
        self.data_window.map_or(image, |data| union(image, data))
    }

    /// True where what may be hidden waits for rays: those that are traced on a GPU cannot have it diced.
    pub fn dices_on_demand(&self) -> bool {
        self.occlusion_culling && !self.backend.is_gpu()
    }

    /// Most micropolygons that dicing may make of one prim with `faces` base faces:
    /// [`Self::max_micropolygons`], or fewer where no image of this size shows so many. Numbers that fail
    /// to tell neighbouring points apart would else fill all of the memory.
    pub fn most_micropolygons(&self, faces: usize) -> u64 {
        let [x0, y0, x1, y1] = self.window().map(f64::from);
        let visible = (x1 - x0) * (y1 - y0) / f64::from(self.shading_rate).powi(2);
        // A float above the largest integer becomes that.
        let layers = (visible * LAYERS) as u64;
        let faces = (faces as u64).saturating_mul(CELLS_A_FACE);
        let most = LEAST_MICROPOLYGONS
            .saturating_add(layers)
            .saturating_add(faces);
        most.min(self.max_micropolygons)
    }
}

/// The smallest rectangle (x0, y0, x1, y1) around two.
pub fn union(a: [i32; 4], b: [i32; 4]) -> [i32; 4] {
    [
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ]
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            resolution: [960, 540],
            data_window: None,
            pixel_aspect: 1.0,
            window_policy: WindowPolicy::default(),
            samples: 64,
            shading_rate: 1.0,
            filter: FilterKind::default(),
            filter_width: 0.0,
            seed: 0,
            threads: 0,
            backend: Backend::Auto,
            shutter: None,
            disable_motion_blur: false,
            disable_defocus: false,
            camera_light: true,
            time_window: [0.0, 1.0],
            lens_point: None,
            max_micropolygons: 200_000_000,
            keep_finer: false,
            occlusion_culling: true,
            curves: CurveForm::Auto,
            cull: Cull::None,
            aovs: vec!["color".to_owned()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_prim_gets_more_micropolygons_than_its_image_can_show() {
        let mut settings = RenderSettings {
            resolution: [64, 36],
            ..RenderSettings::default()
        };
        let least = settings.most_micropolygons(0);
        assert_eq!(least, 1_000_000 + 64 * 64 * 36);
        assert_eq!(settings.most_micropolygons(1000), least + 8000);
        settings.data_window = Some([-64, 0, 64, 36]);
        assert_eq!(settings.most_micropolygons(0), least + 64 * 64 * 36);
        settings.shading_rate = 1.0e-6;
        assert_eq!(settings.most_micropolygons(0), settings.max_micropolygons);
        settings.shading_rate = f32::MIN_POSITIVE;
        settings.max_micropolygons = u64::MAX;
        assert_eq!(settings.most_micropolygons(usize::MAX), u64::MAX);
    }
}
