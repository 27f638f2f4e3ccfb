//! [`OsdEvaluator`]: one thread's view of an [`OsdSurface`].
//!
//! Binding a face makes the library gather the control points of all keys side by side and derive
//! the remaining patch points; a lattice is then evaluated in one call. Channels are bound when they
//! are first asked for.

use cxx::UniquePtr;
use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    ChannelKind, LimitEvaluator, LimitSamples, LimitSurface, PatchDomain,
};

use crate::bridge::ffi;
use crate::domain::Parameterization;
use crate::linear;
use crate::normal;
use crate::surface::{OsdSurface, POINT};

/// No face is bound.
const UNBOUND: u32 = u32::MAX;

/// The surface of one kind of data over the bound face.
struct Bound {
    face: u32,
    info: ffi::PatchInfo,
    patch: UniquePtr<ffi::Patch>,
}

impl Bound {
    fn new() -> Self {
        Self {
            face: UNBOUND,
            info: ffi::PatchInfo::default(),
            patch: ffi::make_patch(),
        }
    }

    /// Binds `face` for `values` of `size` floats, unless it is bound already. A face that the
    /// library refuses is left without a valid surface.
    fn bind(&mut self, surface: &OsdSurface, face: u32, channel: i32, values: &[f32], size: usize) {
        if self.face == face {
            return;
        }
        self.face = face;
        let library_face = surface.library_face(face);
        self.info = match surface.mesh.as_ref() {
            Some(mesh) => self
                .patch
                .pin_mut()
                .bind(mesh, library_face, channel, values, size)
                .unwrap_or_default(),
            None => ffi::PatchInfo::default(),
        };
    }
}

/// Evaluates the faces of an [`OsdSurface`].
pub struct OsdEvaluator<'a> {
    surface: &'a OsdSurface,
    face: u32,
    vertex: Bound,
    channels: Vec<Bound>,
    uv: Vec<f32>,
}

impl<'a> OsdEvaluator<'a> {
    pub(crate) fn new(surface: &'a OsdSurface) -> Self {
        Self {
            surface,
            face: UNBOUND,
            vertex: Bound::new(),
            channels: surface.channels.iter().map(|_| Bound::new()).collect(),
            uv: Vec::new(),
        }
    }

    /// Where a face without a surface is put: its first vertex, or the origin.
    fn collapse(&self, count: usize, out: &mut LimitSamples) {
        let keys = self.surface.key_count();
        let vertex = match self.face {
            UNBOUND => None,
            face => self.surface.face_vertices(face).first(),
        };
        for key in 0..keys {
            let p = vertex.map_or(Vec3::ZERO, |&v| {
                Vec3::from_slice(&self.surface.points[(v as usize * keys + key) * POINT..])
            });
            out.positions.extend(std::iter::repeat_n(p, count));
        }
    }

    /// One library call a point: any patch, exactly as the library has it.
    fn evaluate_by_library(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        let param =
            Parameterization::of_face(self.surface.is_loop, self.vertex.info.face_size as usize);
        self.uv.clear();
        param.append_uv(domain, st, &mut self.uv);
        let mut patch = self.vertex.patch.pin_mut();
        if patch.as_mut().evaluate(&self.uv, with_normals).is_err() {
            return self.collapse(st.len(), out);
        }
        let keys = self.surface.key_count();
        let stride = keys * POINT;
        let at = |values: &[f32], key: usize, i: usize| {
            Vec3::from_slice(&values[i * stride + key * POINT..])
        };
        let position = self.vertex.patch.position();
        for key in 0..keys {
            out.positions
                .extend((0..st.len()).map(|i| at(position, key, i)));
        }
        if !with_normals {
            return;
        }
        let (du, dv) = (self.vertex.patch.du(), self.vertex.patch.dv());
        let mut undefined = Vec::new();
        for key in 0..keys {
            for i in 0..st.len() {
                match normal::unit_normal(at(du, key, i), at(dv, key, i)) {
                    Some(n) => out.normals.push(n),
                    None => {
                        undefined.push((key, i));
                        out.normals.push(Vec3::ZERO);
                    }
                }
            }
        }
        for (key, i) in undefined {
            self.uv.clear();
            param.append_uv(domain, &[normal::nudged(st[i])], &mut self.uv);
            if self.vertex.patch.pin_mut().evaluate(&self.uv, true).is_ok() {
                let (du, dv) = (self.vertex.patch.du(), self.vertex.patch.dv());
                out.normals[key * st.len() + i] =
                    normal::unit_normal(at(du, key, 0), at(dv, key, 0)).unwrap_or(Vec3::ZERO);
            }
        }
    }
}

impl LimitEvaluator for OsdEvaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.face = face;
        let surface = self.surface;
        self.vertex.bind(
            surface,
            face,
            -1,
            &surface.points,
            surface.key_count() * POINT,
        );
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        out.positions.clear();
        out.normals.clear();
        if self.vertex.info.valid {
            self.evaluate_by_library(domain, st, with_normals, out);
        } else {
            self.collapse(st.len(), out);
        }
        if with_normals {
            // Only a face without a surface leaves normals out.
            out.normals.resize(out.positions.len(), Vec3::ZERO);
            if self.surface.is_left_handed {
                out.normals.iter_mut().for_each(|n| *n = -*n);
            }
        }
    }

    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        out.clear();
        let surface = self.surface;
        let data = &surface.channels[channel];
        let width = data.width;
        if !self.vertex.info.valid {
            out.resize(st.len() * width, 0.0);
            return;
        }
        let size = self.vertex.info.face_size as usize;
        if data.kind == ChannelKind::Varying {
            let vertices = surface.face_vertices(self.face);
            let corner = |i: usize| &data.values[vertices[i] as usize * width..][..width];
            linear::interpolate(surface.is_loop, size, width, corner, domain, st, out);
            return;
        }
        let bound = &mut self.channels[channel];
        bound.bind(
            surface,
            self.face,
            data.library_channel,
            &data.values,
            width,
        );
        if !bound.info.valid {
            out.resize(st.len() * width, 0.0);
            return;
        }
        self.uv.clear();
        Parameterization::of_face(surface.is_loop, size).append_uv(domain, st, &mut self.uv);
        match bound.patch.pin_mut().evaluate(&self.uv, false) {
            Ok(()) => out.extend_from_slice(bound.patch.position()),
            Err(_) => out.resize(st.len() * width, 0.0),
        }
    }
}
