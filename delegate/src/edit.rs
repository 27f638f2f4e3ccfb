//! Edits: what hosts change in the scene, queued from any thread and applied in order at commit.
//!
//! Applying makes one new `Arc` for each prim that really changed, however many edits it got, and
//! keeps the old one where nothing did: the renderer recognises unchanged prims by pointer.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use hdtrapeze_core::scene::{
    CameraDesc, CurvesDesc, Geometry, GridsDesc, ImplicitDesc, InstanceArrays, InstancerDesc,
    MeshDesc, NurbsCurvesDesc, NurbsPatchDesc, PointsSamples, PrimCommon, PrimDesc, PrimId,
    PrimvarDesc, PrototypeOf, RenderSettings, Scene, SpheresDesc, SubsetDesc, TransformSamples,
};
use hdtrapeze_core::surface::MeshTopology;

use crate::error::Error;

/// What an id stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A polygon or subdivision mesh.
    Mesh,
    /// Grids that the host has diced.
    Grids,
    /// A cube, sphere and so on.
    Implicit,
    /// A NURBS patch.
    NurbsPatch,
    /// NURBS curves.
    NurbsCurves,
    /// Curves.
    Curves,
    /// Spheres.
    Spheres,
    /// An instancer.
    Instancer,
    /// A camera.
    Camera,
}

/// One change of one prim or camera.
#[derive(Clone, Debug)]
pub enum Edit {
    /// A mesh's topology.
    Topology(Arc<MeshTopology>),
    /// A mesh's subsets.
    Subsets(Arc<Vec<SubsetDesc>>),
    /// Points of a mesh, NURBS patch, of curves or spheres.
    Points(PointsSamples),
    /// A cube, sphere and so on.
    Implicit(ImplicitDesc),
    /// Orders, knots, weights of a NURBS patch; its points stay.
    NurbsPatch(NurbsPatchDesc),
    /// Orders, knots, weights of NURBS curves; their points stay.
    NurbsCurves(NurbsCurvesDesc),
    /// Basis, wrap and counts of curves; their points stay.
    Curves(CurvesDesc),
    /// The grids of a grids prim.
    Grids(GridsDesc),
    /// A camera; its path and transform stay.
    Camera(Box<CameraDesc>),
    /// Transform levels, own level first.
    Transform(Vec<TransformSamples>),
    /// A primvar, or its removal.
    Primvar(String, Option<PrimvarDesc>),
    /// The arrays of an instancer.
    Instances(Arc<InstanceArrays>),
    /// The prototype that a prim or instancer is part of, or none: it stands by itself.
    PartOf(Option<PrototypeOf>),
    /// Visible to the camera.
    Visible(bool),
    /// A holdout.
    Matte(bool),
    /// primId AOV value.
    PickId(i32),
    /// motion:blurScale, and motion:nonlinearSampleCount or none.
    Motion(f64, Option<u32>),
    /// Both sides are outsides.
    DoubleSided(bool),
    /// The prim or camera goes away.
    Remove,
}

impl Edit {
    /// Whether a prim of this kind can be edited so.
    fn fits(&self, kind: Kind) -> bool {
        match self {
            Edit::Topology(_) | Edit::Subsets(_) => kind == Kind::Mesh,
            Edit::Points(_) => matches!(
                kind,
                Kind::Mesh | Kind::NurbsPatch | Kind::NurbsCurves | Kind::Curves | Kind::Spheres
            ),
            Edit::Grids(_) => kind == Kind::Grids,
            Edit::Implicit(_) => kind == Kind::Implicit,
            Edit::NurbsPatch(_) => kind == Kind::NurbsPatch,
            Edit::NurbsCurves(_) => kind == Kind::NurbsCurves,
            Edit::Curves(_) => kind == Kind::Curves,
            Edit::Camera(_) => kind == Kind::Camera,
            Edit::Instances(_) => kind == Kind::Instancer,
            Edit::Matte(_) | Edit::PickId(_) | Edit::DoubleSided(_) => {
                !matches!(kind, Kind::Camera | Kind::Instancer)
            }
            Edit::Primvar(..) | Edit::PartOf(_) | Edit::Visible(_) | Edit::Motion(..) => {
                kind != Kind::Camera
            }
            Edit::Transform(_) | Edit::Remove => true,
        }
    }
}

