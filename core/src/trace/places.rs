//! Sets of instances: every appearance of one object, with what tracing needs and nothing else.
//!
//! A set is immutable, does not know the camera, and is shared between commits. It holds one record an
//! instance, in absolute world space:
//!
//! | places | record | bytes |
//! |---|---|---|
//! | translated | where the object's origin is, f64 | 32 |
//! | fixed | the same, and the inverse of the matrix, f32 | 64 |
//! | moving | the same at every key, and the matrix there, f32 | 64 a key |
//!
//! **Rounding.** Matrices are rounded to f32, translations are not. The rounded matrix *is* the
//! instance's matrix from then on: bounds, rays and shading use the same numbers, so nothing that is
//! proven about them suffers. A fixed place rounds the inverse, because that is what rays go through,
//! and its matrix is the inverse of that in f64. Compared with the matrix that was given, points move by
//! at most `condition * 2^-24` of the object's size, as they would by rounding its vertices.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use hdtrapeze_simd::{Float, Simd};

use super::deferred::Deferred;
use super::instance::{may_invert, normal_matrix};
use super::packet::{LANES, Rays};
use crate::bvh::{LinearBox, ObjectGeometry};
use crate::grid::locate_key;

/// Where one instance is, or is at a key.
#[derive(Clone, Copy, Debug, Default)]
pub struct Record {
    /// World position of the mesh's origin.
    pub(super) origin: DVec3,
    /// Columns of a matrix; see [`Places`].
    linear: [f32; 9],
    id: i32,
}

// One cache line.
const _: () = assert!(size_of::<Record>() == 64);

/// Where one translated instance is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shift {
    pub(super) origin: DVec3,
    id: i32,
}

impl Shift {
    /// An instance of a mesh with this origin that is moved by `by`.
    pub fn new(by: DVec3, mesh_origin: DVec3, id: i32) -> Self {
        let origin = by + mesh_origin;
        Self { origin, id }
    }
}

impl Record {
    /// For a fixed place: `m` takes target space (positions plus the mesh's origin) to the world.
    pub fn fixed(m: &DAffine3, mesh_origin: DVec3, id: i32) -> Self {
        Self::new(m, &m.matrix3.inverse(), mesh_origin, id)
    }

    /// For one key of a moving place.
    pub fn key(m: &DAffine3, mesh_origin: DVec3, id: i32) -> Self {
        Self::new(m, &m.matrix3, mesh_origin, id)
    }

    fn new(m: &DAffine3, linear: &DMat3, mesh_origin: DVec3, id: i32) -> Self {
        Self {
            origin: m.transform_point3(mesh_origin),
            linear: linear.to_cols_array().map(|x| x as f32),
            id,
        }
    }
}

/// What kind of records a set has.
#[derive(Clone, Debug)]
pub(super) enum Places {
    /// No matrices: rays keep their direction, and hits are as exact as untransformed ones.
    Translated(Vec<Shift>),
    /// Matrices are from world to object.
    Fixed(Vec<Record>),
    /// Matrices are from object to world, at keys (one instance after the other), straight between.
    Moving {
        /// Ascending in [0, 1], the first 0 and the last 1.
        key_times: Box<[f32]>,
        records: Vec<Record>,
    },
}

/// What appears.
#[derive(Clone, Debug)]
enum Object {
    Made(Arc<ObjectGeometry>),
    Deferred(Arc<Deferred>),
}

/// All instances of one object that move in the same way.
#[derive(Clone, Debug)]
pub struct InstanceSet {
    object: Object,
    pub(super) places: Places,
}

impl InstanceSet {
    /// Translated instances.
    pub fn translated(object: Arc<ObjectGeometry>, shifts: Vec<Shift>) -> Self {
        let places = Places::Translated(shifts);
        let object = Object::Made(object);
        Self { object, places }
    }

    /// Instances with a matrix that does not move: records by [`Record::fixed`].
    pub fn fixed(object: Arc<ObjectGeometry>, records: Vec<Record>) -> Self {
        let places = Places::Fixed(records);
        let object = Object::Made(object);
        Self { object, places }
    }

    /// Instances with matrices at keys, which are ascending times in [0, 1], the first 0 and the last 1:
    /// records by [`Record::key`], all keys of an instance one after the other.
    pub fn moving(
        object: Arc<ObjectGeometry>,
        key_times: Box<[f32]>,
        records: Vec<Record>,
    ) -> Self {
        let places = Places::Moving { key_times, records };
        let object = Object::Made(object);
        Self { object, places }
    }

