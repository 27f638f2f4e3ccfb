//! Occlusion rays of a frame: 16 from the first hit of each pixel's first sample, about as many as there are micropolygons in
//! view where these are as large as pixels.

use std::error::Error;
use std::sync::Arc;

use glam::Vec3;
use hdtrapeze_core::film::frame::TILE_SIZE;
use hdtrapeze_core::render::{Generator, Prepared, TileSamples};
use hdtrapeze_core::trace::{Ray, TraceCounts};
use hdtrapeze_gpu::occlude::OcclusionSeconds;
use hdtrapeze_gpu::{Device, GpuCamera, GpuScene, GpuTiles, Occluder, Occlusion, RayMaker, Tracer};
use hdtrapeze_shaders::layout::Ray as RayThere;

use super::SIZE;
use crate::bench_roofline::{OCCLUDED_BYTES, Peaks, RAY_BYTES, asked};

/// A scene on a device, and the stages that secondary rays take.
pub struct Secondary<'a> {
    prepared: &'a Prepared,
    scene: GpuScene,
    camera: GpuCamera,
    maker: RayMaker,
    tracer: Tracer,
    occluder: Occluder,
}

impl<'a> Secondary<'a> {
    pub fn new(device: &Arc<Device>, prepared: &'a Prepared) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            scene: GpuScene::new(device, prepared.world())?,
            camera: GpuCamera::new(device, &Generator::new(prepared))?,
            maker: RayMaker::new(Arc::clone(device)),
            tracer: Tracer::new(Arc::clone(device)),
            occluder: Occluder::new(Arc::clone(device)),
            prepared,
        })
    }

    /// Prints what each stage takes, after some answers were held against the CPU's.
    pub fn run(&self, different: f64, peaks: Peaks) -> Result<(), Box<dyn Error>> {
        let occlusion = Occlusion::default();
        let pixels = self.occluder.most_hits(occlusion.samples);
        let tiles = tiles();
        let per_batch = (pixels / (TILE_SIZE * TILE_SIZE) as usize).max(1);
        let mut seconds = [OcclusionSeconds::default(); 2];
        let mut counts = TraceCounts::default();
        let (mut rays, mut hits, mut free) = (0, 0, 0.0);
        for (i, tiles) in tiles.chunks(per_batch).enumerate() {
            let device = self.occluder.device();
            let tiles = GpuTiles::new(device, tiles, self.camera.has_time)?;
            let (first_rays, _) = self.maker.draw(&self.camera, &tiles, false)?;
            let traced =
                self.tracer
                    .batch_of(&self.scene, &first_rays, tiles.rays, false, false)?;
            self.tracer.run(&traced)?;
            let first = [&first_rays, traced.hits()];
            let occlusion = Occlusion {
                first: rays,
                ..occlusion
            };
            rays += tiles.rays as u32;
            if i == 0 {
                self.check(first, tiles.rays, &occlusion, different)?;
            }
            let mut shares = [vec![0.0f32; tiles.rays], vec![0.0f32; tiles.rays]];
            for (sorted, (sum, shares)) in [false, true]
                .into_iter()
                .zip(seconds.iter_mut().zip(&mut shares))
            {
                let occlusion = Occlusion {
                    sorted,
                    ..occlusion
                };
                let (there, took) =
                    self.occluder
                        .shares(&self.scene, first, tiles.rays, &occlusion, true)?;
                device.fetch(&there, shares)?;
                sum.scatter += took.scatter;
                sum.sort += took.sort;
                sum.occlude += took.occlude;
                sum.share += took.share;
            }
            if shares[0] != shares[1] {
                return Err("shares depend on the order of rays".into());
            }
            free += shares[0].iter().map(|x| f64::from(*x)).sum::<f64>();
            let (sites, _) = self.occluder.sites(&self.scene, first, tiles.rays, false)?;
            let (scattered, _) = self
                .occluder
                .scatter(&sites, tiles.rays, &occlusion, false)?;
            for count in self.occluder.counts(&self.scene, &scattered)? {
                hits += u64::from(count.node_tests > 0);
                counts = counts + count;
            }
        }
        counts.rays = hits;
        let secondary = hits as f64;
        say!(
            "{:.2} M occlusion rays: {:.1} nodes and {:.1} cells a ray; {:.3} of all is free",
            secondary * 1e-6,
            counts.node_tests as f64 / secondary,
            counts.cell_tests as f64 / secondary,
            free / f64::from(rays),
        );
        say!(
            "{:<18} {:>9} {:>9} {}",
            "stage",
            "s",
            "Mrays/s",
            Peaks::head()
        );
        let asked = asked(&counts, true, RAY_BYTES + OCCLUDED_BYTES);
        let line = |stage: &str, seconds: f64, columns: String| {
            let rate = secondary / seconds * 1e-6;
            say!("{stage:<18} {seconds:>9.3} {rate:>9.1} {columns}");
        };
        let [plain, sorted] = seconds;
        line("scatter", sorted.scatter, String::new());
        line("sort", sorted.sort, String::new());
        line(
            "occlude, sorted",
            sorted.occlude,
            peaks.columns(&asked, sorted.occlude),
        );
        line(
            "occlude, as given",
            plain.occlude,
            peaks.columns(&asked, plain.occlude),
        );
        line("share", sorted.share, String::new());
        Ok(())
    }

    /// Answers that are not the CPU's are few.
    fn check(
        &self,
        first: [&wgpu::Buffer; 2],
        len: usize,
        occlusion: &Occlusion,
        different: f64,
    ) -> Result<(), Box<dyn Error>> {
        let (sites, _) = self.occluder.sites(&self.scene, first, len, false)?;
        let (scattered, _) = self.occluder.scatter(&sites, len, occlusion, false)?;
        let mut rays = vec![RayThere::default(); scattered.len];
        self.occluder.device().fetch(&scattered.rays, &mut rays)?;
        // Every so manieth, all over the batch.
        let some = rays.iter().filter(|ray| ray.t_max > 0.0).step_by(16);
        let some: Vec<Ray> = some
            .map(|ray| Ray {
                origin: Vec3::from_array(ray.origin),
                dir: Vec3::from_array(ray.dir),
                time: ray.time,
                t_min: ray.t_min,
                t_max: ray.t_max,
            })
            .collect();
        let (mut here, mut there) = (vec![false; some.len()], vec![false; some.len()]);
        let world = self.prepared.world();
        world.occluded_many(&some, &mut here, &mut TraceCounts::default());
        self.occluder
            .occluded(&self.scene, &some, true, &mut there)?;
        let differ = here.iter().zip(&there).filter(|(a, b)| a != b).count();
        let share = differ as f64 / some.len().max(1) as f64;
        say!(
            "occlusion that differs from the CPU's: {differ} of {} rays",
            some.len()
        );
        match share > different {
            true => Err(format!("{share} of the rays differ").into()),
            false => Ok(()),
        }
    }
}

/// All tiles of the frame, with one sample.
fn tiles() -> Vec<TileSamples> {
    let size = TILE_SIZE as usize;
    let rows = (0..SIZE[1]).step_by(size);
    let places = rows.flat_map(|y| (0..SIZE[0]).step_by(size).map(move |x| (x, y)));
    let tile = |(x, y): (u32, u32)| TileSamples {
        x: x as i32,
        y: y as i32,
        width: TILE_SIZE.min(SIZE[0] - x),
        height: TILE_SIZE.min(SIZE[1] - y),
        samples: 0..1,
    };
    places.map(tile).collect()
}