/// A queued change of the scene.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    Create(PrimId, Kind, Arc<str>),
    Edit(PrimId, Box<Edit>),
    /// A prim with all its edits so far applied.
    Complete(PrimId, Arc<PrimDesc>),
    ActiveCamera(Option<PrimId>),
    Settings(Box<RenderSettings>),
    Aovs(Vec<String>),
}

/// Changes that wait for a commit, and the ids that are in use once they are applied.
#[derive(Debug, Default)]
pub(crate) struct EditQueue {
    changes: Vec<Change>,
    /// Changes before these that a render was asked for with.
    sealed: Vec<Change>,
    /// Changes in the queue of each prim.
    counts: HashMap<PrimId, usize>,
    known: HashMap<PrimId, (Kind, Arc<str>)>,
    last_id: u64,
    /// The scene as of the last commit.
    base: Scene,
    /// Goes up with every change of a camera or the settings.
    view_version: u64,
    edits: Edits,
}

/// How many edits were queued so far. Settings, AOVs and the active camera are none of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edits {
    /// Of prims, instancers and cameras, their making and removal too.
    pub all: u64,
    /// Those of cameras.
    pub of_cameras: u64,
}

impl EditQueue {
    /// Kind and path of a prim, instancer or camera; not found where it never was or is removed.
    pub fn find(&self, id: PrimId) -> Result<(Kind, Arc<str>), Error> {
        let found = self.known.get(&id).cloned();
        found.ok_or_else(|| Error::NotFound(format!("no prim or camera has id {}", id.0)))
    }

    pub fn create(&mut self, kind: Kind, path: &str) -> PrimId {
        self.last_id += 1;
        let id = PrimId(self.last_id);
        let path: Arc<str> = path.into();
        self.known.insert(id, (kind, path.clone()));
        self.count(kind);
        self.changes.push(Change::Create(id, kind, path));
        self.counts.insert(id, 1);
        id
    }

    pub fn edit(&mut self, id: PrimId, edit: Edit) -> Result<(), Error> {
        let (kind, path) = self.find(id)?;
        if !edit.fits(kind) {
            return Err(Error::InvalidArgument(format!(
                "{path} (id {}) is of kind {kind:?} and cannot be edited so",
                id.0
            )));
        }
        if let Edit::PartOf(Some((instancer, _))) = edit {
            let (kind, path) = self.find(instancer)?;
            if kind != Kind::Instancer {
                return Err(Error::InvalidArgument(format!(
                    "{path} (id {}) is not an instancer",
                    instancer.0
                )));
            }
        }
        if matches!(edit, Edit::Remove) {
            self.known.remove(&id);
        }
        self.count(kind);
        self.changes.push(Change::Edit(id, Box::new(edit)));
        *self.counts.entry(id).or_default() += 1;
        Ok(())
    }

    fn count(&mut self, kind: Kind) {
        let of_camera = u64::from(kind == Kind::Camera);
        self.edits.all += 1;
        self.edits.of_cameras += of_camera;
        self.view_version += of_camera;
    }

    /// Edits that were queued so far.
    pub fn edits(&self) -> Edits {
        self.edits
    }

    /// Refuses what is not a camera.
    pub fn check_camera(&self, id: PrimId) -> Result<(), Error> {
        match self.find(id)? {
            (Kind::Camera, _) => Ok(()),
            (_, path) => Err(Error::InvalidArgument(format!(
                "{path} (id {}) is not a camera",
                id.0
            ))),
        }
    }

    pub fn push(&mut self, change: Change) -> Result<(), Error> {
        if let Change::ActiveCamera(Some(id)) = change {
            self.check_camera(id)?;
        }
        // What is left are settings, their AOVs and the active camera.
        self.view_version += 1;
        self.changes.push(change);
        Ok(())
    }

    /// All changes, which stay in the queue.
    pub fn all(&self) -> Vec<Change> {
        self.sealed.iter().chain(&self.changes).cloned().collect()
    }

