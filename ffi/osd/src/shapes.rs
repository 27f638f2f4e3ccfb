//! [`SharedPatches`]: what is known of patches by their topology, shared by all meshes with the same
//! subdivision options and by all threads.

use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock};

use cxx::SharedPtr;

use crate::bridge::ffi;
use crate::domain::Parameterization;
use crate::patch::tree::Tree;
use crate::patch::{Shape, triangle};

/// More irregular topologies than this are not remembered: memory stays bounded on meshes where no
/// two vertices are alike.
const MOST_TREES: usize = 1 << 16;

/// Multiplications that finding a tree may take: about a fifth of a second on one core. An n-gon on its
/// own reaches it with 57 sides, a triangle at a vertex of valence n with n = 300. The library
/// evaluates what is larger.
const MOST_TREE_WORK: u64 = 1 << 28;

/// Weights that are asked for to find the patches of a sub-face: two for each of some 20 leaves, one for
/// each of some 20 cells that are cut.
const PROBES: u64 = 60;

/// Points that a patch's weights are gathered from.
const PATCH_CONTROLS: u64 = 20;

/// Multiplications that it takes the library to answer what [`Source::find_tree`] asks.
fn tree_work(info: &ffi::PatchInfo) -> u64 {
    let count = |n: i32| n.max(0) as u64;
    let (points, controls) = (count(info.point_count), count(info.control_count));
    let probes = count(info.face_size).saturating_mul(PROBES * PATCH_CONTROLS);
    // Weights of all points a probe; and the stencils, a row of controls a point times the controls.
    points.saturating_mul(probes.saturating_add(controls.saturating_mul(controls)))
}

/// Caches of one set of subdivision options.
pub(crate) struct SharedPatches {
    /// The library's own cache.
    pub(crate) cache: SharedPtr<ffi::PatchCache>,
    /// Shapes of irregular faces by the library's key.
    trees: RwLock<HashMap<u64, Shape>>,
    /// Regular triangles by the bits of their signature.
    triangles: RwLock<Vec<(Vec<u32>, Shape)>>,
}

impl SharedPatches {
    pub(crate) fn new() -> Self {
        Self {
            cache: ffi::make_cache(),
            trees: RwLock::default(),
            triangles: RwLock::default(),
        }
    }

    /// The shape of a patch that was just bound.
    pub(crate) fn shape(
        &self,
        patch: &ffi::Patch,
        info: &ffi::PatchInfo,
        source: &Source<'_>,
        known: &mut HashMap<u64, Shape>,
    ) -> Shape {
        if !info.valid || info.linear {
            return Shape::Library;
        }
        match (info.regular, source.is_loop) {
            (true, false) => Shape::BSpline(info.mask),
            (true, true) => self.triangle(patch.signature(), source),
            // The library's trees over triangles are not taken apart.
            (false, true) => Shape::Library,
            (false, false) if info.key == 0 || tree_work(info) > MOST_TREE_WORK => Shape::Library,
            (false, false) => known
                .entry(info.key)
                .or_insert_with(|| self.tree(info, source))
                .clone(),
        }
    }

    fn tree(&self, info: &ffi::PatchInfo, source: &Source<'_>) -> Shape {
        let trees = self.trees.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(shape) = trees.get(&info.key) {
            return shape.clone();
        }
        drop(trees);
        let shape = source
            .find_tree(info)
            .map_or(Shape::Library, |tree| Shape::Tree(Arc::new(tree)));
        let mut trees = self.trees.write().unwrap_or_else(PoisonError::into_inner);
        if trees.len() < MOST_TREES {
            trees.insert(info.key, shape.clone());
        }
        shape
    }

    fn triangle(&self, signature: &[f32], source: &Source<'_>) -> Shape {
        let same = |bits: &[u32]| bits.iter().zip(signature).all(|(b, s)| *b == s.to_bits());
        let triangles = self
            .triangles
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some((_, shape)) = triangles.iter().find(|(bits, _)| same(bits)) {
            return shape.clone();
        }
        drop(triangles);
        let shape = source
            .find_conversion()
            .map_or(Shape::Library, |conversion| {
                Shape::Triangle(Arc::new(conversion))
            });
        let bits = signature.iter().map(|s| s.to_bits()).collect();
        self.triangles
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .push((bits, shape.clone()));
        shape
    }
}

/// Where a patch came from, to ask the library about its weights.
pub(crate) struct Source<'a> {
    pub(crate) mesh: &'a ffi::Mesh,
    pub(crate) is_loop: bool,
    pub(crate) library_face: i32,
    pub(crate) channel: i32,
}

impl Source<'_> {
    fn weights(&self) -> Option<cxx::UniquePtr<ffi::Weights>> {
        ffi::make_weights(self.mesh, self.library_face, self.channel).ok()
    }

    fn find_tree(&self, info: &ffi::PatchInfo) -> Option<Tree> {
        let mut weights = self.weights()?;
        let parameterization = Parameterization::of_face(self.is_loop, info.face_size as usize);
        let sub_faces = match parameterization {
            Parameterization::SubFaces(n) => n,
            _ => 1,
        };
        let mut tree = Tree::find(sub_faces, |sub_face, u, v| {
            let (u, v) = match parameterization {
                Parameterization::SubFaces(n) => {
                    let [u0, v0] = ffi::sub_face_origin(n as i32, sub_face as i32);
                    (f64::from(u0) + 0.5 * u, f64::from(v0) + 0.5 * v)
                }
                _ => (u, v),
            };
            weights.pin_mut().at(u, v).ok().map(<[f64]>::to_vec)
        })?;
        tree.set_stencils(
            info.control_count as usize,
            weights.pin_mut().stencils().ok()?,
        );
        Some(tree)
    }

    fn find_conversion(&self) -> Option<triangle::Conversion> {
        let mut weights = self.weights()?;
        triangle::conversion(|u, v| weights.pin_mut().at(u, v).ok()?.try_into().ok())
    }
}
