// A ray's walk through a page of a scene: the nearest hit, or any; the twin of core's trace/traverse.rs.
//
// One invocation takes one ray through the tree over instances and through the trees of their objects, with one stack for
// both. Where the nearest hit is looked for, nearest children come first. Hits are compared by (t, instance, grid, cell), and
// entries are dropped only when they start behind the best hit, so the answer does not depend on the order of the walk. Where
// any hit will do, the first ends the walk, and children come as they stand: whether there is one does not depend on it.

// The permutation fixes TIME (something moves: nodes, vertices or instances may have a second end), STACK (entries of
// the stack; the host knows how many a scene needs at most), ANY (any hit will do), what `tell` and `visit` do with the work
// of a ray (tell_none.wgsl, tell_counts.wgsl or tell_visits.wgsl), which sides of surfaces are there (sides_all.wgsl or
// sides_some.wgsl), and whether hits are left out that were met before (met_none.wgsl or met_before.wgsl).

@group(0) @binding(0) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read> vertices: array<f32>;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read> objects: array<Object>;
@group(0) @binding(4) var<storage, read> instances: array<Instance>;
@group(0) @binding(5) var<storage, read> matrices: array<vec4<f32>>;
@group(1) @binding(2) var<uniform> launch: TraceLaunch;

const WORKGROUP: u32 = 64u;
// Micropolygons along a loose group of a strip, unless it is a single one.
const LOOSE_LENGTH: u32 = 2u;
// Bits of its number, and the first number of a single one.
const LOOSE_BITS: u32 = 5u;
const SINGLES: u32 = 8u;
// Instance of a miss.
const NONE: u32 = 0xffffffffu;

// A ray in an object's space.
struct Local {
    origin: vec3<f32>,
    dir: vec3<f32>,
    // False where it cannot be carried there.
    sound: bool,
}

fn row(i: u32) -> vec4<f32> {
    return matrices[i];
}

// Inverse of the matrix with these columns, times a vector.
fn solve(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, v: vec3<f32>, det: f32) -> vec3<f32> {
    return vec3<f32>(dot(cross(y, z), v), dot(cross(z, x), v), dot(cross(x, y), v)) / det;
}

fn carried(instance: Instance, origin: vec3<f32>, dir: vec3<f32>, time: f32) -> Local {
    let at = instance.matrices;
    if instance.key_count == 0u {
        return Local(origin - row(at).xyz, dir, true);
    }
    if !TIME || instance.key_count == 1u {
        // The inverse, and where the object's origin is.
        let x = row(at);
        let y = row(at + 1u);
        let z = row(at + 2u);
        let o = origin - vec3<f32>(x.w, y.w, z.w);
        return Local(x.xyz * o.x + y.xyz * o.y + z.xyz * o.z, x.xyz * dir.x + y.xyz * dir.y + z.xyz * dir.z, true);
    }
    let place = locate(instance.key_times, instance.key_count, time);
    let a = at + 3u * place.key;
    let x = mix(row(a), row(a + 3u), place.fraction);
    let y = mix(row(a + 1u), row(a + 4u), place.fraction);
    let z = mix(row(a + 2u), row(a + 5u), place.fraction);
    let o = origin - vec3<f32>(x.w, y.w, z.w);
    let det = dot(x.xyz, cross(y.xyz, z.xyz));
    let sound = abs(det) > 1.0e-30;
    let divisor = select(1.0, det, sound);
    return Local(solve(x.xyz, y.xyz, z.xyz, o, divisor), solve(x.xyz, y.xyz, z.xyz, dir, divisor), sound);
}

// The micropolygons of a loose group, as core's bvh/block.rs cuts them.
fn loose_rect(object: Object, item: u32) -> Rect {
    let grid = (item & ~(LEAF | LOOSE)) >> LOOSE_BITS;
    let slot = item & ((1u << LOOSE_BITS) - 1u);
    let rates = words[object.grids + 2u * grid + 1u];
    let w = rates & 0xffffu;
    let h = rates >> 16u;
    if w <= 4u && h <= 2u {
        return Rect(grid, 0u, 0u, w, h);
    }
    let single = slot >= SINGLES;
    let length = select(LOOSE_LENGTH, 1u, single);
    let start = select(slot * LOOSE_LENGTH, slot - SINGLES, single);
    if w == 1u {
        return Rect(grid, 0u, start, w, min(length, h - start));
    }
    return Rect(grid, start, 0u, min(length, w - start), h);
}

// Micropolygons of a group of a block; `span` is its rectangle and its groups, as bytes.
fn group_rect(grid: u32, span: vec2<u32>, slot: u32) -> Rect {
    let rect = unpack4xU8(span.x);
    let groups = unpack4xU8(span.y);
    let columns = max(groups.z, 1u);
    let i = (slot % columns) * groups.x;
    let j = (slot / columns) * groups.y;
    return Rect(grid, rect.x + i, rect.y + j, min(groups.x, rect.z - i), min(groups.y, rect.w - j));
}

