//! The session: one scene, one renderer, one image at a time.
//!
//! Locks, in the order in which they are taken: `work` (held through a commit or start; who holds
//! it owns the scene and the render thread), then for moments `ahead`, `edits` or the status. Readers take
//! the status only, so they never wait for a commit.

mod gpu;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use hdtrapeze_core::aov::{Aov, AovImage};
use hdtrapeze_core::diagnostics::{Code, Warning};
use hdtrapeze_core::dump::dump;
use hdtrapeze_core::memory;
use hdtrapeze_core::render::{
    Elsewhere, Frame, Prepared, RayTracer, RenderControl, RenderStatistics, Watcher, WorldHit,
    WorldRay, prepare_with, render_with,
};
use hdtrapeze_core::scene::{PrimId, RenderSettings, Scene};
use hdtrapeze_core::surface::SubdivisionFactory;
use hdtrapeze_gpu::{EarlyBytes, EarlyVertices, GpuFrame};
use tracing::Level;
use tracing::dispatcher::with_default;

use crate::ahead::Ahead;
use crate::aov::AovShape;
use crate::edit::{Change, Edit, EditQueue, Edits, Kind, apply};
use crate::engine::{
    MISS, NO_RAY, current_statistics, is_traceable, new_frame, prepare_error, prepare_statistics,
};
use crate::error::{Error, try_map};
use crate::file::{self, ImageOptions};
use crate::image::Image;
use crate::log::{LogFn, in_log_callback};
use crate::plan::PlannedFiles;
use crate::pool::Pool;
use crate::primvar::{self, AuthoredPrimvar};
use crate::product::RenderVar;
use crate::progress::{Progress, State, Statistics};
use crate::status::{Committed, Rendered, Shared, lock};
use crate::translate::{self, AuthoredTopology};
use gpu::early_vertices;

/// See the module. Every method may be called from any thread.
///
/// After a panic of the renderer every method returns [`Error::Poisoned`]; dropping still works.
/// Methods that wait return [`Error::Busy`] inside a log function.
pub struct Session {
    shared: Arc<Shared>,
    factory: Arc<dyn SubdivisionFactory>,
    edits: Mutex<EditQueue>,
    ahead: Mutex<Option<Ahead>>,
    work: Mutex<Work>,
    pub(crate) planned: Mutex<PlannedFiles>,
}

/// What belongs to whoever commits.
#[derive(Default)]
struct Work {
    scene: Scene,
    version: u64,
    /// The scene was prepared as it is.
    current: bool,
    /// The last preparation, whose objects the next one takes over.
    previous: Option<Arc<Prepared>>,
    /// The same on a GPU.
    gpu: Option<Arc<GpuFrame>>,
    pool: Option<(u32, Arc<Pool>)>,
    renderer: Option<JoinHandle<()>>,
}

impl Session {
    /// An empty session that subdivides with `factory`.
    pub fn new(factory: Box<dyn SubdivisionFactory>) -> Self {
        Self {
            shared: Shared::new(),
            factory: factory.into(),
            edits: Mutex::default(),
            ahead: Mutex::default(),
            work: Mutex::default(),
            planned: Mutex::default(),
        }
    }

    /// Sets the function that receives messages of up to `level`, or none. When this returns, the
    /// function before is not running and will not be called again.
    pub fn set_log(&self, log: Option<LogFn>, level: Level) -> Result<(), Error> {
        self.may_wait()?;
        self.shared.log.set(log, level);
        Ok(())
    }

    /// Queues a prim or camera; `path` names it in messages.
    pub fn create(&self, kind: Kind, path: &str) -> Result<PrimId, Error> {
        self.shared.check()?;
        Ok(lock(&self.edits).create(kind, path))
    }

    /// Kind and path of a prim or camera.
    pub fn find(&self, id: PrimId) -> Result<(Kind, Arc<str>), Error> {
        self.shared.check()?;
        lock(&self.edits).find(id)
    }

    /// Queues an edit of a prim or camera.
    pub fn edit(&self, id: PrimId, edit: Edit) -> Result<(), Error> {
        self.shared.check()?;
        lock(&self.edits).edit(id, edit)
    }

