//! [`OsdEvaluator`]: one thread's view of an [`OsdSurface`].
//!
//! Binding a face makes the library gather the control points of all keys side by side; the patch
//! points that follow from them are derived once per face. Lattices are then evaluated here: regular patches and
//! the regular cells of irregular ones as B-splines with row sums, cells at extraordinary vertices as
//! Gregory patches, Loop triangles as quartics. What does not fit (irregular Loop triangles, patches
//! whose structure was not recognised or would take long to find) goes to the library, a lattice a call.
//!
//! Channels are bound when they are first asked for.

use std::collections::HashMap;

use cxx::UniquePtr;
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use hdtrapeze_core::surface::{
    LimitEvaluator, LimitSamples, LimitSurface, PatchDomain, nearest_corner,
};

use crate::bridge::ffi;
use crate::domain::Parameterization;
use crate::normal;
use crate::patch::{LaneSample, Patches, Shape};
use crate::shapes::Source;
use crate::surface::{ChannelSource, OsdSurface, POINT};

/// No face is bound.
const UNBOUND: u32 = u32::MAX;

/// The surface of one kind of data over the bound face.
struct Bound {
    face: u32,
    lanes: usize,
    patch: UniquePtr<ffi::Patch>,
    /// Patch points of our own: corners of a linear surface, or all that a tree needs.
    points: Vec<f32>,
    state: State,
    patches: Patches,
}

/// Who evaluates a bound surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nobody: there is no surface.
    None,
    /// The library, from its own patch points.
    Library,
    /// [`Patches`], from the library's patch points.
    Patches,
    /// [`Patches`], from `points`.
    Own,
}

impl Bound {
    fn new(lanes: usize) -> Self {
        Self {
            face: UNBOUND,
            lanes,
            patch: ffi::make_patch(),
            points: Vec::new(),
            state: State::None,
            patches: Patches::default(),
        }
    }

    /// Binds `face` of the library's surface over `values` (`lanes * POINT` floats each). A face
    /// that the library refuses is left without a surface.
    fn bind_library(
        &mut self,
        surface: &OsdSurface,
        face: u32,
        channel: i32,
        values: &[f32],
        known: Option<&mut HashMap<u64, Shape>>,
    ) {
        self.face = face;
        self.state = State::None;
        let Some(mesh) = surface.mesh.as_ref() else {
            return;
        };
        let library_face = surface.library_face(face);
        let size = self.lanes * POINT;
        let bound = self
            .patch
            .pin_mut()
            .bind(mesh, library_face, channel, values, size);
        let Some(info) = bound.ok().filter(|info| info.valid) else {
            return;
        };
        let source = Source {
            mesh,
            is_loop: surface.is_loop,
            library_face,
            channel,
        };
        let shape = match known {
            Some(known) => surface.shared.shape(&self.patch, &info, &source, known),
            None => Shape::Library,
        };
        self.state = match &shape {
            Shape::Library => match self.patch.pin_mut().complete() {
                Ok(()) => State::Library,
                Err(_) => return,
            },
            Shape::Tree(tree) => {
                tree.complete(self.patch.points(), self.lanes, &mut self.points);
                State::Own
            }
            _ => State::Patches,
        };
        self.patches.reset(shape, self.lanes);
    }

    /// Binds `face` as linear between corner values.
    fn bind_linear(&mut self, face: u32, values: &[f32], corners: impl Iterator<Item = usize>) {
        self.face = face;
        self.state = State::Own;
        let size = self.lanes * POINT;
        self.points.clear();
        for i in corners {
            self.points
                .extend_from_slice(&values[i * size..(i + 1) * size]);
        }
        let count = self.points.len() / size;
        self.patches.reset(Shape::Linear(count as u32), self.lanes);
    }

    /// Evaluates all lanes at every `st`. False where there is no surface.
    fn evaluate(
        &mut self,
        place: &Place<'_>,
        derivatives: bool,
        uv: &mut Vec<f32>,
        mut sink: impl FnMut(usize, usize, LaneSample),
    ) -> bool {
        let Place {
            parameterization,
            domain,
            st,
        } = *place;
        match self.state {
            State::None => return false,
            State::Own => {
                let points = &self.points;
                self.patches
                    .evaluate(points, parameterization, domain, st, derivatives, sink);
            }
            State::Patches => {
                let points = self.patch.points();
                self.patches
                    .evaluate(points, parameterization, domain, st, derivatives, sink);
            }
            State::Library => {
                uv.clear();
                parameterization.append_uv(domain, st, uv);
                if self.patch.pin_mut().evaluate(uv, derivatives).is_err() {
                    return false;
                }
                let lanes = self.lanes;
                let at = |values: &[f32], i: usize, lane: usize| {
                    Vec4::from_slice(&values[(i * lanes + lane) * POINT..])
                };
                let (p, du, dv) = (self.patch.position(), self.patch.du(), self.patch.dv());
                for i in 0..st.len() {
                    for lane in 0..lanes {
                        let derivative = |values: &[f32]| match derivatives {
                            true => at(values, i, lane),
                            false => Vec4::ZERO,
                        };
                        let sample = LaneSample {
                            position: at(p, i, lane),
                            du: derivative(du),
                            dv: derivative(dv),
                        };
                        sink(i, lane, sample);
                    }
                }
            }
        }
        true
    }
}

