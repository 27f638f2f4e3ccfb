//! What occlusion culling saves: scenes of some depth, rendered with it and without.
//!
//! `cargo bench -p hdtrapeze-osd --bench occlusion [-- NAME...]` prints two rows a scene. Each row is a process
//! of its own, so that its peak memory is its own. All AOVs of both images must have the same bits before
//! a figure is printed. Seconds are those of all threads together: *first* is everything up to a finished image,
//! with dicing and building part of it; *again* is the same image from what is diced by then, the best of three.

#[path = "../tests/hidden/mod.rs"]
mod hidden;

use std::hash::{DefaultHasher, Hash, Hasher};

use glam::DVec3;
use hdtrapeze_core::scene::{RenderSettings, Scene};
use hidden::{ball, bits, placed, prepared, rendered, scene, sheet, with_culling};

/// Makes a scene.
type Make = fn() -> Scene;

const SCENES: [(&str, Make); 5] = [
    ("sheet", one_sheet),
    ("ball", one_ball),
    ("layers", layers),
    ("crowd", || crowd(0.0)),
    ("moving", || crowd(0.2)),
];
const CHILD: &str = "OCCLUSION_BENCH_CHILD";

fn main() {
    let names: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    if let Ok(child) = std::env::var(CHILD) {
        let (name, on) = child.split_once(' ').expect("a scene and a word");
        let make = SCENES.iter().find(|(n, _)| *n == name).expect("a scene").1;
        return run(&make(), on == "on");
    }
    let s = settings();
    println!(
        "{} x {}, {} samples a pixel, {} threads",
        s.resolution[0],
        s.resolution[1],
        s.samples,
        rayon::current_num_threads()
    );
    println!(
        "{:<8} {:<8} {:>8} {:>8} {:>10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}",
        "scene",
        "culling",
        "Mupoly",
        "culled M",
        "clusters",
        "dice s",
        "build s",
        "first s",
        "again s",
        "mesh MB",
        "peak MB"
    );
    let me = std::env::current_exe().expect("a path of this program");
    for (name, _) in SCENES {
        if !names.is_empty() && !names.iter().any(|n| n == name) {
            continue;
        }
        let rows = ["off", "on"].map(|on| {
            let mut command = std::process::Command::new(&me);
            let output = command.env(CHILD, format!("{name} {on}")).output();
            let output = output.expect("this program starts again");
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{name} {on}: {text}");
            let row = String::from_utf8_lossy(&output.stdout).into_owned();
            let (image, figures) = row.trim().split_once(' ').expect("an image and figures");
            (image.to_owned(), format!("{name:<8} {on:<8} {figures}"))
        });
        assert_eq!(rows[0].0, rows[1].0, "{name}: the images differ");
        rows.iter().for_each(|(_, row)| println!("{row}"));
    }
}

fn run(scene: &Scene, on: bool) {
    let scene = with_culling(scene, on);
    let start = cpu_seconds();
    let prepared = prepared(&scene, None);
    let (frame, ..) = rendered(&prepared);
    let first = cpu_seconds() - start;
    let s = prepared.statistics();
    let peak = peak_bytes();
    let again = (0..3).map(|_| {
        let start = cpu_seconds();
        rendered(&prepared);
        cpu_seconds() - start
    });
    let again = again.fold(f64::INFINITY, f64::min);
    let mut image = DefaultHasher::new();
    bits(&frame).hash(&mut image);
    let clusters = format!("{}/{}", s.clusters - s.clusters_culled, s.clusters);
    println!(
        "{:x} {:>8.3} {:>8.3} {:>10} {:>8.2} {:>8.2} {:>8.2} {:>8.2} {:>8.1} {:>9.1}",
        image.finish(),
        s.micropolygons as f64 * 1e-6,
        s.micropolygons_culled as f64 * 1e-6,
        clusters,
        s.dice_seconds,
        s.build_seconds,
        first,
        again,
        (s.geometry_bytes + s.bvh_bytes) as f64 * 1e-6,
        peak as f64 * 1e-6,
    );
}

fn status(file: &str) -> String {
    std::fs::read_to_string(file).unwrap_or_default()
}

/// Seconds of all threads of this process; 0 where the system does not tell.
fn cpu_seconds() -> f64 {
    const TICK: f64 = 0.01;
    let text = status("/proc/self/stat");
    let after = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = after.split_whitespace().skip(11).take(2);
    ticks.filter_map(|n| n.parse::<f64>().ok()).sum::<f64>() * TICK
}

/// Most memory this process has held, bytes; 0 where the system does not tell.
fn peak_bytes() -> u64 {
    let text = status("/proc/self/status");
    let line = text.lines().find(|l| l.starts_with("VmHWM:"));
    let kib = line
        .and_then(|l| l.split_whitespace().nth(1))
        .and_then(|n| n.parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

fn settings() -> RenderSettings {
    RenderSettings {
        resolution: [1280, 720],
        samples: 8,
        aovs: ["color", "P", "primId", "elementId"]
            .map(str::to_owned)
            .to_vec(),
        ..RenderSettings::default()
    }
}

/// Nothing is hidden.
fn one_sheet() -> Scene {
    let sheet = placed(sheet("/sheet", 96, 9.0), &[DVec3::ZERO]);
    scene(vec![sheet], settings(), 4.0)
}

/// Its far side is hidden.
fn one_ball() -> Scene {
    let ball = placed(ball("/ball", 48, 2.6, 0.0), &[DVec3::ZERO]);
    scene(vec![ball], settings(), 4.0)
}

/// Sheets behind one another.
fn layers() -> Scene {
    let layer = |i: i32| {
        let away = DVec3::Z * -f64::from(i);
        placed(sheet(&format!("/sheet{i}"), 64, 9.0 + i as f32), &[away])
    };
    scene((0..16).map(layer).collect(), settings(), 4.0)
}

/// 480 balls, ten deep, which move and grow by `growth`.
fn crowd(growth: f32) -> Scene {
    let one = |i: i32| {
        let (x, y, z) = (i % 8, i / 8 % 6, i / 48);
        let jitter = |k: f64| (f64::from(i) * k).fract() - 0.5;
        let spread = 1.0 + 0.08 * f64::from(z);
        let place = DVec3::new(
            (f64::from(x) - 3.5 + jitter(0.618)) * 1.1 * spread,
            (f64::from(y) - 2.5 + jitter(0.367)) * 0.9 * spread,
            -1.2 * f64::from(z),
        );
        let places = match growth {
            0.0 => vec![place],
            _ => vec![place, place + DVec3::new(0.2, jitter(0.77), 0.0)],
        };
        placed(ball(&format!("/ball{i}"), 8, 0.75, growth), &places)
    };
    scene((0..480).map(one).collect(), settings(), 4.0)
}