    /// One translated instance of an object that is made when it is first asked for.
    pub fn deferred(object: Arc<Deferred>, shift: Shift) -> Self {
        Self {
            object: Object::Deferred(object),
            places: Places::Translated(vec![shift]),
        }
    }

    /// What appears; it is made where it was deferred.
    #[inline]
    pub fn object(&self) -> &Arc<ObjectGeometry> {
        match &self.object {
            Object::Made(object) => object,
            Object::Deferred(deferred) => deferred.object(),
        }
    }

    /// What appears, where it is made.
    #[inline]
    pub fn made(&self) -> Option<&Arc<ObjectGeometry>> {
        match &self.object {
            Object::Made(object) => Some(object),
            Object::Deferred(deferred) => deferred.made(),
        }
    }

    /// Bytes of its positions: as expected where it is not made.
    pub(super) fn position_bytes(&self) -> usize {
        match &self.object {
            Object::Made(object) => object.mesh().position_bytes(),
            Object::Deferred(deferred) => deferred.position_bytes(),
        }
    }

    /// Another for each other object.
    pub(super) fn address(&self) -> usize {
        match &self.object {
            Object::Made(object) => Arc::as_ptr(object).addr(),
            Object::Deferred(deferred) => Arc::as_ptr(deferred).addr(),
        }
    }

    /// What is made when it is first asked for.
    pub fn as_deferred(&self) -> Option<&Arc<Deferred>> {
        match &self.object {
            Object::Made(_) => None,
            Object::Deferred(deferred) => Some(deferred),
        }
    }

    /// Bounds of the object over time, relative to its mesh's origin, and its [`ObjectGeometry::radius`]; nothing
    /// where it cannot be hit.
    pub(super) fn object_bounds(&self) -> Option<(&LinearBox, f32)> {
        match &self.object {
            Object::Made(object) => {
                (!object.is_empty()).then(|| (object.bounds(), object.radius()))
            }
            Object::Deferred(deferred) => Some((deferred.bounds(), deferred.radius())),
        }
    }

    /// Where a ray in the object's space enters the bounds of one that is not made yet; nothing where it cannot
    /// hit it between two distances, both inclusive.
    pub(super) fn entry(&self, origin: Vec3, dir: Vec3, time: f32, t: [f32; 2]) -> Option<f64> {
        match &self.object {
            Object::Made(_) => Some(0.0),
            Object::Deferred(deferred) => deferred.entry(origin, dir, time, t),
        }
    }

    /// Number of instances.
    pub fn len(&self) -> usize {
        match &self.places {
            Places::Translated(shifts) => shifts.len(),
            Places::Fixed(records) => records.len(),
            Places::Moving { key_times, records } => records.len() / key_times.len().max(1),
        }
    }

    /// True when it has no instance.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Key times of a moving set.
    pub fn key_times(&self) -> Option<&[f32]> {
        match &self.places {
            Places::Moving { key_times, .. } => Some(key_times),
            _ => None,
        }
    }

    /// Number of instance `i` as the host knows it.
    pub fn id(&self, i: usize) -> i32 {
        match &self.places {
            Places::Translated(shifts) => shifts[i].id,
            Places::Fixed(records) => records[i].id,
            Places::Moving { key_times, records } => records[i * key_times.len()].id,
        }
    }

    /// Bytes on the heap, without the object's.
    pub fn bytes(&self) -> usize {
        match &self.places {
            Places::Translated(shifts) => size_of::<Shift>() * shifts.capacity(),
            Places::Fixed(records) => size_of::<Record>() * records.capacity(),
            Places::Moving { key_times, records } => {
                size_of::<Record>() * records.capacity() + size_of_val(&**key_times)
            }
        }
    }

    /// The matrix from the mesh's positions to the world relative to `world_origin`, at `time`.
    pub(super) fn to_world(&self, i: usize, time: f32, world_origin: DVec3) -> DAffine3 {
        match &self.places {
            Places::Translated(shifts) => {
                DAffine3::from_translation(shifts[i].origin - world_origin)
            }
            Places::Fixed(records) => records[i].inverted(world_origin),
            Places::Moving { key_times, records } => {
                moving_at(key_times, records, i, time, world_origin)
            }
        }
    }

