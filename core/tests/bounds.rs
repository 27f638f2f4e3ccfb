//! The central invariant of the BVH: bounds contain every vertex below them, at every time, in exact
//! arithmetic.

mod exact;
mod trace_scenes;

use std::sync::Arc;

use exact::{Exact, dot};
use glam::{DAffine3, DVec3, Vec3};
use hdtrapeze_core::bvh::block::{CellRect, loose};
use hdtrapeze_core::bvh::diagonal::{Diagonals, STEP};
use hdtrapeze_core::bvh::node::Lattice8;
use hdtrapeze_core::bvh::object::{Blas, BlockTree, loose_group};
use hdtrapeze_core::bvh::turn::{Turn, Turning};
use hdtrapeze_core::bvh::{Bounds8, BvhStats, Frame, LinearBox, Node, ObjectGeometry, Tree};
use hdtrapeze_core::grid::{DicedMesh, PlanarMesh};
use hdtrapeze_core::trace::instance::world_bounds;
use hdtrapeze_core::trace::{InstanceTransform, TraceCounts, World};
use proptest::prelude::*;
use trace_scenes::*;

/// A vertex between two keys: where it is at each of them, when that is, and the instant.
struct Vertex {
    at: [Vec3; 2],
    keys: [f32; 2],
    time: f32,
    /// Bows of frames go straight from key to key.
    straight: bool,
}

impl Vertex {
    fn new(mesh: &PlanarMesh, g: usize, i: usize, time: f32) -> Vertex {
        let keys = &mesh.key_times;
        let k = (0..keys.len().max(2) - 2)
            .take_while(|&k| keys[k + 1] <= time)
            .count();
        let next = (k + 1).min(keys.len() - 1);
        Vertex {
            at: [mesh.position(g, k, i), mesh.position(g, next, i)],
            keys: [keys[k], if next > k { keys[next] } else { 1.0 }],
            time,
            straight: (3..=9).contains(&keys.len()),
        }
    }

    /// Its coordinate along `axis`, times the time between its keys.
    fn along(&self, axis: Vec3) -> Exact {
        let [a, b] = self.at.map(|p| dot(p.to_array(), axis.to_array()));
        let ([t0, t1], time) = (self.keys.map(Exact::from), Exact::from(self.time));
        a * (t1 - time.clone()) + b * (time - t0)
    }

    /// The same in a frame that may turn.
    fn in_frame(&self, frame: &Turn, axis: usize) -> Exact {
        let time = Exact::from(self.time);
        let rest = Exact::from(1.0f32) - time.clone();
        let span = Exact::from(self.keys[1]) - Exact::from(self.keys[0]);
        let bow = if self.straight {
            let part = |key: f32| Exact::from(key) * (Exact::from(1.0f32) - Exact::from(key));
            let [t0, t1] = self.keys;
            part(t0) * (Exact::from(t1) - time.clone())
                + part(t1) * (time.clone() - Exact::from(t0))
        } else {
            time.clone() * rest.clone() * span
        };
        let bow = bow * Exact::from(frame.bow[axis]);
        if axis < 2 {
            return self.along(frame.axes[axis]) + bow;
        }
        let [a, b] = frame.normals.map(|normal| self.along(normal));
        a * rest + b * time + bow
    }

    /// False where f64 leaves no doubt that it is inside a bound, `sign` telling lower from upper.
    fn is_near(&self, frame: &Turn, axis: usize, [start, end]: [f64; 2], sign: f64) -> bool {
        let ([t0, t1], time) = (self.keys.map(f64::from), f64::from(self.time));
        let own = frame.axes.map(|axis| axis.as_dvec3());
        let [from, to] = frame.normals.map(|normal| normal.as_dvec3());
        let of_axis = [own[0], own[1], from + (to - from) * time][axis];
        let [a, b] = self.at.map(|p| p.as_dvec3().dot(of_axis));
        let bow = f64::from(frame.bow[axis]);
        let fraction = (time - t0) / (t1 - t0);
        let part = |time: f64| time * (1.0 - time);
        let part = match self.straight {
            true => part(t0) + (part(t1) - part(t0)) * fraction,
            false => part(time),
        };
        let along = a + (b - a) * fraction + bow * part;
        let bound = start + (end - start) * time;
        let size = self.at[0].abs() + self.at[1].abs();
        let size = f64::from(size.max_element()) + start.abs() + end.abs() + bow.abs();
        // Also where all is 0.
        (along - bound) * sign <= 1e-14 * size
    }

