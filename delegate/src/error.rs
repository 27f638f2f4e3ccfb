//! Why a session refused or failed.

use hdtrapeze_core::memory::{self, OutOfMemory};

/// One failure, with a sentence for the user.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An argument is out of range, or contradicts another.
    #[error("{0}")]
    InvalidArgument(String),
    /// No prim, AOV, committed scene or render of that name or number.
    #[error("{0}")]
    NotFound(String),
    /// Well formed, but this build cannot do it.
    #[error("{0}")]
    Unsupported(String),
    /// Memory was refused; the session is unharmed.
    #[error("{0}")]
    OutOfMemory(String),
    /// A file could not be written.
    #[error("{0}")]
    Io(String),
    /// Cancelled before it was done.
    #[error("cancelled")]
    Cancelled,
    /// An earlier call panicked; the session can only be dropped.
    #[error("the session failed earlier and can only be destroyed: {0}")]
    Poisoned(String),
    /// Called from inside a log callback, where it would wait for itself.
    #[error("this cannot be called from inside a log callback")]
    Busy,
    /// The renderer panicked; the session is poisoned now.
    #[error("the renderer failed, please report it: {0}")]
    Internal(String),
}

impl From<OutOfMemory> for Error {
    fn from(error: OutOfMemory) -> Self {
        Error::OutOfMemory(error.to_string())
    }
}

/// Copies of more bytes than this are asked for first: memory that the system promises may not be there.
const LARGE_COPY: usize = 1 << 26;

/// A copy of a slice; refused where memory for it is not to be had.
pub fn try_copy<T: Clone>(source: &[T]) -> Result<Vec<T>, Error> {
    try_map(source, T::clone)
}

/// Each element of a slice converted; refused where memory for it is not to be had.
pub fn try_map<S, T>(source: &[S], convert: impl FnMut(&S) -> T) -> Result<Vec<T>, Error> {
    let bytes = source.len().saturating_mul(size_of::<T>());
    if bytes > LARGE_COPY {
        memory::check(bytes as u64, "a copy of an array")?;
    }
    let mut copy = Vec::new();
    copy.try_reserve_exact(source.len())
        .map_err(|_| Error::OutOfMemory(format!("no memory for a copy of {bytes} bytes")))?;
    copy.extend(source.iter().map(convert));
    Ok(copy)
}
