//! One tile of the film: sums over the samples of each pixel.

use crate::aov::Aov;
use crate::trace::Hit;
use crate::trace::surface_order::Expected;

/// Mean weight of a pixel's samples below which their sum is not divided by.
const LEAST_WEIGHT: f64 = 0.5;

/// What one camera sample brings home.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// Filter weight, mean 1.
    pub weight: f32,
    /// Squared distance from the pixel's centre, pixels.
    pub distance2: f32,
    /// Premultiplied radiance and coverage.
    pub color: [f32; 4],
    /// The nearest thing that is not fully transparent.
    pub first: Option<FirstHit>,
    /// Nodes opened and micropolygons tested.
    pub cost: [f32; 2],
}

/// The first surface of a sample; see [`crate::aov`] for meanings and units.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)] // named as the AOVs are
pub struct FirstHit {
    pub depth: f32,
    pub camera_depth: f32,
    pub p: [f32; 3],
    pub normal: [f32; 3],
    pub n_eye: [f32; 3],
    pub motion: [f32; 2],
    pub prim_id: i32,
    pub instance_id: i32,
    pub element_id: i32,
    pub subset_id: i32,
}

/// What samples of one pixel add up to where they were filmed elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSums {
    /// Weighted radiance and coverage, and the weights.
    pub color: [f32; 5],
    /// Squared distance from the pixel's centre of the sample nearest to it.
    pub distance2: f32,
    /// Its time.
    pub time: f32,
    /// What it met first; a miss where that gives nothing.
    pub hit: Hit,
}

/// Values of what samples see first whose sums are filmed elsewhere, for AOVs that show their means. They stand one after the
/// other, those that are asked for, and behind their sums is how many samples see anything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MeanValues {
    /// Normals.
    pub normal: bool,
    /// Normals in camera space.
    pub n_eye: bool,
    /// Raster movement; where nothing moves it is 0, and is not asked for.
    pub motion: bool,
    /// Floats of primvar AOVs.
    pub primvars: usize,
}

impl MeanValues {
    /// Floats of a sample.
    pub fn count(self) -> usize {
        self.places().count() + self.primvars
    }

    /// Floats of a pixel's sums; none where no value is asked for.
    pub fn stride(self) -> usize {
        match self.count() {
            0 => 0,
            count => count + 1,
        }
    }

    /// Where those that are not of primvars are among all that [`Means`] has.
    fn places(self) -> impl Iterator<Item = usize> + use<> {
        let all = [(self.normal, 0..3), (self.n_eye, 3..6), (self.motion, 6..8)];
        let asked = all.into_iter().filter(|(asked, _)| *asked);
        asked.flat_map(|(_, places)| places)
    }

    /// The values of what a sample sees first; they mean nothing where it sees nothing.
    pub fn of(
        self,
        first: Option<&FirstHit>,
        primvars: &PrimvarSample,
    ) -> impl Iterator<Item = f32> {
        let all = first.map_or([0.0; 8], FirstHit::means);
        let means = self.places().map(move |place| all[place]);
        means.chain(primvars.floats.iter().copied())
    }
}

impl FirstHit {
    /// Normal, Neye and motion.
    fn means(&self) -> [f32; 8] {
        let ([a, b, c], [d, e, f], [g, h]) = (self.normal, self.n_eye, self.motion);
        [a, b, c, d, e, f, g, h]
    }
}

impl PixelSums {
    /// Of no sample.
    pub const NONE: Self = Self {
        color: [0.0; 5],
        distance2: f32::INFINITY,
        time: 0.0,
        hit: Hit::MISS,
    };
}

