//! The stage `shade` on a device: what first hits give, where everything is opaque, or else what hits give layer after layer.
//!
//! Normals, colours and matrices are those that core shades with; f64 is used nowhere. A colour is off by some roundings
//! times the condition of an instance's matrix; the tests state how many.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::f32::consts::PI;
use std::sync::Arc;

use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::film::tile::MeanValues;
use hdtrapeze_core::render::Prepared;
use hdtrapeze_core::shade::{Source, Values};
use hdtrapeze_core::trace::InstanceSet;
use hdtrapeze_shaders::layout::{Look, Sample, ShadeLaunch};
use hdtrapeze_shaders::stage::{KeptValues, SHADE_WORKGROUP, ShadePermutation, TimeKind};
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels, rows, run};
use super::layers::{Layer, Layers};
use super::scene::Page;
use super::{Device, GpuCamera, GpuError, GpuScene, pages};

/// Storage buffers that the stage sees; one more where there are layers, and one where values are kept.
const BUFFERS: u32 = 11;

/// Where a colour's values are: one for all, one a grid, or one a vertex.
const CONSTANT: u32 = 0;
const GRIDS: u32 = 1;
const VERTICES: u32 = 2;

/// Marks of a look.
const MATTE: u32 = 1;
const INVERTED: u32 = 2;
const DOUBLE_SIDED: u32 = 4;

/// How the instances of a scene look, on a device.
#[derive(Debug)]
pub struct GpuLooks {
    /// What the stage `shade` needs for it.
    pub permutation: ShadePermutation,
    /// Of each page the looks of its instances, and their colours and normals.
    pages: Vec<[wgpu::Buffer; 2]>,
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
    /// It must be shaded on the CPU, see [`Prepared::shaded_here`]; or the device is too small, or binds too few buffers.
    pub fn new(
        device: &Device,
        scene: &GpuScene,
        camera: &GpuCamera,
        prepared: &Prepared,
    ) -> Result<Self, GpuError> {
        if let Some(why) = shaded_here(device, prepared) {
            return Err(GpuError::Unsupported(why));
        }
        let sets = prepared.world().parts();
        let of_set = |set: &'_ Arc<InstanceSet>| vec![Arc::clone(set.object()); set.len()];
        let objects: Vec<Arc<ObjectGeometry>> = sets.sets().flat_map(of_set).collect();
        let layers = prepared.plan().has_transparency();
        let mut time = false;
        let page = |page: &Page| {
            let mut paints = Paints::default();
            let mut looks = Vec::with_capacity(page.numbers.len());
            for whole in &page.numbers {
                let object = &objects[whole.instance as usize];
                let cut = Cut {
                    object,
                    grids: whole.grids.as_ref(),
                };
                let look = prepared.look(whole.instance);
                looks.push(paints.look(&cut, &look)?);
                if layers {
                    looks.push(paints.opacity(&cut, &look)?);
                }
                let primvars = prepared.primvar_paints(whole.instance);
                for (floats, paint) in prepared.primvar_floats().zip(primvars) {
                    looks.push(paints.primvar(&cut, floats, paint.as_ref())?);
                }
            }
            time |= page.permutation.time || paints.time;
            let buffers = [
                device.upload("looks", bytemuck::cast_slice(&looks))?,
                device.upload("colours and normals", bytemuck::cast_slice(&paints.words))?,
            ];
            // What was uploaded is kept on the host until it is submitted.
            device.wait(device.queue.submit([]))?;
            Ok(buffers)
        };
        let pages = scene.pages.iter().map(page);
        let pages = pages.collect::<Result<_, GpuError>>()?;
        Ok(Self {
            permutation: ShadePermutation {
                color: prepared.aovs().contains(&Aov::Color),
                time,
                camera_moves: camera.permutation.time == TimeKind::CameraMoves,
                lens_changes: camera.permutation.lens_changes,
                layers,
                values: kept(prepared),
            },
            pages,
            light: prepared.irradiance() / PI,
        })
    }

    /// Floats that are kept of each ray beside its colour.
    pub(crate) fn values(&self) -> u32 {
        self.permutation.values.count()
    }
}

/// What AOVs ask to be kept of each ray beside its colour.
fn kept(prepared: &Prepared) -> KeptValues {
    let MeanValues {
        normal,
        n_eye,
        motion,
        primvars,
    } = prepared.mean_values();
    KeptValues {
        normal,
        n_eye,
        motion,
        primvars: prepared.primvar_floats().count() as u32,
        floats: primvars as u32,
    }
}

