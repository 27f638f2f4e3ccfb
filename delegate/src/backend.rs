//! The backend of a render: the CPU, or a GPU that is opened once for the process.

use std::sync::{Arc, Mutex, OnceLock};

use hdtrapeze_core::render::{Generator, Prepared, RayTracer, Stage, TileSamples};
use hdtrapeze_core::scene::Backend;
use hdtrapeze_core::trace::{Hit, Ray};
pub use hdtrapeze_gpu::device::{Found, Kind};
use hdtrapeze_gpu::{Device, GpuCamera, GpuError, GpuScene, RayMaker, Tracer};

use crate::error::Error;
use crate::status::lock;

/// The device that is open. Where opening fails it is tried again: a driver may have come up.
static TRACER: Mutex<Option<Arc<Tracer>>> = Mutex::new(None);

/// All devices there are, the best first; looked for once.
pub fn devices() -> &'static [Found] {
    static DEVICES: OnceLock<Vec<Found>> = OnceLock::new();
    DEVICES.get_or_init(Device::list)
}

/// Opens what a backend needs; nothing for the CPU.
///
/// # Errors
/// A GPU is asked for, and there is none that opens.
pub fn open(backend: Backend) -> Result<Option<Arc<Tracer>>, Error> {
    if backend != Backend::Gpu {
        return Ok(None);
    }
    let open = &mut *lock(&TRACER);
    if let Some(tracer) = open.as_ref().filter(|t| t.device().check().is_ok()) {
        return Ok(Some(Arc::clone(tracer)));
    }
    let device = Device::open()
        .map_err(|error| Error::Unsupported(format!("{error}; the backend cpu needs no device")))?;
    let tracer = Arc::new(Tracer::new(Arc::new(device)));
    *open = Some(Arc::clone(&tracer));
    Ok(Some(tracer))
}

/// A committed scene on a GPU.
#[derive(Debug)]
pub(crate) struct OnGpu {
    tracer: Arc<Tracer>,
    scene: GpuScene,
    /// Where it draws the rays of this camera.
    camera: Option<(RayMaker, GpuCamera)>,
}

impl OnGpu {
    /// Uploads a scene.
    pub fn new(tracer: Arc<Tracer>, prepared: &Prepared) -> Result<Self, GpuError> {
        if prepared.plan().has_culling() {
            let what = "scenes whose sides are culled".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let scene = GpuScene::new(tracer.device(), prepared.world())?;
        let camera = match GpuCamera::new(tracer.device(), &Generator::new(prepared)) {
            Ok(camera) => Some((RayMaker::new(Arc::clone(tracer.device())), camera)),
            Err(GpuError::Unsupported(_)) => None,
            Err(error) => return Err(error),
        };
        Ok(Self {
            tracer,
            scene,
            camera,
        })
    }

    /// What it is on, for people.
    pub fn name(&self) -> String {
        format!("gpu ({})", self.tracer.device().found().name)
    }

    /// The same, and what is done there.
    pub fn explain(&self) -> String {
        let done = match self.first_stage() {
            Stage::Generate => "draws and traces camera rays",
            Stage::Trace => "traces camera rays",
        };
        format!("{}, which {done}", self.name())
    }
}

impl RayTracer for OnGpu {
    fn first_stage(&self) -> Stage {
        match self.camera {
            Some(_) => Stage::Generate,
            None => Stage::Trace,
        }
    }

    fn trace_tiles(&self, tiles: &[TileSamples], hits: &mut [Hit]) -> Result<(), String> {
        let Some((maker, camera)) = &self.camera else {
            return Err("it draws no rays".to_owned());
        };
        let traced = maker.draw(camera, tiles, false).and_then(|drawn| {
            self.tracer
                .trace_there(&self.scene, &drawn.rays, drawn.len, hits)
        });
        traced.map_err(|error| error.to_string())
    }

    fn trace(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), String> {
        let traced = self.tracer.trace(&self.scene, rays, false, hits);
        traced.map_err(|error| error.to_string())
    }
}