    /// True where it is inside bounds `[axis][lower, upper][start, end]`, exactly.
    fn check(&self, frame: &Turn, bounds: &[[[Exact; 2]; 2]; 3]) -> Result<(), String> {
        let span = || Exact::from(self.keys[1]) - Exact::from(self.keys[0]);
        for (axis, sides) in bounds.iter().enumerate() {
            let value = |side: usize| [0, 1].map(|end: usize| sides[side][end].value());
            if !self.is_near(frame, axis, value(0), 1.0)
                && !self.is_near(frame, axis, value(1), -1.0)
            {
                continue;
            }
            let along = self.in_frame(frame, axis);
            let [lo, hi] = sides.clone().map(|[start, end]| {
                (start.clone() + (end - start) * Exact::from(self.time)) * span()
            });
            let slack = [along.clone() - lo, hi - along].map(|x| x.value());
            if slack[0] < 0.0 || slack[1] < 0.0 {
                let Vertex { at, time, .. } = self;
                return Err(format!("axis {axis}: {at:?} at {time} is out by {slack:?}"));
            }
        }
        Ok(())
    }
}

/// Bounds as stored.
fn stored<B: Bounds8>(bounds: &B, slot: usize) -> [[[Exact; 2]; 2]; 3] {
    let plane = |lattice: &Lattice8, axis: usize, side: usize| {
        let q = f64::from(lattice.planes[axis][side][slot]);
        Exact::from(lattice.origin()[axis]) + Exact::product(lattice.step()[axis].into(), q)
    };
    let ends = |axis, side| [bounds.start(), bounds.end()].map(|l| plane(l, axis, side));
    [0, 1, 2].map(|axis| [0, 1].map(|side| ends(axis, side)))
}

/// The same of a box.
fn linear(b: &LinearBox) -> [[[Exact; 2]; 2]; 3] {
    [0, 1, 2]
        .map(|a| [[b.lo0[a], b.lo1[a]], [b.hi0[a], b.hi1[a]]].map(|ends| ends.map(Exact::from)))
}

/// Vertices, as (grid, vertex).
type Vertices = Vec<(usize, usize)>;

/// Checks that the vertices of an item are near to a point of its diagonal, in f64.
fn check_diagonal<B: Bounds8>(
    mesh: &PlanarMesh,
    node: &Node<B>,
    diagonals: &Diagonals,
    slot: usize,
    frame: &Turn,
    vertices: &Vertices,
    times: &[f32],
) -> Result<(), String> {
    // What the radius may be short by, and a vertex' coordinates off by.
    const ROOM: f64 = 32.0 / (1 << 24) as f64;
    if frame.normals[0] != frame.normals[1] || frame.bow != Vec3::ZERO {
        return Err("a diagonal in a frame that turns".into());
    }
    let axes = [frame.axes[0], frame.axes[1], frame.normals[0]].map(|axis| axis.as_dvec3());
    let grids = [node.bounds.start(), node.bounds.end()];
    for &time in times {
        let at = |ends: [f64; 2]| ends[0] + (ends[1] - ends[0]) * f64::from(time);
        let corner = |far: bool, axis: usize| {
            at([0, 1].map(|end| {
                let down = diagonals.down[end][axis] >> slot & 1 == 1;
                let q = grids[end].planes[axis][usize::from(far != down)][slot];
                f64::from(grids[end].origin()[axis])
                    + f64::from(grids[end].step()[axis]) * f64::from(q)
            }))
        };
        let [a, b] = [false, true].map(|far| [0, 1, 2].map(|axis| corner(far, axis)));
        for &(g, i) in vertices {
            let vertex = Vertex::new(mesh, g, i, time);
            let ([t0, t1], [p0, p1]) =
                (vertex.keys.map(f64::from), vertex.at.map(|p| p.as_dvec3()));
            let p = p0 + (p1 - p0) * ((f64::from(time) - t0) / (t1 - t0));
            let size = p0.abs().max(p1.abs()).max_element();
            // The most that it is out by on an axis, which is convex along the line.
            let out = |s: f64| {
                (0..3).fold(f64::NEG_INFINITY, |most: f64, axis| {
                    let own = a[axis] + (b[axis] - a[axis]) * s - p.dot(axes[axis]);
                    let step = at(grids.map(|grid| f64::from(grid.step()[axis])));
                    most.max(own.abs() - step * f64::from(STEP))
                })
            };
            let (mut from, mut to) = (0.0, 1.0);
            for _ in 0..200 {
                let third = (to - from) / 3.0;
                match out(from + third) < out(to - third) {
                    true => to -= third,
                    false => from += third,
                }
            }
            let out = out(from) - f64::from(diagonals.radius);
            if out > ROOM * size + f64::from(f32::MIN_POSITIVE) {
                return Err(format!("{p} at {time} is {out} too far from its diagonal"));
            }
        }
    }
    Ok(())
}