/// Why the CPU shades a scene, where it does: for what it shows, or since the device binds too little.
pub(crate) fn shaded_here(device: &Device, prepared: &Prepared) -> Option<String> {
    prepared.shaded_here().or_else(|| {
        let there = device.device.limits().max_storage_buffers_per_shader_stage;
        let layers = u32::from(prepared.plan().has_transparency());
        let needed = BUFFERS + layers + u32::from(kept(prepared).count() > 0);
        let few = there < needed;
        few.then(|| format!("it needs {needed} storage buffers, and the device binds {there}"))
    })
}

/// What normals, colours and opacities of each object take where the device shades: as [`GpuLooks`] lays them out.
pub(crate) fn paints_of(prepared: &Prepared) -> pages::Paints {
    let mut paints = pages::Paints::new();
    let mut known = HashSet::new();
    let mut instance = 0;
    for set in prepared.world().parts().sets() {
        let first = instance;
        instance += set.len() as u32;
        // What is not made yet is refused.
        let Some(object) = set.made().filter(|_| !set.is_empty()) else {
            continue;
        };
        let (object, mesh) = (Arc::as_ptr(object), object.mesh());
        let look = prepared.look(first);
        let paint = paints.entry(object).or_insert_with(|| pages::Paint {
            a_vertex: size_of_val(&mesh.normals[..]) as u64 / mesh.vertex_count.max(1) as u64,
            a_grid: 0,
        });
        let primvars = prepared.primvar_paints(first).flatten();
        let paints = [Some(look.color), look.opacity].into_iter().flatten();
        for of in paints.chain(primvars) {
            let source = of.source;
            if !known.insert((object, std::ptr::from_ref::<Source>(source))) {
                continue;
            }
            match source.values() {
                Values::Uniform(_) => paint.a_grid += 4 * words_of(source) as u64,
                Values::Channel(channel) => {
                    let width = mesh.channels.get(*channel).map_or(0, |c| c.width);
                    paint.a_vertex += 4 * width as u64;
                }
                Values::Constant(_) | Values::Instance(..) => {}
            }
        }
    }
    paints
}

/// What of a look is yes or no.
fn marks(look: &hdtrapeze_core::render::Look<'_>) -> u32 {
    let all = [
        (look.matte, MATTE),
        (look.inverted, INVERTED),
        (look.double_sided, DOUBLE_SIDED),
    ];
    all.iter().filter(|(is, _)| *is).map(|(_, mark)| mark).sum()
}

/// Words of a value at all keys.
fn words_of(source: &Source) -> usize {
    source.lanes() * source.key_times().len().max(1)
}

