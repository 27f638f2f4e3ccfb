//! The effect plan: which effects this scene, camera and these settings call for, and who called.
//! An effect that nothing calls for costs no time and no memory: kernels, nodes and buffers follow
//! the plan.

use std::fmt;

/// How time enters a render.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum TimePlan {
    /// Nothing moves: no time is drawn.
    #[default]
    Still,
    /// Only the camera moves: rays move, geometry is static.
    CameraOnly,
    /// Geometry moves, at most this many straight segments a vertex.
    Segments(usize),
}

/// The plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EffectPlan {
    /// Motion.
    pub time: TimePlan,
    /// Path of the prim or camera with the most segments.
    pub time_by: Option<String>,
    /// Why nothing moves, where something could have.
    pub time_note: Option<String>,
    /// Path of the first prim with a primvar in use that changes while the shutter is open.
    pub primvar_time_by: Option<String>,
    /// Lens radius in scene units, the largest while the shutter is open; 0 for a pinhole.
    pub lens_radius: f32,
    /// Lens, film back or exposure change while the shutter is open.
    pub lens_changes: bool,
    /// Path of the camera with the lens.
    pub lens_by: Option<String>,
    /// Path of the first prim that is not opaque.
    pub transparency_by: Option<String>,
    /// Path of the first prim that is a matte object (a holdout).
    pub matte_by: Option<String>,
    /// Path of the first prim with a side that rays pass through.
    pub culled_by: Option<String>,
    /// Number of instances traced through a moving matrix.
    pub moving_instances: usize,
    /// Number of prims lit by the camera light.
    pub camera_light: bool,
}

impl EffectPlan {
    /// True when samples draw a time.
    pub fn has_time(&self) -> bool {
        self.time != TimePlan::Still || self.primvar_time_by.is_some()
    }

    /// True when samples draw a lens point.
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0
    }

    /// True when a ray may pass through a surface.
    pub fn has_transparency(&self) -> bool {
        self.transparency_by.is_some()
    }

    /// True when rays pass through one side of a surface.
    pub fn has_culling(&self) -> bool {
        self.culled_by.is_some()
    }

    /// True when a surface may hold out what lies behind it.
    pub fn has_matte(&self) -> bool {
        self.matte_by.is_some()
    }
}

impl fmt::Display for EffectPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = |path: &Option<String>| {
            path.as_ref()
                .map_or(String::new(), |p| format!(", called for by {p}"))
        };
        match &self.time {
            TimePlan::Still if self.primvar_time_by.is_some() => {
                writeln!(f, "time: primvars only; geometry is static")?;
            }
            TimePlan::Still => {
                let why = self
                    .time_note
                    .as_deref()
                    .unwrap_or("nothing moves while it is open");
                writeln!(f, "time: still ({why})")?;
            }
            TimePlan::CameraOnly => {
                writeln!(
                    f,
                    "time: camera only{}; geometry is static",
                    by(&self.time_by)
                )?;
            }
            TimePlan::Segments(1) => writeln!(f, "time: linear{}", by(&self.time_by))?,
            TimePlan::Segments(n) => writeln!(f, "time: {n} segments{}", by(&self.time_by))?,
        }
        if self.primvar_time_by.is_some() {
            let by = by(&self.primvar_time_by);
            writeln!(f, "primvars: time-sampled{by}")?;
        }
        if self.moving_instances > 0 {
            writeln!(f, "moving instances: {}", self.moving_instances)?;
        }
        let changes = if self.lens_changes {
            ", changing over the shutter"
        } else {
            ""
        };
        if self.has_lens() {
            writeln!(
                f,
                "lens: thin, radius {}{changes}{}",
                self.lens_radius,
                by(&self.lens_by)
            )?;
        } else {
            writeln!(f, "lens: pinhole{changes}")?;
        }
        match &self.transparency_by {
            Some(path) => writeln!(f, "opacity: transparent, called for by {path}")?,
            None => writeln!(f, "opacity: opaque")?,
        }
        if self.has_culling() {
            writeln!(f, "culled sides: some{}", by(&self.culled_by))?;
        }
        if self.has_matte() {
            writeln!(f, "matte objects: some{}", by(&self.matte_by))?;
        }
        let light = if self.camera_light {
            "camera light, no shadows"
        } else {
            "none"
        };
        writeln!(f, "light: {light}")
    }
}
