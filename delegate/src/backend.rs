//! The backend of a render: the CPU, or a GPU that is opened once for the process.

use std::ffi::{OsStr, OsString};
use std::fmt::{self, Display, Formatter};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};

use hdtrapeze_core::scene::Backend;
pub use hdtrapeze_gpu::device::{Found, Kind};
use hdtrapeze_gpu::trial::{self, Verdict};
use hdtrapeze_gpu::{Device, FirstOnDevice, FrameOptions, Stages, device};
use tracing::Dispatch;

use crate::error::Error;
use crate::pool::Pool;
use crate::status::lock;

/// The device that is open. Where opening fails it is tried again: a driver may have come up.
static STAGES: Mutex<Option<Arc<Stages>>> = Mutex::new(None);

/// Names the first stage that a GPU runs, where those before it are to run on the CPU: to narrow a difference down to a stage.
const FIRST_ON_GPU: &str = "HDTRAPEZE_FIRST_ON_GPU";

/// 0: what drivers compile is not kept on disk.
const PIPELINE_CACHE: &str = "HDTRAPEZE_PIPELINE_CACHE";

/// What the backend auto is here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Auto {
    /// The GPU that it is; nothing where it is the CPU.
    pub gpu: Option<String>,
    /// Why, for people.
    pub why: String,
    /// There is a GPU that was tried, now or before.
    pub tried: bool,
    /// It was tried just now, and failed or was wrong.
    pub fails: bool,
}

impl Auto {
    fn cpu(why: impl Into<String>) -> Self {
        Self {
            gpu: None,
            why: why.into(),
            tried: false,
            fails: false,
        }
    }

    fn of(found: &Found, verdict: Verdict) -> Self {
        Self {
            gpu: verdict.gpu.then(|| found.name.clone()),
            why: verdict.why,
            tried: true,
            fails: false,
        }
    }
}

impl Display for Auto {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let what = self.gpu.as_deref().unwrap_or("the CPU");
        write!(f, "{what}, since {}", self.why)
    }
}

static AUTO: OnceLock<Auto> = OnceLock::new();

/// What the backend auto is here. The first call looks for a GPU, and tries it where no verdict on it is kept, which may take
/// some seconds.
pub fn auto() -> &'static Auto {
    AUTO.get_or_init(|| {
        if !device::may_have_hardware() {
            return Auto::cpu("there is no GPU");
        }
        match candidate(devices()) {
            Err(why) => Auto::cpu(why),
            Ok(found) => chosen(found, pipelines_folder().as_deref(), try_device),
        }
    })
}

/// The device that auto may be, of all, the best first; or why there is none.
fn candidate(found: &[Found]) -> Result<&Found, String> {
    match found.first() {
        None => Err("no GPU is found".to_owned()),
        Some(best) if best.kind == Kind::Software => {
            Err(format!("{} computes on the CPU", best.name))
        }
        Some(best) => Ok(best),
    }
}

/// What follows for a device, by the verdict that is kept, or by what `try_it` tells.
fn chosen(
    found: &Found,
    folder: Option<&Path>,
    try_it: impl FnOnce(&Found, Option<&Path>) -> Result<Verdict, Error>,
) -> Auto {
    if let Some(verdict) = folder.and_then(|folder| trial::known(folder, found)) {
        return Auto::of(found, verdict);
    }
    match try_it(found, folder) {
        Ok(verdict) => Auto {
            fails: verdict.failed,
            ..Auto::of(found, verdict)
        },
        Err(error) => Auto {
            tried: true,
            fails: true,
            ..Auto::cpu(error.to_string())
        },
    }
}

/// Opens the device and tries it; it stays open where it is to be used.
fn try_device(found: &Found, folder: Option<&Path>) -> Result<Verdict, Error> {
    let stages = open_device()?;
    // Where the best does not open, another does.
    let opened = stages.device().found();
    if opened.name != found.name || opened.kind == Kind::Software {
        return Err(Error::Unsupported(format!(
            "{} cannot be opened",
            found.name
        )));
    }
    let pool = Pool::new(0, &Dispatch::none())?;
    let run = || pool.install(|| trial::tried(&stages, folder));
    let verdict = catch_unwind(AssertUnwindSafe(run))
        .map_err(|_| Error::Internal("a trial frame".to_owned()))?;
    if verdict.gpu {
        *lock(&STAGES) = Some(stages);
    }
    Ok(verdict)
}

