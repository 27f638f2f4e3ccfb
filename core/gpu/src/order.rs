//! The stages `order` and `sort` on a device: which order rays are best taken in.

use std::sync::Arc;
use std::time::Duration;

use hdtrapeze_shaders::layout::{BuildLaunch, OrderLaunch};
use hdtrapeze_shaders::stage::{BuildStage, SCATTER_WORKGROUP, SORT_BITS, SORT_TILE, order_source};
use wgpu::BufferUsages as Usage;

use super::build::run::{Runner, sort_steps, workgroups};
use super::kernel::{Binding, Kernel, Kernels, rows};
use super::{Device, GpuError};

/// Rays of a run, as a power of two: those of 256 hits that have 16 each.
const RUN_BITS: u32 = 12;
/// Bits of each axis of the unfolded octahedron: in each of its 64 cells are as many rays of a run as a workgroup takes.
const DIRECTION_BITS: u32 = 3;
/// Bits of a time, where something moves.
const TIME_BITS: u32 = 2;

/// Puts rays in order on a device.
#[derive(Debug)]
pub(crate) struct Orderer {
    kernels: Kernels<()>,
    sort: Runner,
}

impl Orderer {
    /// For this device, which should be at one submission no longer than `target`.
    pub fn new(device: Arc<Device>, target: Duration) -> Self {
        Self {
            kernels: Kernels::default(),
            sort: Runner::new(device, target),
        }
    }

    /// What the keys of `len` rays are made of: their times, too, where something `moves`.
    pub fn launch(&self, len: usize, moves: bool) -> OrderLaunch {
        let count = workgroups(len as u32, SCATTER_WORKGROUP);
        OrderLaunch {
            ray_count: len as u32,
            row: rows(&self.sort.device, count)[0] * SCATTER_WORKGROUP,
            run_bits: RUN_BITS,
            direction_bits: DIRECTION_BITS,
            time_bits: if moves { TIME_BITS } else { 0 },
        }
    }

    /// The keys of rays, and their places; and the seconds that the device took where that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn keys(
        &self,
        rays: &wgpu::Buffer,
        launch: &OrderLaunch,
        timed: bool,
    ) -> Result<([wgpu::Buffer; 2], Option<f64>), GpuError> {
        let device = &*self.sort.device;
        let len = launch.ray_count as usize;
        let keyed = [self.words("keys", 2 * len)?, self.words("order", len)?];
        let count = workgroups(launch.ray_count, SCATTER_WORKGROUP);
        let launch = device.uniform("launch", launch)?;
        let buffers: [&[&wgpu::Buffer]; 1] = [&[&launch, rays, &keyed[0], &keyed[1]]];
        let launched = self.kernel()?.launch(device, &buffers, count);
        let seconds = launched.run(device, timed)?;
        Ok((keyed, seconds))
    }

    /// The places of rays in the order of their keys; and seconds as [`Orderer::keys`].
    ///
    /// # Errors
    /// As [`Orderer::keys`].
    pub fn sort(
        &self,
        [keys, places]: [wgpu::Buffer; 2],
        launch: &OrderLaunch,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let (len, items) = (launch.ray_count as usize, launch.ray_count);
        let keys = [keys, self.words("keys", 2 * len)?];
        let numbers = [places, self.words("order", len)?];
        let run_count = items.div_ceil(1 << launch.run_bits).max(1);
        let run_bits = run_count.next_power_of_two().ilog2();
        let bits = run_bits + 2 * launch.direction_bits + launch.time_bits;
        let tiles = workgroups(items, SORT_TILE);
        let launch = BuildLaunch {
            items,
            tiles,
            ..BuildLaunch::default()
        };
        let (steps, rounds) = sort_steps(launch, bits);
        let histogram = self.words("histogram", (tiles as usize) << SORT_BITS)?;
        // What only trees need of the stage.
        let unused = [self.words("clusters", 1)?, self.words("state", 1 << 9)?];
        let set = |from: usize| {
            let to = 1 - from;
            [
                &keys[from],
                &numbers[from],
                &keys[to],
                &numbers[to],
                &histogram,
                &unused[0],
                &unused[1],
            ]
        };
        let mut clock = self.sort.clock();
        let stage = (BuildStage::Sort, false);
        self.sort
            .run(&mut clock, stage, &steps, &[&set(0), &set(1)])?;
        let mut seconds = None;
        if timed && self.sort.device.found().timestamps {
            let stages = self.sort.seconds(&clock)?;
            seconds = Some(stages.iter().map(|(_, seconds)| seconds).sum());
        }
        let [even, odd] = numbers;
        let order = if rounds.is_multiple_of(2) { even } else { odd };
        Ok((order, seconds))
    }

    fn words(&self, what: &'static str, count: usize) -> Result<wgpu::Buffer, GpuError> {
        let bytes = (4 * count as u64).max(64);
        let usage = Usage::STORAGE | Usage::COPY_SRC;
        self.sort.device.buffer(what, bytes, usage)
    }

    fn kernel(&self) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get((), || {
            let groups: [&[Binding]; 1] = [&[
                Binding::Uniform,
                Binding::Read,
                Binding::Write,
                Binding::Write,
            ]];
            Kernel::new(&self.sort.device, "order", &order_source(), &groups)
        })
    }
}
