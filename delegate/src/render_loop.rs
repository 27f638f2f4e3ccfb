//! Renders for hosts that wait for nothing: edits are committed and views rendered on a thread of the
//! loop, several views one after the other, and files written of them.
//!
//! What runs is given up as soon as something else is asked for. What is edited after a call waits for the
//! next one: hosts edit while renders go on, and half of their edits make no scene.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use hdtrapeze_core::scene::{PrimId, RenderSettings};

use crate::edit::Edits;
use crate::error::Error;
use crate::file::{self, ImageOptions};
use crate::progress::State as SessionState;
use crate::session::Session;
use crate::status::lock;

/// What is rendered, besides the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The camera to render through.
    pub camera: Option<PrimId>,
    /// With the AOVs.
    pub settings: RenderSettings,
}

/// A file of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Path of the prim that asks for it, which is told where it cannot be written.
    pub owner: String,
    /// Where it is written.
    pub path: PathBuf,
    /// What is written, and how.
    pub image: ImageOptions,
}

/// One render, and the files that are written of it once all samples were taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// What is rendered.
    pub view: View,
    /// What is written.
    pub files: Vec<Output>,
}

/// How far a loop is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoopProgress {
    /// How often renders were started.
    pub starts: u64,
    /// The number of the render that AOVs can be read of, 0 for none; it grows with each.
    pub readable: u64,
    /// It starts nothing until it is resumed, and nothing runs.
    pub stopped: bool,
    /// Nothing more comes: all samples were taken, or it failed, or it was stopped.
    pub converged: bool,
}

/// See the module. Every method may be called from any thread. Dropped, it cancels what runs.
pub struct RenderLoop {
    inner: Arc<Inner>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

struct Inner {
    session: Arc<Session>,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    jobs: Arc<Vec<Job>>,
    /// Of the session when the jobs were asked for.
    edits: Edits,
    wanted: u64,
    started: u64,
    readable: u64,
    finished: u64,
    busy: bool,
    stopped: bool,
    quit: bool,
    /// Why the last render failed: told once on end, whatever is edited meanwhile.
    failure: String,
    /// Where that is kept which the end of the host interrupted.
    kept: Vec<String>,
}

impl State {
    fn is_given_up(&self, mine: u64) -> bool {
        self.quit || self.stopped || self.wanted != mine
    }
}

impl RenderLoop {
    /// A loop that has nothing to render yet.
    pub fn new(session: Arc<Session>) -> Self {
        Self {
            inner: Arc::new(Inner {
                session,
                state: Mutex::default(),
                changed: Condvar::new(),
            }),
            thread: Mutex::default(),
        }
    }

    /// Makes the renders one after the other, each from the first sample; what runs is given up. Only
    /// the last can be read. Does nothing where they are the ones that were asked for last, and
    /// nothing was edited since.
    pub fn render(&self, jobs: Vec<Job>) -> Result<(), Error> {
        let inner = &self.inner;
        inner.session.check()?;
        let edits = inner.session.edits();
        let mut state = inner.lock();
        if state.wanted > 0 && state.edits == edits && *state.jobs == jobs {
            return Ok(());
        }
        for camera in jobs.iter().filter_map(|job| job.view.camera) {
            inner.session.check_camera(camera)?;
        }
        // A dump shows the host's view from now on.
        if let Some(Job { view, .. }) = jobs.last() {
            inner.session.set_settings(view.settings.clone())?;
            inner.session.set_aovs(view.settings.aovs.clone())?;
            inner.session.set_active_camera(view.camera)?;
        }
        self.begin_thread()?;
        state.edits = inner.session.seal();
        state.jobs = Arc::new(jobs);
        state.wanted += 1;
        let running = state.busy;
        drop(state);
        inner.changed.notify_all();
        match running {
            true => inner.session.interrupt(),
            false => Ok(()),
        }
    }

    /// Gives up what runs, and starts nothing until it is resumed. What was rendered stays readable.
    pub fn stop(&self, wait: bool) -> Result<(), Error> {
        let inner = &self.inner;
        if wait {
            inner.session.may_wait()?;
        }
        inner.lock().stopped = true;
        inner.changed.notify_all();
        inner.session.interrupt()?;
        let mut state = inner.lock();
        while wait && state.busy {
            state = inner.wait(state);
        }
        Ok(())
    }

