//! Split and dice: limit surfaces to watertight micropolygon grids at a shading rate in raster
//! space (Cook, Carpenter, Catmull, "The Reyes Image Rendering Architecture", SIGGRAPH 1987; Fisher
//! et al., "DiagSplit: Parallel, Crack-free, Adaptive Tessellation", SIGGRAPH Asia 2009).
//!
//! `metric` measures in pixels, worst case over the shutter.

pub mod metric;

pub use metric::{RasterMetric, RasterView};
