//! A scene on a device, and the stages that it runs for core's passes.
//!
//! Its trees are made there, of vertices that the CPU has made none over; where an edit moves vertices, they are refitted.
//!
//! Everything from samples to sums of pixels, where the scene and its AOVs are of the kind that `shade` knows; camera rays
//! and their hits elsewhere; hits of rays that the CPU draws where the device does not know the lens.

use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, PoisonError};

use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_core::render::{Generator, Made, Prepared, RayTracer, Stage, TileSamples};
use hdtrapeze_core::trace::{Hit, Ray};
use hdtrapeze_shaders::layout::{self, Sample};

use super::film::Filmer;
use super::layers::{Layer, Layers};
use super::shade::{GpuLooks, Shader};
use super::tiles::GpuTiles;
use super::trace::{packed, to_layout};
use super::{BuildOptions, Device, EarlyVertices, FirstOnDevice, GpuCamera, GpuError, GpuScene};
use super::{RayMaker, Tracer, TreeBuilder, pages, shade};
use hdtrapeze_shaders::stage::BuildStage;

/// The stages of a device, each compiled once.
#[derive(Debug)]
pub struct Stages {
    builder: TreeBuilder,
    rays: RayMaker,
    tracer: Tracer,
    shader: Shader,
    filmer: Filmer,
}

/// How a scene is taken to a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameOptions {
    /// The first stage that is run there: a difference is narrowed down by moving it.
    pub first: FirstOnDevice,
    /// Bytes of the largest array of a page.
    pub most: u64,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self {
            first: FirstOnDevice::default(),
            most: u64::MAX,
        }
    }
}

/// A committed scene on a device.
#[derive(Debug)]
pub struct GpuFrame {
    stages: Arc<Stages>,
    scene: GpuScene,
    options: FrameOptions,
    /// Its trees are those of the scene before, with other bounds.
    refitted: bool,
    /// Where it draws the rays of this camera.
    camera: Option<GpuCamera>,
    /// How it looks, nothing where the CPU's colours are filmed; or why the CPU shades and films it.
    looks: Result<Option<GpuLooks>, String>,
    /// Seconds of each stage, where they are asked for.
    seconds: Option<Mutex<[f64; 4]>>,
}

impl Stages {
    /// For this device.
    pub fn new(device: &Arc<Device>) -> Self {
        Self {
            builder: TreeBuilder::new(Arc::clone(device)),
            rays: RayMaker::new(Arc::clone(device)),
            tracer: Tracer::new(Arc::clone(device)),
            shader: Shader::new(Arc::clone(device)),
            filmer: Filmer::new(Arc::clone(device)),
        }
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        self.tracer.device()
    }
}

impl GpuFrame {
    /// Uploads a scene, and makes its trees there.
    ///
    /// # Errors
    /// It is larger than the device takes, or holds what a GPU cannot trace; or the device is lost.
    pub fn new(stages: Arc<Stages>, prepared: &Prepared) -> Result<Self, GpuError> {
        Self::with(FrameOptions::default(), stages, prepared)
    }

    /// The same, in a way that is asked for.
    ///
    /// # Errors
    /// As [`GpuFrame::new`]; or the CPU does all of the stages that are left.
    pub fn with(
        options: FrameOptions,
        stages: Arc<Stages>,
        prepared: &Prepared,
    ) -> Result<Self, GpuError> {
        Self::with_early(options, stages, prepared, None)
    }

    /// The same where vertices of some objects are on the device.
    ///
    /// # Errors
    /// As [`GpuFrame::with`].
    pub fn with_early(
        options: FrameOptions,
        stages: Arc<Stages>,
        prepared: &Prepared,
        early: Option<&EarlyVertices>,
    ) -> Result<Self, GpuError> {
        let build = BuildOptions {
            first: options.first,
            most: options.most,
            // Who keeps grids where only the camera moves edits, and may move points as well.
            refits: prepared.settings().keep_finer,
        };
        let device = stages.device();
        let paints = match options.first == FirstOnDevice::Film
            || shade::shaded_here(device, prepared).is_some()
        {
            true => pages::Paints::new(),
            false => shade::paints_of(prepared),
        };
        let scene = GpuScene::painted(&stages.builder, prepared.world(), &build, &paints, early)?;
        Self::around(options, stages, scene, prepared)
    }

