//! What was found out, as tables.

use crate::bench::{ORDERS, Options, Report, Traced, Tracer};
use crate::clock::Clock;
use crate::embree::Embree;
use crate::load::Group;
use crate::table::{Table, best, number, rate};

/// What ran on what.
pub fn heading(embree: Option<&Embree>, options: &Options) -> String {
    let peer = match embree {
        Some(embree) => format!(
            "Embree {} (not its robust mode; triangles are the same as ours)",
            embree.version()
        ),
        None if options.alone => "Embree: left out".into(),
        None => "Embree: not found (install libembree3-3)".into(),
    };
    let clock = match options.clock {
        Clock::Wall => "the clock on the wall",
        Clock::Cpu => "processor time",
    };
    let [width, height] = options.image;
    let middle = if options.across > width {
        format!(
            " in the middle of a picture {} pixels across",
            options.across
        )
    } else {
        String::new()
    };
    format!(
        "{peer}\n\n{} threads, {width}x{height} pixels{middle} of {} rays with lens and time, best of {} rounds \
         (median in brackets) by {clock}.\n\n",
        rayon::current_num_threads(),
        options.samples,
        options.rounds
    )
}

/// A ratio, `-` where there is nothing to divide or to divide by.
fn ratio(a: f64, b: f64) -> String {
    if a > 0.0 && b > 0.0 {
        number(a / b)
    } else {
        "-".into()
    }
}

fn traced(tracer: Option<&Tracer>, group: Group) -> String {
    let traced = tracer.and_then(|t| t.traced[group as usize].as_ref());
    traced.map_or("-".into(), |t| rate(&t.rates))
}

fn how(tracer: Option<&Tracer>, group: Group) -> String {
    let traced = tracer.and_then(|t| t.traced[group as usize].as_ref());
    traced.map_or("-".into(), |t| t.how.clone())
}

fn fastest(report: &Report, group: Group) -> Option<&Tracer> {
    report
        .peers
        .iter()
        .max_by(|a, b| a.rate(group).total_cmp(&b.rate(group)))
}

fn grid(report: &Report) -> Option<&Tracer> {
    report.peers.iter().find(|p| p.name == "GRID")
}

/// One scene in a line, for those who wait.
pub fn line(report: &Report) -> String {
    let group = Group::Camera;
    let peer = fastest(report, group);
    format!(
        "{}: camera {} Mrays/s, Embree {}",
        report.name,
        traced(Some(&report.ours), group),
        traced(peer, group)
    )
}

/// Ours in JSON, a line a scene: sizes, best rates, that of rays one by one, bytes of the hierarchy a micropolygon, peak
/// bytes of the process while building and in all, nodes and micropolygons tested a ray.
pub fn numbers(reports: &[Report]) -> String {
    let line = |r: &Report| {
        let [building, whole] = r.peaks;
        format!(
            "{{\"scene\": \"{}\", \"family\": \"{}\", \"moving\": {}, \"micropolygons\": {}, \
             \"build_mquads\": {}, \"mrays\": {}, \"mrays_single\": {}, \"bytes\": {}, \"peak_building\": {building}, \
             \"peak\": {whole}, \"nodes\": {}, \"tested\": {}, \"threads\": {}}}",
            r.name,
            r.family.name(),
            r.moving,
            r.cells,
            best(&r.ours.builds),
            r.ours.rate(Group::Camera),
            r.single,
            r.ours.bytes,
            r.nodes,
            r.tested,
            rayon::current_num_threads(),
        )
    };
    let lines: Vec<String> = reports.iter().map(line).collect();
    format!("[\n{}\n]\n", lines.join(",\n"))
}

/// All tables, in Markdown.
pub fn tables(reports: &[Report]) -> String {
    let mut all = vec![
        camera(reports),
        builds(reports),
        blur(reports),
        leaving(reports),
        tried(reports),
        answers(reports),
    ];
    if reports.iter().any(|r| r.upright.is_some()) {
        all.insert(4, frames(reports));
    }
    all.iter().map(Table::markdown).collect()
}

