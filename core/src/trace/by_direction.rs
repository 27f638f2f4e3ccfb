//! The order of rays that go all ways from where they begin, as those that leave surfaces do: rays that go about the same way go
//! together.
//!
//! Rays that leave neighbouring points meet the same nodes only where they go the same way. So some thousand of them are sorted by
//! direction, and packets are cut from that: each has some of the directions, and origins as far apart as all of them are. That pays where
//! packets had nearly all directions before, and origins that were about as far apart. Where neighbours in the usual order are much nearer to each other
//! than all rays are, that order stays.
//!
//! Directions are places on an octahedron that is folded open into a square (Cigolle et al., "A Survey of Efficient Representations for
//! Independent Unit Vectors", JCGT 3(2), 2014), whose cells follow each other along Hilbert's curve. Rays of one cell keep the order that
//! they had. Hits do not depend on the order.

use hdtrapeze_simd::{Float, Kernel, Level, Simd};

use super::Ray;
use super::packet::{PACKET, columns};

/// Rays that are sorted together, at the most.
pub const BATCH: usize = 4096;
/// Rays of a part that is sorted by itself, where all are too far from each other.
const PART: usize = 1024;
/// Rays that are sorted, at the least.
const LEAST: usize = 4 * PACKET;
/// Rays go all ways where directions, of which the largest component is 1, differ by more than this along an axis.
const ALL_WAYS: f32 = 1.0;
/// Packets go all ways where their directions differ by this part of those of all rays.
const MIXED: f32 = 0.6;
/// Origins of all rays may be this many times as far apart as those of packets.
const CLOSE: f32 = 2.5;
/// Packets that tell of all, and rays that tell of each.
const JUDGED: [usize; 2] = [4, 16];
/// Cells along a side of the square.
const SIDE: usize = 16;

/// False where rays go about the same way, of which a packet is one of many: [`by_direction`] would most likely keep the order of all, and
/// looks at rays all over memory to tell.
pub fn goes_many_ways(packet: &[Ray]) -> bool {
    let [_, of_each] = JUDGED;
    let mut ways = Around::NOTHING;
    for ray in packet.iter().step_by((packet.len() / of_each).max(1)) {
        ways.add(way(ray));
    }
    // Half of what packets need in the mean.
    ways.widest() >= 0.5 * MIXED * ALL_WAYS
}

/// Numbers of `rays` in an order in which packets go fewer ways; `None` where the order that they have stays. Any thread.
///
/// # Panics
/// There are more than [`BATCH`].
pub fn by_direction(level: Level, rays: &[Ray]) -> Option<Vec<u16>> {
    assert!(rays.len() <= BATCH, "{} rays at once", rays.len());
    let mut order: Option<Vec<u16>> = None;
    let mut sort = |from: usize, rays: &[Ray]| {
        let pole = sorting_pays(rays);
        if let Some(pole) = pole {
            let order = order.get_or_insert_with(|| (0..BATCH as u16).collect());
            let order = &mut order[from..from + rays.len()];
            level.run(Sort {
                rays,
                pole,
                from: from as u16,
                order,
            });
        }
        pole.is_some()
    };
    if !sort(0, rays) && rays.len() > PART {
        for (k, part) in rays.chunks(PART).enumerate() {
            sort(PART * k, part);
        }
    }
    if let Some(order) = &mut order {
        order.truncate(rays.len());
    }
    order
}

/// The axis that most directions lie along, and whether they go down it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pole {
    axis: usize,
    down: bool,
}

/// A box around vectors.
#[derive(Clone, Copy)]
struct Around {
    least: [f32; 3],
    most: [f32; 3],
}

impl Around {
    const NOTHING: Around = Around {
        least: [f32::INFINITY; 3],
        most: [f32::NEG_INFINITY; 3],
    };

    /// Holds `v` too; coordinates that are NaN are passed over.
    fn add(&mut self, v: [f32; 3]) {
        for (axis, x) in v.into_iter().enumerate() {
            self.least[axis] = self.least[axis].min(x);
            self.most[axis] = self.most[axis].max(x);
        }
    }

    fn size(&self) -> [f32; 3] {
        std::array::from_fn(|axis| self.most[axis] - self.least[axis])
    }

    fn widest(&self) -> f32 {
        self.size().into_iter().fold(0.0, f32::max)
    }

    /// A half of the way around.
    fn apart(&self) -> f32 {
        self.size().iter().sum()
    }
}

/// A direction of which the largest component is 1.
fn way(ray: &Ray) -> [f32; 3] {
    (ray.dir / ray.dir.abs().max_element()).to_array()
}