    /// Tells that all edits of a prim have been queued, so that it can be prepared while the host goes
    /// on with others. A hint: it changes nothing but when the work is done. It is taken where the
    /// active camera and the settings are known and no commit is running.
    pub fn complete(&self, id: PrimId) -> Result<(), Error> {
        self.shared.check()?;
        let mut edits = lock(&self.edits);
        let Some(prim) = edits.complete(id)? else {
            return Ok(());
        };
        let version = edits.view_version();
        let is_new = !edits.is_committed(id, &prim);
        drop(edits);
        if !is_new || in_log_callback() {
            return Ok(());
        }
        let Ok(mut work) = self.work.try_lock() else {
            return Ok(());
        };
        let mut ahead = lock(&self.ahead);
        if ahead
            .as_ref()
            .is_none_or(|ahead| ahead.view_version != version)
        {
            *ahead = None;
            let view = lock(&self.edits).view();
            let threads = view.settings.threads;
            let pool = self.pool(&mut work, threads)?;
            let early = early_vertices(&view.settings);
            *ahead = Ahead::new(&view, version, &self.factory, &self.shared, pool, early);
        }
        if let Some(ahead) = &*ahead {
            ahead.begin(id, prim);
        }
        Ok(())
    }

    /// Queues a mesh's topology. Creases and corners whose lists do not fit each other are dropped
    /// with a warning.
    pub fn set_topology(&self, id: PrimId, from: &AuthoredTopology<'_>) -> Result<(), Error> {
        let (_, path) = self.find(id)?;
        let (topology, dropped) = translate::topology(from)?;
        self.edit(id, Edit::Topology(Arc::new(topology)))?;
        let warnings = dropped
            .into_iter()
            .map(|text| Warning::new(&*path, Code::Topology, text));
        self.warn(&warnings.collect::<Vec<_>>());
        Ok(())
    }

    /// Queues a primvar of a prim. Whole numbers that do not fit 32 bits give a warning.
    pub fn set_primvar(
        &self,
        id: PrimId,
        name: &str,
        from: &AuthoredPrimvar<'_>,
    ) -> Result<(), Error> {
        let (_, path) = self.find(id)?;
        let (desc, clipped) = primvar::primvar(from)?;
        self.edit(id, Edit::Primvar(name.to_owned(), Some(desc)))?;
        if clipped > 0 {
            let text = format!(
                "primvar {name} has {clipped} numbers that do not fit 32 bits; the nearest that do \
                 are taken"
            );
            self.warn(&[Warning::new(&*path, Code::PrimvarLength, text)]);
        }
        Ok(())
    }

    /// Refuses what is not a camera.
    pub(crate) fn check_camera(&self, id: PrimId) -> Result<(), Error> {
        lock(&self.edits).check_camera(id)
    }

    /// Edits that were queued so far.
    pub fn edits(&self) -> Edits {
        lock(&self.edits).edits()
    }

    /// Queues which camera to render through, or none.
    pub fn set_active_camera(&self, camera: Option<PrimId>) -> Result<(), Error> {
        self.push(Change::ActiveCamera(camera))
    }

    /// Queues settings; their AOVs are ignored, see [`Session::set_aovs`].
    pub fn set_settings(&self, settings: RenderSettings) -> Result<(), Error> {
        self.push(Change::Settings(Box::new(settings)))
    }

    /// Queues the AOVs to render.
    pub fn set_aovs(&self, names: Vec<String>) -> Result<(), Error> {
        self.push(Change::Aovs(names))
    }

    fn push(&self, change: Change) -> Result<(), Error> {
        self.shared.check()?;
        lock(&self.edits).push(change)
    }

    /// Applies queued edits in order, dices and builds. Stops a running render first, unless
    /// nothing changes.
    pub fn commit(&self) -> Result<(), Error> {
        self.may_wait()?;
        let work = &mut *lock(&self.work);
        self.shared.check()?;
        self.apply_edits(work, EditQueue::take);
        if work.current {
            return Ok(());
        }
        self.stop(work);
        let cancel = self.shared.begin();
        let result = self.prepare(work, &cancel).map(|_| ());
        self.shared.end(match &result {
            Ok(()) => State::Idle,
            Err(Error::Cancelled) => State::Cancelled,
            Err(_) => State::Failed,
        });
        result
    }

    /// Commits, then renders from the first sample on a thread of the session.
    pub fn start(&self) -> Result<(), Error> {
        self.start_with(EditQueue::take, &|| false)
    }