    /// All changes.
    pub fn take(&mut self) -> Vec<Change> {
        self.seal();
        std::mem::take(&mut self.sealed)
    }

    /// Draws a line under the changes so far: what comes later is the next render's.
    pub fn seal(&mut self) -> Edits {
        self.counts.clear();
        let waits = !self.sealed.is_empty();
        self.sealed.append(&mut self.changes);
        if waits {
            self.drop_replaced();
        }
        self.edits
    }

    /// Drops sealed edits that a later one makes good for: nobody has taken them for so long that others came.
    fn drop_replaced(&mut self) {
        let mut later = HashSet::new();
        let mut kept: Vec<Change> = std::mem::take(&mut self.sealed);
        kept.reverse();
        kept.retain(|change| match change {
            Change::Edit(id, edit) => {
                let primvar = match &**edit {
                    Edit::Primvar(name, _) => Some(name.clone()),
                    _ => None,
                };
                later.insert((*id, std::mem::discriminant(&**edit), primvar))
            }
            _ => true,
        });
        kept.reverse();
        self.sealed = kept;
    }

    /// The sealed changes, and after them the camera, settings and AOVs of a render of them.
    pub fn take_sealed(
        &mut self,
        camera: Option<PrimId>,
        settings: &RenderSettings,
    ) -> Vec<Change> {
        self.view_version += 1;
        let mut changes = std::mem::take(&mut self.sealed);
        changes.push(Change::Settings(Box::new(settings.clone())));
        changes.push(Change::Aovs(settings.aovs.clone()));
        changes.push(Change::ActiveCamera(camera));
        changes
    }

    /// Remembers the scene that all changes so far have been applied to.
    pub fn applied(&mut self, scene: &Scene) {
        self.base = scene.clone();
    }

    /// Whether `prim` is what the last commit had under this id.
    pub fn is_committed(&self, id: PrimId, prim: &Arc<PrimDesc>) -> bool {
        let base = self.base.prims.get(&id);
        base.is_some_and(|base| Arc::ptr_eq(base, prim))
    }

    /// The version of cameras and settings: other numbers, other cameras or settings.
    pub fn view_version(&self) -> u64 {
        self.view_version
    }

    /// The last scene with the cameras and settings of now, and without its prims.
    pub fn view(&self) -> Scene {
        let mut scene = Scene {
            prims: BTreeMap::new(),
            instancers: BTreeMap::new(),
            ..self.base.clone()
        };
        let is_camera = |id: &PrimId| self.known.get(id).is_some_and(|k| k.0 == Kind::Camera);
        let matters = |change: &&Change| match change {
            Change::Create(id, ..) | Change::Edit(id, _) => is_camera(id),
            Change::Complete(..) => false,
            Change::ActiveCamera(_) | Change::Settings(_) | Change::Aovs(_) => true,
        };
        apply(
            &mut scene,
            self.sealed
                .iter()
                .chain(&self.changes)
                .filter(matters)
                .cloned()
                .collect(),
        );
        scene
    }

    /// Applies the queued edits of a prim, and gives the result; nothing where there are none,
    /// where edits of others came between them, or a render of those before is about to begin.
    pub fn complete(&mut self, id: PrimId) -> Result<Option<Arc<PrimDesc>>, Error> {
        let (kind, path) = self.find(id)?;
        // The scene that sealed changes make is not known yet.
        if matches!(kind, Kind::Camera | Kind::Instancer) || !self.sealed.is_empty() {
            return Ok(None);
        }
        let is_own = |change: &Change| match change {
            Change::Create(of, ..) | Change::Edit(of, _) | Change::Complete(of, _) => *of == id,
            _ => false,
        };
        let own = self.changes.iter().rev().take_while(|c| is_own(c)).count();
        if own == 0 || self.counts.get(&id) != Some(&own) {
            return Ok(None);
        }
        let first = self.changes.len() - own;
        let begins = matches!(
            self.changes.get(first),
            Some(Change::Create(..) | Change::Complete(..))
        );
        let mut prim = match self.base.prims.get(&id) {
            _ if begins => new_prim(kind, &path),
            Some(base) => PrimDesc::clone(base),
            None => return Ok(None),
        };
        for change in self.changes.drain(first..) {
            match change {
                Change::Complete(_, done) => prim = PrimDesc::clone(&done),
                Change::Edit(_, edit) => edit_prim(&mut prim, *edit),
                _ => {}
            }
        }
        let prim = match self.base.prims.get(&id) {
            Some(base) if **base == prim => Arc::clone(base),
            _ => Arc::new(prim),
        };
        self.changes.push(Change::Complete(id, Arc::clone(&prim)));
        self.counts.insert(id, 1);
        Ok(Some(prim))
    }
}

