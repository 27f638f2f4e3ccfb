//! The backend of a render: the CPU, or a GPU that is opened once for the process.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock};

use hdtrapeze_core::scene::Backend;
pub use hdtrapeze_gpu::device::{Found, Kind};
use hdtrapeze_gpu::{Device, FirstOnDevice, FrameOptions, Stages};

use crate::error::Error;
use crate::status::lock;

/// The device that is open. Where opening fails it is tried again: a driver may have come up.
static STAGES: Mutex<Option<Arc<Stages>>> = Mutex::new(None);

/// Names the first stage that a GPU runs, where those before it are to run on the CPU: to narrow a difference down to a stage.
const FIRST_ON_GPU: &str = "HDTRAPEZE_FIRST_ON_GPU";

/// 0: what drivers compile is not kept on disk.
const PIPELINE_CACHE: &str = "HDTRAPEZE_PIPELINE_CACHE";

/// What renders where no GPU is to, for people.
pub fn cpu(asked: Backend) -> String {
    let why = match asked {
        Backend::Auto => " (auto: no GPU has been timed yet)",
        Backend::Cpu | Backend::Gpu => "",
    };
    format!("cpu{why}")
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
/// A GPU is asked for, and there is none that opens.
pub fn open(backend: Backend) -> Result<Option<Arc<Stages>>, Error> {
    if backend != Backend::Gpu {
        return Ok(None);
    }
    let open = &mut *lock(&STAGES);
    if let Some(stages) = open.as_ref().filter(|s| s.device().check().is_ok()) {
        return Ok(Some(Arc::clone(stages)));
    }
    let device = Device::open_with(pipelines_folder().as_deref())
        .map_err(|error| Error::Unsupported(format!("{error}; the backend cpu needs no device")))?;
    let stages = Arc::new(Stages::new(&Arc::new(device)));
    *open = Some(Arc::clone(&stages));
    Ok(Some(stages))
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

    #[test]
    fn auto_says_why_it_is_the_cpu() {
        assert!(cpu(Backend::Auto).contains("timed"));
        assert_eq!(cpu(Backend::Cpu), "cpu");
    }
}