fn camera(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Camera rays",
        "Million rays a second. Ratios are ours to Embree's. Ours is timed in each order, Embree in the one that was best in \
         trials. By surface: in squares of 32x32 pixels with all of their samples, where renders have tiles of 16x16 and passes; ours finds that order of large scenes while it is timed, Embree is given it; \
         \"given\" is ours where it is given that order, too. Static scenes are the moving ones, frozen at half the shutter. Nodes and micropolygons tested are ours, a ray, by tile.",
        &[
            "scene",
            "M quads",
            "hit",
            "ours",
            "order",
            "best Embree",
            "which",
            "ratio",
            "ours given",
            "ratio",
            "Embree GRID",
            "ratio",
            "nodes",
            "quads",
        ],
    );
    for r in reports {
        let group = Group::Camera;
        let (peer, grid) = (fastest(r, group), grid(r));
        let over =
            |peer: Option<&Tracer>| ratio(r.ours.rate(group), peer.map_or(0.0, |p| p.rate(group)));
        let which = peer.map_or("-".into(), |p| format!("{} {}", p.name, how(peer, group)));
        let given = r.ours.given.as_ref();
        table.row(vec![
            r.name.clone(),
            number(r.cells * 1e-6),
            number(r.hit_share),
            traced(Some(&r.ours), group),
            how(Some(&r.ours), group),
            traced(peer, group),
            which,
            over(peer),
            given.map_or("-".into(), |t| rate(&t.rates)),
            ratio(
                given.map_or(0.0, Traced::best),
                peer.map_or(0.0, |p| p.rate(group)),
            ),
            traced(grid, group),
            over(grid),
            number(r.nodes),
            number(r.tested),
        ]);
    }
    table
}

fn builds(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Builds and bytes",
        "Million micropolygons a second, and bytes of the hierarchy a micropolygon, above positions and \
         index buffers. Smallest: of all variants tried. Peaks: of the whole process, in GiB, while \
         ours was built and by the end of the scene.",
        &[
            "scene",
            "ours",
            "Embree GRID",
            "ratio",
            "B/quad ours",
            "GRID",
            "ratio",
            "smallest",
            "which",
            "ratio",
            "peaks",
        ],
    );
    for r in reports {
        let grid = grid(r);
        let built = grid.map_or(f64::NAN, |g| best(&g.builds));
        let bytes = grid.map_or(f64::NAN, |g| g.bytes);
        let small = r.tried.iter().filter(|t| t.refused.is_none());
        let small = small.min_by(|a, b| a.bytes.total_cmp(&b.bytes));
        let smallest = small.map_or(f64::NAN, |s| s.bytes);
        let gib = r.peaks.map(|p| number(p as f64 / (1u64 << 30) as f64));
        table.row(vec![
            r.name.clone(),
            rate(&r.ours.builds),
            grid.map_or("-".into(), |g| rate(&g.builds)),
            ratio(best(&r.ours.builds), built),
            number(r.ours.bytes),
            number(bytes),
            ratio(r.ours.bytes, bytes),
            number(smallest),
            small.map_or("-".into(), |s| s.name.clone()),
            ratio(r.ours.bytes, smallest),
            gib.join(", "),
        ]);
    }
    table
}

fn blur(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Blurred to sharp",
        "Rate of camera rays on the moving scene divided by that of the same rays on the frozen one: first each in \
         the order that is best for it, then both in the same order; Embree's each in its best order.",
        &[
            "scene",
            "ours, each in its best order",
            "ours by tile",
            "ours by block",
            "ours by pixel",
            "ours by surface",
            "best Embree",
            "Embree GRID",
        ],
    );
    for moving in reports.iter().filter(|r| r.moving) {
        let sharp = reports
            .iter()
            .find(|r| r.family == moving.family && !r.moving);
        let Some(sharp) = sharp else { continue };
        let rate = |t: Option<&Tracer>| t.map_or(0.0, |t| t.rate(Group::Camera));
        let peer = |r| fastest(r, Group::Camera);
        let same = |order: &&str| ratio(moving.ours.rate_by(order), sharp.ours.rate_by(order));
        let mut cells = vec![
            moving.family.name().into(),
            ratio(rate(Some(&moving.ours)), rate(Some(&sharp.ours))),
        ];
        cells.extend(ORDERS.iter().map(same));
        cells.extend([
            ratio(rate(peer(moving)), rate(peer(sharp))),
            ratio(rate(grid(moving)), rate(grid(sharp))),
        ]);
        table.row(cells);
    }
    table
}