/// Applies changes in order; true where the scene is another one afterwards.
pub(crate) fn apply(scene: &mut Scene, changes: Vec<Change>) -> bool {
    let mut prims = Working::new(&mut scene.prims);
    let mut instancers = Working::new(&mut scene.instancers);
    let mut cameras = Working::new(&mut scene.cameras);
    let mut settings = RenderSettings::clone(&scene.settings);
    let mut active = scene.active_camera;
    for change in changes {
        match change {
            Change::Create(id, Kind::Camera, path) => {
                let camera = CameraDesc {
                    path: path.to_string(),
                    ..CameraDesc::default()
                };
                cameras.insert(id, camera);
            }
            Change::Create(id, Kind::Instancer, path) => {
                instancers.insert(id, InstancerDesc::new(&*path));
            }
            Change::Create(id, kind, path) => {
                let prim = new_prim(kind, &path);
                prims.insert(id, prim);
            }
            Change::Complete(id, prim) => prims.set(id, prim),
            Change::Edit(id, edit) if matches!(*edit, Edit::Remove) => {
                prims.remove(id);
                instancers.remove(id);
                cameras.remove(id);
                active = active.filter(|camera| *camera != id);
            }
            Change::Edit(id, edit) => {
                if let Some(prim) = prims.get(id) {
                    edit_prim(prim, *edit);
                } else if let Some(instancer) = instancers.get(id) {
                    edit_instancer(instancer, *edit);
                } else if let Some(camera) = cameras.get(id) {
                    edit_camera(camera, *edit);
                }
            }
            Change::ActiveCamera(id) => active = id,
            Change::Settings(new) => {
                let aovs = settings.aovs;
                settings = RenderSettings { aovs, ..*new };
            }
            Change::Aovs(names) => settings.aovs = names,
        }
    }
    let mut differs = prims.finish();
    differs |= instancers.finish();
    differs |= cameras.finish();
    if settings != *scene.settings {
        scene.settings = Arc::new(settings);
        differs = true;
    }
    if active != scene.active_camera {
        scene.active_camera = active;
        differs = true;
    }
    differs
}

fn new_prim(kind: Kind, path: &str) -> PrimDesc {
    PrimDesc {
        common: PrimCommon::new(path),
        geometry: match kind {
            Kind::Grids => Geometry::Grids(GridsDesc::default()),
            Kind::Implicit => Geometry::Implicit(ImplicitDesc::default()),
            Kind::NurbsCurves => Geometry::NurbsCurves(NurbsCurvesDesc::default()),
            Kind::NurbsPatch => Geometry::NurbsPatch(NurbsPatchDesc::default()),
            Kind::Curves => Geometry::Curves(CurvesDesc::default()),
            Kind::Spheres => Geometry::Spheres(SpheresDesc::default()),
            Kind::Mesh | Kind::Instancer | Kind::Camera => Geometry::Mesh(MeshDesc::default()),
        },
    }
}