impl Bound {
    /// Points whose hull contains the bound surface, by `sink(lane, point)`. False where there is none.
    fn hull(
        &mut self,
        parameterization: Parameterization,
        mut sink: impl FnMut(usize, Vec4),
    ) -> bool {
        match self.state {
            State::None => return false,
            State::Own => self.patches.hull(&self.points, parameterization, sink),
            State::Patches => {
                let points = self.patch.points();
                self.patches.hull(points, parameterization, sink);
            }
            // Each patch of the library is a mean of its patch points.
            State::Library => {
                for points in self.patch.points().chunks_exact(self.lanes * POINT) {
                    for (lane, p) in points.chunks_exact(POINT).enumerate() {
                        sink(lane, Vec4::from_slice(p));
                    }
                }
            }
        }
        true
    }
}

/// Where on the bound face.
struct Place<'a> {
    parameterization: Parameterization,
    domain: PatchDomain,
    st: &'a [Vec2],
}

/// Evaluates the faces of an [`OsdSurface`].
pub struct OsdEvaluator<'a> {
    surface: &'a OsdSurface,
    face: u32,
    /// Vertices of the bound face.
    size: usize,
    by_library: bool,
    vertex: Bound,
    channels: Vec<Bound>,
    known: HashMap<u64, Shape>,
    uv: Vec<f32>,
}

impl<'a> OsdEvaluator<'a> {
    pub(crate) fn new(surface: &'a OsdSurface, by_library: bool) -> Self {
        Self {
            surface,
            face: UNBOUND,
            size: 0,
            by_library,
            vertex: Bound::new(surface.key_count()),
            channels: surface
                .channels
                .iter()
                .map(|c| Bound::new(c.lanes))
                .collect(),
            known: HashMap::new(),
            uv: Vec::new(),
        }
    }

    /// Whether the bound face is evaluated by the library, a call a point, and not by lattices here.
    pub fn is_by_library(&self) -> bool {
        self.vertex.state == State::Library
    }

    fn place<'s>(&self, domain: PatchDomain, st: &'s [Vec2]) -> Place<'s> {
        Place {
            parameterization: Parameterization::of_face(self.surface.is_loop, self.size),
            domain,
            st,
        }
    }

    /// Where a face without a surface is put: its first vertex, or the origin.
    fn collapse(&self, out: &mut LimitSamples, count: usize) {
        let keys = self.surface.key_count();
        let vertex = match self.size {
            0 => None,
            _ => self.surface.face_vertices(self.face).first(),
        };
        for (key, out) in out.positions.chunks_exact_mut(count.max(1)).enumerate() {
            out.fill(vertex.map_or(Vec3::ZERO, |&v| {
                Vec3::from_slice(&self.surface.points[(v as usize * keys + key) * POINT..])
            }));
        }
    }

    fn bind_channel(&mut self, channel: usize) {
        let (surface, face) = (self.surface, self.face);
        let bound = &mut self.channels[channel];
        if bound.face == face {
            return;
        }
        let data = &surface.channels[channel];
        let known = (!self.by_library).then_some(&mut self.known);
        let source = match data.source {
            ChannelSource::Vertex if surface.is_linear_face(face) => ChannelSource::LinearVertex,
            ChannelSource::FaceVarying(number) if surface.is_linear_face(face) => {
                ChannelSource::LinearFaceVarying(number as usize)
            }
            source => source,
        };
        match source {
            ChannelSource::Vertex => bound.bind_library(surface, face, -1, &data.values, known),
            ChannelSource::FaceVarying(library_channel) => {
                bound.bind_library(surface, face, library_channel, &data.values, known);
            }
            ChannelSource::LinearVertex => {
                let vertices = surface.face_vertices(face);
                bound.bind_linear(face, &data.values, vertices.iter().map(|&v| v as usize));
            }
            ChannelSource::LinearFaceVarying(number) => {
                let indices = surface.value_indices(number, face, self.size);
                bound.bind_linear(face, &data.values, indices.iter().map(|&i| i as usize));
            }
            // Nothing to bind: see `nearest`.
            ChannelSource::Nearest(_) => {}
        }
    }

    /// Values of the corners of the bound face that are nearest to `st`.
    fn nearest(&self, channel: usize, number: usize, place: &Place<'_>, out: &mut [f32]) {
        let data = &self.surface.channels[channel];
        let indices = self.surface.value_indices(number, self.face, self.size);
        for (&st, out) in place.st.iter().zip(out.chunks_exact_mut(data.width)) {
            let corner = nearest_corner(self.size, place.domain, st);
            let at = indices[corner] as usize * data.lanes * POINT;
            out.copy_from_slice(&data.values[at..][..data.width]);
        }
    }
}