    /// The same with the edits that were sealed, whole, and none of those after: a view of theirs, with
    /// its AOVs. What is given up takes none, and what is given up as it begins is cancelled.
    pub(crate) fn start_sealed(
        &self,
        camera: Option<PrimId>,
        settings: &RenderSettings,
        is_given_up: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        self.start_with(|edits| edits.take_sealed(camera, settings), is_given_up)
    }

    /// Seals the edits so far, and tells how many there were ever.
    pub(crate) fn seal(&self) -> Edits {
        lock(&self.edits).seal()
    }

    fn start_with(
        &self,
        take: impl FnOnce(&mut EditQueue) -> Vec<Change>,
        is_given_up: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        self.may_wait()?;
        let work = &mut *lock(&self.work);
        self.shared.check()?;
        if is_given_up() {
            return Err(Error::Cancelled);
        }
        self.apply_edits(work, take);
        self.stop(work);
        let cancel = self.shared.begin();
        // An interrupt before this had nothing to cancel.
        if is_given_up() {
            self.shared.request_cancel();
        }
        let result = match work.current {
            true => self.committed(),
            false => self.prepare(work, &cancel),
        };
        let result = result.and_then(|committed| self.launch(work, committed, cancel));
        if let Err(error) = &result {
            self.shared.end(match error {
                Error::Cancelled => State::Cancelled,
                _ => State::Failed,
            });
        }
        result
    }

    /// Waits until no commit or render is running, at most so long; true when none is.
    pub fn wait(&self, limit: Option<Duration>) -> Result<bool, Error> {
        self.may_wait()?;
        let ended = self.shared.wait(limit);
        self.shared.check()?;
        Ok(ended)
    }

    /// Asks a running commit or render to stop, and does not wait.
    pub fn interrupt(&self) -> Result<(), Error> {
        self.shared.check()?;
        self.shared.request_cancel();
        Ok(())
    }

    /// Cancels a running commit or render and waits until it has stopped; keeps what was rendered. What
    /// another thread starts meanwhile is not waited for.
    pub fn cancel(&self) -> Result<(), Error> {
        self.may_wait()?;
        let cancelled = self.shared.request_cancel();
        self.shared.wait_for(&cancelled);
        self.shared.check()
    }

    /// Has renders wait with the samples that they have, from the next tile on, or go on. A commit goes
    /// on to its end; a render that is started during a pause waits before its first sample.
    pub fn pause(&self, paused: bool) -> Result<(), Error> {
        self.shared.check()?;
        self.shared.pause(paused);
        Ok(())
    }

    /// How far the session is.
    pub fn progress(&self) -> Result<Progress, Error> {
        self.shared.check()?;
        let status = self.shared.status();
        Ok(status.run.progress(status.state, Instant::now()))
    }

    /// Numbers of the last commit and the last render that ended.
    pub fn statistics(&self) -> Result<Statistics, Error> {
        self.shared.check()?;
        let peak_bytes = memory::peak_bytes().unwrap_or(0);
        let status = self.shared.status();
        let known = Statistics {
            peak_bytes,
            ..status.statistics
        };
        let prepared = status.committed.as_ref().map(|c| Arc::clone(&c.prepared));
        drop(status);
        Ok(match prepared {
            Some(prepared) => current_statistics(&known, &prepared),
            None => known,
        })
    }

    /// Which effects the committed scene calls for, and which prim called for each.
    pub fn explain(&self) -> Result<String, Error> {
        self.shared.check()?;
        let Committed {
            prepared, backend, ..
        } = self.committed()?;
        self.shared.guard(|| prepared.explain(&backend))
    }

    /// The scene with all queued edits as text, its samples resolved to the shutter; nothing is
    /// diced. A running render goes on with what it had.
    pub fn dump(&self) -> Result<String, Error> {
        self.may_wait()?;
        let work = lock(&self.work);
        self.shared.check()?;
        // Edits stay in the queue: a render may be waiting for those before a certain one.
        let mut scene = work.scene.clone();
        apply(&mut scene, lock(&self.edits).all());
        drop(work);
        self.shared.guard(|| dump(&scene))
    }

    /// Writes what [`Session::dump`] gives to a file, which is complete or stays as it was.
    pub fn write_dump(&self, path: &Path) -> Result<(), Error> {
        file::write_text(path, &self.dump()?)
    }