fn edit_prim(prim: &mut PrimDesc, edit: Edit) {
    let common = &mut prim.common;
    match (edit, &mut prim.geometry) {
        (Edit::Topology(topology), Geometry::Mesh(mesh)) => mesh.topology = topology,
        (Edit::Subsets(subsets), Geometry::Mesh(mesh)) => mesh.subsets = subsets,
        (Edit::Points(new), geometry) => {
            if let Some(points) = geometry.points_mut() {
                *points = new;
            }
        }
        (Edit::Implicit(new), Geometry::Implicit(implicit)) => *implicit = new,
        (Edit::NurbsCurves(new), Geometry::NurbsCurves(curves)) => {
            let points = std::mem::take(&mut curves.points);
            *curves = NurbsCurvesDesc { points, ..new };
        }
        (Edit::NurbsPatch(new), Geometry::NurbsPatch(patch)) => {
            let points = std::mem::take(&mut patch.points);
            *patch = NurbsPatchDesc { points, ..new };
        }
        (Edit::Curves(new), Geometry::Curves(curves)) => {
            let points = std::mem::take(&mut curves.points);
            *curves = CurvesDesc { points, ..new };
        }
        (Edit::Grids(new), Geometry::Grids(grids)) => *grids = new,
        (Edit::Transform(levels), _) => common.transform = levels,
        (Edit::Primvar(name, Some(primvar)), _) => {
            common.primvars.insert(name, primvar);
        }
        (Edit::Primvar(name, None), _) => {
            common.primvars.remove(&name);
        }
        (Edit::PartOf(part), _) => common.instancer = part,
        (Edit::Visible(visible), _) => common.visible = visible,
        (Edit::Matte(matte), _) => common.matte = matte,
        (Edit::PickId(id), _) => common.pick_id = id,
        (Edit::Motion(scale, samples), _) => {
            common.blur_scale = scale;
            common.nonlinear_samples = samples;
        }
        (Edit::DoubleSided(on), _) => common.double_sided = on,
        // The queue has checked that the edit fits the kind.
        _ => {}
    }
}

fn edit_instancer(instancer: &mut InstancerDesc, edit: Edit) {
    match edit {
        Edit::Instances(arrays) => instancer.arrays = arrays,
        Edit::Primvar(name, Some(primvar)) => {
            instancer.primvars.insert(name, primvar);
        }
        Edit::Primvar(name, None) => {
            instancer.primvars.remove(&name);
        }
        Edit::Transform(levels) => instancer.transform = levels,
        Edit::PartOf(part) => instancer.parent = part,
        Edit::Visible(visible) => instancer.visible = visible,
        Edit::Motion(scale, samples) => {
            instancer.blur_scale = scale;
            instancer.nonlinear_samples = samples;
        }
        _ => {}
    }
}

fn edit_camera(camera: &mut CameraDesc, edit: Edit) {
    match edit {
        Edit::Camera(new) => {
            *camera = CameraDesc {
                path: std::mem::take(&mut camera.path),
                transform: std::mem::take(&mut camera.transform),
                ..*new
            };
        }
        Edit::Transform(levels) => camera.transform = levels,
        _ => {}
    }
}

/// A map of the scene with copies of what edits touch.
struct Working<'a, T> {
    map: &'a mut BTreeMap<PrimId, Arc<T>>,
    changed: BTreeMap<PrimId, State<T>>,
}

/// What became of an entry.
enum State<T> {
    Copy(T),
    Shared(Arc<T>),
    Removed,
}

impl<'a, T: Clone + PartialEq> Working<'a, T> {
    fn new(map: &'a mut BTreeMap<PrimId, Arc<T>>) -> Self {
        Self {
            map,
            changed: BTreeMap::new(),
        }
    }

    fn insert(&mut self, id: PrimId, new: T) {
        self.changed.insert(id, State::Copy(new));
    }

    fn set(&mut self, id: PrimId, new: Arc<T>) {
        self.changed.insert(id, State::Shared(new));
    }

    fn get(&mut self, id: PrimId) -> Option<&mut T> {
        let old = match self.changed.get(&id) {
            Some(State::Shared(new)) => Some(T::clone(new)),
            Some(State::Copy(_) | State::Removed) => None,
            None => Some(T::clone(self.map.get(&id)?)),
        };
        if let Some(old) = old {
            self.changed.insert(id, State::Copy(old));
        }
        match self.changed.get_mut(&id) {
            Some(State::Copy(copy)) => Some(copy),
            _ => None,
        }
    }

    fn remove(&mut self, id: PrimId) {
        self.changed.insert(id, State::Removed);
    }