/// A backend that is asked for, with what auto is.
///
/// # Errors
/// As [`open`].
pub fn resolved(asked: Backend) -> Result<Backend, Error> {
    match asked {
        Backend::Cpu => Ok(Backend::Cpu),
        Backend::Gpu => open(Backend::Gpu).map(|_| Backend::Gpu),
        Backend::Auto | Backend::AutoGpu => Ok(match auto().gpu {
            Some(_) => Backend::AutoGpu,
            None => Backend::Auto,
        }),
    }
}

/// What was found out of auto, where a render is by it.
pub fn auto_of(asked: Backend) -> Option<&'static Auto> {
    match asked {
        Backend::Auto | Backend::AutoGpu => AUTO.get(),
        Backend::Cpu | Backend::Gpu => None,
    }
}

/// What renders where no GPU is to, for people.
pub fn cpu(asked: Backend) -> String {
    auto_of(asked).map_or("cpu".to_owned(), |auto| format!("cpu (auto: {})", auto.why))
}

/// What renders where a GPU was to and cannot, for people.
pub fn cpu_since(why: &str) -> String {
    format!("cpu ({why})")
}

/// How scenes are taken to a GPU, as the environment has it.
///
/// # Errors
/// It names no stage.
pub fn gpu_options() -> Result<FrameOptions, Error> {
    options_of(std::env::var_os(FIRST_ON_GPU).as_deref())
}

fn options_of(first: Option<&OsStr>) -> Result<FrameOptions, Error> {
    let mut options = FrameOptions::default();
    if let Some(name) = first.filter(|name| !name.is_empty()) {
        let named = name.to_str().and_then(FirstOnDevice::named);
        options.first = named.ok_or_else(|| {
            let all = FirstOnDevice::ALL.map(FirstOnDevice::name).join(", ");
            let name = name.display();
            Error::InvalidArgument(format!(
                "{FIRST_ON_GPU} is '{name}', which is none of {all}"
            ))
        })?;
    }
    Ok(options)
}

/// Where what drivers compile is kept from one run to the next: in the user's own cache folder.
fn pipelines_folder() -> Option<PathBuf> {
    let var = |name| std::env::var_os(name);
    folder_of(
        var(PIPELINE_CACHE),
        var("XDG_CACHE_HOME"),
        std::env::home_dir(),
    )
}

fn folder_of(
    keep: Option<OsString>,
    caches: Option<OsString>,
    home: Option<PathBuf>,
) -> Option<PathBuf> {
    if keep.is_some_and(|keep| keep == "0") {
        return None;
    }
    // XDG: what is not absolute does not count.
    let named = caches.map(PathBuf::from).filter(|path| path.is_absolute());
    let folder = named.or_else(|| Some(home?.join(".cache")))?;
    folder.is_absolute().then(|| folder.join("hdtrapeze"))
}

/// All devices there are, the best first; looked for once.
pub fn devices() -> &'static [Found] {
    static DEVICES: OnceLock<Vec<Found>> = OnceLock::new();
    DEVICES.get_or_init(Device::list)
}

/// Opens what a backend needs; nothing for the CPU.
///
/// # Errors
/// A GPU is to render, and there is none that opens.
pub fn open(backend: Backend) -> Result<Option<Arc<Stages>>, Error> {
    if !backend.is_gpu() {
        return Ok(None);
    }
    let open = &mut *lock(&STAGES);
    if let Some(stages) = open.as_ref().filter(|s| s.device().check().is_ok()) {
        return Ok(Some(Arc::clone(stages)));
    }
    let stages = open_device().map_err(|error| match backend {
        Backend::Gpu => Error::Unsupported(format!("{error}; the backend cpu needs no device")),
        _ => error,
    })?;
    *open = Some(Arc::clone(&stages));
    Ok(Some(stages))
}