impl PrimvarSample {
    /// As many values as `keeps` has.
    pub fn new(keeps: Keeps) -> Self {
        Self {
            floats: vec![0.0; keeps.primvars.floats],
            integers: vec![-1; keeps.primvars.integers],
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct PointSample {
    distance2: f32,
    hit: Option<PointHit>,
}

#[derive(Clone, Copy, Debug)]
struct PointHit {
    depth: f32,
    camera_depth: f32,
    p: [f32; 3],
    ids: [i32; 3],
}

/// Means over the samples that hit: normal, Neye, motion.
#[derive(Clone, Copy, Debug, Default)]
struct Means {
    sums: [f64; 8],
    hits: u32,
}

/// Which sums a film keeps: only those that the asked-for AOVs need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keeps {
    color: bool,
    point: bool,
    subsets: bool,
    means: bool,
    cost: bool,
    /// Values of primvar AOVs.
    primvars: PrimvarCounts,
}

/// Values of all primvar AOVs together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrimvarCounts {
    /// Floats.
    pub floats: usize,
    /// Whole numbers.
    pub integers: usize,
}

/// Values of primvar AOVs that one camera sample brings home.
#[derive(Clone, Debug, Default)]
pub struct PrimvarSample {
    /// As the AOVs say where.
    pub floats: Vec<f32>,
    /// As the AOVs say where.
    pub integers: Vec<i32>,
}

impl Keeps {
    /// Sums that `aovs` need.
    pub fn of(aovs: &[Aov]) -> Self {
        let any = |f: &dyn Fn(&Aov) -> bool| aovs.iter().any(f);
        let mut primvars = PrimvarCounts::default();
        for aov in aovs {
            if let Aov::Primvar(primvar) = aov {
                let count = match primvar.is_integer {
                    true => &mut primvars.integers,
                    false => &mut primvars.floats,
                };
                *count = (*count).max(primvar.first + primvar.components);
            }
        }
        Self {
            color: any(&|a| *a == Aov::Color),
            point: any(&Aov::is_point_sampled),
            subsets: any(&|a| *a == Aov::SubsetId),
            means: any(&|a| matches!(a, Aov::Normal | Aov::Neye | Aov::MotionVectors)),
            cost: any(&|a| *a == Aov::Cost),
            primvars,
        }
    }

    /// True when shading is asked for: without it only visibility is traced.
    pub fn color(self) -> bool {
        self.color
    }

    /// True when anything of the first surface of every sample is asked for.
    pub fn first_of_all(self) -> bool {
        self.means || self.primvars.floats > 0
    }

    /// Values of primvar AOVs; none where none is asked for.
    pub fn primvars(self) -> Option<PrimvarCounts> {
        let some = self.primvars.floats + self.primvars.integers > 0;
        some.then_some(self.primvars)
    }

    /// Floats of primvar AOVs.
    pub fn primvar_floats(self) -> usize {
        self.primvars.floats
    }

    /// True when what samples cost is asked for.
    pub fn cost(self) -> bool {
        self.cost
    }

    /// Sums of primvar floats a pixel: one each, and the number of hits.
    fn float_stride(self) -> usize {
        match self.primvars.floats {
            0 => 0,
            floats => floats + 1,
        }
    }

    /// Bytes a pixel.
    pub fn bytes(self) -> usize {
        let size = |keep: bool, bytes: usize| if keep { bytes } else { 0 };
        size(self.color, 40)
            + size(self.point, size_of::<PointSample>())
            + size(self.subsets, size_of::<i32>())
            + size(self.means, size_of::<Means>())
            + size(self.cost, 16)
            + self.float_stride() * size_of::<f64>()
            + self.primvars.integers * size_of::<i32>()
    }
}

/// Sums of a rectangle of pixels. Sums are f64, so that a million samples lose nothing.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Left pixel.
    pub x: i32,
    /// Top pixel.
    pub y: i32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
    /// Samples that every pixel of the tile has.
    pub samples: u32,
    /// What rays of the tile are expected to meet, where some of its samples told.
    pub expected: Option<Expected>,
    /// Weighted radiance and coverage, and the weights.
    color: Vec<[f64; 5]>,
    point: Vec<PointSample>,
    /// Of the sample in `point`.
    subsets: Vec<i32>,
    means: Vec<Means>,
    cost: Vec<[f64; 2]>,
    /// [`Keeps::float_stride`] sums a pixel.
    primvar_sums: Vec<f64>,
    /// Whole numbers of primvars, of the sample in `point`.
    primvar_integers: Vec<i32>,
    keeps: Keeps,
}