    /// The same as [`GpuFrame::new`] for a scene that came after this one: trees whose grids are as they were are refitted,
    /// where they stay good.
    ///
    /// # Errors
    /// As [`GpuFrame::new`].
    pub fn after(self, prepared: &Prepared) -> Result<Self, GpuError> {
        self.after_early(prepared, None)
    }

    /// The same where vertices of some objects are on the device.
    ///
    /// # Errors
    /// As [`GpuFrame::new`].
    pub fn after_early(
        self,
        prepared: &Prepared,
        early: Option<&EarlyVertices>,
    ) -> Result<Self, GpuError> {
        let Self {
            stages,
            mut scene,
            options,
            camera,
            looks,
            ..
        } = self;
        // Their room is for what comes.
        drop((camera, looks));
        let refitted = match scene.refit_early(&stages.builder, prepared.world(), early) {
            // There may be room for one of both, or for more pages.
            Err(
                GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. } | GpuError::Unsupported(_),
            ) => false,
            refitted => refitted?,
        };
        if refitted {
            let frame = Self::around(options, stages, scene, prepared)?;
            return Ok(Self {
                refitted: true,
                ..frame
            });
        }
        drop(scene);
        Self::with_early(options, stages, prepared, early)
    }

    fn around(
        options: FrameOptions,
        stages: Arc<Stages>,
        scene: GpuScene,
        prepared: &Prepared,
    ) -> Result<Self, GpuError> {
        let device = stages.device();
        let camera = match GpuCamera::new(device, &Generator::new(prepared)) {
            Err(GpuError::Unsupported(why)) => Err(why),
            made => Ok(made?),
        };
        let (camera, looks) = match camera {
            Err(why) => (None, Err(why)),
            Ok(camera) => {
                let looks = match options.first {
                    FirstOnDevice::Film => prepared.shaded_here().map_or(Ok(None), Err),
                    _ => match GpuLooks::new(device, &scene, &camera, prepared) {
                        Err(GpuError::Unsupported(why)) => Err(why),
                        Err(
                            error @ (GpuError::TooLarge { .. }
                            | GpuError::OutOfMemory { .. }
                            | GpuError::HostMemory { .. }),
                        ) => Err(error.to_string()),
                        made => Ok(Some(made?)),
                    },
                };
                (Some(camera), looks)
            }
        };
        match (&looks, options.first > FirstOnDevice::Trace) {
            (Err(why), true) => Err(GpuError::Nothing {
                first: options.first.name(),
                why: why.clone(),
            }),
            _ => Ok(Self {
                stages,
                scene,
                options,
                refitted: false,
                camera,
                looks,
                seconds: None,
            }),
        }
    }

    /// The same with each stage timed.
    #[must_use]
    pub fn timed(self) -> Self {
        Self {
            seconds: Some(Mutex::default()),
            ..self
        }
    }

    /// Seconds that the device took for generate, trace, shade and film by now, where they are timed and it can tell.
    pub fn seconds(&self) -> [f64; 4] {
        let seconds = self.seconds.as_ref();
        seconds.map_or([0.0; 4], |s| {
            *s.lock().unwrap_or_else(PoisonError::into_inner)
        })
    }

    /// As [`GpuScene::build_seconds`].
    pub fn build_seconds(&self) -> Vec<(BuildStage, f64)> {
        self.scene.build_seconds()
    }

    /// Pages that its scene is on.
    pub fn page_count(&self) -> usize {
        self.scene.page_count()
    }

    /// Bytes of trees, vertices and instances on the device; normals and colours, rays and samples are not among them.
    pub fn bytes(&self) -> u64 {
        self.scene.bytes()
    }

    /// True where it is on the device of these stages, and was taken there in this way.
    pub fn is_of(&self, stages: &Arc<Stages>, options: &FrameOptions) -> bool {
        Arc::ptr_eq(&self.stages, stages) && self.options == *options
    }

    /// What it is on, for people.
    pub fn name(&self) -> String {
        format!("gpu ({})", self.stages.device().found().name)
    }

    /// The same, and what is done there.
    pub fn explain(&self) -> String {
        let first = self.options.first.of_samples();
        let done = match (&self.camera, &self.looks) {
            (_, Ok(_)) => match first {
                Stage::Generate => "draws, traces, shades and films samples",
                Stage::Trace => "traces, shades and films samples",
                Stage::Shade => "shades and films samples",
                Stage::Film => "films samples",
            }
            .to_owned(),
            (Some(_), Err(why)) if first == Stage::Generate => {
                format!("draws and traces camera rays; the CPU shades and films them: {why}")
            }
            (Some(_), Err(why)) => {
                format!("traces camera rays; the CPU draws, shades and films them: {why}")
            }
            (None, Err(why)) => {
                format!("traces camera rays; the CPU draws, shades and films them: {why}")
            }
        };
        let trees = match (self.scene.has_own_trees(), self.refitted) {
            (true, false) => "makes trees, ",
            (true, true) => "refits trees, ",
            (false, _) => "",
        };
        let from = match self.options.first {
            FirstOnDevice::Bound => String::new(),
            first => format!(", from the stage {} on", first.name()),
        };
        let pages = match self.page_count() {
            1 => String::new(),
            count => format!(" on {count} pages"),
        };
        format!("{}{from}, which {trees}{done}{pages}", self.name())
    }

    /// True where its trees are those of the scene before, with other bounds.
    pub fn is_refitted(&self) -> bool {
        self.refitted
    }

    /// Keeps what was compiled by now, for other runs.
    fn keep_pipelines(&self) {
        if let Some(pipelines) = self.stages.device().pipelines() {
            pipelines.keep();
        }
    }

    fn took(&self, stage: Stage, seconds: Option<f64>) {
        if let (Some(all), Some(seconds)) = (&self.seconds, seconds) {
            all.lock().unwrap_or_else(PoisonError::into_inner)[stage as usize] += seconds;
        }
    }

    /// Rays of tiles, on the device.
    fn drawn(&self, camera: &GpuCamera, tiles: &GpuTiles) -> Result<wgpu::Buffer, GpuError> {
        let timed = self.seconds.is_some();
        let (rays, seconds) = self.stages.rays.draw(camera, tiles, timed)?;
        self.took(Stage::Generate, seconds);
        Ok(rays)
    }

    /// What rays that are there hit, on the device.
    fn traced(&self, rays: &wgpu::Buffer, len: usize) -> Result<wgpu::Buffer, GpuError> {
        let tracer = &self.stages.tracer;
        let batch = tracer.batch_of(&self.scene, rays, len, false, false)?;
        let timed = self.seconds.is_some();
        self.took(Stage::Trace, tracer.start(&batch, timed)?);
        Ok(batch.into_hits())
    }

    /// Films what the CPU has shaded.
    fn film_made(
        &self,
        camera: &GpuCamera,
        tiles: &[TileSamples],
        made: &Made,
        out: (&mut [PixelSums], &mut [f32]),
    ) -> Result<(), GpuError> {
        let device = self.stages.device();
        let timed = self.seconds.is_some();
        let tiles = &GpuTiles::new(device, tiles, camera.has_time)?;
        let hits: Vec<layout::Hit> = made.hits.iter().map(to_layout).collect();
        let hits = device.upload("hits", bytemuck::cast_slice(&hits))?;
        let samples = made.jobs.iter().zip(&made.colors);
        let samples = samples.map(|(job, &color)| Sample {
            color,
            weight: job.weight,
            distance2: job.distance2,
            time: job.ray.time,
            ..Sample::default()
        });
        let samples: Vec<Sample> = samples.collect();
        let samples = device.upload("samples", bytemuck::cast_slice(&samples))?;
        let values = (!made.values.is_empty())
            .then(|| device.upload("values of samples", bytemuck::cast_slice(&made.values)));
        let values = values.transpose()?;
        let filmer = &self.stages.filmer;
        let there = [&samples, &hits];
        let seconds = filmer.film(tiles, there, values.as_ref(), true, out, timed)?;
        self.took(Stage::Film, seconds);
        Ok(())
    }

    /// Shades and films, and does what comes before from the first stage on.
    fn film_tiles(
        &self,
        camera: &GpuCamera,
        looks: &GpuLooks,
        tiles: &[TileSamples],
        made: &Made,
        out: (&mut [PixelSums], &mut [f32]),
    ) -> Result<(), GpuError> {
        let device = self.stages.device();
        let timed = self.seconds.is_some();
        let tiles = &GpuTiles::new(device, tiles, camera.has_time)?;
        let first = self.options.first.of_samples();
        let rays = match first {
            Stage::Generate => self.drawn(camera, tiles)?,
            _ => {
                let jobs = (0..).zip(&made.jobs);
                let rays = jobs.map(|(number, job)| layout::Ray {
                    weight: job.weight,
                    distance2: job.distance2,
                    ..packed((number, &job.ray))
                });
                let rays: Vec<layout::Ray> = rays.collect();
                device.upload("rays", bytemuck::cast_slice(&rays))?
            }
        };
        let shader = &self.stages.shader;
        let values = shader.values(looks, tiles.rays)?;
        let values = values.as_ref();
        if looks.permutation.layers {
            let layers = self.composited(camera, looks, (&rays, values), made, tiles.rays)?;
            let filmer = &self.stages.filmer;
            let seen = [&layers.samples, &layers.hits];
            let seconds = filmer.film(tiles, seen, values, true, out, timed)?;
            self.took(Stage::Film, seconds);
            return Ok(());
        }
        let hits = match first {
            Stage::Shade => {
                let hits: Vec<layout::Hit> = made.hits.iter().map(to_layout).collect();
                device.upload("hits", bytemuck::cast_slice(&hits))?
            }
            _ => self.traced(&rays, tiles.rays)?,
        };
        let (samples, seconds) = shader.shade(
            &self.scene,
            camera,
            looks,
            ([&rays, &hits], values),
            tiles.rays,
            timed,
        )?;
        self.took(Stage::Shade, seconds);
        let filmer = &self.stages.filmer;
        let seconds = filmer.film(tiles, [&samples, &hits], values, false, out, timed)?;
        self.took(Stage::Film, seconds);
        Ok(())
    }

    /// Traces and shades `len` rays layer after layer, where the CPU has not traced them.
    fn composited(
        &self,
        camera: &GpuCamera,
        looks: &GpuLooks,
        (rays, values): (&wgpu::Buffer, Option<&wgpu::Buffer>),
        made: &Made,
        len: usize,
    ) -> Result<Layers, GpuError> {
        let device = self.stages.device();
        let timed = self.seconds.is_some();
        let layers = Layers::new(device, len)?;
        let shade = |layer: Layer| {
            let shader = &self.stages.shader;
            let there = (rays, &layers, values);
            let seconds = shader.layer(&self.scene, camera, looks, there, layer, timed)?;
            self.took(Stage::Shade, seconds);
            Ok(())
        };
        if self.options.first.of_samples() == Stage::Shade {
            let met = std::iter::once(&made.hits).chain(&made.behind);
            for (number, hits) in met.enumerate() {
                layers.put(device, number, hits);
                shade(Layer {
                    number,
                    ..Layer::first(len)
                })?;
            }
            return Ok(layers);
        }
        layers.run(device, |layer| {
            let tracer = &self.stages.tracer;
            let seconds = tracer.layer(&self.scene, rays, &layers, layer, timed)?;
            self.took(Stage::Trace, seconds);
            shade(layer)
        })?;
        Ok(layers)
    }
}