    /// Ends a stop: renders anew where something was given up.
    pub fn resume(&self) -> Result<(), Error> {
        self.inner.session.check()?;
        let mut state = self.inner.lock();
        if state.stopped {
            state.stopped = false;
            if state.finished < state.wanted {
                state.wanted += 1;
            }
            self.inner.changed.notify_all();
        }
        Ok(())
    }

    pub(crate) fn session(&self) -> &Session {
        &self.inner.session
    }

    /// How far it is.
    pub fn progress(&self) -> LoopProgress {
        let state = self.inner.lock();
        LoopProgress {
            starts: state.wanted,
            readable: state.readable,
            stopped: state.stopped && !state.busy,
            converged: match state.stopped {
                true => !state.busy,
                false => state.finished == state.wanted,
            },
        }
    }

    fn begin_thread(&self) -> Result<(), Error> {
        let mut thread = lock(&self.thread);
        if thread.is_none() {
            let inner = Arc::clone(&self.inner);
            let spawned = Builder::new()
                .name("hdtrapeze-loop".to_owned())
                .spawn(move || inner.run());
            *thread =
                Some(spawned.map_err(|error| {
                    Error::OutOfMemory(format!("cannot start a thread: {error}"))
                })?);
        }
        Ok(())
    }
}

impl Drop for RenderLoop {
    fn drop(&mut self) {
        let Some(thread) = lock(&self.thread).take() else {
            return;
        };
        self.inner.lock().quit = true;
        self.inner.changed.notify_all();
        // A session that is poisoned runs nothing.
        let _ = self.inner.session.interrupt();
        let _ = thread.join();
    }
}

impl Inner {
    fn lock(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.changed
            .wait(state)
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// The loop's thread.
    fn run(&self) {
        let mut state = self.lock();
        loop {
            while !state.quit && (state.stopped || state.started == state.wanted) {
                state = self.wait(state);
            }
            if state.quit {
                let has_files = state.jobs.iter().any(|job| !job.files.is_empty());
                if has_files && state.finished < state.wanted {
                    let mut text =
                        "the host is gone before all its products are written".to_owned();
                    if !state.kept.is_empty() {
                        text += &format!("; what was rendered is in {}", state.kept.join(", "));
                    }
                    drop(state);
                    self.session.with_log(|| tracing::warn!("{text}"));
                }
                return;
            }
            let mine = state.wanted;
            state.started = mine;
            state.busy = true;
            let jobs = Arc::clone(&state.jobs);
            drop(state);
            let is_last = |job: usize| job + 1 == jobs.len();
            let is_whole = (0..jobs.len()).all(|job| {
                let run = || self.run_job(&jobs[job], mine, is_last(job));
                // What panics has failed, and there is no more to come.
                self.session.guard(run).unwrap_or(true)
            });
            state = self.lock();
            state.busy = false;
            if is_whole {
                state.finished = mine;
            }
            // Else a resume makes up for what was given up.
            self.changed.notify_all();
        }
    }

    /// False where it is given up, and with it the other jobs.
    fn run_job(&self, job: &Job, mine: u64, is_last: bool) -> bool {
        // A cancel that was meant for the render before may come late: then it is made again.
        let failure = loop {
            if !is_last {
                self.lock().readable = 0;
            }
            let view = &job.view;
            let is_given_up = || self.lock().is_given_up(mine);
            let mut result = self
                .session
                .start_sealed(view.camera, &view.settings, &is_given_up);
            let has_begun = result.is_ok();
            if has_begun {
                if is_last {
                    self.lock().readable = mine;
                }
                result = self.finish(mine);
            }
            if self.lock().is_given_up(mine) {
                // Fails where the session does, which the next call of the host tells.
                let _ = self.session.cancel();
                // Else the session has the pixels of the render before.
                return has_begun && self.lock().quit && self.keep(job);
            }
            let progress = self.session.progress();
            if !progress.is_ok_and(|progress| progress.state == SessionState::Cancelled) {
                break result.err();
            }
        };
        let failure = failure.map(|error| error.to_string());
        for file in &job.files {
            self.write(file, failure.as_deref());
        }
        self.tell(failure.unwrap_or_default());
        true
    }

    /// Waits for the end of a render, or until it is given up: the call that does so interrupts it, but
    /// perhaps before it began.
    fn finish(&self, mine: u64) -> Result<(), Error> {
        while !self.lock().is_given_up(mine) {
            if self.session.wait(Some(Duration::from_millis(50)))? {
                break;
            }
        }
        Ok(())
    }

    /// Keeps what a render had that the end of the host interrupts, beside the places of its files; true
    /// where it was whole by then, and is in their places.
    fn keep(&self, job: &Job) -> bool {
        // Nothing is kept of a session that has failed.
        let _ = self.session.wait(None);
        let Ok(progress) = self.session.progress() else {
            return false;
        };
        let is_whole = progress.state == SessionState::Finished;
        if progress.samples_done == 0 && !is_whole {
            return false;
        }
        for file in &job.files {
            let image = ImageOptions {
                partial: !is_whole,
                ..file.image.clone()
            };
            if self.write_as(file, &image, None) && !is_whole {
                let path = file::partial(&file.path);
                self.lock().kept.push(path.display().to_string());
            }
        }
        is_whole
    }

    fn write(&self, file: &Output, failure: Option<&str>) {
        self.write_as(file, &file.image, failure);
    }

    /// Whether it is written; of what is not there has been a warning.
    fn write_as(&self, file: &Output, image: &ImageOptions, failure: Option<&str>) -> bool {
        let why = match failure {
            Some(failure) => failure.to_owned(),
            None => match self.session.write_image(&file.path, image) {
                Ok(()) => return true,
                Err(error) => error.to_string(),
            },
        };
        let (prim, path) = (file.owner.as_str(), file.path.display());
        self.session
            .with_log(|| tracing::warn!(prim, "{path} cannot be written: {why}"));
        false
    }

    fn tell(&self, failure: String) {
        let is_new = self.lock().failure != failure;
        if is_new && !failure.is_empty() {
            self.session.with_log(|| tracing::error!("{failure}"));
        }
        self.lock().failure = failure;
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{create_dir_all, read_dir, remove_dir_all};

    use super::*;
    use crate::edit::Kind;
    use crate::file::FileType;
    use crate::image::PngColor;
    use crate::session::tests::NoSubdivision;

    /// A loop without its thread, which was asked for a render once, a camera and an empty folder.
    fn asked(name: &str) -> (RenderLoop, PrimId, PathBuf) {
        let session = Arc::new(Session::new(Box::new(NoSubdivision)));
        let camera = session.create(Kind::Camera, "/camera").unwrap();
        session.seal();
        let asked = RenderLoop::new(session);
        asked.inner.lock().wanted = 1;
        let folder = std::env::temp_dir().join(format!("hdtrapeze-{name}-{}", std::process::id()));
        create_dir_all(&folder).unwrap();
        (asked, camera, folder)
    }

    fn job(camera: PrimId, path: PathBuf) -> Job {
        let aovs = vec!["color".to_owned()];
        Job {
            view: View {
                camera: Some(camera),
                settings: RenderSettings {
                    resolution: [4, 4],
                    samples: 1,
                    aovs: aovs.clone(),
                    ..RenderSettings::default()
                },
            },
            files: vec![Output {
                owner: "/product".to_owned(),
                path,
                image: ImageOptions {
                    file: FileType::Png,
                    color: PngColor::Srgb,
                    aovs,
                    vars: Vec::new(),
                    metadata: Vec::new(),
                    partial: false,
                },
            }],
        }
    }

    /// The names of files in a folder, which then is no more.
    fn taken(folder: PathBuf) -> Vec<String> {
        let names = read_dir(&folder).unwrap().map(|entry| {
            let name = entry.unwrap().file_name();
            name.into_string().unwrap()
        });
        let mut names: Vec<_> = names.collect();
        names.sort();
        remove_dir_all(folder).unwrap();
        names
    }

    #[test]
    fn what_has_not_begun_keeps_nothing_of_the_render_before() {
        let (asked, camera, folder) = asked("begun");
        let [first, second] = ["a.png", "b.png"].map(|name| job(camera, folder.join(name)));
        assert!(asked.inner.run_job(&first, 1, false));
        // The host goes while the first one's files are written.
        asked.inner.lock().quit = true;
        assert!(!asked.inner.run_job(&second, 1, true));
        assert_eq!(taken(folder), ["a.png"]);
    }

    #[test]
    fn what_is_whole_as_the_host_goes_is_no_part() {
        let (asked, camera, folder) = asked("whole");
        let job = job(camera, folder.join("a.png"));
        let rendered = Job {
            files: Vec::new(),
            ..job.clone()
        };
        assert!(asked.inner.run_job(&rendered, 1, true));
        assert!(asked.inner.keep(&job));
        assert!(asked.inner.lock().kept.is_empty());
        assert_eq!(taken(folder), ["a.png"]);
    }
}