impl LimitEvaluator for OsdEvaluator<'_> {
    fn bind(&mut self, face: u32) {
        if self.face == face {
            return;
        }
        let surface = self.surface;
        self.face = face;
        self.size = match (face as usize) < surface.face_count() {
            true => surface.face_vertices(face).len(),
            false => 0,
        };
        if self.size == 0 {
            self.vertex.state = State::None;
            self.vertex.face = face;
        } else if (surface.is_bilinear && !self.by_library) || surface.is_linear_face(face) {
            let vertices = surface.face_vertices(face).iter().map(|&v| v as usize);
            self.vertex.bind_linear(face, &surface.points, vertices);
        } else {
            let known = (!self.by_library).then_some(&mut self.known);
            self.vertex
                .bind_library(surface, face, -1, &surface.points, known);
        }
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        let (count, keys) = (st.len(), self.surface.key_count());
        out.positions.clear();
        out.positions.resize(count * keys, Vec3::ZERO);
        out.normals.clear();
        let place = self.place(domain, st);
        let positions = &mut out.positions[..];
        if !with_normals {
            let sink = |i: usize, key: usize, sample: LaneSample| {
                positions[key * count + i] = sample.position.xyz();
            };
            if !self.vertex.evaluate(&place, false, &mut self.uv, sink) {
                self.collapse(out, count);
            }
            return;
        }
        out.normals.resize(count * keys, Vec3::ZERO);
        let normals = &mut out.normals[..];
        let front = if self.surface.is_left_handed {
            -1.0
        } else {
            1.0
        };
        let mut undefined = Vec::new();
        let sink = |i: usize, key: usize, sample: LaneSample| {
            let at = key * count + i;
            positions[at] = sample.position.xyz();
            match normal::unit_normal(sample.du.xyz(), sample.dv.xyz()) {
                Some(n) => normals[at] = n * front,
                None => undefined.push((i, key)),
            }
        };
        if !self.vertex.evaluate(&place, true, &mut self.uv, sink) {
            return self.collapse(out, count);
        }
        for (i, key) in undefined {
            let st = [normal::nudged(st[i])];
            let place = self.place(domain, &st);
            let normal = &mut out.normals[key * count + i];
            let sink = |_: usize, k: usize, sample: LaneSample| {
                if k == key {
                    let n = normal::unit_normal(sample.du.xyz(), sample.dv.xyz());
                    *normal = n.unwrap_or(Vec3::ZERO) * front;
                }
            };
            self.vertex.evaluate(&place, true, &mut self.uv, sink);
        }
    }

    fn hull(&mut self, out: &mut Vec<Vec3>) -> bool {
        out.clear();
        // Linear faces of a smooth mesh do not meet their neighbours.
        if !self.surface.is_bilinear && self.surface.is_linear_face(self.face) {
            return false;
        }
        let parameterization = Parameterization::of_face(self.surface.is_loop, self.size);
        let mut lanes = vec![Vec::new(); self.surface.key_count()];
        let sink = |lane: usize, p: Vec4| lanes[lane].push(p.xyz());
        let known = self.vertex.hull(parameterization, sink);
        lanes
            .iter()
            .for_each(|points| out.extend_from_slice(points));
        known
    }

    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        out.clear();
        let width = self.surface.channels[channel].width;
        out.resize(st.len() * width, 0.0);
        if self.size == 0 {
            return;
        }
        let place = self.place(domain, st);
        if let ChannelSource::Nearest(number) = self.surface.channels[channel].source {
            return self.nearest(channel, number, &place, out);
        }
        self.bind_channel(channel);
        let sink = |i: usize, lane: usize, sample: LaneSample| {
            let start = lane * POINT;
            let part = (width - start).min(POINT);
            out[i * width + start..][..part].copy_from_slice(&sample.position.to_array()[..part]);
        };
        self.channels[channel].evaluate(&place, false, &mut self.uv, sink);
    }
}