impl Shader {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            device,
            kernels: Kernels::default(),
        }
    }

    /// A buffer for what is kept of `len` rays beside colours, [`KeptValues::count`] floats each; none where that is nothing.
    ///
    /// # Errors
    /// They are more than the device takes, or it is lost.
    pub(crate) fn values(
        &self,
        looks: &GpuLooks,
        len: usize,
    ) -> Result<Option<wgpu::Buffer>, GpuError> {
        let bytes = (len.max(1) * size_of::<f32>()) as u64 * u64::from(looks.values());
        let usage = Usage::STORAGE | Usage::COPY_SRC;
        let values = (bytes > 0).then(|| self.device.buffer("values of samples", bytes, usage));
        values.transpose()
    }

    /// Shades `len` rays that met `hits`, and fills `values`, where some are kept; gives samples by their numbers, and the seconds
    /// that the device took where that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes, or it is lost.
    pub fn shade(
        &self,
        scene: &GpuScene,
        camera: &GpuCamera,
        looks: &GpuLooks,
        ([rays, hits], values): ([&wgpu::Buffer; 2], Option<&wgpu::Buffer>),
        len: usize,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.device;
        let bytes = (len.max(1) * size_of::<Sample>()) as u64;
        let samples = device.buffer("samples", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let buffers = [rays, hits, &samples];
        let layer = Layer::first(len);
        let seconds = self.run(scene, camera, looks, (&buffers, values), layer, timed)?;
        Ok((samples, seconds))
    }

    /// Takes in what rays met in a layer, and fills `values`, where some are kept. Gives the seconds that the device took where that
    /// is asked for and it can tell.
    ///
    /// # Errors
    /// As [`Shader::shade`].
    pub(crate) fn layer(
        &self,
        scene: &GpuScene,
        camera: &GpuCamera,
        looks: &GpuLooks,
        (rays, layers, values): (&wgpu::Buffer, &Layers, Option<&wgpu::Buffer>),
        layer: Layer,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let buffers = [rays, &layers.hits, &layers.samples, &layers.veils];
        self.run(scene, camera, looks, (&buffers, values), layer, timed)
    }

    /// Runs the stage on one page after the other; `buffers` are rays, hits, samples, and veils where there are layers; `values` are
    /// there where some are kept.
    fn run(
        &self,
        scene: &GpuScene,
        camera: &GpuCamera,
        looks: &GpuLooks,
        (buffers, values): (&[&wgpu::Buffer], Option<&wgpu::Buffer>),
        layer: Layer,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let device = &*self.device;
        let workgroups = (layer.most as u32).div_ceil(SHADE_WORKGROUP);
        let kernel = self.kernel(looks.permutation)?;
        let mut launches = Vec::with_capacity(scene.pages.len());
        for (number, (page, [own, paints])) in scene.pages.iter().zip(&looks.pages).enumerate() {
            let [instances, places] = page.instances();
            let launch = ShadeLaunch {
                ray_count: layer.len as u32,
                row: rows(device, workgroups)[0] * SHADE_WORKGROUP,
                light: looks.light,
                page: number as u32,
                instances,
                places,
                layer: layer.number as u32,
            };
            let launch = device.uniform("launch", &launch)?;
            let [_, vertices, words, objects, instanced, matrices] = &page.group;
            let mut batch = buffers.to_vec();
            batch.insert(2, &launch);
            let groups: [&[&wgpu::Buffer]; 3] = [
                &[vertices, words, objects, instanced, matrices],
                &[own, paints, &camera.camera, &camera.tables],
                &batch,
            ];
            let mut groups = groups.to_vec();
            groups.extend(values.as_ref().map(std::slice::from_ref));
            launches.push(kernel.launch(device, &groups, workgroups));
        }
        run(device, &launches, timed)
    }

    fn kernel(&self, permutation: ShadePermutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(permutation, || {
            use Binding::{Read, Uniform, Write};
            let batch: &[Binding] = match permutation.layers {
                true => &[Read, Write, Uniform, Write, Write],
                false => &[Read, Read, Uniform, Write],
            };
            let mut groups: Vec<&[Binding]> = vec![&[Read; 5], &[Read, Read, Uniform, Read], batch];
            if permutation.values.count() > 0 {
                groups.push(&[Write]);
            }
            let source = permutation.source();
            Kernel::new(&self.device, "shade", &source, &groups)
        })
    }
}

/// An object, or what a page has of it.
struct Cut<'a> {
    object: &'a Arc<ObjectGeometry>,
    /// Numbers of its grids that are there, where these are not all.
    grids: Option<&'a Arc<[u32]>>,
}

impl Cut<'_> {
    /// Whose vertices they are.
    fn address(&self) -> usize {
        match self.grids {
            Some(grids) => grids.as_ptr() as usize,
            None => Arc::as_ptr(self.object) as usize,
        }
    }

    /// Of numbers of all vertices of the object, so many each, those of the vertices that are there, in their order.
    fn of_vertices<'n>(&self, all: &'n [u32], each: usize) -> Cow<'n, [u32]> {
        let Some(grids) = self.grids else {
            return Cow::Borrowed(all);
        };
        let mesh = self.object.mesh();
        let sound = mesh.sound_grids();
        let mut own = Vec::new();
        for g in grids.iter().map(|&g| g as usize) {
            let grid = &mesh.grids[g];
            let from = grid.first_vertex as usize * each;
            match all.get(from..from + grid.vertex_count() * each) {
                Some(numbers) if sound[g] => own.extend_from_slice(numbers),
                // It has a single vertex there, and is never hit.
                _ => own.resize(own.len() + each, 0),
            }
        }
        Cow::Owned(own)
    }

    /// Of values of faces, so many words each, that of each grid that is there: a grid lies on one face. 0 where that has none.
    fn of_grids(&self, faces: &[f32], each: usize) -> Vec<u32> {
        let all = &self.object.mesh().grids;
        let count = self.grids.map_or(all.len(), |grids| grids.len());
        let mut own = Vec::with_capacity(count * each);
        for place in 0..count {
            let grid = self.grids.map_or(place, |grids| grids[place] as usize);
            let from = all[grid].element as usize * each;
            match faces.get(from..from + each) {
                Some(value) => own.extend(value.iter().map(|x| x.to_bits())),
                None => own.resize(own.len() + each, 0),
            }
        }
        own
    }
}

/// Colours and normals of a page, each once.
#[derive(Default)]
struct Paints {
    words: Vec<u32>,
    /// Places of what is there, by address: sources' values, and of objects, or of grids that were picked, channels, normals,
    /// and values of sources for their grids.
    known: HashMap<(usize, usize), u32>,
    /// A colour changes while the shutter is open.
    time: bool,
}

