//! The stage `shade` on a device: what first hits give, where everything is opaque.
//!
//! Normals, colours and matrices are those that core shades with; f64 is used nowhere. A colour is off by some roundings
//! times the condition of an instance's matrix; the tests state how many.

use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;

use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::render::Prepared;
use hdtrapeze_core::shade::{Source, Values};
use hdtrapeze_shaders::layout::{Look, Sample, ShadeLaunch};
use hdtrapeze_shaders::stage::{SHADE_WORKGROUP, ShadePermutation, TimeKind};
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels, rows};
use super::{Device, GpuCamera, GpuError, GpuScene};

/// Storage buffers that the stage sees.
const BUFFERS: u32 = 11;

/// Words of colours that one for all, one a face, and one a vertex need told.
const CONSTANT: u32 = 0;
const FACES: u32 = 1;
const VERTICES: u32 = 2;

/// How the instances of a scene look, on a device.
#[derive(Debug)]
pub struct GpuLooks {
    /// What the stage `shade` needs for it.
    pub permutation: ShadePermutation,
    looks: wgpu::Buffer,
    paints: wgpu::Buffer,
    /// Radiance of a white surface that looks along the axis of view.
    light: f32,
}

/// Shades on a device.
#[derive(Debug)]
pub struct Shader {
    device: Arc<Device>,
    kernels: Kernels<ShadePermutation>,
}

impl GpuLooks {
    /// Lays out what `prepared`, which `scene` and `camera` are of, is shaded with.
    ///
    /// # Errors
    /// It must be shaded on the CPU, see [`Prepared::shaded_here`]; or the device is too small.
    pub fn new(
        device: &Device,
        scene: &GpuScene,
        camera: &GpuCamera,
        prepared: &Prepared,
    ) -> Result<Self, GpuError> {
        if let Some(why) = prepared.shaded_here() {
            return Err(GpuError::Unsupported(why));
        }
        let [page] = &scene.pages[..] else {
            let what = "colours of a scene on several pages".to_owned();
            return Err(GpuError::Unsupported(what));
        };
        let limits = device.device.limits();
        if limits.max_storage_buffers_per_shader_stage < BUFFERS {
            let what = format!("colours with fewer than {BUFFERS} buffers");
            return Err(GpuError::Unsupported(what));
        }
        let mut paints = Paints::default();
        let mut looks = Vec::new();
        let mut number = 0;
        for set in prepared.world().parts().sets() {
            let object = set.object();
            for _ in 0..set.len() {
                looks.push(paints.look(object, &prepared.look(number))?);
                number += 1;
            }
        }
        Ok(Self {
            permutation: ShadePermutation {
                color: prepared.aovs().contains(&Aov::Color),
                time: page.permutation.time || paints.time,
                camera_moves: camera.permutation.time == TimeKind::CameraMoves,
            },
            looks: device.upload("looks", bytemuck::cast_slice(&looks))?,
            paints: device.upload("colours and normals", bytemuck::cast_slice(&paints.words))?,
            light: prepared.irradiance() / PI,
        })
    }
}

impl Shader {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            device,
            kernels: Kernels::default(),
        }
    }

    /// Shades `len` rays that met `hits`; gives samples by their numbers, and the seconds that the device took where
    /// that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes, or it is lost.
    pub fn shade(
        &self,
        scene: &GpuScene,
        camera: &GpuCamera,
        looks: &GpuLooks,
        [rays, hits]: [&wgpu::Buffer; 2],
        len: usize,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.device;
        let workgroups = (len as u32).div_ceil(SHADE_WORKGROUP);
        let launch = ShadeLaunch {
            ray_count: len as u32,
            row: rows(device, workgroups)[0] * SHADE_WORKGROUP,
            light: looks.light,
        };
        let launch = device.uniform("launch", &launch)?;
        let bytes = (len.max(1) * size_of::<Sample>()) as u64;
        let samples = device.buffer("samples", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        // Looks are made of scenes of one page.
        let [_, planes, words, objects, instances, matrices] = &scene.pages[0].group;
        let groups: [&[&wgpu::Buffer]; 3] = [
            &[planes, words, objects, instances, matrices],
            &[&looks.looks, &looks.paints, &camera.camera, &camera.tables],
            &[rays, hits, &launch, &samples],
        ];
        let kernel = self.kernel(looks.permutation)?;
        let launched = kernel.launch(device, &groups, workgroups);
        let seconds = launched.run(device, timed)?;
        Ok((samples, seconds))
    }

    fn kernel(&self, permutation: ShadePermutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(permutation, || {
            let groups: [&[Binding]; 3] = [
                &[Binding::Read; 5],
                &[
                    Binding::Read,
                    Binding::Read,
                    Binding::Uniform,
                    Binding::Read,
                ],
                &[
                    Binding::Read,
                    Binding::Read,
                    Binding::Uniform,
                    Binding::Write,
                ],
            ];
            let source = permutation.source();
            Kernel::new(&self.device, "shade", &source, &groups)
        })
    }
}

