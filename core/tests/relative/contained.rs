//! Bounds of relative trees contain every vertex below them, at every time, but for what rays are padded by.

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::block::{CellRect, loose};
use hdtrapeze_core::bvh::object::{Blas, BlockTree, loose_group};
use hdtrapeze_core::bvh::relative::{Relative, Trees};
use hdtrapeze_core::bvh::turn::{Turn, Turning};
use hdtrapeze_core::bvh::{Bounds8, Frame, ObjectGeometry, StoredBox, Tree};
use hdtrapeze_core::grid::{DicedMesh, PlanarMesh};
use proptest::prelude::*;

use crate::trace_scenes::*;
use crate::wind;

/// A vertex's position in f64; rounded by 2^-52 of it.
fn position(mesh: &PlanarMesh, g: usize, i: usize, time: f64) -> DVec3 {
    let keys = &mesh.key_times;
    let k = (0..keys.len().max(2) - 2)
        .take_while(|&k| f64::from(keys[k + 1]) <= time)
        .count();
    let a = mesh.position(g, k, i).as_dvec3();
    if keys.len() < 2 {
        return a;
    }
    let b = mesh.position(g, k + 1, i).as_dvec3();
    let (t0, t1) = (f64::from(keys[k]), f64::from(keys[k + 1]));
    a + (b - a) * ((time - t0) / (t1 - t0))
}

/// What bows are multiplied by: `T (1 - T)`, with 3 to 9 keys at these, and straight between them.
fn part(key_times: &[f64], time: f64) -> f64 {
    let parabola = |time: f64| time * (1.0 - time);
    if !(3..=9).contains(&key_times.len()) {
        return parabola(time);
    }
    let next = key_times.iter().position(|&key| key > time);
    let next = next.unwrap_or(key_times.len() - 1);
    let (a, b) = (key_times[next - 1], key_times[next]);
    parabola(a) + (parabola(b) - parabola(a)) * ((time - a) / (b - a))
}

/// True when `p` is inside at a time, to within the rounding of f64 in this test; bows are multiplied by `part`.
fn contains(
    b: &impl Fn(f64) -> (DVec3, DVec3),
    frame: &Turn,
    p: DVec3,
    (time, part): (f64, f64),
) -> Result<(), String> {
    let (lo, hi) = b(time);
    for a in 0..3 {
        let [from, to] = frame.normals.map(|normal| normal.as_dvec3());
        let [first, second] = frame.axes.map(|axis| axis.as_dvec3());
        let bow = f64::from(frame.bow[a]) * part;
        let x = [first, second, from + (to - from) * time][a].dot(p) + bow;
        let slack = 1e-14
            * (p.abs().max_element() + lo.abs().max_element() + hi.abs().max_element() + bow.abs());
        // Written so that NaN is refused.
        let inside = x >= lo[a] - slack && x <= hi[a] + slack;
        if !inside {
            return Err(format!(
                "axis {a}: {x} not in [{}, {}] at {time}",
                lo[a], hi[a]
            ));
        }
    }
    Ok(())
}

/// Vertices, as (grid, vertex).
type Vertices = Vec<(usize, usize)>;

/// Where a vertex is, by grid, number and time, and how far from its bounds it may be, in the space of a tree.
struct Place<'a> {
    at: &'a dyn Fn(usize, usize, f64) -> DVec3,
    slack: f64,
    /// Times of the tree's keys.
    key_times: Vec<f64>,
}