/// Checks all below `reference`; returns the vertices there, as (grid, vertex).
fn check_tree<B: Bounds8>(
    mesh: &PlanarMesh,
    tree: &BlockTree<B>,
    reference: u32,
    times: &[f32],
) -> Result<Vertices, String> {
    let mut all = Vec::new();
    let children: Vec<(_, Turn, Vertices)>;
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
                (stored(&block.bounds, slot as usize), frame, vertices)
            })
            .collect();
    } else {
        let node = &tree.tree.nodes[reference as usize];
        frame = tree.tree.frames[node.frame as usize].turn();
        for slot in (0..8).filter(|s| node.slots >> s & 1 == 1) {
            let item = node.children[slot] & !Tree::<B>::LEAF;
            if let Some(diagonals) = node.diagonals()
                && node.children[slot] != item
            {
                let (g, part) = loose_group(item).ok_or("a block has a diagonal")?;
                let (g, rect) = (g as usize, loose(&mesh.grids[g as usize], part));
                let vertices = rect_vertices(g, rect);
                check_diagonal(mesh, node, &diagonals, slot, &frame, &vertices, times)?;
            }
        }
        children = (0..8)
            .filter(|s| node.slots >> s & 1 == 1)
            .map(|s| {
                let below = check_tree(mesh, tree, node.children[s], times)?;
                Ok((stored(&node.bounds, s), frame, below))
            })
            .collect::<Result<_, String>>()?;
    }
    for (bounds, frame, vertices) in children {
        for &(g, i) in &vertices {
            for &time in times {
                Vertex::new(mesh, g, i, time).check(&frame, &bounds)?;
            }
        }
        all.extend(vertices);
    }
    Ok(all)
}

fn check_object(mesh: DicedMesh, times: &[f32]) -> Result<BvhStats, String> {
    let object = ObjectGeometry::plain(mesh);
    let mesh = object.mesh();
    let found = match object.blas() {
        Blas::Static(t) => {
            if mesh.is_moving() {
                return Err("a moving mesh has a static tree".into());
            }
            check_tree(mesh, t, t.tree.root, times)?
        }
        Blas::Moving(t) => check_tree(mesh, t, t.tree.root, times)?,
        Blas::Relative(_) => return Err("not a plain tree".into()),
    };
    let mut found = found;
    found.sort_unstable();
    found.dedup();
    // Grids are there whole, or left out whole and counted: only where coordinates, which inner keys raise, near the limit.
    let mut there = vec![false; mesh.grids.len()];
    found.iter().for_each(|&(g, _)| there[g] = true);
    let all: usize = (0..there.len())
        .filter(|&g| there[g])
        .map(|g| mesh.grids[g].vertex_count())
        .sum();
    let dropped = there.iter().filter(|&&there| !there).count() as u64;
    let reach = mesh.floats().iter().fold(0.0, |a: f32, x| a.max(x.abs()));
    let may_drop = reach > (1u64 << 57) as f32;
    if found.len() != all || dropped != object.stats().dropped_grids || (dropped > 0 && !may_drop) {
        return Err(format!("{} of {} vertices", found.len(), mesh.vertex_count));
    }
    for &(g, i) in &found {
        for &time in times {
            let vertex = Vertex::new(mesh, g, i, time);
            vertex.check(&Turn::fixed(&Frame::IDENTITY), &linear(object.bounds()))?;
            if vertex
                .at
                .iter()
                .any(|p| p.abs().max_element() > object.radius())
            {
                return Err("beyond the radius".into());
            }
        }
    }
    Ok(*object.stats())
}

