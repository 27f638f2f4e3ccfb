//! What a commit leaves behind: everything that rays need, immutable and shared.

use std::collections::HashMap;
use std::sync::Arc;

use super::chains::Chain;
use super::objects::PrimObjects;
use crate::aov::{Aov, PrimvarAov};
use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::diagnostics::Warning;
use crate::effects::EffectPlan;
use crate::motion::Shutter;
use crate::scene::{CameraDesc, PrimDesc, PrimId, RenderSettings};
use crate::shade::{PrimShading, Source};
use crate::trace::world::WorldStats;
use crate::trace::{Hit, Side, Winding, World};

/// A prim as rays meet it.
#[derive(Debug)]
pub(super) struct PreparedPrim {
    pub path: String,
    pub pick_id: i32,
    /// See [`crate::scene::PrimCommon::matte`].
    pub matte: bool,
    /// See [`crate::scene::PrimCommon::double_sided`].
    pub double_sided: bool,
    /// The side that rays pass through.
    pub culled: Option<Side>,
    /// Of each authored face the number of its subset, or -1; empty where the AOV is not asked for, or
    /// there are none.
    pub subsets: Vec<i32>,
    pub objects: Arc<PrimObjects>,
    /// Its own, with what instancers give it.
    pub shading: PrimShading,
    /// The primvar of each of [`Prepared::primvar_aovs`], in their order.
    pub primvars: Vec<Option<Arc<Source>>>,
}

impl PreparedPrim {
    /// The number of the subset that an authored face is in, or -1.
    pub fn subset_of(&self, element: u32) -> i32 {
        self.subsets.get(element as usize).copied().unwrap_or(-1)
    }
}

/// One entry a set of instances of the world: which prim appears.
#[derive(Clone, Debug)]
pub(super) struct SetEntry {
    pub prim: u32,
    /// Which of the prim's sets.
    pub placed: u32,
    /// Where the fronts of facets are; of meshes that store normals, these know.
    pub facets: Winding,
}

/// What a prim was prepared from, to know it again.
#[derive(Clone, Debug)]
pub(super) struct CacheEntry {
    pub desc: Arc<PrimDesc>,
    pub chain: Chain,
    pub objects: Arc<PrimObjects>,
}

/// Counts and times of a commit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // named after what they count; bytes and seconds
pub struct PrepareStatistics {
    pub prims: u64,
    pub instances: u64,
    pub objects: u64,
    pub grids: u64,
    pub micropolygons: u64,
    pub limit_evaluations: u64,
    pub geometry_bytes: u64,
    pub bvh_bytes: u64,
    pub bvh_nodes: u64,
    /// Whole commit, wall clock.
    pub total_seconds: f64,
    /// Checking, surfaces and paths, summed over prims (threads add up).
    pub translate_seconds: f64,
    /// Dicing, summed over prims.
    pub dice_seconds: f64,
    /// Building trees over grids, summed over prims.
    pub build_seconds: f64,
    /// Building the tree over instances, wall clock.
    pub world_seconds: f64,
    /// Prims diced by this commit.
    pub objects_diced: u64,
    /// Prims taken over from the commit before.
    pub objects_reused: u64,
    /// Those of them that were placed anew: only their grids were taken over.
    pub objects_placed: u64,
    /// Parts of prims that are diced when a ray first comes near them.
    pub clusters: u64,
    /// Those of them that none has come near by now; they count nowhere else.
    pub clusters_culled: u64,
    /// About how many micropolygons these would have.
    pub micropolygons_culled: u64,
}

impl PrepareStatistics {
    /// Counts what an object has.
    pub(super) fn add_object(&mut self, object: &ObjectGeometry) {
        let stats = object.stats();
        self.grids += object.mesh().grids.len() as u64;
        self.micropolygons += stats.cells;
        self.geometry_bytes += stats.mesh_bytes;
        self.bvh_bytes += stats.bvh_bytes;
        self.bvh_nodes += stats.nodes + stats.blocks;
    }
}

