//! Camera rays that are traced elsewhere give the same image, and one that fails on the way costs nothing.

mod hidden;

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use glam::DVec3;
use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_core::render::{
    Elsewhere, Frame, Generator, Made, Prepared, RayTracer, RenderControl, Stage, TileSamples,
    prepare, render_with,
};
use hdtrapeze_core::scene::{
    Cull, Interpolation, PrimvarDesc, PrimvarSample, PrimvarValues, RenderSettings, Scene,
};
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts};
use hdtrapeze_osd::OsdFactory;
use hidden::{ball, bits, placed, prepared, rendered, scene, sheet, with_culling};

/// The CPU, in a GPU's place: fails at call number `fails`.
struct Standin<'a> {
    prepared: &'a Prepared,
    first: Stage,
    calls: AtomicU32,
    fails: u32,
}

impl RayTracer for Standin<'_> {
    fn stages(&self) -> RangeInclusive<Stage> {
        self.first..=self.first.max(Stage::Trace)
    }

    fn film(
        &self,
        tiles: &[TileSamples],
        made: &Made,
        pixels: &mut [PixelSums],
        means: &mut [f32],
    ) -> Result<(), String> {
        if self.calls.fetch_add(1, Ordering::Relaxed) >= self.fails {
            return Err("it is lost".to_owned());
        }
        let values = self.prepared.mean_values();
        let (count, stride) = (values.count(), values.stride());
        let generator = Generator::new(self.prepared);
        let (mut ray, mut pixel) = (0, 0);
        for tile in tiles {
            for (slot, job) in generator.draw_tile(tile) {
                let sums = &mut pixels[pixel + slot];
                let color = made.colors[ray].map(|c| c * job.weight);
                for (sum, c) in sums
                    .color
                    .iter_mut()
                    .zip(color.into_iter().chain([job.weight]))
                {
                    *sum += c;
                }
                if job.distance2 < sums.distance2 {
                    sums.distance2 = job.distance2;
                    sums.time = job.ray.time;
                    sums.hit = made.hits[ray];
                }
                if made.hits[ray].is_hit() && count > 0 {
                    let own = &made.values[ray * count..][..count];
                    let sums = &mut means[(pixel + slot) * stride..][..stride];
                    for (sum, value) in sums.iter_mut().zip(own.iter().chain([&1.0])) {
                        *sum += value;
                    }
                }
                ray += 1;
            }
            pixel += (tile.width * tile.height) as usize;
        }
        Ok(())
    }

    fn trace_tiles(&self, tiles: &[TileSamples], hits: &mut [Hit]) -> Result<(), String> {
        let generator = Generator::new(self.prepared);
        let drawn = tiles.iter().flat_map(|tile| generator.draw_tile(tile));
        let rays: Vec<Ray> = drawn.map(|(_, job)| job.ray).collect();
        self.trace(&rays, hits)
    }

    fn trace(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), String> {
        if self.calls.fetch_add(1, Ordering::Relaxed) >= self.fails {
            hits.fill(Hit::MISS);
            return Err("it is lost".to_owned());
        }
        let (world, counts) = (self.prepared.world(), &mut TraceCounts::default());
        if self.prepared.plan().has_culling() {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = world.next::<true>(ray, None, counts);
            }
            return Ok(());
        }
        world.trace_many(rays, hits, counts);
        Ok(())
    }
}

fn stage() -> Scene {
    let aovs = ["color", "depth", "normal", "primId", "motionVectors"];
    let settings = RenderSettings {
        resolution: [72, 40],
        samples: 9,
        aovs: aovs.map(str::to_owned).to_vec(),
        ..RenderSettings::default()
    };
    let mut prims = vec![placed(sheet("/wall", 8, 24.0), &[DVec3::NEG_Z * 12.0])];
    for i in 0..3 {
        let from = DVec3::new(f64::from(i) * 3.0 - 3.0, 0.0, -4.0);
        let to = from + DVec3::new(0.3, 0.5, 0.0);
        prims.push(placed(ball(&format!("/ball{i}"), 6, 1.5, 0.1), &[from, to]));
    }
    let half = PrimvarDesc::still(Interpolation::Constant, 1, vec![0.5], vec![]);
    let glass = &mut prims[1].common.primvars;
    glass.insert("displayOpacity".to_owned(), half);
    with_culling(&scene(prims, settings, 0.5), false)
}

/// The same with a whole number for each prim, or, where they are `mixed`, with a float for one.
fn numbered(mut stage: Scene, mixed: bool) -> Scene {
    for (i, prim) in (0..).zip(stage.prims.values_mut()) {
        let number = match mixed && i == 1 {
            true => PrimvarValues::Float(vec![0.5]),
            false => PrimvarValues::Int(vec![1000 * i]),
        };
        let sample = PrimvarSample {
            time: 0.0,
            values: Arc::new(number),
            indices: Arc::default(),
        };
        let number = PrimvarDesc {
            samples: vec![sample],
            ..PrimvarDesc::still(Interpolation::Constant, 1, vec![], vec![])
        };
        let primvars = &mut Arc::make_mut(prim).common.primvars;
        primvars.insert("number".to_owned(), number);
    }
    stage
}