fn times_strategy() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(0.0f32..=1.0, 3).prop_map(|mut t| {
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn random_vertices_are_contained(
        rates in prop::collection::vec((1u16..=16, 1u16..=16), 1..12),
        keys in keys_strategy(), seed: u64, size in -150i32..58, flat in 0usize..4, far: bool, times in times_strategy()
    ) {
        // Noise at every key: nothing is smooth, chords are raised. Flat in one axis or more.
        let size = f64::from(size).exp2() as f32;
        let h = |g: usize, u: f32, v: f32, t: f32, a: u64| {
            let bits = (g as u64) << 40 ^ u64::from(u.to_bits()) ^ u64::from(v.to_bits()).rotate_left(20)
                ^ u64::from(t.to_bits()).rotate_left(37) ^ seed.wrapping_mul(a + 1);
            Rng(bits).signed()
        };
        let m = mesh(&rates, &keys, |g, u, v, t| {
            let p = Vec3::new(h(g, u, v, t, 1), h(g, u, v, t, 2), h(g, u, v, t, 3));
            let mask = [Vec3::ONE, Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::ZERO][flat];
            let beside = if far { g as f32 } else { size * g as f32 };
            (Vec3::new(u, v, 0.0) + p * mask) * size + Vec3::splat(beside)
        });
        check_object(m, &times).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn oriented_bounds_contain(
        seed: u64, shape in 0usize..4, k in 1usize..4, offset in -100f32..100.0, times in times_strategy()
    ) {
        let keys = keys(k);
        let mut m = match shape {
            0 => fur(40, &keys, seed),
            1 => combed(40, 0.003, &keys, seed),
            2 => thin(40, &keys, seed),
            _ => bent_patches(12, 16, &keys[..1], seed, 0.1),
        };
        let spin = glam::Quat::from_axis_angle(Rng(seed).direction(), 1.0);
        for p in &mut m.positions {
            *p = spin * *p + Vec3::splat(offset);
        }
        let stats = check_object(m, &times).map_err(TestCaseError::fail)?;
        // Strands may happen to run along an axis; those of the test below do not.
        prop_assert!(shape < 3 || stats.oriented_blocks > 0 || offset.abs() > 50.0, "{stats:?}");
    }

    #[test]
    fn frames_that_turn_contain(
        keys in keys_strategy(), seed: u64, noise in 0i32..12, size in -100i32..40, times in times_strategy()
    ) {
        let noise = if noise == 0 { 0.0 } else { (-noise as f32).exp2() };
        let mut m = curved::flown(3, &keys, noise, seed);
        for p in &mut m.positions {
            *p *= (size as f32).exp2();
        }
        check_object(m, &times).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn instance_bounds_contain_the_quadratic_path(
        keys in keys_strategy(), seed: u64, moving: bool, time in 0.0f64..=1.0
    ) {
        let mut rng = Rng(seed);
        let (a, b, c, d) = (rng.cube(), rng.cube(), rng.cube(), rng.cube());
        let object = if moving {
            LinearBox { lo0: a.min(b), hi0: a.max(b), lo1: c.min(d), hi1: c.max(d) }
        } else {
            LinearBox { lo0: a.min(b), hi0: a.max(b), lo1: a.min(b), hi1: a.max(b) }
        };
        let matrices: Vec<DAffine3> = keys
            .iter()
            .map(|_| DAffine3::from_cols_array(&std::array::from_fn(|_| f64::from(rng.signed()) * 3.0)))
            .collect();
        let world = world_bounds(&object, &keys, &matrices);
        let k = (0..keys.len() - 2).take_while(|&k| f64::from(keys[k + 1]) <= time).count();
        let s = (time - f64::from(keys[k])) / (f64::from(keys[k + 1]) - f64::from(keys[k]));
        let (m0, m1) = (&matrices[k], &matrices[k + 1]);
        let (lo, hi) = object.at(time);
        let (wlo, whi) = world.at(time);
        for corner in 0..8 {
            let pick = |i: usize| if corner >> i & 1 == 0 { lo[i] } else { hi[i] };
            let p = DVec3::new(pick(0), pick(1), pick(2));
            let q = m0.transform_point3(p) * (1.0 - s) + m1.transform_point3(p) * s;
            prop_assert!((q - wlo).min_element() >= -1e-12, "{} {}", q, wlo);
            prop_assert!((whi - q).min_element() >= -1e-12, "{} {}", q, whi);
        }
    }
}

#[test]
fn the_excess_is_a_quarter() {
    // M from 0 to 1, p from 1 to 0: the path reaches 1/4 in between, though it is 0 at both ends.
    let object = LinearBox {
        lo0: Vec3::ONE,
        hi0: Vec3::ONE,
        lo1: Vec3::ZERO,
        hi1: Vec3::ZERO,
    };
    let scale = |s: f64| DAffine3::from_scale(DVec3::splat(s));
    let b = world_bounds(&object, &[0.0, 1.0], &[scale(0.0), scale(1.0)]);
    assert_eq!((b.hi0.x, b.hi1.x, b.lo0.x, b.lo1.x), (0.25, 0.25, 0.0, 0.0));
}

#[test]
fn degenerate_grids_are_contained_and_never_hit() {
    let times = [0.0, 0.3, 1.0];
    for shape in 0..3 {
        let m = mesh(
            &[(16, 16), (3, 9)],
            &[0.0, 0.4, 1.0],
            |g, u, _, t| match shape {
                0 => Vec3::splat(g as f32 + t),
                1 => Vec3::new(u, 2.0 * u, t),
                _ => Vec3::ZERO,
            },
        );
        check_object(m.clone(), &times).expect("contained");
        let world = world_of(m);
        let mut counts = Default::default();
        for time in [0.0, 0.5, 1.0] {
            // Straight at points and lines: nothing has an area.
            let r = ray(Vec3::new(0.25, 0.5, 9.0), -Vec3::Z, time);
            assert!(!world.trace(&r, &mut counts).is_hit());
        }
    }
}

/// Frames of an object's blocks that turn, and those of them that have a bow along a fixed axis.
fn turning(object: &ObjectGeometry) -> [usize; 2] {
    let Blas::Moving(tree) = object.blas() else {
        return [0; 2];
    };
    let turns = tree
        .frames
        .iter()
        .map(Turning::turn)
        .filter(|turn| turn.turns());
    let bowed = |turn: &Turn| turn.bow.truncate() != glam::Vec2::ZERO;
    [turns.clone().count(), turns.filter(bowed).count()]
}

#[test]
fn frames_follow_blocks_along_arcs() {
    let times: Vec<f32> = (0..=16).map(|i| i as f32 / 16.0).collect();
    for count in 3..=9 {
        let object = ObjectGeometry::plain(curved::flown(12, &keys(count), 0.0, 3));
        let [turns, bows] = turning(&object);
        assert!(turns > 24 && bows > 24, "{count}: {turns}, {bows}");
        for noise in [0.0, 0.002] {
            check_object(curved::flown(12, &keys(count), noise, 3), &times).expect("contained");
        }
    }
}

#[test]
fn keys_next_to_an_end_of_the_shutter_leave_nothing_undefined() {
    let nearest_to_1 = 1.0 - 0.5f32.powi(24);
    for keys in [
        &[0.0, 1e-25, 1.0][..],
        &[0.0, 1e-40, 1e-25, 0.5, 1.0],
        &[0.0, nearest_to_1, 1.0],
    ] {
        for make in [combed(2000, 0.002, keys, 1), sheet(8, 16, keys)] {
            let object = ObjectGeometry::plain(make.clone());
            assert!(object.radius() < 10.0, "{keys:?}: {}", object.radius());
            let Blas::Moving(tree) = object.blas() else {
                panic!("it moves");
            };
            let frames = tree.frames.iter().chain(&tree.tree.frames);
            // Besides those that are the identity.
            let count = frames.clone().count();
            assert!(count > 12, "{keys:?}: {count}");
            for turn in frames.map(Turning::turn) {
                assert!(turn.bow.is_finite(), "{keys:?}: {turn:?}");
            }
            check_object(make, &[0.0, 1e-25, 0.3, nearest_to_1, 1.0]).expect("contained");
        }
    }
}

#[test]
fn frames_follow_normals_that_turn() {
    for count in [2, 5, 9] {
        let make = || sheet(24, 16, &keys(count));
        check_object(make(), &[0.0, 0.3, 0.5, 0.8, 1.0]).expect("contained");
        let object = Arc::new(ObjectGeometry::plain(make()));
        let [turns, _] = turning(&object);
        let Blas::Moving(tree) = object.blas() else {
            panic!("the sheet moves");
        };
        assert!(5 * turns > 2 * tree.blocks.len(), "{turns}");
        // Fewer micropolygons are tested than along the axes of space, and the same are hit.
        let mut rng = Rng(11);
        let rays: Vec<_> = (0..512)
            .map(|_| {
                let target = Vec3::new(0.9 * rng.signed(), 0.9 * rng.signed(), 0.0);
                let dir = rng.direction();
                ray(target - dir * 3.0, dir, rng.unit())
            })
            .collect();
        let trace = |object: &Arc<ObjectGeometry>| {
            let place = InstanceTransform::Translation(DVec3::ZERO);
            let world = World::build(vec![instance(object, place)], DVec3::ZERO);
            let mut counts = TraceCounts::default();
            let hits: Vec<_> = rays.iter().map(|r| world.trace(r, &mut counts)).collect();
            (hits, counts.cell_tests)
        };
        let (hits, tests) = trace(&object);
        let (same, upright_tests) = trace(&Arc::new(ObjectGeometry::upright(make())));
        assert_eq!(hits, same);
        assert!(hits.iter().filter(|h| h.is_hit()).count() > 400);
        let share = if count == 2 { 0.8 } else { 0.9 };
        let share = share * upright_tests as f64;
        assert!((tests as f64) < share, "{count}: {tests} {upright_tests}");
    }
}

#[test]
fn whole_subtrees_of_combed_fur_share_frames() {
    for k in [1, 2, 3] {
        let stats =
            check_object(combed(3000, 0.003, &keys(k), 1), &[0.0, 0.3, 1.0]).expect("contained");
        assert_eq!((stats.blocks, stats.loose_groups), (0, 3000 * 8));
        assert!(stats.oriented_nodes * 2 > stats.nodes, "{stats:?}");
        let object = ObjectGeometry::plain(combed(3000, 0.003, &keys(k), 1));
        let (frames, turn) = match object.blas() {
            Blas::Static(t) => (t.tree.frames.len(), 0),
            Blas::Moving(t) => {
                let turn = t.tree.frames.iter().filter(|frame| frame.turn().turns());
                (t.tree.frames.len(), turn.count())
            }
            Blas::Relative(_) => (0, 0),
        };
        assert!(frames as u64 * 3 < stats.nodes, "{frames} {stats:?}");
        // They swing.
        let least = if k == 1 { 0 } else { frames / 2 };
        assert!(turn >= least, "{turn} of {frames}");
    }
    // What stands upright is well bounded by a block.
    let upright = mesh(&[(1, 16); 100], &keys(1), |g, u, v, _| {
        Vec3::new(g as f32 + u * 0.1, u * 0.1, v)
    });
    let stats = check_object(upright, &[0.0]).expect("contained");
    assert_eq!((stats.blocks, stats.loose_groups), (100, 0));
}

/// Boxes of two micropolygons would have a hundred times their area.
#[test]
fn micropolygons_of_thin_strands_are_items() {
    for k in [1, 2, 3] {
        let groups = |m: DicedMesh| {
            let stats = check_object(m, &[0.0, 0.3, 1.0]).expect("contained");
            assert_eq!(stats.blocks, 0);
            stats.loose_groups
        };
        assert_eq!(groups(combed(300, 0.003, &keys(k), 1)), 300 * 8);
        assert_eq!(groups(combed(300, 0.0005, &keys(k), 1)), 300 * 16);
        // Of each length two, but three and four along a row are as few as a group's.
        let lengths = (3..=16).map(|n| 2 * n).sum::<u64>() - 2 - 3;
        assert_eq!(groups(thin(28 * 20, &keys(k), 1)), 20 * lengths);
        // Nothing is there to be hit.
        assert_eq!(groups(combed(300, 0.0, &keys(k), 1)), 300 * 8);
    }
}

/// Where frames were tried in vain before, too: of fur whose strands cross, for some.
#[test]
fn one_thread_builds_the_same_trees_over_strands() {
    for mesh in [
        fur(3000, &keys(1), 1),
        combed(3000, 0.003, &keys(2), 1),
        thin(3000, &keys(1), 1),
    ] {
        let pool = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool")
        };
        let [one, four] = [1, 4].map(|threads| {
            let object = pool(threads).install(|| ObjectGeometry::plain(mesh.clone()));
            let words = format!("{:?}", object.blas());
            assert!(object.stats().nodes > 3000 && words.len() > 1 << 20);
            words
        });
        assert!(one == four);
    }
}

#[test]
fn upright_trees_have_no_frames_and_give_the_same_hits() {
    // Of patches so small none has a frame; their hits are the same all the more.
    for (mesh, framed) in [
        (combed(600, 0.003, &keys(2), 1), true),
        (sheet(16, 16, &keys(2)), true),
        (patches(40, 9, &keys(2), 3), false),
    ] {
        let turned = ObjectGeometry::plain(mesh.clone());
        let upright = ObjectGeometry::upright(mesh);
        let frames = |stats: &BvhStats| stats.oriented_nodes + stats.oriented_blocks;
        assert_eq!(frames(turned.stats()) > 0, framed);
        assert_eq!(frames(upright.stats()), 0);
        let world = |object| {
            let place = InstanceTransform::Translation(DVec3::ZERO);
            World::build(vec![instance(&Arc::new(object), place)], DVec3::ZERO)
        };
        let worlds = [turned, upright].map(world);
        let mut rng = Rng(8);
        for _ in 0..500 {
            let origin = rng.direction() * 3.0;
            let ray = ray(origin, rng.cube() - origin, rng.unit());
            let [a, b] = worlds
                .each_ref()
                .map(|world| world.trace(&ray, &mut TraceCounts::default()));
            assert_eq!(a, b, "{ray:?}");
        }
    }
}

#[test]
fn strands_without_extent_or_all_in_one_place_build() {
    let n = 2000;
    for shape in 0..4 {
        let m = mesh(&vec![(1, 16); n], &keys(2), |g, u, v, t| match shape {
            // Points, lines in one place, ribbons in one place, and strands that turn over in the shutter.
            0 => Vec3::ONE,
            1 => Vec3::new(v, v, 2.0 * v + t),
            2 => Vec3::new(v + 0.1 * u, v, 2.0 * v),
            _ => {
                Vec3::new(g as f32, u * 0.1, 0.0) + Vec3::new(1.0, 2.0, 3.0) * (v * (1.0 - 2.0 * t))
            }
        });
        check_object(m, &[0.0, 0.4, 1.0]).expect("contained");
    }
}

#[test]
fn one_thread_turns_the_same_nodes() {
    let nodes = || {
        let object = ObjectGeometry::plain(combed(1500, 0.003, &keys(2), 1));
        match object.blas() {
            Blas::Static(_) | Blas::Relative(_) => String::new(),
            Blas::Moving(t) => format!("{:?}", t.tree),
        }
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool of one thread");
    assert!(nodes() == pool.install(nodes));
}

#[test]
fn a_million_identical_grids_build_and_answer_the_first() {
    let m = mesh(&vec![(1, 1); 1_000_000], &[0.0], |_, u, v, _| {
        Vec3::new(u, v, 0.0)
    });
    let world = world_of(m);
    let mut counts = Default::default();
    let hit = world.trace(&ray(Vec3::new(0.25, 0.5, 1.0), -Vec3::Z, 0.0), &mut counts);
    assert_eq!((hit.t, hit.grid, hit.cell), (1.0, 0, 0));
    assert!(
        !world
            .trace(&ray(Vec3::new(1.5, 0.5, 1.0), -Vec3::Z, 0.0), &mut counts)
            .is_hit()
    );
}

#[test]
fn tilted_strands_are_halved_and_surfaces_are_not() {
    for k in [1, 2, 3] {
        let ribbon = mesh(&[(4, 16)], &keys(k), |_, u, v, t| {
            Vec3::new(v + 0.01 * u, v - 0.01 * u, v) + Vec3::X * (0.2 * t * t)
        });
        let stats = check_object(ribbon, &[0.0, 0.3, 1.0]).unwrap();
        assert!(stats.blocks > 1, "{stats:?}");
        let stats = check_object(sheet(1, 16, &keys(k)), &[0.0, 0.3, 1.0]).unwrap();
        assert_eq!(stats.blocks, 4);
    }
}

#[test]
fn what_does_not_move_stores_no_second_bounds() {
    let still = ObjectGeometry::new(sheet(8, 16, &keys(1)));
    let moving = ObjectGeometry::new(sheet(8, 16, &keys(2)));
    let per_cell = |o: &ObjectGeometry| o.stats().bvh_bytes as f64 / o.stats().cells as f64;
    assert!(per_cell(&still) < 5.0, "{}", per_cell(&still));
    assert!(per_cell(&moving) < 9.0, "{}", per_cell(&moving));
    assert!(matches!(still.blas(), Blas::Static(_)));
}