/// Where packets of neighbours go nearly all ways, and begin nearly everywhere: the axis that most go along.
fn sorting_pays(rays: &[Ray]) -> Option<Pole> {
    if rays.len() < LEAST {
        return None;
    }
    let (mut ways, mut origins) = (Around::NOTHING, Around::NOTHING);
    let mut sum = [0.0f32; 3];
    for ray in rays.iter().step_by(rays.len() / PACKET) {
        let way = way(ray);
        ways.add(way);
        origins.add(ray.origin.to_array());
        for (sum, x) in sum.iter_mut().zip(way) {
            *sum += x;
        }
    }
    let (width, apart) = (ways.widest(), origins.apart());
    if width <= ALL_WAYS {
        return None;
    }
    // Of packets, all that are judged together.
    let (packets, _) = rays.as_chunks::<PACKET>();
    let [judged, of_each] = JUDGED;
    let (mut own_width, mut own_apart) = (0.0, 0.0);
    for packet in packets.iter().step_by(packets.len() / judged).take(judged) {
        let (mut ways, mut origins) = (Around::NOTHING, Around::NOTHING);
        for ray in packet.iter().step_by(PACKET / of_each) {
            ways.add(way(ray));
            origins.add(ray.origin.to_array());
        }
        own_width += ways.widest();
        own_apart += origins.apart();
    }
    let judged = judged as f32;
    // Written so that NaN is refused.
    let pays = own_width >= MIXED * width * judged && apart * judged <= CLOSE * own_apart;
    pays.then(|| {
        let axis = (0..3).fold(0, |a, b| if sum[b].abs() > sum[a].abs() { b } else { a });
        Pole {
            axis,
            down: sum[axis] < 0.0,
        }
    })
}

struct Sort<'a> {
    rays: &'a [Ray],
    pole: Pole,
    /// The number of the first ray.
    from: u16,
    order: &'a mut [u16],
}

impl Kernel for Sort<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self {
            rays,
            pole,
            from,
            order,
        } = self;
        let mut keys = [0u8; BATCH];
        let mut begin = [0u16; SIDE * SIDE];
        for (keys, rays) in keys.as_chunks_mut().0.iter_mut().zip(rays.chunks(8)) {
            *keys = cells(simd, rays, pole);
        }
        for &key in &keys[..rays.len()] {
            begin[usize::from(key)] += 1;
        }
        let mut sum = 0;
        for begin in &mut begin {
            sum += std::mem::replace(begin, sum);
        }
        for (i, &key) in (from..).zip(&keys[..rays.len()]) {
            let begin = &mut begin[usize::from(key)];
            order[usize::from(*begin)] = i;
            *begin += 1;
        }
    }
}

/// Places along the curve of up to 8 rays' directions; any for a direction that is none.
#[inline(always)]
fn cells<S: Simd>(simd: S, rays: &[Ray], pole: Pole) -> [u8; 8] {
    let [_, _, _, dx, dy, dz, ..] = columns(simd, rays);
    let dirs = [dx, dy, dz];
    let (x, y) = (dirs[(pole.axis + 1) % 3], dirs[(pole.axis + 2) % 3]);
    let along = dirs[pole.axis];
    let (zero, one) = (simd.all8(0.0), simd.all8(1.0));
    let inverse = one.over(x.abs() + y.abs() + along.abs());
    let (x, y) = (x * inverse, y * inverse);
    // The half about the other pole is folded out.
    let other = if pole.down {
        zero.lt(along)
    } else {
        along.lt(zero)
    };
    let signed = |size: S::F8, sign: S::F8| (-size).or(sign.lt(zero), size);
    let (folded_x, folded_y) = (signed(one - y.abs(), x), signed(one - x.abs(), y));
    let (x, y) = (folded_x.or(other, x), folded_y.or(other, y));
    let half = simd.all8(0.5 * SIDE as f32);
    let last = simd.all8(SIDE as f32 - 1.0);
    let number = |x: S::F8| x.mul_add(half, half).max(zero).min(last).to_array();
    let (columns, rows) = (number(x), number(y));
    let cells: [u32; 8] = std::array::from_fn(
        #[inline(always)]
        |k| rows[k] as u32 * SIDE as u32 + columns[k] as u32,
    );
    cells.map(
        #[inline(always)]
        |cell| CURVE[cell as usize & (SIDE * SIDE - 1)],
    )
}

