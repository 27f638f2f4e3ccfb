//! Arrays of one instancer, checked: what of them is used, and at which key times.

use std::sync::Arc;

use glam::{DMat4, Quat, Vec3};

use super::moment::{self, Mix, Moment, Rated};
use crate::diagnostics::Code;
use crate::motion::keys::{self, Timeline};
use crate::motion::rates::{Bracket, RateFault, matching};
use crate::motion::{Shutter, transform, turn};
use crate::scene::{InstanceArrays, Samples};

/// Samples of one array, all of the same length.
#[derive(Clone, Debug)]
pub(super) struct Track<T> {
    timeline: Timeline,
    values: Vec<Arc<Vec<T>>>,
}

impl<T> Track<T> {
    fn new(times: &[f64], values: &[Arc<Vec<T>>], shutter: Shutter) -> Option<Self> {
        let values = values.to_vec();
        let timeline = Timeline::new(times, shutter)?;
        Some(Self { timeline, values })
    }

    fn held(values: &Arc<Vec<T>>) -> Self {
        let timeline = Timeline::new(&[0.0], Shutter::default()).expect("0 is finite");
        let values = vec![Arc::clone(values)];
        Self { timeline, values }
    }

    /// What to mix at `time`.
    pub fn at(&self, time: f64) -> Mix<'_, T> {
        let blend = self.timeline.blend(time);
        Mix {
            a: &self.values[blend.a],
            b: &self.values[blend.b],
            f: blend.f,
        }
    }

    fn key_times(&self, still: bool) -> Vec<f64> {
        self.timeline.key_times(still)
    }
}

/// An array that moves an instance on, and the time of the sample that it moves.
#[derive(Clone, Debug)]
pub(super) struct Rate {
    pub values: Arc<Vec<Vec3>>,
    /// In time codes relative to the frame.
    pub from: f64,
}

/// The arrays that are used.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    pub count: usize,
    /// As the host gave them.
    pub given: Arc<InstanceArrays>,
    pub positions: Option<Track<Vec3>>,
    pub orientations: Option<Track<Quat>>,
    pub scales: Option<Track<Vec3>>,
    pub matrices: Option<Track<DMat4>>,
    /// Matrices turn between samples.
    pub matrices_turn: bool,
    pub velocities: Option<Rate>,
    pub accelerations: Option<Arc<Vec<Vec3>>>,
    pub spins: Option<Rate>,
    time_codes_per_second: f64,
    shutter: Shutter,
    /// Where not empty, instances go straight from one of these times to the next.
    stops: Vec<f64>,
    pub key_times: Vec<f64>,
    /// Paths may bend between key times.
    pub bends: bool,
}

/// Most stops: as many as paths have keys.
const MOST_STOPS: u32 = transform::MAX_KEYS as u32;

impl Arrays {
    /// `None`, with a warning, where nothing can be placed; without one where there are no instances.
    pub fn check(
        from: &Arc<InstanceArrays>,
        nonlinear_samples: Option<u32>,
        shutter: Shutter,
        warn: &mut impl FnMut(Code, String),
    ) -> Option<Self> {
        let count = instance_count(from);
        let listed = from.lists.iter().map(Vec::len).sum::<usize>();
        if count == 0 {
            if listed > 0 {
                let text = "it has no positions; it is not rendered";
                warn(Code::Topology, text.to_owned());
            }
            return None;
        }
        let is_there = |&&i: &&i32| usize::try_from(i).is_ok_and(|i| i < count);
        let without = listed - from.lists.iter().flatten().filter(is_there).count();
        if without > 0 {
            let mut all: Vec<i32> = from.lists.iter().flatten().copied().collect();
            all.sort_unstable();
            all.dedup();
            // Where lists name all instances from the first on, it is the positions that are too few.
            if all.iter().copied().eq(0..all.len() as i32) {
                let needed = all.len();
                let text =
                    format!("{count} positions for {needed} instances; they are not rendered");
                warn(Code::Topology, text);
                return None;
            }
            let text = format!("{without} of {listed} instances have no place; left out");
            warn(Code::Topology, text);
        }
        let mut out = Self {
            count,
            given: Arc::clone(from),
            time_codes_per_second: from.time_codes_per_second,
            shutter,
            ..Self::default()
        };
        let lists = [
            ("protoIndices", from.prototypes.len()),
            ("positions", length(&from.positions)),
            ("matrices", length(&from.matrices)),
        ];
        for (name, found) in lists {
            if found != 0 && found != count {
                let text = format!("{found} {name} for {count} instances; they are not rendered");
                warn(Code::Topology, text);
                return None;
            }
        }
        let lists = [
            ("orientations", length(&from.orientations)),
            ("scales", length(&from.scales)),
            ("ids", from.ids.len()),
            ("values of the mask", from.mask.len()),
        ];
        for (name, found) in lists {
            if found != 0 && found != count {
                let text = format!("{found} {name} for {count} instances; they are ignored");
                warn(Code::Topology, text);
            }
        }
        out.find_rates(from, warn);
        let held = out.velocities.is_some() || out.spins.is_some();
        let mut changes = false;
        out.positions = track(&from.positions, count, held, shutter, &mut changes);
        out.orientations = track(&from.orientations, count, held, shutter, &mut changes);
        out.scales = track(&from.scales, count, held, shutter, &mut changes);
        out.matrices = track(&from.matrices, count, held, shutter, &mut changes);
        if changes && !held && !shutter.is_still() {
            let text = "the number of instances changes around the shutter; they do not move";
            warn(Code::TimeSamples, text.to_owned());
        }
        let moves = |track: &Track<DMat4>| track.key_times(shutter.is_still()).len() > 1;
        out.matrices_turn = from.matrices_turn
            && out.matrices.as_ref().is_some_and(moves)
            && turn::any_turns(&from.matrices);
        out.count_quaternions(warn);
        out.choose_keys(nonlinear_samples);
        Some(out)
    }