    /// The nearest hit of each ray in the committed scene.
    pub fn trace(&self, rays: &[WorldRay]) -> Result<Vec<WorldHit>, Error> {
        self.shared.check()?;
        let Committed { prepared, pool, .. } = self.committed()?;
        // Rays that cannot be traced are replaced by one that ends before it begins.
        let checked = try_map(rays, |ray| match is_traceable(ray) {
            true => *ray,
            false => NO_RAY,
        })?;
        let mut hits = try_map(rays, |_| MISS)?;
        self.shared
            .guard(|| pool.install(|| prepared.trace_world(&checked, &mut hits)))?;
        Ok(hits)
    }

    /// Size and type of an AOV of the last render that was started.
    pub fn describe_aov(&self, name: &str) -> Result<AovShape, Error> {
        let (rendered, aov) = self.rendered_aov(name)?;
        Ok(AovShape::new(&aov, &rendered.frame))
    }

    /// An AOV of the last render that was started, as far as it is.
    pub fn aov(&self, name: &str) -> Result<AovImage, Error> {
        let (rendered, aov) = self.rendered_aov(name)?;
        let needed = AovShape::new(&aov, &rendered.frame).bytes();
        memory::check(needed, "reading an AOV")?;
        let image = self.shared.guard(|| rendered.frame.aov(aov))?;
        image.ok_or_else(|| file::not_rendered(name))
    }

    /// Writes AOVs of the last render to a file.
    pub fn write_image(&self, path: &Path, options: &ImageOptions) -> Result<(), Error> {
        self.shared.check()?;
        let rendered = self.rendered()?;
        let frame = &rendered.frame;
        let [width, height] = rendered.resolution;
        let aovs = file::choose(options, frame.aovs())?;
        let shapes = aovs.iter().map(|aov| AovShape::new(aov, frame));
        // Once as layers, once more while the file is encoded.
        memory::check(
            2 * shapes.map(|shape| shape.bytes()).sum::<u64>(),
            "an image file",
        )?;
        let written = self.shared.guard(|| {
            let mut image = Image::new(width, height);
            image.pixel_aspect = rendered.pixel_aspect;
            image.window = frame.window();
            image.data_window = frame.data_window();
            let (layers, warnings) = file::layers(options, frame.aovs(), |aov| frame.aov(aov))?;
            image.layers = layers;
            image.metadata = rendered.facts;
            let done = frame.samples_done().to_string();
            file::set_fact(&mut image.metadata, "hdtrapeze/samplesDone", done);
            for (name, value) in &options.metadata {
                file::set_fact(&mut image.metadata, name, value.clone());
            }
            let beside = options.partial.then(|| file::partial(path));
            if options.partial {
                file::set_fact(
                    &mut image.metadata,
                    "hdtrapeze/complete",
                    "false".to_owned(),
                );
            }
            file::write(beside.as_deref().unwrap_or(path), &image, options)?;
            Ok::<_, Error>(warnings)
        })?;
        self.warn(&written?);
        Ok(())
    }

    /// Name of the AOV that a render var is written from. What it asks for that is not done gives
    /// one warning.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a var that has to be left out.
    pub fn render_var_aov(&self, var: &RenderVar) -> Result<String, Error> {
        self.shared.check()?;
        let source = var.source().and_then(|source| {
            match source.is_primvar() || Aov::from_name(&source.aov).is_some() {
                true => Ok(source.aov),
                false => Err(format!("the renderer has no AOV {}", source.aov)),
            }
        });
        match source {
            Ok(aov) => {
                self.warn(var.check_type().as_slice());
                Ok(aov)
            }
            Err(why) => {
                let text = format!("{why}; the var is left out");
                self.warn(&[Warning::new(&var.path, Code::Unsupported, text)]);
                Err(Error::Unsupported(why))
            }
        }
    }

    fn rendered_aov(&self, name: &str) -> Result<(Rendered, Aov), Error> {
        self.shared.check()?;
        let rendered = self.rendered()?;
        let aov = rendered.frame.find(name).cloned();
        Ok((rendered, aov.ok_or_else(|| file::not_rendered(name))?))
    }

    fn rendered(&self) -> Result<Rendered, Error> {
        let rendered = self.shared.status().rendered.clone();
        rendered.ok_or_else(|| Error::NotFound("no render was started yet".to_owned()))
    }