/// Checks all below `reference`; returns the vertices there, as (grid, vertex). `times` are the tree's.
fn check_tree<B: Bounds8>(
    mesh: &PlanarMesh,
    tree: &BlockTree<B>,
    reference: u32,
    times: &[f64],
    place: &Place<'_>,
) -> Result<Vertices, String> {
    let mut all = Vec::new();
    let children: Vec<(StoredBox, Turn, Vertices)>;
    let frame;
    let rect_vertices = |g: usize, r: CellRect| -> Vertices {
        let stride = usize::from(mesh.grids[g].nu) + 1;
        let [i, j, w, h] = [r.i, r.j, r.w, r.h].map(usize::from);
        (j..=j + h)
            .flat_map(|y| (i..=i + w).map(move |x| (g, y * stride + x)))
            .collect()
    };
    let leaf = reference & Tree::<B>::LEAF != 0;
    if leaf && let Some((g, slot)) = loose_group(reference & !Tree::<B>::LEAF) {
        // A group by itself: its bounds are those of the node above.
        let rect = loose(&mesh.grids[g as usize], slot);
        return Ok(rect_vertices(g as usize, rect));
    } else if leaf {
        let block = &tree.blocks[(reference & !Tree::<B>::LEAF) as usize];
        let g = block.span.grid as usize;
        frame = tree.frames[block.frame as usize].turn();
        children = (0..u32::from(block.span.count))
            .map(|slot| {
                let vertices = rect_vertices(g, block.span.group_rect(slot));
                (block.bounds.unpack(slot as usize), frame, vertices)
            })
            .collect();
    } else {
        let node = &tree.tree.nodes[reference as usize];
        frame = tree.tree.frames[node.frame as usize].turn();
        children = (0..8)
            .filter(|s| node.slots >> s & 1 == 1)
            .map(|s| {
                let below = check_tree(mesh, tree, node.children[s], times, place)?;
                Ok((node.bounds.unpack(s), frame, below))
            })
            .collect::<Result<_, String>>()?;
    }
    for (bounds, frame, vertices) in children {
        for &(g, i) in &vertices {
            for &time in times {
                let wide = |t| {
                    let (lo, hi) = bounds.at(t);
                    (lo - place.slack, hi + place.slack)
                };
                let when = (time, part(&place.key_times, time));
                contains(&wide, &frame, (place.at)(g, i, time), when)?;
            }
        }
        all.extend(vertices);
    }
    Ok(all)
}

/// The same for trees in a space that moves along, and for parts of the shutter.
fn check_relative(
    mesh: &PlanarMesh,
    relative: &Relative,
    times: &[f64],
) -> Result<Vertices, String> {
    let carried = |g: usize, i: usize, time: f64| {
        let p = position(mesh, g, i, time);
        let Some(carrier) = &relative.carrier else {
            return p;
        };
        let keys = &mesh.key_times;
        let k = (0..keys.len() - 2)
            .take_while(|&k| f64::from(keys[k + 1]) <= time)
            .count();
        let (t0, t1) = (f64::from(keys[k]), f64::from(keys[k + 1]));
        let (m, by) = carrier.at(k, (time - t0) / (t1 - t0));
        m.inverse() * (p - by)
    };
    let slack = f64::from(relative.slack);
    let of =
        |a: f64, b: f64| move |g: usize, i: usize, time: f64| carried(g, i, a + (b - a) * time);
    match &relative.trees {
        Trees::Still(tree) => {
            let place = Place {
                at: &of(0.0, 1.0),
                slack,
                key_times: vec![0.0],
            };
            check_tree(mesh, tree, tree.tree.root, times, &place)
        }
        Trees::Moving(trees) => {
            let mut ends = vec![0.0];
            ends.extend(relative.middle.map(f64::from));
            ends.push(1.0);
            if trees.len() != ends.len() - 1 {
                return Err("parts and trees".into());
            }
            let mut all = Vec::new();
            for (tree, ends) in trees.iter().zip(ends.windows(2)) {
                // As they are rounded there.
                let (a, b) = (ends[0] as f32, ends[1] as f32);
                let inner = mesh.key_times.iter().filter(|&&key| a < key && key < b);
                let mut key_times = vec![0.0];
                key_times.extend(inner.map(|&key| f64::from((key - a) / (b - a))));
                key_times.push(1.0);
                let place = Place {
                    at: &of(ends[0], ends[1]),
                    slack,
                    key_times,
                };
                all = check_tree(mesh, tree, tree.tree.root, times, &place)?;
                all.sort_unstable();
                all.dedup();
                if all.len() != mesh.vertex_count {
                    return Err(format!("{} of {} vertices", all.len(), mesh.vertex_count));
                }
            }
            Ok(all)
        }
    }
}

/// Checks the object of a mesh; true where its trees are relative.
fn check_object(mesh: DicedMesh, times: &[f64]) -> Result<bool, String> {
    let object = ObjectGeometry::new(mesh);
    let mesh = object.mesh();
    let Blas::Relative(relative) = object.blas() else {
        return Ok(false);
    };
    let mut found = check_relative(mesh, relative, times)?;
    found.sort_unstable();
    found.dedup();
    if found.len() != mesh.vertex_count {
        return Err(format!("{} of {} vertices", found.len(), mesh.vertex_count));
    }
    for &(g, i) in &found {
        for &time in times {
            let p = position(mesh, g, i, time);
            contains(
                &|t| object.bounds().at(t),
                &Turn::fixed(&Frame::IDENTITY),
                p,
                (time, 0.0),
            )?;
        }
    }
    Ok(true)
}