    fn find_rates(&mut self, from: &InstanceArrays, warn: &mut impl FnMut(Code, String)) {
        let count = self.count;
        let mut fault = |fault: RateFault| {
            let code = match fault {
                RateFault::Length { .. } => Code::Topology,
                _ => Code::TimeSamples,
            };
            warn(code, fault.to_string());
        };
        let mut find = |moved: Option<Bracket>, rates: &Samples<Vec3>, name| {
            let base = moved?;
            match matching(&base, rates, count, name) {
                Ok(Some(_)) => Some(Rate {
                    values: Arc::clone(&rates.values[Bracket::of(&rates.times)?.sample]),
                    from: base.below,
                }),
                Ok(None) => None,
                Err(error) => {
                    fault(error);
                    None
                }
            }
        };
        let velocities = find(bracket(&from.positions), &from.velocities, "velocities");
        let accelerations = match &velocities {
            Some(_) => find(
                bracket(&from.positions),
                &from.accelerations,
                "accelerations",
            ),
            None => None,
        };
        let turned = Some(length(&from.orientations)).filter(|&n| n == count);
        let spins = find(
            turned.and_then(|_| bracket(&from.orientations)),
            &from.angular_velocities,
            "angularVelocities",
        );
        let seconds = self.time_codes_per_second;
        if !(seconds > 0.0 && seconds.is_finite()) && (velocities.is_some() || spins.is_some()) {
            fault(RateFault::NoSeconds);
            return;
        }
        let turns = |a: &Rate| a.values.iter().any(|v| *v != Vec3::ZERO);
        self.accelerations = accelerations.filter(turns).map(|a| a.values);
        self.velocities = velocities;
        self.spins = spins;
    }

    /// Warns of orientations that are none.
    fn count_quaternions(&self, warn: &mut impl FnMut(Code, String)) {
        let Some(track) = &self.orientations else {
            return;
        };
        let mut zero = 0usize;
        let mut other = 0usize;
        for i in 0..self.count {
            let kinds = track.values.iter().map(|values| moment::quality(values[i]));
            match kinds.max() {
                Some(moment::Quality::Zero) => zero += 1,
                Some(moment::Quality::NotUnit) => other += 1,
                _ => {}
            }
        }
        let of = self.count;
        if zero > 0 {
            let text = format!("{zero} of {of} orientations are zero; they turn nothing");
            warn(Code::NotFinite, text);
        }
        if other > 0 {
            let text = format!("{other} of {of} orientations are not of unit length; normalized");
            warn(Code::NotFinite, text);
        }
    }

    fn choose_keys(&mut self, nonlinear_samples: Option<u32>) {
        let still = self.shutter.is_still();
        let own = |keys: Option<Vec<f64>>| keys.unwrap_or_else(|| vec![0.0]);
        let positions = own(self.positions.as_ref().map(|t| t.key_times(still)));
        let orientations = own(self.orientations.as_ref().map(|t| t.key_times(still)));
        let scales = own(self.scales.as_ref().map(|t| t.key_times(still)));
        let matrices = own(self.matrices.as_ref().map(|t| t.key_times(still)));
        let rated = !still && (self.velocities.is_some() || self.spins.is_some());
        let ends = if rated { vec![0.0, 1.0] } else { vec![0.0] };
        let lists = [&positions, &orientations, &scales, &matrices, &ends];
        self.key_times = keys::union(lists.map(Vec::as_slice));
        let moves = |keys: &Vec<f64>| keys.len() > 1;
        let stops = nonlinear_samples.map(|n| n.clamp(2, MOST_STOPS));
        let curved = rated && (self.accelerations.is_some() || self.spins.is_some());
        if let (true, Some(n)) = (curved, stops) {
            self.stops = (0..n).map(|k| f64::from(k) / f64::from(n - 1)).collect();
            self.key_times.clone_from(&self.stops);
            return;
        }
        let others = moves(&positions) || moves(&orientations) || moves(&scales);
        self.bends =
            curved || moves(&orientations) || self.matrices_turn || (moves(&matrices) && others);
    }

