//! The stages `order` and `sort` on a device: which order rays are best taken in.

use std::sync::Arc;

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
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            kernels: Kernels::default(),
            sort: Runner::new(device),
        }
    }

    /// The places of `len` rays in the order of their keys, which their times are part of where something `moves`; and the
    /// seconds that the device took where that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn order(
        &self,
        rays: &wgpu::Buffer,
        len: usize,
        moves: bool,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.sort.device;
        let words = |what, count: usize| {
            let bytes = (4 * count as u64).max(64);
            device.buffer(what, bytes, Usage::STORAGE | Usage::COPY_SRC)
        };
        let keys = [words("keys", 2 * len)?, words("keys", 2 * len)?];
        let numbers = [words("order", len)?, words("order", len)?];
        let count = workgroups(len as u32, SCATTER_WORKGROUP);
        let time_bits = if moves { TIME_BITS } else { 0 };
        let run_count = (len as u32).div_ceil(1 << RUN_BITS).max(1);
        let bits = run_count.next_power_of_two().ilog2() + 2 * DIRECTION_BITS + time_bits;
        let launch = OrderLaunch {
            ray_count: len as u32,
            row: rows(device, count)[0] * SCATTER_WORKGROUP,
            run_bits: RUN_BITS,
            direction_bits: DIRECTION_BITS,
            time_bits,
        };
        let launch = device.uniform("launch", &launch)?;
        let buffers: [&[&wgpu::Buffer]; 1] = [&[&launch, rays, &keys[0], &numbers[0]]];
        let kernel = self.kernel()?;
        let told = kernel.launch(device, &buffers, count).run(device, timed)?;
        let tiles = workgroups(len as u32, SORT_TILE);
        let launch = BuildLaunch {
            items: len as u32,
            tiles,
            ..BuildLaunch::default()
        };
        let (steps, rounds) = sort_steps(launch, bits);
        let histogram = words("histogram", (tiles as usize) << SORT_BITS)?;
        // What only trees need of the stage.
        let unused = [words("clusters", 1)?, words("state", 1 << 9)?];
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
        if let Some(told) = told {
            let sorted = self.sort.seconds(&clock)?;
            seconds = Some(told + sorted.iter().map(|(_, seconds)| seconds).sum::<f64>());
        }
        let [even, odd] = numbers;
        let order = if rounds.is_multiple_of(2) { even } else { odd };
        Ok((order, seconds))
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