impl Tile {
    /// An empty tile.
    pub fn new(x: i32, y: i32, width: u32, height: u32, keeps: Keeps) -> Self {
        let n = (width * height) as usize;
        let count = |keep: bool| if keep { n } else { 0 };
        let no_point = PointSample {
            distance2: f32::INFINITY,
            hit: None,
        };
        Self {
            x,
            y,
            width,
            height,
            samples: 0,
            expected: None,
            color: vec![[0.0; 5]; count(keeps.color)],
            point: vec![no_point; count(keeps.point)],
            subsets: vec![-1; count(keeps.subsets)],
            means: vec![Means::default(); count(keeps.means)],
            cost: vec![[0.0; 2]; count(keeps.cost)],
            primvar_sums: vec![0.0; n * keeps.float_stride()],
            primvar_integers: vec![-1; n * keeps.primvars.integers],
            keeps,
        }
    }

    /// Adds a sample to pixel `i` (row-major in the tile). Samples of a pixel come in the order of
    /// their numbers. True where it is the pixel's point sample, for now.
    pub fn add(&mut self, i: usize, sample: &Sample) -> bool {
        let mut is_point = false;
        if let Some(sum) = self.color.get_mut(i) {
            for (sum, v) in sum.iter_mut().zip(sample.color) {
                *sum += f64::from(sample.weight * v);
            }
            sum[4] += f64::from(sample.weight);
        }
        if self.is_nearest(i, sample.distance2) {
            self.set_point(i, sample.distance2, sample.first.as_ref());
            is_point = true;
        }
        if let (Some(means), Some(hit)) = (self.means.get_mut(i), &sample.first) {
            for (sum, v) in means.sums.iter_mut().zip(hit.means()) {
                *sum += f64::from(v);
            }
            means.hits += 1;
        }
        if let Some(cost) = self.cost.get_mut(i) {
            cost[0] += f64::from(sample.cost[0]);
            cost[1] += f64::from(sample.cost[1]);
        }
        is_point
    }

    /// Adds samples of pixel `i` that were filmed elsewhere, the next in their order. `first` tells what the nearest of them
    /// to the pixel's centre met, with the whole numbers of its primvars, and is asked only where no sample before is nearer. Costs
    /// are not filmed elsewhere; for means see [`Tile::merge_means`].
    pub fn merge(
        &mut self,
        i: usize,
        sums: &PixelSums,
        first: impl FnOnce() -> Option<(FirstHit, PrimvarSample)>,
    ) {
        if let Some(sum) = self.color.get_mut(i) {
            for (sum, v) in sum.iter_mut().zip(sums.color) {
                *sum += f64::from(v);
            }
        }
        if self.is_nearest(i, sums.distance2) {
            let first = first();
            let (hit, primvars) = (first.as_ref())
                .map(|(hit, primvars)| (hit, primvars))
                .unzip();
            self.set_point(i, sums.distance2, hit);
            self.set_integers(i, primvars);
        }
    }

    /// Adds sums of `values` of samples of pixel `i` that were filmed elsewhere, and behind them how many of these see anything.
    pub fn merge_means(&mut self, i: usize, values: MeanValues, sums: &[f32]) {
        let Some((hits, sums)) = sums.split_last() else {
            return;
        };
        if let Some(means) = self.means.get_mut(i) {
            for (place, &sum) in values.places().zip(sums) {
                means.sums[place] += f64::from(sum);
            }
            means.hits += *hits as u32;
        }
        let floats = self.keeps.float_stride();
        let own = &mut self.primvar_sums[i * floats..][..floats];
        let primvars = &sums[values.count() - values.primvars..];
        for (to, &sum) in own.iter_mut().zip(primvars.iter().chain([hits])) {
            *to += f64::from(sum);
        }
    }

    /// True where a sample so far from the centre of pixel `i` becomes its point sample, for now; never where none is kept.
    pub fn is_nearest(&self, i: usize, distance2: f32) -> bool {
        let point = self.point.get(i);
        point.is_some_and(|point| distance2 < point.distance2)
    }

    fn set_point(&mut self, i: usize, distance2: f32, first: Option<&FirstHit>) {
        let hit = first.map(|h| PointHit {
            depth: h.depth,
            camera_depth: h.camera_depth,
            p: h.p,
            ids: [h.prim_id, h.instance_id, h.element_id],
        });
        self.point[i] = PointSample { distance2, hit };
        if let Some(subset) = self.subsets.get_mut(i) {
            *subset = first.map_or(-1, |h| h.subset_id);
        }
    }