/// The image, how often the tracer was asked, and why it failed, if it did.
fn traced_elsewhere(prepared: &Prepared, first: Stage, fails: u32) -> (Frame, u32, Option<String>) {
    let settings = prepared.settings();
    let frame = Frame::new(settings.resolution, None, prepared.aovs()).expect("a film");
    let standin = Standin {
        prepared,
        first,
        calls: AtomicU32::new(0),
        fails,
    };
    let elsewhere = Elsewhere::new(&standin);
    let control = RenderControl {
        cancel: &AtomicBool::new(false),
        on_progress: &|fraction| assert!((0.0..=1.0).contains(&fraction)),
        on_pass: &|_, _| {},
    };
    let statistics = render_with(prepared, &frame, &control, Some(&elsewhere));
    assert!(!statistics.cancelled);
    assert_eq!(frame.samples_done(), settings.samples);
    let calls = standin.calls.load(Ordering::Relaxed);
    (frame, calls, elsewhere.fault())
}

#[test]
fn the_image_is_the_same_wherever_rays_are_traced() {
    let prepared = prepared(&stage(), None);
    let here = bits(&rendered(&prepared).0);
    for first in [Stage::Generate, Stage::Trace] {
        let (frame, calls, fault) = traced_elsewhere(&prepared, first, u32::MAX);
        // Passes of 1, 1, 2, 4 and 1 samples.
        assert_eq!((calls, fault), (5, None));
        assert!(bits(&frame) == here, "from {first:?} on");
    }
}

#[test]
fn samples_that_were_taken_stay_when_it_fails() {
    let prepared = prepared(&stage(), None);
    let here = bits(&rendered(&prepared).0);
    for fails in [0, 1, 3, 4] {
        let first = [Stage::Generate, Stage::Trace][fails as usize % 2];
        let (frame, calls, fault) = traced_elsewhere(&prepared, first, fails);
        // It is not asked again.
        assert_eq!(calls, fails + 1);
        assert_eq!(fault.as_deref(), Some("it is lost"));
        assert!(bits(&frame) == here, "failed at call {fails}");
    }
}

/// What both films show, within roundings of the sums of a pass.
fn same_but_for_rounding(a: &Frame, b: &Frame) -> bool {
    let same = |a: &u32, b: &u32| {
        let [a, b] = [*a, *b].map(f32::from_bits);
        (a - b).abs() <= 2.0e-6 * b.abs().max(1.0)
    };
    let (a, b) = (bits(a), bits(b));
    a.iter().zip(&b).all(|((name, a), (_, b))| match &name[..] {
        "color" | "normal" | "Neye" | "motionVectors" | "primvars:displayOpacity" => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        _ => a == b,
    })
}

#[test]
fn pixels_that_are_summed_elsewhere_are_taken_up() {
    let mut glass = stage();
    let aovs = [
        "color",
        "depth",
        "P",
        "primId",
        "elementId",
        "subsetId",
        "sampleCount",
        "motionVectors",
        "Neye",
    ];
    Arc::make_mut(&mut glass.settings).aovs = aovs.map(str::to_owned).to_vec();
    let mut opaque = glass.clone();
    for prim in opaque.prims.values_mut() {
        Arc::make_mut(prim).common.primvars.clear();
    }
    let mut culled = glass.clone();
    Arc::make_mut(&mut culled.settings).cull = Cull::Back;
    let mut normals = numbered(glass.clone(), false);
    let aovs = ["normal", "primvars:displayOpacity", "primvars:number"];
    Arc::make_mut(&mut normals.settings).aovs = aovs.map(str::to_owned).to_vec();
    for (stage, failures) in [
        (opaque, &[0, 2, 3, u32::MAX][..]),
        (glass, &[2, u32::MAX]),
        (normals, &[3, u32::MAX]),
        (culled, &[u32::MAX]),
    ] {
        let prepared = prepared(&stage, None);
        assert_eq!(prepared.shaded_here(), None);
        let here = rendered(&prepared).0;
        for &fails in failures {
            let (frame, calls, fault) = traced_elsewhere(&prepared, Stage::Film, fails);
            assert_eq!(calls, fails.saturating_add(1).min(5));
            assert_eq!(fault.is_some(), fails < 5);
            assert!(
                same_but_for_rounding(&frame, &here),
                "failed at call {fails}"
            );
        }
    }
}

#[test]
fn what_is_shaded_here_is_said() {
    for (mixed, why) in [
        (false, None),
        (
            true,
            Some("some values of the AOV primvars:number are whole numbers"),
        ),
    ] {
        let mut stage = numbered(stage(), mixed);
        let asked = "primvars:number".to_owned();
        Arc::make_mut(&mut stage.settings).aovs.push(asked);
        let (surfaces, cancel) = (OsdFactory::default(), AtomicBool::new(false));
        let made = prepare(&stage, &surfaces, None, &cancel).expect("the scene is sound");
        assert_eq!(made.prepared.shaded_here().as_deref(), why);
        assert_eq!(made.warnings.len(), usize::from(mixed));
    }
}

#[test]
fn culled_sides_are_passed_through_wherever_rays_are_traced() {
    let mut stage = stage();
    Arc::make_mut(&mut stage.settings).cull = Cull::Front;
    let prepared = prepared(&stage, None);
    let here = bits(&rendered(&prepared).0);
    for first in [Stage::Generate, Stage::Trace] {
        let (frame, calls, _) = traced_elsewhere(&prepared, first, u32::MAX);
        assert_eq!(calls, 5);
        assert!(bits(&frame) == here, "from {first:?} on");
    }
}