fn open_device() -> Result<Arc<Stages>, Error> {
    let device = Device::open_with(pipelines_folder().as_deref())
        .map_err(|error| Error::Unsupported(error.to_string()))?;
    Ok(Arc::new(Stages::new(&Arc::new(device))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_stage_goes_by_its_name() {
        let first = |name: &str| options_of(Some(OsStr::new(name))).map(|options| options.first);
        assert_eq!(first("trace").unwrap(), FirstOnDevice::Trace);
        assert_eq!(first("").unwrap(), FirstOnDevice::Bound);
        assert_eq!(options_of(None).unwrap().first, FirstOnDevice::Bound);
        let refused = first("cook").unwrap_err().to_string();
        assert!(refused.contains("'cook', which is none of bound, build, instances"));
    }

    #[test]
    fn pipelines_are_kept_in_the_users_caches() {
        let folder = |keep: &str, caches: &str, home: &str| {
            let home = Some(PathBuf::from(home)).filter(|home| home != "");
            folder_of(Some(keep.into()), Some(caches.into()), home)
        };
        assert_eq!(folder("", "/c", "/h"), Some("/c/hdtrapeze".into()));
        assert_eq!(folder("1", "", "/h"), Some("/h/.cache/hdtrapeze".into()));
        assert_eq!(folder("", "c", "/h"), Some("/h/.cache/hdtrapeze".into()));
        assert_eq!(folder("0", "/c", "/h"), None);
        assert_eq!(folder("", "", ""), None);
        assert_eq!(folder_of(None, None, None), None);
    }

    fn found(kind: Kind) -> Found {
        Found {
            name: format!("{kind:?}"),
            api: "vulkan".to_owned(),
            driver: "maker 1.0".to_owned(),
            kind,
            largest_buffer: 1,
            largest_binding: 1,
            workgroups: 1,
            timestamps: true,
            subgroups: true,
            chosen: false,
        }
    }

    #[test]
    fn auto_is_no_device_of_software() {
        assert!(candidate(&[]).unwrap_err().contains("no GPU is found"));
        let software = candidate(&[found(Kind::Software)]).unwrap_err();
        assert!(software.contains("computes on the CPU"));
        for kind in [Kind::Discrete, Kind::Integrated, Kind::Other] {
            let all = [found(kind), found(Kind::Software)];
            assert_eq!(candidate(&all).unwrap().kind, kind);
        }
    }

    fn faster() -> Verdict {
        Verdict {
            gpu: true,
            failed: false,
            why: "it is faster".to_owned(),
        }
    }

    #[test]
    fn auto_is_what_a_trial_says() {
        let device = found(Kind::Discrete);
        let auto = chosen(&device, None, |_, _| Ok(faster()));
        assert!(auto.tried && !auto.fails);
        assert_eq!(auto.to_string(), "Discrete, since it is faster");
        let slower = Verdict {
            gpu: false,
            why: "it is slower".to_owned(),
            ..faster()
        };
        let auto = chosen(&device, None, |_, _| Ok(slower.clone()));
        assert!(auto.tried && !auto.fails);
        assert_eq!(auto.to_string(), "the CPU, since it is slower");
        let wrong = Verdict {
            failed: true,
            ..slower
        };
        let auto = chosen(&device, None, |_, _| Ok(wrong.clone()));
        assert!(auto.gpu.is_none() && auto.fails);
        let refused = || Error::Unsupported("it cannot be opened".to_owned());
        let auto = chosen(&device, None, |_, _| Err(refused()));
        assert!(auto.fails);
        assert_eq!(auto.to_string(), "the CPU, since it cannot be opened");
    }

    #[test]
    fn the_cpu_and_a_gpu_that_is_asked_for_are_what_they_are() {
        assert_eq!(resolved(Backend::Cpu), Ok(Backend::Cpu));
        assert_eq!(cpu(Backend::Cpu), "cpu");
        assert!(auto_of(Backend::Gpu).is_none() && auto_of(Backend::Cpu).is_none());
    }
}