// Gives the nodes opened and the micropolygons tested.
fn walk(ray: Ray, best: ptr<function, Hit>) -> vec2<u32> {
    var tests = vec2<u32>(0u);
    var stack: array<Waiting, STACK>;
    var top = 0u;
    // Above this the stack holds what is to be visited of the object; `inside` is false in the tree over instances.
    var floor = 0u;
    var inside = false;
    let carried_pad = launch.pad * (longest(ray.origin) + launch.radius);
    let world = tree_ray(ray.origin, ray.dir, ray.time, launch.radius, carried_pad);
    if !is_sound(world) {
        return tests;
    }
    var tree = world;
    var slab = turned(tree, 0u);
    // The frame that `slab` is in.
    var frame = 0u;
    var object: Object;
    // Number of the instance in the world.
    var instance = 0u;
    var cells: CellRay;
    var at = launch.root;
    loop {
        var leave = true;
        if (at & LEAF) == 0u {
            tests.x += 1u;
            visit(ray.number, at);
            let moves = (at & MOVES) != 0u;
            let place = at & PLACE;
            let children = select(18u, 36u, TIME && moves);
            let tail = place + select(6u, 11u, TIME && moves);
            let tail_words = nodes[tail];
            let node_frame = select(tail_words.z, tail_words.x, TIME && moves);
            let valid = select(tail_words.w, tail_words.y, TIME && moves);
            if node_frame != frame {
                frame = node_frame;
                slab = turned(tree, frame);
            }
            let found = enter(place, moves, valid, slab, ray.t_min, (*best).t);
            var mask = found.mask;
            if mask != 0u {
                var slot = firstTrailingBit(mask);
                mask &= mask - 1u;
                var next = node_word(place, children + slot);
                var next_near = found.near[slot >> 2u][slot & 3u];
                let base = top;
                while mask != 0u {
                    slot = firstTrailingBit(mask);
                    mask &= mask - 1u;
                    var child = node_word(place, children + slot);
                    var near = found.near[slot >> 2u][slot & 3u];
                    // The nearest child is next; the others wait, farthest first.
                    if !ANY && near < next_near {
                        let other = next;
                        let other_near = next_near;
                        next = child;
                        next_near = near;
                        child = other;
                        near = other_near;
                    }
                    var i = min(top, STACK - 1u);
                    top = min(top + 1u, STACK);
                    while !ANY && i > base && near_of(stack[i - 1u]) < near {
                        stack[i] = stack[i - 1u];
                        i -= 1u;
                    }
                    stack[i] = waiting(child, near);
                }
                at = next;
                leave = false;
            }
        } else if !inside {
            let place = instances[at & ~LEAF];
            instance = place.number;
            let local = carried(place, ray.origin, ray.dir, ray.time);
            object = objects[place.object];
            var there = tree_ray(local.origin, local.dir, ray.time, object.radius, 0.0);
            if TIME && goes_straight(object.key_count) {
                there.bow = straight_bow(object.key_times, object.key_count, ray.time);
            }
            if local.sound && is_sound(there) && object.root != EMPTY {
                inside = true;
                floor = top;
                tree = there;
                frame = 0u;
                slab = turned(tree, 0u);
                cells = cell_ray(local.origin, local.dir, ray.time, object);
                come_to(at & ~LEAF);
                at = object.root;
                leave = false;
            }
        } else if (at & LOOSE) != 0u {
            let rect = loose_rect(object, at);
            tests.y += rect.w * rect.h;
            test_group(best, rect, object, cells, ray.t_min, instance);
        } else {
            // A block: bounds of its groups, where they are, its frame.
            tests.x += 1u;
            visit(ray.number, at);
            let place = at & PLACE;
            let moves = TIME && object.key_count > 1u;
            let span_at = select(18u, 36u, moves);
            let grid = node_word(place, span_at);
            let span = vec2<u32>(node_word(place, span_at + 1u), node_word(place, span_at + 2u));
            let block_frame = node_word(place, span_at + 3u);
            if block_frame != frame {
                frame = block_frame;
                slab = turned(tree, frame);
            }
            let valid = (1u << (span.y >> 24u)) - 1u;
            let found = enter(place, moves, valid, slab, ray.t_min, (*best).t);
            var mask = found.mask;
            while mask != 0u {
                // The nearest of those that are left.
                var slot = firstTrailingBit(mask);
                var near = found.near[slot >> 2u][slot & 3u];
                var rest = mask & (mask - 1u);
                while !ANY && rest != 0u {
                    let other = firstTrailingBit(rest);
                    rest &= rest - 1u;
                    let other_near = found.near[other >> 2u][other & 3u];
                    if other_near < near {
                        slot = other;
                        near = other_near;
                    }
                }
                mask &= ~(1u << slot);
                if near > (*best).t {
                    break;
                }
                let rect = group_rect(grid, span, slot);
                tests.y += rect.w * rect.h;
                test_group(best, rect, object, cells, ray.t_min, instance);
                if ANY && (*best).instance != NONE {
                    break;
                }
            }
        }
        if ANY && (*best).instance != NONE {
            return tests;
        }
        // The next subtree that does not start behind the best hit.
        while leave {
            if inside && top == floor {
                inside = false;
                floor = 0u;
                tree = world;
                frame = 0u;
                slab = turned(tree, 0u);
            }
            if top == 0u {
                return tests;
            }
            top -= 1u;
            let entry = stack[top];
            if near_of(entry) <= (*best).t {
                at = child_of(entry);
                leave = false;
            }
        }
    }
    return tests;
}