    /// Refuses where the session is poisoned.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.shared.check()
    }

    /// Runs work of this session; a panic poisons it.
    pub(crate) fn guard<T>(&self, work: impl FnOnce() -> T) -> Result<T, Error> {
        self.shared.guard(work)
    }

    /// Refuses every further call: for the layer above, where it caught a panic itself.
    pub fn poison(&self, why: &str) {
        self.shared.poison(why);
    }

    fn committed(&self) -> Result<Committed, Error> {
        let committed = self.shared.status().committed.clone();
        committed.ok_or_else(|| Error::NotFound("no scene was committed yet".to_owned()))
    }

    pub(crate) fn may_wait(&self) -> Result<(), Error> {
        if in_log_callback() {
            return Err(Error::Busy);
        }
        self.shared.check()
    }

    fn warn(&self, warnings: &[Warning]) {
        if !warnings.is_empty() {
            let log = &self.shared.log;
            self.with_log(|| warnings.iter().for_each(|w| log.warn_once(w)));
        }
    }

    /// A warning about a prim that has no code, the first time only.
    pub fn say_once(&self, prim: &str, text: &str) {
        self.with_log(|| self.shared.log.say_once(prim, text));
    }

    /// Runs what sends messages of this session.
    pub(crate) fn with_log(&self, tell: impl FnOnce()) {
        // A log function that edits is told nothing of it, and a dispatcher that is at work cannot
        // be replaced.
        if !in_log_callback() {
            with_default(&self.shared.dispatch, tell);
        }
    }

    fn apply_edits(&self, work: &mut Work, take: impl FnOnce(&mut EditQueue) -> Vec<Change>) {
        let mut edits = lock(&self.edits);
        let changes = take(&mut edits);
        if apply(&mut work.scene, changes) {
            edits.applied(&work.scene);
            work.version += 1;
            work.current = false;
        }
    }

    /// Stops the render thread and waits for its end.
    fn stop(&self, work: &mut Work) {
        if let Some(renderer) = work.renderer.take() {
            self.shared.request_cancel();
            // Its panics were caught and told already.
            let _ = renderer.join();
        }
    }

    fn pool(&self, work: &mut Work, threads: u32) -> Result<Arc<Pool>, Error> {
        if let Some((count, pool)) = &work.pool
            && *count == threads
        {
            return Ok(pool.clone());
        }
        let pool = Arc::new(Pool::new(threads, &self.shared.dispatch)?);
        work.pool = Some((threads, pool.clone()));
        Ok(pool)
    }

    /// Makes the scene ready for rays and publishes it.
    fn prepare(&self, work: &mut Work, cancel: &AtomicBool) -> Result<Committed, Error> {
        self.shared.status().committed = None;
        let pool = self.pool(work, work.scene.settings.threads)?;
        let ahead = lock(&self.ahead).take();
        let ahead = ahead.as_ref().map(|ahead| ahead.finish(cancel));
        let (ahead, begun) = ahead.map_or((None, None), |(ahead, early)| (Some(ahead), early));
        let new = early_vertices(&work.scene.settings);
        // Settings may have changed since.
        let begun = begun.filter(|begun| new.as_ref().is_some_and(|new| begun.is_like(new)));
        let early = begun.or(new.as_ref());
        let watcher = early.map(|early| early as &dyn Watcher);
        let (scene, previous) = (&work.scene, work.previous.as_deref());
        let factory = self.factory.as_ref();
        let preparation = self
            .shared
            .guard(|| {
                pool.install(|| prepare_with(scene, factory, previous, ahead, watcher, cancel))
            })?
            .map_err(prepare_error)?;
        self.warn(&preparation.warnings);
        let prepared = Arc::new(preparation.prepared);
        work.previous = Some(prepared.clone());
        // What was prepared is taken over by the next; the device keeps what it has until then.
        if cancel.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        let (gpu, backend) = self.upload(&prepared, work.gpu.take(), early)?;
        work.gpu.clone_from(&gpu);
        if let Some(bytes) = early.map(EarlyVertices::bytes).filter(|b| b.uploaded > 0) {
            let EarlyBytes {
                uploaded,
                beside,
                used,
            } = bytes;
            with_default(&self.shared.dispatch, || {
                tracing::debug!(
                    "of {uploaded} bytes of vertices that went to the GPU early, {beside} did before the last prim was diced, \
                     and {used} are in the scene"
                );
            });
        }
        work.current = true;
        let committed = Committed {
            prepared,
            gpu,
            backend: backend.into(),
            pool,
        };
        let mut status = self.shared.status();
        status.statistics = prepare_statistics(&committed.prepared);
        status.committed = Some(committed.clone());
        drop(status);
        with_default(&self.shared.dispatch, || {
            tracing::debug!("scene version {} is committed", work.version);
        });
        Ok(committed)
    }

    /// Starts the render thread.
    fn launch(
        &self,
        work: &mut Work,
        committed: Committed,
        cancel: Arc<AtomicBool>,
    ) -> Result<(), Error> {
        let Committed {
            prepared,
            gpu,
            pool,
            ..
        } = committed;
        let settings = &work.scene.settings;
        let total = settings.samples;
        let camera = work.scene.active_camera;
        let camera = camera.and_then(|id| work.scene.cameras.get(&id));
        let mut facts = camera.map_or_else(Vec::new, |camera| file::facts(camera, settings));
        let seconds = prepared.statistics().total_seconds;
        file::set_fact(&mut facts, "hdtrapeze/prepareSeconds", seconds.to_string());
        if let Some(gpu) = &gpu {
            file::set_fact(&mut facts, "hdtrapeze/backend", gpu.name());
        }
        let frame = Arc::new(self.shared.guard(|| new_frame(&prepared))??);
        let mut status = self.shared.status();
        status.rendered = Some(Rendered {
            frame: frame.clone(),
            resolution: settings.resolution,
            pixel_aspect: settings.pixel_aspect,
            facts,
        });
        status.state = State::Rendering;
        status.run.rendering_since = Some(Instant::now());
        status.run.total = total;
        drop(status);
        let shared = self.shared.clone();
        let run = move || {
            with_default(&shared.dispatch, || {
                let gpu = gpu.as_deref().map(|gpu| gpu as &dyn RayTracer);
                render_all(&shared, &pool, &prepared, gpu, &frame, &cancel);
            });
        };
        let spawned = Builder::new()
            .name("hdtrapeze-render".to_owned())
            .spawn(run);
        work.renderer = Some(
            spawned
                .map_err(|error| Error::OutOfMemory(format!("cannot start a thread: {error}")))?,
        );
        Ok(())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        drop(lock(&self.ahead).take());
        let mut work = std::mem::take(&mut *lock(&self.work));
        self.stop(&mut work);
    }
}