/// Colours and normals, each once.
#[derive(Default)]
struct Paints {
    words: Vec<u32>,
    /// Places of what is there, by address: sources' values, channels' and objects' normals.
    known: HashMap<(usize, usize), u32>,
    /// A colour changes while the shutter is open.
    time: bool,
}

impl Paints {
    fn look(
        &mut self,
        object: &Arc<ObjectGeometry>,
        look: &hdtrapeze_core::render::Look<'_>,
    ) -> Result<Look, GpuError> {
        let mesh = object.mesh();
        let source = look.color;
        if source.is_integer() {
            let what = "colours of whole numbers".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let keys = source.key_times().len();
        self.time |= keys > 1;
        let lanes = source.lanes();
        let whole = lanes * keys.max(1);
        let at = |address: usize, part: usize| (address, part);
        let of_object = Arc::as_ptr(object) as usize;
        let of_source = std::ptr::from_ref::<Source>(source) as usize;
        let mut out = Look {
            matte: look.matte.into(),
            kind: CONSTANT,
            stride: whole as u32,
            lanes: lanes as u32,
            paint_keys: keys as u32,
            normals: self.add(at(of_object, usize::MAX), || mesh.normals.as_slice())?,
            normal_keys: mesh.normal_key_count as u32,
            ..Look::default()
        };
        if keys > 1 {
            out.paint_times = self.floats(at(of_source, usize::MAX), source.key_times())?;
        }
        match source.values() {
            Values::Constant(values) => out.paint = self.floats(at(of_source, 0), values)?,
            Values::Uniform(values) => {
                out.kind = FACES;
                out.items = (values.len() / whole.max(1)) as u32;
                out.paint = self.floats(at(of_source, 0), values)?;
            }
            Values::Channel(channel) => {
                // One that is not there is black, as core reads it.
                out.lanes = 0;
                if let Some(channel_at) = mesh.channels.get(*channel) {
                    out.kind = VERTICES;
                    (out.lanes, out.stride) = (lanes as u32, channel_at.width as u32);
                    out.paint = self.floats(at(of_object, *channel), &channel_at.values)?;
                }
            }
            Values::Instance(_, resolved) if look.item < resolved.item_count() => {
                let value = resolved.item(look.item);
                out.paint = self.floats(at(value.as_ptr() as usize, 0), value)?;
            }
            Values::Instance(..) => out.lanes = 0,
        }
        Ok(out)
    }

    fn floats(&mut self, what: (usize, usize), floats: &[f32]) -> Result<u32, GpuError> {
        self.add(what, || bytemuck::cast_slice(floats))
    }

    /// The place of words, which are added where they are not there.
    fn add<'a>(
        &mut self,
        what: (usize, usize),
        words: impl FnOnce() -> &'a [u32],
    ) -> Result<u32, GpuError> {
        if let Some(&place) = self.known.get(&what) {
            return Ok(place);
        }
        let place = u32::try_from(self.words.len());
        let place = place
            .map_err(|_| GpuError::Unsupported("2^32 numbers of colours and normals".to_owned()))?;
        self.words.extend_from_slice(words());
        self.known.insert(what, place);
        Ok(place)
    }
}
