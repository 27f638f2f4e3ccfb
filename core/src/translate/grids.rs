//! Grids that the host has diced itself: checked, and placed along a path.

use glam::Vec3;

use super::points::{Bends, PointKeys, point_keys};
use super::primvar::{Count, Counts, Resolved, Spread};
use crate::diagnostics::{Code, Warning};
use crate::grid::{DicedMesh, Grid, MAX_GRID_RATE};
use crate::motion::{PointPath, Shutter};
use crate::scene::{GridsDesc, Interpolation, PointsSamples};

/// Checked grids: vertices of all grids, concatenated, at each key.
#[derive(Clone, Debug)]
pub struct CheckedGrids {
    grids: Vec<Grid>,
    /// Vertices at keys, in object space.
    pub points: PointKeys,
}

/// Checks `desc`; `None` when nothing is left.
pub fn check(
    path: &str,
    desc: &GridsDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedGrids> {
    let mut grids = Vec::with_capacity(desc.grids.len());
    let mut vertex_count = 0usize;
    for &(nu, nv, element) in &desc.grids {
        let side = 1..=MAX_GRID_RATE as u16;
        if !(side.contains(&nu) && side.contains(&nv)) {
            let text =
                format!("a grid of {nu} x {nv} micropolygons; 1 to 16 are possible; dropped");
            warnings.push(Warning::new(path, Code::Topology, text));
            return None;
        }
        let first_vertex = u32::try_from(vertex_count).ok()?;
        let grid = Grid {
            first_vertex,
            element,
            nu,
            nv,
        };
        vertex_count += grid.vertex_count();
        grids.push(grid);
    }
    let keys = desc.times.len();
    if grids.is_empty() || keys == 0 {
        return None;
    }
    if desc.positions.len() != vertex_count * keys {
        let text = format!(
            "{} grids with {keys} keys need {} positions, {} are given; the prim is dropped",
            grids.len(),
            vertex_count * keys,
            desc.positions.len()
        );
        warnings.push(Warning::new(path, Code::Topology, text));
        return None;
    }
    // [grid][key][vertex] to [key][all vertices].
    let mut samples = PointsSamples {
        times: desc.times.clone(),
        points: Vec::new(),
        ..PointsSamples::default()
    };
    for key in 0..keys {
        let mut points: Vec<Vec3> = Vec::with_capacity(vertex_count);
        for grid in &grids {
            let n = grid.vertex_count();
            points.extend(&desc.positions[grid.first_vertex as usize * keys + key * n..][..n]);
        }
        samples.points.push(points.into());
    }
    let none = Bends::Samples(2); // there are no rates
    let points = point_keys(path, &samples, vertex_count, shutter, none, warnings)?;
    Some(CheckedGrids { grids, points })
}

impl CheckedGrids {
    /// Primvars are constant, or uniform by element.
    pub fn primvar_counts(&self) -> Counts {
        let last = self.grids.iter().map(|g| g.element as usize + 1).max();
        Counts {
            uniform: Count(last.unwrap_or(0), "elements"),
            more_is_fine: true,
            ..Counts::one_value("grids")
        }
    }

    /// Spreads a primvar that was resolved with [`CheckedGrids::primvar_counts`].
    pub fn spread<C>(resolved: Resolved) -> Spread<C> {
        match resolved.interpolation {
            Interpolation::Uniform => Spread::Uniform(resolved.into_items()),
            _ => resolved.into_constant(),
        }
    }

    /// The diced mesh along `path`. Shading is flat: grids carry no normals.
    pub fn place(&self, path: &PointPath) -> DicedMesh {
        let vertex_count = self.points.points[0].len();
        let mut mesh = DicedMesh {
            origin: path.origin(),
            key_times: path.key_times().to_vec(),
            grids: self.grids.clone(),
            vertex_count,
            ..DicedMesh::default()
        };
        // Where there is no room, adding to them says so.
        let _ = mesh.reserve_positions(vertex_count);
        let (mut limit, mut placed) = (Vec::new(), Vec::new());
        for grid in &self.grids {
            let n = grid.vertex_count();
            limit.clear();
            for key in &self.points.points {
                limit.extend_from_slice(&key[grid.first_vertex as usize..][..n]);
            }
            path.map_positions(&limit, n, &mut placed);
            mesh.positions.extend_from_slice(&placed);
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::sync::Arc;

    #[test]
    fn keys_are_regrouped_and_placed() {
        let corner = |g: f32, k: f32| {
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .map(|(x, y)| Vec3::new(x + 10.0 * g, y, k))
        };
        let mut positions = Vec::new();
        for g in 0..2 {
            for k in 0..2 {
                positions.extend(corner(g as f32, k as f32));
            }
        }
        let desc = GridsDesc {
            times: vec![0.0, 1.0],
            grids: vec![(1, 1, 0), (1, 1, 7)],
            positions: Arc::new(positions.clone()),
        };
        let mut warnings = Vec::new();
        let shutter = Shutter {
            open: 0.0,
            close: 1.0,
        };
        let checked = check("/g", &desc, shutter, &mut warnings).unwrap();
        let mesh = checked.place(&PointPath::identity(&checked.points.times, DVec3::ZERO));
        assert!(warnings.is_empty());
        assert_eq!(mesh.positions, positions);
        let short = GridsDesc {
            positions: Arc::new(vec![Vec3::ZERO; 3]),
            ..desc
        };
        assert!(check("/g", &short, shutter, &mut warnings).is_none());
        assert_eq!(warnings.len(), 1);
    }
}