impl RayTracer for GpuFrame {
    fn stages(&self) -> RangeInclusive<Stage> {
        match (&self.camera, &self.looks) {
            (Some(_), Ok(_)) => self.options.first.of_samples()..=Stage::Film,
            (Some(_), Err(_)) => self.options.first.of_samples()..=Stage::Trace,
            (None, _) => Stage::Trace..=Stage::Trace,
        }
    }

    fn trace(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), String> {
        let traced = self.stages.tracer.trace(&self.scene, rays, false, hits);
        self.keep_pipelines();
        traced.map_err(|error| error.to_string())
    }

    fn trace_tiles(&self, tiles: &[TileSamples], hits: &mut [Hit]) -> Result<(), String> {
        let Some(camera) = &self.camera else {
            return Err("it draws no rays".to_owned());
        };
        let device = self.stages.device();
        let traced = GpuTiles::new(device, tiles, camera.has_time).and_then(|tiles| {
            let rays = self.drawn(camera, &tiles)?;
            let there = self.traced(&rays, tiles.rays)?;
            self.stages.tracer.read_hits(&there, hits)
        });
        self.keep_pipelines();
        traced.map_err(|error| error.to_string())
    }

    fn film(
        &self,
        tiles: &[TileSamples],
        made: &Made,
        pixels: &mut [PixelSums],
        means: &mut [f32],
    ) -> Result<(), String> {
        let (Some(camera), Ok(looks)) = (&self.camera, &self.looks) else {
            return Err("it films nothing".to_owned());
        };
        let filmed = match looks {
            Some(looks) => self.film_tiles(camera, looks, tiles, made, (pixels, means)),
            None => self.film_made(camera, tiles, made, (pixels, means)),
        };
        self.keep_pipelines();
        filmed.map_err(|error| error.to_string())
    }
}
