//! What a session takes to a GPU, and what it tells of that.

use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::diagnostics::{Code, Warning};
use hdtrapeze_core::render::Prepared;
use hdtrapeze_core::scene::{Backend, RenderSettings};
use hdtrapeze_gpu::{EarlyVertices, GpuFrame};

use super::Session;
use crate::backend;
use crate::error::Error;

/// What is told where the AOV cost is asked of a GPU.
const NO_COST: &str = "the AOV cost is 0 where a GPU traces, since none counts what it tests";

impl Session {
    /// What is prepared, on a GPU where one is asked for, and what renders and why; `before` is what it replaces, `early`
    /// what is there already. A scene that a GPU does not take is rendered on the CPU.
    pub(super) fn upload(
        &self,
        prepared: &Prepared,
        before: Option<Arc<GpuFrame>>,
        early: Option<&EarlyVertices>,
    ) -> Result<(Option<Arc<GpuFrame>>, String), Error> {
        let asked = prepared.settings().backend;
        self.tell_auto(asked);
        let stages = match backend::open(asked) {
            Ok(Some(stages)) => stages,
            Ok(None) => return Ok((None, backend::cpu(asked))),
            // It was there when it was chosen.
            Err(error) if asked == Backend::AutoGpu => return Ok(self.falls_back(&error)),
            Err(error) => return Err(error),
        };
        let options = backend::gpu_options()?;
        // Nobody else renders it any more. It keeps the way it was taken there.
        let before = before.and_then(Arc::into_inner);
        let before = before.filter(|gpu| gpu.is_of(&stages, &options));
        let upload = || match before {
            Some(before) => before.after_early(prepared, early),
            None => GpuFrame::with_early(options, stages, prepared, early),
        };
        match self.shared.guard(upload)? {
            Ok(gpu) => {
                let mut told = gpu.explain();
                if prepared.aovs().contains(&Aov::Cost) {
                    self.warn(&[Warning::new("", Code::Unsupported, NO_COST)]);
                    told = format!("{told}; {NO_COST}");
                }
                if let Some(auto) = backend::auto_of(asked) {
                    told = format!("{told} (auto: {})", auto.why);
                }
                Ok((Some(Arc::new(gpu)), told))
            }
            Err(error) => Ok(self.falls_back(&error)),
        }
    }

    /// Tells that the CPU renders what a GPU was to, and why.
    fn falls_back(&self, why: &dyn Display) -> (Option<Arc<GpuFrame>>, String) {
        let text = format!("{why}; the CPU renders");
        self.warn(&[Warning::new("", Code::Backend, text)]);
        (None, backend::cpu_since(&why.to_string()))
    }

    /// Tells what the backend auto is where a GPU was tried for it: once a process, as a warning where the trial has just failed.
    fn tell_auto(&self, asked: Backend) {
        static TOLD: AtomicBool = AtomicBool::new(false);
        let Some(auto) = backend::auto_of(asked).filter(|auto| auto.tried) else {
            return;
        };
        if !TOLD.swap(true, Ordering::Relaxed) {
            self.with_log(|| match auto.fails {
                true => tracing::warn!("the backend auto is {auto}"),
                false => tracing::info!("the backend auto is {auto}"),
            });
        }
    }
}

/// Takes vertices to the GPU as they are diced, where one is to render with these settings.
pub(super) fn early_vertices(settings: &RenderSettings) -> Option<EarlyVertices> {
    // What is wrong with it is told once the scene is to go there.
    let stages = backend::open(settings.backend).ok()??;
    EarlyVertices::for_frame(&stages, &backend::gpu_options().ok()?)
}
