//! Compiled pipelines, kept on disk from one run to the next: what a driver makes of a stage takes it longer than anything else
//! that happens once.
//!
//! There is one file a device, in a folder that the caller names, with what wgpu gives of its cache and a hash of that. A file that
//! is not there, broken, too large or of another driver is as none; so is a folder that cannot be written to. Files are
//! written beside and renamed, since other processes read and write them too. Only Vulkan knows of such caches.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What files of pipelines begin with.
const MARK: [u8; 8] = *b"TRZPIPE1";
/// Files that have grown beyond this, by stages of versions that are gone, are begun anew.
const MOST: u64 = 1 << 26;

/// Pipelines of a device that are kept.
#[derive(Debug)]
pub(crate) struct KeptPipelines {
    cache: wgpu::PipelineCache,
    path: PathBuf,
    /// They came from a file.
    found: bool,
    /// There are some that the file does not have.
    has_new: AtomicBool,
}

impl KeptPipelines {
    /// Those of a device, in this folder; nothing where its driver has no such cache.
    pub fn open(device: &wgpu::Device, info: &wgpu::AdapterInfo, folder: &Path) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(wgpu::util::pipeline_cache_key(info)?);
        let data = read(&path, MARK);
        Some(Self {
            cache: cache_of(device, data.as_deref()),
            found: data.is_some(),
            path,
            has_new: AtomicBool::new(false),
        })
    }

    /// For pipelines that are about to be made.
    pub fn cache(&self) -> &wgpu::PipelineCache {
        self.has_new.store(true, Ordering::Relaxed);
        &self.cache
    }

    /// True where there was a sound file.
    pub fn were_found(&self) -> bool {
        self.found
    }

    /// Writes the file, where it lacks something. Nothing is lost but time where that fails.
    pub fn keep(&self) {
        if self.has_new.swap(false, Ordering::Relaxed)
            && let Some(data) = self.cache.get_data()
        {
            let _ = write(&self.path, MARK, &data);
        }
    }
}

/// wgpu's cache with this in it.
#[allow(unsafe_code, reason = "wgpu cannot tell where data is from")]
fn cache_of(device: &wgpu::Device, data: Option<&[u8]>) -> wgpu::PipelineCache {
    let descriptor = wgpu::PipelineCacheDescriptor {
        label: Some("pipelines"),
        data,
        // What is of another driver is left out.
        fallback: true,
    };
    // SAFETY: data is what `PipelineCache::get_data` gave, whole: it has the hash that was written with it, in a folder that
    // belongs to the user. wgpu looks whether it is of this driver.
    unsafe { device.create_pipeline_cache(&descriptor) }
}

fn hash_of(data: &[u8]) -> [u8; 8] {
    let mut hasher = DefaultHasher::new();
    hasher.write(data);
    hasher.finish().to_le_bytes()
}

/// What a file holds that begins with this mark and a hash, where it is sound.
pub(crate) fn read(path: &Path, mark: [u8; 8]) -> Option<Vec<u8>> {
    if fs::metadata(path).ok()?.len() > MOST {
        return None;
    }
    let mut all = fs::read(path).ok()?;
    let head = all.strip_prefix(&mark)?;
    let (hash, data) = head.split_first_chunk()?;
    if *hash != hash_of(data) {
        return None;
    }
    let head = all.len() - data.len();
    all.drain(..head);
    Some(all)
}

/// Writes a file that [`read`] reads, beside, and renames it.
pub(crate) fn write(path: &Path, mark: [u8; 8], data: &[u8]) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let beside = path.with_extension(std::process::id().to_string());
    let written = fs::File::create(&beside).and_then(|mut file| {
        file.write_all(&mark)?;
        file.write_all(&hash_of(data))?;
        file.write_all(data)
    });
    let renamed = written.and_then(|()| fs::rename(&beside, path));
    if renamed.is_err() {
        let _ = fs::remove_file(&beside);
    }
    renamed
}

/// Makes a folder that nobody else writes to: what is in it goes to the driver.
fn make_folder(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}