    /// Adds the primvars of the sample that was added last to pixel `i`, or `None` where it hit
    /// nothing. `is_point` is what [`Tile::add`] said.
    pub fn add_primvars(&mut self, i: usize, sample: Option<&PrimvarSample>, is_point: bool) {
        let floats = self.keeps.float_stride();
        if let Some(sample) = sample
            && let Some((hits, sums)) = self.primvar_sums[i * floats..][..floats].split_last_mut()
        {
            for (sum, v) in sums.iter_mut().zip(&sample.floats) {
                *sum += f64::from(*v);
            }
            *hits += 1.0;
        }
        if is_point {
            self.set_integers(i, sample);
        }
    }

    /// The whole numbers of primvars of the point sample.
    fn set_integers(&mut self, i: usize, sample: Option<&PrimvarSample>) {
        let integers = self.keeps.primvars.integers;
        let values = &mut self.primvar_integers[i * integers..][..integers];
        match sample {
            Some(sample) => values.copy_from_slice(&sample.integers[..integers]),
            None => values.fill(-1),
        }
    }

    /// Values of a float AOV at pixel `i`, appended to `out`.
    pub fn resolve_f32(&self, aov: &Aov, i: usize, out: &mut Vec<f32>) {
        let n = f64::from(self.samples.max(1));
        let mean = |range: std::ops::Range<usize>, out: &mut Vec<f32>| {
            let means = &self.means[i];
            let hits = f64::from(means.hits.max(1));
            out.extend(means.sums[range].iter().map(|s| (s / hits) as f32));
        };
        match aov {
            Aov::Color => {
                let sums = &self.color[i];
                // The weights' own sum keeps what is constant constant. Of few samples of a filter
                // with negative lobes it may be next to nothing: then their expected sum.
                let weight = if sums[4].abs() > LEAST_WEIGHT * n {
                    sums[4]
                } else {
                    n
                };
                let [r, g, b, a] = [0, 1, 2, 3].map(|c| (sums[c] / weight) as f32);
                // Negative lobes can leave a hair outside what coverage can be.
                out.extend([r, g, b, a.clamp(0.0, 1.0)]);
            }
            Aov::Depth => out.push(self.point[i].hit.map_or(1.0, |h| h.depth)),
            Aov::CameraDepth => out.push(self.point[i].hit.map_or(0.0, |h| h.camera_depth)),
            Aov::P => out.extend(self.point[i].hit.map_or([0.0; 3], |h| h.p)),
            Aov::Normal => mean(0..3, out),
            Aov::Neye => mean(3..6, out),
            Aov::MotionVectors => mean(6..8, out),
            Aov::Cost => out.extend(self.cost[i].map(|s| (s / n) as f32)),
            Aov::Primvar(primvar) if !primvar.is_integer => {
                let stride = self.keeps.float_stride();
                let sums = &self.primvar_sums[i * stride..][..stride];
                let hits = sums[stride - 1].max(1.0);
                let own = &sums[primvar.first..][..primvar.components];
                out.extend(own.iter().map(|s| (s / hits) as f32));
            }
            Aov::PrimId
            | Aov::InstanceId
            | Aov::ElementId
            | Aov::SubsetId
            | Aov::SampleCount
            | Aov::Primvar(_) => {}
        }
    }

    /// Values of an integer AOV at pixel `i`, appended to `out`; nothing for float AOVs.
    pub fn resolve_i32(&self, aov: &Aov, i: usize, out: &mut Vec<i32>) {
        let id = |k: usize| self.point[i].hit.map_or(-1, |h| h.ids[k]);
        match aov {
            Aov::PrimId => out.push(id(0)),
            Aov::InstanceId => out.push(id(1)),
            Aov::ElementId => out.push(id(2)),
            Aov::SubsetId => out.push(self.subsets[i]),
            Aov::SampleCount => out.push(self.samples as i32),
            Aov::Primvar(primvar) if primvar.is_integer => {
                let start = i * self.keeps.primvars.integers + primvar.first;
                out.extend_from_slice(&self.primvar_integers[start..][..primvar.components]);
            }
            _ => {}
        }
    }
}