/// The render thread.
fn render_all(
    shared: &Shared,
    pool: &Pool,
    prepared: &Prepared,
    gpu: Option<&dyn RayTracer>,
    frame: &Frame,
    cancel: &AtomicBool,
) {
    let elsewhere = gpu.map(Elsewhere::new);
    let work = || {
        let control = RenderControl {
            cancel,
            on_progress: &|fraction| {
                let run = &mut shared.status().run;
                run.fraction = run.fraction.max(fraction);
            },
            on_pass: &|done, _| shared.status().run.done = done,
        };
        render_with(prepared, frame, &control, elsewhere.as_ref())
    };
    let mut statistics = RenderStatistics {
        cancelled: true,
        ..RenderStatistics::default()
    };
    // A render that was interrupted goes on from the samples that its film has.
    while shared.wait_for_resume() {
        let Ok(more) = shared.guard(|| pool.install(work)) else {
            tracing::error!("the renderer failed; the session can only be destroyed");
            return;
        };
        statistics.seconds += more.seconds;
        statistics.counts = statistics.counts + more.counts;
        statistics.cancelled = more.cancelled;
        if !more.cancelled {
            break;
        }
    }
    if let Some(why) = elsewhere.as_ref().and_then(Elsewhere::fault) {
        let text = format!("{why}; the CPU went on from the samples that there were");
        shared.log.warn_once(&Warning::new("", Code::Backend, text));
    }
    for warning in prepared.late_warnings() {
        shared.log.warn_once(&warning);
    }
    let mut status = shared.status();
    status.run.done = frame.samples_done();
    let all = &mut status.statistics;
    all.film_bytes = frame.bytes();
    all.trace_seconds = statistics.seconds;
    all.total_seconds = prepared.statistics().total_seconds + statistics.seconds;
    all.rays = statistics.counts.rays;
    all.node_tests = statistics.counts.node_tests;
    all.cell_tests = statistics.counts.cell_tests;
    if let Some(rendered) = &mut status.rendered {
        let seconds = statistics.seconds.to_string();
        file::set_fact(&mut rendered.facts, "hdtrapeze/renderSeconds", seconds);
    }
    drop(status);
    shared.end(match statistics.cancelled {
        true => State::Cancelled,
        false => State::Finished,
    });
}

#[cfg(test)]
pub(crate) mod tests;