    fn finish(self) -> bool {
        let mut differs = false;
        for (id, new) in self.changed {
            let old = self.map.get(&id);
            let new = match new {
                State::Copy(new) if old.is_some_and(|old| **old == new) => continue,
                State::Copy(new) => Arc::new(new),
                State::Shared(new) if old.is_some_and(|old| Arc::ptr_eq(old, &new)) => continue,
                State::Shared(new) => new,
                State::Removed => {
                    differs |= self.map.remove(&id).is_some();
                    continue;
                }
            };
            self.map.insert(id, new);
            differs = true;
        }
        differs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(x: f32) -> Edit {
        Edit::Points(PointsSamples {
            times: vec![0.0],
            points: vec![Arc::new(vec![glam::Vec3::splat(x)])],
            ..PointsSamples::default()
        })
    }

    #[test]
    fn edits_of_a_removed_or_unfit_prim_are_refused() {
        let mut queue = EditQueue::default();
        let mesh = queue.create(Kind::Mesh, "/mesh");
        let camera = queue.create(Kind::Camera, "/camera");
        assert_ne!(mesh, camera);
        assert!(matches!(
            queue.edit(camera, points(0.0)),
            Err(Error::InvalidArgument(_))
        ));
        assert!(matches!(
            queue.edit(mesh, Edit::Camera(Box::default())),
            Err(Error::InvalidArgument(_))
        ));
        let camera_is_mesh = queue.push(Change::ActiveCamera(Some(mesh)));
        assert!(matches!(camera_is_mesh, Err(Error::InvalidArgument(_))));
        queue.edit(mesh, Edit::Remove).unwrap();
        assert!(matches!(
            queue.edit(mesh, points(0.0)),
            Err(Error::NotFound(_))
        ));
        assert!(queue.create(Kind::Mesh, "/mesh") > camera, "ids come back");
    }

    #[test]
    fn what_nobody_takes_does_not_pile_up() {
        let mut queue = EditQueue::default();
        let mesh = queue.create(Kind::Mesh, "/mesh");
        let other = queue.create(Kind::Mesh, "/other");
        queue.seal();
        for i in 0..100 {
            queue.edit(mesh, points(i as f32)).unwrap();
            let primvar = |name: &str| Edit::Primvar(name.to_owned(), None);
            queue.edit(mesh, primvar("a")).unwrap();
            queue.edit(mesh, primvar("b")).unwrap();
            queue.edit(other, Edit::Visible(i % 2 == 0)).unwrap();
            queue.seal();
        }
        let changes = queue.take();
        // Two prims, and of each edit the last.
        assert_eq!(changes.len(), 6);
        let (mut all, mut last) = (Scene::default(), Scene::default());
        apply(&mut all, changes);
        let edits = [(mesh, points(99.0)), (other, Edit::Visible(false))];
        let made = [(mesh, "/mesh"), (other, "/other")];
        let made = made.map(|(id, path)| Change::Create(id, Kind::Mesh, path.into()));
        let edits = edits.map(|(id, edit)| Change::Edit(id, Box::new(edit)));
        apply(&mut last, made.into_iter().chain(edits).collect());
        assert_eq!(all.prims, last.prims);
    }

    #[test]
    fn unchanged_prims_keep_their_pointer_and_changed_ones_get_one() {
        let mut queue = EditQueue::default();
        let mut scene = Scene::default();
        let still = queue.create(Kind::Mesh, "/still");
        let moving = queue.create(Kind::Mesh, "/moving");
        queue.edit(still, points(1.0)).unwrap();
        assert!(apply(&mut scene, queue.take()));
        let before = scene.clone();

        queue.edit(still, points(1.0)).unwrap();
        queue.edit(moving, points(2.0)).unwrap();
        queue.edit(moving, points(3.0)).unwrap();
        assert!(apply(&mut scene, queue.take()));
        assert!(Arc::ptr_eq(&before.prims[&still], &scene.prims[&still]));
        assert!(!Arc::ptr_eq(&before.prims[&moving], &scene.prims[&moving]));
        let Geometry::Mesh(mesh) = &scene.prims[&moving].geometry else {
            panic!("a mesh");
        };
        assert_eq!(mesh.points.points[0][0].x, 3.0, "the last edit wins");

        queue.edit(moving, points(3.0)).unwrap();
        assert!(!apply(&mut scene, queue.take()), "nothing changed");
    }

    #[test]
    fn a_completed_prim_is_the_one_that_is_committed() {
        let mut queue = EditQueue::default();
        let mut scene = Scene::default();
        let a = queue.create(Kind::Mesh, "/a");
        queue.edit(a, points(1.0)).unwrap();
        let done = queue.complete(a).unwrap().expect("it has edits");
        assert!(queue.complete(a).unwrap().is_some(), "again is harmless");
        apply(&mut scene, queue.take());
        queue.applied(&scene);
        assert_eq!(*scene.prims[&a], *done);
        let before = scene.prims[&a].clone();

        // The same again: the prim of before; something else: a new one, also with later edits.
        queue.edit(a, points(1.0)).unwrap();
        let same = queue.complete(a).unwrap().unwrap();
        assert!(Arc::ptr_eq(&before, &same));
        queue.edit(a, points(2.0)).unwrap();
        let new = queue.complete(a).unwrap().unwrap();
        assert!(apply(&mut scene, queue.take()));
        queue.applied(&scene);
        assert!(Arc::ptr_eq(&scene.prims[&a], &new));
        queue.edit(a, points(3.0)).unwrap();
        queue.complete(a).unwrap();
        queue.edit(a, points(4.0)).unwrap();
        apply(&mut scene, queue.take());
        let Geometry::Mesh(mesh) = &scene.prims[&a].geometry else {
            panic!("a mesh");
        };
        assert_eq!(mesh.points.points[0][0].x, 4.0, "the last edit wins");
    }

    #[test]
    fn prims_edited_by_turns_are_not_completed() {
        let mut queue = EditQueue::default();
        let a = queue.create(Kind::Mesh, "/a");
        let b = queue.create(Kind::Mesh, "/b");
        queue.edit(a, points(1.0)).unwrap();
        assert!(queue.complete(a).unwrap().is_none());
        assert!(queue.complete(b).unwrap().is_none());
        let mut scene = Scene::default();
        apply(&mut scene, queue.take());
        assert_eq!(scene.prims.len(), 2);
    }

    #[test]
    fn settings_and_aovs_do_not_overwrite_each_other() {
        let mut scene = Scene::default();
        let mut queue = EditQueue::default();
        queue.push(Change::Aovs(vec!["P".to_owned()])).unwrap();
        let settings = RenderSettings {
            samples: 3,
            ..RenderSettings::default()
        };
        queue.push(Change::Settings(Box::new(settings))).unwrap();
        assert!(apply(&mut scene, queue.take()));
        assert_eq!(scene.settings.aovs, ["P"]);
        assert_eq!(scene.settings.samples, 3);
    }

    #[test]
    fn a_camera_keeps_its_path_and_transform_and_leaves_with_its_role() {
        let mut scene = Scene::default();
        let mut queue = EditQueue::default();
        let id = queue.create(Kind::Camera, "/camera");
        let level = TransformSamples {
            times: vec![0.0],
            matrices: vec![glam::DMat4::IDENTITY],
            ..TransformSamples::default()
        };
        queue
            .edit(id, Edit::Transform(vec![level.clone()]))
            .unwrap();
        let lens = CameraDesc {
            f_stop: 2.0,
            ..CameraDesc::default()
        };
        queue.edit(id, Edit::Camera(Box::new(lens))).unwrap();
        queue.push(Change::ActiveCamera(Some(id))).unwrap();
        assert!(apply(&mut scene, queue.take()));
        let camera = &scene.cameras[&id];
        assert_eq!((camera.path.as_str(), camera.f_stop), ("/camera", 2.0));
        assert_eq!(camera.transform, [level]);

        queue.edit(id, Edit::Remove).unwrap();
        assert!(apply(&mut scene, queue.take()));
        assert_eq!(scene.active_camera, None);
        assert!(scene.cameras.is_empty());
    }
}
