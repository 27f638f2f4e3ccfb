//! What can go wrong with an image file.

use std::io;
use std::path::{Path, PathBuf};

/// A file that was not written. What stood under the path before still does.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The system refused.
    #[error("{path}: cannot {action}: {source}", path = path.display())]
    Io {
        /// The file asked for.
        path: PathBuf,
        /// What was tried, as a verb and its object.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The image cannot be stored in this format.
    #[error("{path}: {reason}", path = path.display())]
    Invalid {
        /// The file asked for.
        path: PathBuf,
        /// What is wrong with the image.
        reason: String,
    },
}

impl ImageError {
    pub(super) fn invalid(path: &Path, reason: impl Into<String>) -> Self {
        ImageError::Invalid {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }
}

/// Why encoding stopped, before the path is known.
#[derive(Debug)]
pub(super) enum EncodeError {
    Io(io::Error),
    Invalid(String),
}

impl From<io::Error> for EncodeError {
    fn from(error: io::Error) -> Self {
        EncodeError::Io(error)
    }
}

impl From<exr::error::Error> for EncodeError {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::Io(error) => EncodeError::Io(error),
            other => EncodeError::Invalid(other.to_string()),
        }
    }
}

impl From<png::EncodingError> for EncodeError {
    fn from(error: png::EncodingError) -> Self {
        match error {
            png::EncodingError::IoError(error) => EncodeError::Io(error),
            other => EncodeError::Invalid(other.to_string()),
        }
    }
}
