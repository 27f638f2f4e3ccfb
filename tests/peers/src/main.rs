//! The tracer beside Embree 3, in one process, on the same micropolygons and the same rays.
//!
//! `cargo run --release -p hdtrapeze-peers [-- OPTIONS]`, or `make peers`. Embree is found at run time
//! (`libembree3.so.3`); without it the tables show ours alone. Modules: `arguments` are what is asked for, `scenes` and `rays` what is
//! traced, `ffi`, `embree` and `batch` the peer, `compare` holds answers against each other, `load` times one
//! batch and `bench` one scene, `report` and `table` print, `kept` writes.
//!
//! What is counted: a build is everything from diced positions to a hierarchy that can be traced
//! (ours: planes of positions, tree, world; Embree's: geometry, scene and commit over buffers that are
//! ready); Embree's rays are in its own layout before the clock starts, ours are packed inside.
//! Bytes are those above positions and index buffers: ours nodes, blocks and frames; Embree's what
//! its memory monitor says after the commit.

mod arguments;
mod batch;
mod bench;
mod clock;
mod compare;
mod embree;
mod ffi;
mod kept;
mod load;
mod rays;
mod report;
mod scenes;
mod surface;
mod table;
#[path = "../../../core/tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::io::{self, Write};
use std::process::ExitCode;

use arguments::Arguments;
use bench::{Options, Report};
use clap::Parser;
use clock::free_memory;
use embree::Embree;
use kept::Kept;
use scenes::{Family, frozen};

/// Runs all scenes; `found` takes each report as soon as there is one.
fn scenes(
    families: &[Family],
    options: &Options,
    embree: Option<&Embree>,
    mut found: impl FnMut(Report) -> Result<(), String>,
) -> Result<(), String> {
    for &family in families {
        let moving = family.moving(options.millions);
        // Frozen at half the shutter: the same surface without motion.
        for is_moving in [false, true] {
            let still;
            let mesh = if is_moving {
                &moving
            } else {
                still = frozen(&moving, 0.5);
                &still
            };
            found(bench::run(family, is_moving, mesh, options, embree)?)?;
        }
    }
    Ok(())
}

/// Writes to standard output. That whoever reads there has read enough is no error, and what is kept in files goes on.
fn show(text: &str) -> Result<(), String> {
    let mut out = io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(format!("standard output: {e}")),
        _ => Ok(()),
    }
}

/// Tells those who wait, if there are any.
fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let options = arguments.options()?;
    options.fit(free_memory())?;
    let markdown = Kept::beside(arguments.markdown.as_deref())?;
    let json = Kept::beside(arguments.json.as_deref())?;
    let embree = (!options.alone).then(Embree::find).flatten();
    let heading = report::heading(embree.as_ref(), &options);
    show(&heading)?;
    let mut reports = Vec::new();
    let families = arguments.families();
    let outcome = scenes(&families, &options, embree.as_ref(), |report| {
        tell(&report::line(&report));
        reports.push(report);
        markdown.write(|| format!("{heading}{}", report::tables(&reports)))?;
        json.write(|| report::numbers(&reports))
    });
    // Also those before a scene that failed.
    let shown = show(&report::tables(&reports));
    outcome.and(shown)
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            tell(&format!("peers: {message}"));
            ExitCode::FAILURE
        }
    }
}