/// A scene, ready to render.
#[derive(Debug)]
pub struct Prepared {
    pub(super) settings: Arc<RenderSettings>,
    pub(super) camera_desc: Arc<CameraDesc>,
    pub(super) camera: Camera,
    pub(super) shutter: Shutter,
    pub(super) aovs: Vec<Aov>,
    pub(super) primvar_aovs: Vec<Arc<PrimvarAov>>,
    pub(super) world: World,
    pub(super) prims: Vec<PreparedPrim>,
    pub(super) sets: Vec<SetEntry>,
    pub(super) plan: EffectPlan,
    pub(super) statistics: PrepareStatistics,
    pub(super) cache: HashMap<PrimId, CacheEntry>,
}

impl Prepared {
    /// The set and the prim of a hit.
    pub(super) fn hit_prim(&self, hit: &Hit) -> (&SetEntry, &PreparedPrim) {
        let entry = &self.sets[self.world.user(hit).unwrap_or(0) as usize];
        (entry, &self.prims[entry.prim as usize])
    }

    /// Which instance of an instancer a hit is in; `level` is the number of the instancer for the prim.
    pub(super) fn instance(&self, hit: &Hit, level: usize) -> usize {
        let (entry, prim) = self.hit_prim(hit);
        let placed = &prim.objects.placed[entry.placed as usize];
        match placed.numbers.get(level) {
            Some(numbers) => {
                let of = self.world.number_in_set(hit).and_then(|i| numbers.get(i));
                of.map_or(usize::MAX, |&number| number as usize)
            }
            None => {
                let id = self.world.instance_id(hit);
                id.and_then(|id| usize::try_from(id).ok())
                    .unwrap_or(usize::MAX)
            }
        }
    }

    /// Counts and times of the commit, and of what rays have had diced by now.
    pub fn statistics(&self) -> PrepareStatistics {
        let mut statistics = self.statistics;
        for prim in &self.prims {
            if let Some(on_demand) = &prim.objects.on_demand {
                on_demand.add_to(&mut statistics);
            }
        }
        // Trees that were left for later are made by now, or are not.
        if self.settings.backend.is_gpu() {
            let WorldStats {
                object,
                top_nodes,
                top_bytes,
                ..
            } = self.world.stats();
            statistics.bvh_bytes = object.bvh_bytes + top_bytes;
            statistics.bvh_nodes = object.nodes + object.blocks + top_nodes;
        }
        statistics
    }

    /// What went wrong in dicing on demand by now, in prim order.
    pub fn late_warnings(&self) -> Vec<Warning> {
        let of = |prim: &PreparedPrim| prim.objects.on_demand.as_ref()?.warning(&prim.path);
        self.prims.iter().filter_map(of).collect()
    }

    /// The effect plan.
    pub fn plan(&self) -> &EffectPlan {
        &self.plan
    }

    /// The effect plan and the size of the scene, as text for people; `backend` is what renders.
    pub fn explain(&self, backend: &str) -> String {
        let s = &self.statistics();
        let culled = match s.clusters {
            0 => String::new(),
            all => format!(
                "occlusion culling: {} of {all} clusters are not diced yet, about {} micropolygons\n",
                s.clusters_culled, s.micropolygons_culled,
            ),
        };
        let [width, height] = self.settings.resolution;
        let window = self.settings.data_window.map_or(String::new(), |w| {
            format!(" (data window {} {} to {} {})", w[0], w[1], w[2], w[3])
        });
        format!(
            "camera: {}\nimage: {width} x {height}{window}, {} samples a pixel, shading rate {}\n\
             shutter: {} to {} time codes\n{}backend: {backend}\n\
             scene: {} prims, {} instances, {} grids, {} micropolygons\n{culled}",
            self.camera_desc.path,
            self.settings.samples,
            self.settings.shading_rate,
            self.shutter.open,
            self.shutter.close,
            self.plan,
            s.prims,
            s.instances,
            s.grids,
            s.micropolygons,
        )
    }

    /// Settings of the render.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The world that rays are traced in.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// AOVs to render.
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }
}