fn leaving(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Rays that leave surfaces",
        "Million rays a second: from all camera hits of some squares of 32x32 pixels, cosine-weighted, each at a time of its own. Ours finds an order by direction, where that pays, while it is timed; Embree is given the usual order and that one, and has the better of both.",
        &[
            "scene",
            "query",
            "ours",
            "how",
            "best Embree",
            "which",
            "ratio",
            "Embree GRID",
            "ratio",
        ],
    );
    for r in reports {
        for group in [Group::Bounce, Group::Shadow] {
            let (peer, grid) = (fastest(r, group), grid(r));
            let over = |peer: Option<&Tracer>| {
                ratio(r.ours.rate(group), peer.map_or(0.0, |p| p.rate(group)))
            };
            table.row(vec![
                r.name.clone(),
                group.name().into(),
                traced(Some(&r.ours), group),
                how(Some(&r.ours), group),
                traced(peer, group),
                peer.map_or("-".into(), |p| format!("{} {}", p.name, how(peer, group))),
                over(peer),
                traced(grid, group),
                over(grid),
            ]);
        }
    }
    table
}

fn frames(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Oriented frames",
        "Ours as it is beside ours with all bounds along the axes of space: million rays a second, million micropolygons \
         a second, best (and median) of the rounds, each in its best way; bytes of the hierarchy a micropolygon. Nodes and blocks: those that have a frame.",
        &[
            "scene", "nodes", "blocks", "query", "with", "without", "ratio", "build", "without",
            "bytes", "without",
        ],
    );
    for r in reports {
        let Some(upright) = &r.upright else { continue };
        for group in Group::ALL {
            table.row(vec![
                r.name.clone(),
                r.oriented[0].to_string(),
                r.oriented[1].to_string(),
                group.name().into(),
                traced(Some(&r.ours), group),
                traced(Some(upright), group),
                ratio(r.ours.rate(group), upright.rate(group)),
                rate(&r.ours.builds),
                rate(&upright.builds),
                number(r.ours.bytes),
                number(upright.bytes),
            ]);
        }
    }
    table
}

fn tried(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Every variant of Embree",
        "Tried on a part of the rays, by processor time: the best call of each. Built once. Bytes a \
         micropolygon: hierarchy, peak while building, index buffer.",
        &[
            "scene", "variant", "build", "bytes", "peak", "index", "camera", "call", "bounce",
            "call", "any", "call",
        ],
    );
    for r in reports {
        for t in &r.tried {
            let one = |group: Group| match t.traced[group as usize] {
                Some(_) => number(t.rate(group)),
                None => "-".into(),
            };
            table.row(vec![
                r.name.clone(),
                t.name.clone(),
                t.refused.clone().unwrap_or_else(|| number(best(&t.builds))),
                number(t.bytes),
                number(t.peak_bytes),
                number(t.index_bytes),
                one(Group::Camera),
                how(Some(t), Group::Camera),
                one(Group::Bounce),
                how(Some(t), Group::Bounce),
                one(Group::Shadow),
                how(Some(t), Group::Shadow),
            ]);
        }
    }
    table
}

fn answers(reports: &[Report]) -> Table {
    let mut table = Table::new(
        "Answers compared",
        "Of all variants and calls together. Ties: another micropolygon at the same distance. Edges: \
         different answers, the nearer one within the tolerance of an edge.",
        &[
            "scene",
            "rays",
            "compared",
            "ties",
            "edges",
            "ours wrong",
            "Embree wrong",
        ],
    );
    for r in reports {
        for (group, tally) in r.tallies.iter().filter(|(_, t)| t.rays > 0) {
            table.row(vec![
                r.name.clone(),
                group.name().into(),
                tally.rays.to_string(),
                tally.ties.to_string(),
                tally.edges.to_string(),
                tally.ours_wrong.to_string(),
                tally.peer_wrong.to_string(),
            ]);
        }
    }
    table
}