    /// [`InstanceSet::to_world`] when the shutter opens and when it closes.
    pub(super) fn to_world_at_ends(&self, i: usize, world_origin: DVec3) -> [DAffine3; 2] {
        let start = self.to_world(i, 0.0, world_origin);
        match &self.places {
            Places::Moving { .. } => [start, self.to_world(i, 1.0, world_origin)],
            _ => [start; 2],
        }
    }

    /// `n` of the mesh, of any length, as it is in the world at `time` up to a positive scale.
    pub(super) fn normal_to_world(&self, i: usize, time: f32, n: DVec3) -> DVec3 {
        match &self.places {
            Places::Translated(_) => n,
            // Where the world begins does not turn anything.
            _ => normal_matrix(&self.to_world(i, time, DVec3::ZERO).matrix3) * n,
        }
    }

    /// Origin and direction of a ray, relative to `world_origin`, in the object's space. Numbers that are
    /// not finite where the matrix is singular, or nearly ([`super::instance::CONDITION_LIMIT`]): no ray can be prepared from them.
    #[inline]
    pub(super) fn to_object(
        &self,
        i: usize,
        origin: Vec3,
        dir: Vec3,
        time: f32,
        world_origin: DVec3,
    ) -> (Vec3, Vec3) {
        match &self.places {
            Places::Translated(shifts) => {
                let by = shifts[i].origin - world_origin;
                ((origin.as_dvec3() - by).as_vec3(), dir)
            }
            Places::Fixed(records) => {
                let record = &records[i];
                let inverse = record.matrix();
                let origin = origin.as_dvec3() - (record.origin - world_origin);
                (
                    (inverse * origin).as_vec3(),
                    (inverse * dir.as_dvec3()).as_vec3(),
                )
            }
            Places::Moving { key_times, records } => {
                let m = moving_at(key_times, records, i, time, world_origin);
                let inverse = m.matrix3.inverse();
                if !may_invert(&m.matrix3, &inverse) {
                    return (Vec3::NAN, Vec3::NAN);
                }
                (
                    (inverse * (origin.as_dvec3() - m.translation)).as_vec3(),
                    (inverse * dir.as_dvec3()).as_vec3(),
                )
            }
        }
    }
}

impl InstanceSet {
    /// [`InstanceSet::to_object`] for the rays `lanes` of a packet: the same bits.
    #[inline(always)]
    pub(super) fn to_object16<S: Simd>(
        &self,
        simd: S,
        i: usize,
        rays: &Rays,
        lanes: u32,
        world_origin: DVec3,
    ) -> Rays {
        let mut local = *rays;
        if let Places::Translated(shifts) = &self.places {
            let by = shifts[i].origin - world_origin;
            for (axis, x) in local.origin.iter_mut().enumerate() {
                *x = simd.less16(simd.from16(x), by[axis]).to_array();
            }
            return local;
        }
        let mut rest = lanes;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize & (LANES - 1);
            rest &= rest - 1;
            let (origin, dir) = (rays.origin_of(lane), rays.dir_of(lane));
            let (origin, dir) = self.to_object(i, origin, dir, rays.time[lane], world_origin);
            for axis in 0..3 {
                local.origin[axis][lane] = origin[axis];
                local.dir[axis][lane] = dir[axis];
            }
        }
        local
    }
}

impl Record {
    #[inline]
    pub(super) fn matrix(&self) -> DMat3 {
        DMat3::from_cols_array(&self.linear.map(f64::from))
    }

    /// At a key: the matrix to the world.
    #[inline]
    pub(super) fn at_key(&self, world_origin: DVec3) -> DAffine3 {
        DAffine3 {
            matrix3: self.matrix(),
            translation: self.origin - world_origin,
        }
    }

    /// Of a fixed place: the matrix to the world.
    pub(super) fn inverted(&self, world_origin: DVec3) -> DAffine3 {
        DAffine3 {
            matrix3: self.matrix().inverse(),
            translation: self.origin - world_origin,
        }
    }
}

fn moving_at(
    key_times: &[f32],
    records: &[Record],
    i: usize,
    time: f32,
    world_origin: DVec3,
) -> DAffine3 {
    let records = &records[i * key_times.len()..][..key_times.len()];
    let (k, f) = locate_key(key_times, time);
    let a = records[k].at_key(world_origin);
    let b = records
        .get(k + 1)
        .unwrap_or(&records[k])
        .at_key(world_origin);
    let f = f64::from(f);
    DAffine3 {
        matrix3: a.matrix3 + (b.matrix3 - a.matrix3) * f,
        translation: a.translation + (b.translation - a.translation) * f,
    }
}