impl Paints {
    fn look(
        &mut self,
        cut: &Cut<'_>,
        look: &hdtrapeze_core::render::Look<'_>,
    ) -> Result<Look, GpuError> {
        let mesh = cut.object.mesh();
        let normals = || cut.of_vertices(&mesh.normals, mesh.normal_key_count);
        Ok(Look {
            marks: marks(look),
            normals: self.add((cut.address(), usize::MAX), normals)?,
            normal_keys: mesh.normal_key_count as u32,
            ..self.paint(cut, &look.color)?
        })
    }

    /// An opacity, as if it were a colour.
    fn opacity(
        &mut self,
        cut: &Cut<'_>,
        look: &hdtrapeze_core::render::Look<'_>,
    ) -> Result<Look, GpuError> {
        match &look.opacity {
            Some(opacity) => self.paint(cut, opacity),
            None => Ok(Look {
                kind: CONSTANT,
                lanes: 1,
                // At the address of nothing.
                paint: self.floats((0, 0), &[1.0])?,
                ..Look::default()
            }),
        }
    }

    /// A primvar of which so many floats are kept, as if it were a colour.
    fn primvar(
        &mut self,
        cut: &Cut<'_>,
        floats: usize,
        paint: Option<&hdtrapeze_core::render::Paint<'_>>,
    ) -> Result<Look, GpuError> {
        let look = paint.map(|paint| self.paint(cut, paint)).transpose()?;
        Ok(Look {
            marks: floats as u32,
            // Without any lanes it is 0.
            ..look.unwrap_or_default()
        })
    }

    /// A colour, an opacity or a primvar.
    fn paint(
        &mut self,
        cut: &Cut<'_>,
        paint: &hdtrapeze_core::render::Paint<'_>,
    ) -> Result<Look, GpuError> {
        let mesh = cut.object.mesh();
        let source = paint.source;
        if source.is_integer() {
            let what = "colours of whole numbers".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let keys = source.key_times().len();
        self.time |= keys > 1;
        let lanes = source.lanes();
        let whole = words_of(source);
        let at = |address: usize, part: usize| (address, part);
        let of_object = cut.address();
        let of_source = std::ptr::from_ref::<Source>(source) as usize;
        let mut out = Look {
            kind: CONSTANT,
            stride: whole as u32,
            lanes: lanes as u32,
            paint_keys: keys as u32,
            ..Look::default()
        };
        if keys > 1 {
            out.paint_times = self.floats(at(of_source, usize::MAX), source.key_times())?;
        }
        match source.values() {
            Values::Constant(values) => out.paint = self.floats(at(of_source, 0), values)?,
            Values::Uniform(values) => {
                out.kind = GRIDS;
                let of = || Cow::Owned(cut.of_grids(values, whole));
                out.paint = self.add(at(of_object, of_source), of)?;
            }
            Values::Channel(channel) => {
                // One that is not there is black, or not there, as core reads it.
                out.lanes = 0;
                if let Some(channel_at) = mesh.channels.get(*channel) {
                    out.kind = VERTICES;
                    (out.lanes, out.stride) = (lanes as u32, channel_at.width as u32);
                    let values: &[u32] = bytemuck::cast_slice(&channel_at.values);
                    let of = || cut.of_vertices(values, channel_at.width);
                    out.paint = self.add(at(of_object, *channel), of)?;
                }
            }
            Values::Instance(_, resolved) if paint.item < resolved.item_count() => {
                let value = resolved.item(paint.item);
                out.paint = self.floats(at(value.as_ptr() as usize, 0), value)?;
            }
            Values::Instance(..) => out.lanes = 0,
        }
        Ok(out)
    }

    fn floats(&mut self, what: (usize, usize), floats: &[f32]) -> Result<u32, GpuError> {
        self.add(what, || Cow::Borrowed(bytemuck::cast_slice(floats)))
    }

    /// The place of words, which are added where they are not there.
    fn add<'a>(
        &mut self,
        what: (usize, usize),
        words: impl FnOnce() -> Cow<'a, [u32]>,
    ) -> Result<u32, GpuError> {
        if let Some(&place) = self.known.get(&what) {
            return Ok(place);
        }
        let place = u32::try_from(self.words.len());
        let place = place
            .map_err(|_| GpuError::Unsupported("2^32 numbers of colours and normals".to_owned()))?;
        let words = words();
        let reserved = self.words.try_reserve(words.len());
        reserved.map_err(|_| GpuError::HostMemory {
            what: "colours and normals",
            bytes: size_of_val(self.words.as_slice()) + size_of_val(&*words),
        })?;
        self.words.extend_from_slice(&words);
        self.known.insert(what, place);
        Ok(place)
    }
}
