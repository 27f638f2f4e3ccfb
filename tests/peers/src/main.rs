//! The tracer beside Embree 3, in one process, on the same micropolygons and the same rays.
//!
//! `cargo run --release -p hdtrapeze-peers [-- OPTIONS]`, or `make peers`. Embree is found at run time
//! (`libembree3.so.3`); without it the tables show ours alone. Modules: `scenes` and `rays` are what is
//! traced, `ffi`, `embree` and `batch` the peer, `compare` holds answers against each other, `load` times one
//! batch and `bench` one scene, `report` and `table` print.
//!
//! What is counted: a build is everything from diced positions to a hierarchy that can be traced
//! (ours: planes of positions, tree, world; Embree's: geometry, scene and commit over buffers that are
//! ready); Embree's rays are in its own layout before the clock starts, ours are packed inside.
//! Bytes are those above positions and index buffers: ours nodes, blocks and frames; Embree's what
//! its memory monitor says after the commit.

mod batch;
mod bench;
mod clock;
mod compare;
mod embree;
mod ffi;
mod load;
mod rays;
mod report;
mod scenes;
mod table;
#[path = "../../../core/tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::process::ExitCode;

use bench::Options;
use clock::Clock;
use embree::{Embree, Variant};
use scenes::{Family, Shape, frozen};

const USAGE: &str = "\
hdtrapeze-peers: our tracer beside Embree 3, on the same micropolygons and rays

  --size M         millions of micropolygons (1)
  --largest        the sheet alone, of 48.9 million, on Embree's grids and quads
  --quick          a small run that checks, in seconds
  --scene NAME     sheet, patches, fur or combed alone
  --order ORDER    camera rays by `tile`, `block` or `pixel`; all, and the best of them, without
  --image W H      1280 720; multiples of 4
  --samples N      rays a pixel (16)
  --rounds N       rounds (3)
  --cpu            rates by processor time, not by the clock on the wall
  --alone          without Embree
  --frames         ours also without oriented frames, each in its best way, in turns with the rest; memory's
                   peaks are of both
  --markdown FILE  writes the tables there too
  --json FILE      writes numbers of ours there, for scripts/plot_scale.py
";

struct Arguments {
    options: Options,
    families: Vec<Family>,
    markdown: Option<String>,
    json: Option<String>,
}

fn variant(shape: Shape, high: bool, compact: bool) -> Variant {
    Variant {
        shape,
        high,
        compact,
    }
}

fn arguments(mut args: impl Iterator<Item = String>) -> Result<Arguments, String> {
    let mut options = Options {
        millions: 1.0,
        image: [1280, 720],
        samples: 16,
        secondary: 1_000_000,
        rounds: 3,
        clock: Clock::Wall,
        orders: vec!["tile", "block", "pixel"],
        variants: Vec::new(),
        checks: 100,
        screen: 16,
        alone: false,
        frames: false,
    };
    let (mut families, mut largest) = (Family::ALL.to_vec(), false);
    let (mut markdown, mut json) = (None, None);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--size" => options.millions = parse(&value()?)?,
            "--largest" => {
                largest = true;
                // 437 x 437 grids of 16 x 16.
                options.millions = (437.0f64 / 62.5).powi(2);
                families = vec![Family::Sheet];
            }
            "--quick" => {
                options.millions = 0.01;
                (options.image, options.secondary, options.rounds) = ([64, 48], 2000, 1);
                (options.checks, options.screen) = (20, 1);
            }
            "--scene" => {
                let name = value()?;
                families.retain(|f| f.name() == name);
                if families.is_empty() {
                    return Err(format!("no scene {name}"));
                }
            }
            "--order" => {
                let name = value()?;
                options.orders.retain(|&o| o == name);
                if options.orders.is_empty() {
                    return Err(format!("no order {name}"));
                }
            }
            "--image" => options.image = [parse(&value()?)?, parse(&value()?)?],
            "--samples" => options.samples = parse(&value()?)?,
            "--rounds" => options.rounds = parse(&value()?)?,
            "--alone" => options.alone = true,
            "--frames" => options.frames = true,
            "--cpu" => options.clock = Clock::Cpu,
            "--markdown" => markdown = Some(value()?),
            "--json" => json = Some(value()?),
            _ => return Err(format!("no option {arg}\n\n{USAGE}")),
        }
    }
    let sound = options.millions > 0.0
        && options.millions <= 100.0
        && options.image.iter().all(|&n| n >= 4 && n % 4 == 0)
        && options.samples > 0
        && options.rounds > 0;
    if !sound {
        return Err("sizes must be positive, an image's multiples of 4".into());
    }
    options.variants = if largest {
        vec![
            variant(Shape::Grid, false, false),
            variant(Shape::Quad, false, false),
        ]
    } else {
        vec![
            variant(Shape::Grid, false, false),
            variant(Shape::Grid, false, true),
            variant(Shape::Quad, false, false),
            variant(Shape::Quad, true, false),
            variant(Shape::Quad, false, true),
            variant(Shape::Triangle, false, false),
            variant(Shape::Triangle, true, false),
            variant(Shape::Triangle, false, true),
        ]
    };
    Ok(Arguments {
        options,
        families,
        markdown,
        json,
    })
}

fn parse<T: std::str::FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| format!("not a number: {text}"))
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let embree = (!arguments.options.alone).then(Embree::find).flatten();
    let mut text = report::heading(embree.as_ref(), &arguments.options);
    print!("{text}");
    let mut reports = Vec::new();
    for &family in &arguments.families {
        let moving = family.moving(arguments.options.millions);
        // Frozen at half the shutter: the same surface without motion.
        for is_moving in [false, true] {
            let still;
            let mesh = if is_moving {
                &moving
            } else {
                still = frozen(&moving, 0.5);
                &still
            };
            let report = bench::run(family, is_moving, mesh, &arguments.options, embree.as_ref())?;
            eprintln!("{}", report::line(&report));
            reports.push(report);
        }
    }
    let tables = report::tables(&reports);
    print!("{tables}");
    text += &tables;
    let json = report::numbers(&reports);
    for (file, text) in [(&arguments.markdown, &text), (&arguments.json, &json)] {
        if let Some(file) = file {
            std::fs::write(file, text).map_err(|e| format!("{file}: {e}"))?;
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    if std::env::args().any(|a| a == "--help" || a == "-h") {
        print!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    match arguments(std::env::args().skip(1)).and_then(|arguments| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("peers: {message}");
            ExitCode::FAILURE
        }
    }
}