    /// One byte an instance, or none where all are there.
    pub fn mask(&self) -> &[u8] {
        let mask = &self.given.mask;
        match mask.len() == self.count {
            true => mask,
            false => &[],
        }
    }

    /// True where the host did not say how many prototypes there are, or said more.
    pub fn has_prototype(&self, prototype: u32) -> bool {
        let known = self.given.prototype_count;
        known == 0 || (prototype as usize) < known
    }

    /// All instances at `time`, in [0, 1] across the shutter.
    pub fn at(&self, time: f64) -> Moment<'_> {
        if self.stops.is_empty() {
            return self.exactly_at(time);
        }
        let last = self.stops.len() - 1;
        let next = self.stops.partition_point(|&t| t <= time).clamp(1, last);
        let (a, b) = (self.stops[next - 1], self.stops[next]);
        let f = ((time - a) / (b - a)).clamp(0.0, 1.0);
        let mut moment = self.exactly_at(a);
        if f > 0.0 {
            moment.chord = Some((Box::new(self.exactly_at(b)), f));
        }
        moment
    }

    fn exactly_at(&self, time: f64) -> Moment<'_> {
        // Samples outside of a shutter of no length keep their time codes.
        let time = if self.shutter.is_still() { 0.0 } else { time };
        let code = self.shutter.open + (self.shutter.close - self.shutter.open) * time;
        let seconds = |from: f64| (code - from) / self.time_codes_per_second;
        Moment {
            positions: self.positions.as_ref().map(|t| t.at(time)),
            orientations: self.orientations.as_ref().map(|t| t.at(time)),
            scales: self.scales.as_ref().map(|t| t.at(time)),
            matrices: self.matrices.as_ref().map(|t| t.at(time)),
            matrices_turn: self.matrices_turn,
            velocities: self.velocities.as_ref().map(|rate| Rated {
                values: &rate.values,
                seconds: seconds(rate.from),
            }),
            accelerations: self.accelerations.as_ref().map(|a| a.as_slice()),
            spins: self.spins.as_ref().map(|rate| Rated {
                values: &rate.values,
                seconds: seconds(rate.from),
            }),
            chord: None,
        }
    }

    /// Degrees that an instance spins by over the shutter.
    pub fn spin(&self, i: usize) -> f64 {
        let span = (self.shutter.close - self.shutter.open) / self.time_codes_per_second;
        self.spins
            .as_ref()
            .map_or(0.0, |rate| rate.values[i].as_dvec3().length() * span.abs())
    }

    /// What the instanceId AOV shows for an instance.
    pub fn id(&self, i: usize) -> i32 {
        let ids = &self.given.ids;
        match ids.len() == self.count {
            true => ids[i],
            false => i as i32,
        }
    }
}

/// Number of instances: as told, or as many as have a place.
pub fn instance_count(from: &InstanceArrays) -> usize {
    match (from.instance_count, from.lists.is_empty()) {
        (0, false) => length(&from.positions).max(length(&from.matrices)),
        (count, _) => count,
    }
}

/// The samples of an array on either side of the frame.
fn bracket<T>(samples: &Samples<T>) -> Option<Bracket> {
    let n = samples.times.len().min(samples.values.len());
    Bracket::of(&samples.times[..n])
}

/// Values of the sample at the frame; 0 where there is none.
fn length<T>(samples: &Samples<T>) -> usize {
    bracket(samples).map_or(0, |b| samples.values[b.sample].len())
}

/// The samples to use; `changes` is set where lengths differ, and the frame's sample is used alone.
fn track<T>(
    samples: &Samples<T>,
    count: usize,
    held: bool,
    shutter: Shutter,
    changes: &mut bool,
) -> Option<Track<T>> {
    let base = bracket(samples)?;
    let values = &samples.values[base.sample];
    if values.len() != count {
        return None;
    }
    let n = samples.times.len().min(samples.values.len());
    let (times, arrays) = (&samples.times[..n], &samples.values[..n]);
    let differs = arrays.iter().any(|a| a.len() != count);
    *changes |= differs;
    if held || differs {
        return Some(Track::held(values));
    }
    Track::new(times, arrays, shutter)
}