fn times_strategy() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.0f64..=1.0, 3).prop_map(|mut t| {
        t.extend([0.0, 1.0, 0.5]);
        t
    })
}

/// Strictly ascending keys from 0 to 1.
fn keys_strategy() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(0.001f32..0.999, 0..4).prop_map(|mut inner| {
        inner.sort_by(f32::total_cmp);
        inner.dedup();
        let mut keys = vec![0.0];
        keys.extend(inner);
        keys.push(1.0);
        keys
    })
}

/// Frames of an object's blocks that turn, and those of them that have a bow along a fixed axis.
fn turning(object: &ObjectGeometry) -> [usize; 2] {
    let Blas::Relative(relative) = object.blas() else {
        return [0; 2];
    };
    let Trees::Moving(trees) = &relative.trees else {
        return [0; 2];
    };
    let frames = trees.iter().flat_map(|tree| &tree.frames);
    let turns = frames.map(Turning::turn).filter(Turn::turns);
    turns.fold([0; 2], |[turns, bows], turn| {
        let bowed = turn.bow.truncate() != glam::Vec2::ZERO;
        [turns + 1, bows + usize::from(bowed)]
    })
}

#[test]
fn frames_turn_in_halves_of_the_shutter() {
    let times: Vec<f64> = (0..=24).map(|i| f64::from(i) / 24.0).collect();
    for count in [3, 5, 9] {
        let keys = keys(count);
        assert_eq!(
            check_object(curved::debris(12, 16, &keys, 5), &times),
            Ok(true)
        );
        if count != 5 {
            let waves = || sheet(20, 16, &keys);
            assert_eq!(check_object(waves(), &times), Ok(true));
            let [turns, bows] = turning(&ObjectGeometry::new(waves()));
            assert!(
                turns > 100 && (count < 5 || bows > 100),
                "{count}: {turns}, {bows}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn what_moves_as_a_whole_is_contained(
        keys in keys_strategy(), seed: u64, shape in 0usize..4, angle in -4.0f32..4.0, loose in 0i32..9,
        far in 0i32..12, times in times_strategy()
    ) {
        // A rotation and a flight, with noise at every key from none to a good part of the whole.
        let mut rng = Rng(seed);
        let (axis, v, a, off) = (rng.direction(), rng.cube(), rng.cube() * 3.0, rng.cube() * (far as f32).exp2());
        let noise = if loose == 0 { 0.0 } else { (-2.0 * loose as f32).exp2() };
        let mut m = match shape {
            0 => curved::fan(1, 16, &keys, 0.0),
            1 => sheet(4, 9, &keys[..1]),
            2 => fur(40, &keys[..1], seed),
            _ => patches(9, 16, &keys[..1], seed),
        };
        m = mesh(&m.grids.iter().map(|g| (g.nu, g.nv)).collect::<Vec<_>>(), &keys, |g, u, v_, t| {
            let grid = &m.grids[g];
            let i = (u * f32::from(grid.nu)).round() as usize
                + (v_ * f32::from(grid.nv)).round() as usize * (usize::from(grid.nu) + 1);
            let p = m.grid_positions(g, 0)[i];
            let e = Rng(seed ^ u64::from(t.to_bits()) ^ (i as u64) << 32).cube() * noise;
            glam::Quat::from_axis_angle(axis, angle * t) * (p + e) + off + v * t + a * (t * t)
        });
        check_object(m, &times).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn strands_in_wind_are_contained(keys in keys_strategy(), seed: u64, far in 0i32..12, times in times_strategy()) {
        let off = Rng(seed).cube() * (far as f32).exp2();
        let mut m = wind(60, &keys, seed);
        m.positions.iter_mut().for_each(|p| *p += off);
        let parted = check_object(m, &times).map_err(TestCaseError::fail)?;
        // Where there are more than two keys, one of them must be near the middle.
        let near = keys.len() == 2 || keys.iter().any(|key| (key - 0.5).abs() < 0.25);
        prop_assert!(parted || !near);
    }

    #[test]
    fn parts_of_the_shutter_contain(
        keys in keys_strategy(), seed: u64, bend in 0.5f32..4.0, times in times_strategy()
    ) {
        let m = mesh(&[(16, 16); 5], &keys, |g, u, v, t| {
            let who = Rng(seed ^ g as u64).cube() * bend;
            Vec3::new(u, v, 0.0) + who * t + Rng(!seed ^ g as u64).cube() * (bend * t * t)
        });
        check_object(m, &times).map_err(TestCaseError::fail)?;
    }
}