/// The place of each cell of the square along Hilbert's curve.
static CURVE: [u8; SIDE * SIDE] = {
    let mut places = [0; SIDE * SIDE];
    let mut cell = 0;
    while cell < SIDE * SIDE {
        let (mut x, mut y, mut place) = (cell % SIDE, cell / SIDE, 0);
        let mut half = SIDE / 2;
        while half > 0 {
            let (right, up) = (x & half > 0, y & half > 0);
            let quarter = if right { 3 - up as usize } else { up as usize };
            place += quarter * half * half;
            if !up {
                if right {
                    (x, y) = (SIDE - 1 - x, SIDE - 1 - y);
                }
                (x, y) = (y, x);
            }
            half /= 2;
        }
        places[cell] = place as u8;
        cell += 1;
    }
    places
};

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::trace::random::{cube, unit};

    #[test]
    fn the_curve_goes_from_cell_to_neighbour() {
        let mut at = [None; SIDE * SIDE];
        for (cell, &place) in CURVE.iter().enumerate() {
            let old = at[usize::from(place)].replace((cell % SIDE, cell / SIDE));
            assert_eq!(old, None);
        }
        for pair in at.windows(2) {
            let [Some((x, y)), Some((to_x, to_y))] = *pair else {
                panic!("a place without a cell")
            };
            assert_eq!(x.abs_diff(to_x) + y.abs_diff(to_y), 1);
        }
    }

    /// From a square of `side`, row by row, into the hemisphere about `normal`.
    fn leaving(count: usize, side: f32, normal: Vec3) -> Vec<Ray> {
        let state = &mut 5;
        let across = (count as f32).sqrt();
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        let mut ray = |i: usize| {
            let (x, y) = (i as f32 % across, (i as f32 / across).floor());
            Ray {
                origin: (u * x + v * y) * (side / across),
                dir: normal + 0.99 * cube(state).normalize(),
                time: unit(state),
                t_min: 0.0,
                t_max: f32::INFINITY,
            }
        };
        (0..count).map(&mut ray).collect()
    }

    /// The mean width of packets' directions.
    fn ways(rays: &[Ray], order: &[u16]) -> f32 {
        let packets = order.chunks(PACKET);
        let count = packets.len() as f32;
        let width = |packet: &[u16]| {
            let mut around = Around::NOTHING;
            for &i in packet {
                around.add(rays[usize::from(i)].dir.normalize().to_array());
            }
            around.size().iter().sum::<f32>()
        };
        packets.map(width).sum::<f32>() / count
    }

    #[test]
    fn packets_go_fewer_ways() {
        for normal in [Vec3::X, -Vec3::Y, Vec3::new(0.3, 0.5, -0.8).normalize()] {
            for (count, less) in [(4096, 0.4), (1024, 0.65), (1000, 0.65), (300, 0.95)] {
                let mut rays = leaving(count, 1.0, normal);
                // Blocks of neighbours are in no order.
                rays.sort_by_key(|ray| ray.time.to_bits());
                for level in Level::available() {
                    let order = by_direction(level, &rays).expect("an order");
                    let mut all = order.clone();
                    all.sort_unstable();
                    assert!(all.into_iter().eq(0..count as u16));
                    let usual: Vec<u16> = (0..count as u16).collect();
                    let (before, after) = (ways(&rays, &usual), ways(&rays, &order));
                    assert!(after < less * before, "{count}: {after} of {before}");
                }
            }
        }
    }

    #[test]
    fn parts_are_sorted_where_all_are_far_from_each_other() {
        // Four crowds along a line.
        let mut rays = leaving(BATCH, 1.0, Vec3::Y);
        rays.sort_by_key(|ray| ray.time.to_bits());
        for (i, ray) in rays.iter_mut().enumerate() {
            ray.origin.x += 100.0 * (i / PART) as f32;
        }
        let order = by_direction(Level::best(), &rays).expect("an order");
        for (k, part) in order.chunks(PART).enumerate() {
            let mut part = part.to_vec();
            part.sort_unstable();
            assert!(
                part.into_iter()
                    .eq((PART * k..PART * (k + 1)).map(|i| i as u16))
            );
        }
    }

    #[test]
    fn the_order_stays_where_it_is_as_good() {
        let none = |rays: &[Ray]| assert_eq!(by_direction(Level::best(), rays), None);
        let rays = leaving(BATCH, 1.0, Vec3::Y);
        // Too few.
        none(&[]);
        none(&rays[..LEAST - 1]);
        let changed = |change: &dyn Fn(usize, Ray) -> Ray| -> Vec<Ray> {
            let all = rays.iter().enumerate();
            all.map(|(i, ray)| change(i, *ray)).collect()
        };
        // They go one way, which a packet tells.
        let one_way = changed(&|_, r| Ray {
            dir: r.dir * 0.1 - Vec3::Y,
            ..r
        });
        none(&one_way);
        for count in [1, 5, PACKET] {
            assert!(!goes_many_ways(&one_way[..count]));
        }
        for packet in rays.chunks(PACKET) {
            assert!(goes_many_ways(packet));
        }
        // Packets go one way, each its own.
        let order = by_direction(Level::best(), &rays).expect("an order");
        none(&changed(&|i, _| rays[usize::from(order[i])]));
        // Neighbours are near each other.
        none(&changed(&|i, r| Ray {
            origin: r.origin + Vec3::X * i as f32,
            ..r
        }));
        // No place, or no direction.
        none(&changed(&|_, r| Ray {
            origin: r.origin + f32::INFINITY,
            ..r
        }));
        none(&changed(&|_, r| Ray {
            dir: r.dir * f32::NAN,
            ..r
        }));
    }
}
