//! What can go wrong on a GPU.

use hdtrapeze_core::trace::world::WorldError;

/// Why a device cannot be used, or no longer. Each sentence stands after a name or a path, on one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No driver, or none with a device that is asked for.
    #[error("no GPU is found: {0}")]
    NoDevice(String),
    /// The driver refused to open it.
    #[error("{name} cannot be opened: {}", on_one_line(why))]
    Refused {
        /// The device's name.
        name: String,
        /// In the driver's words.
        why: String,
    },
    /// A scene is larger than the device, or what it binds at once.
    #[error("the scene's {what} need {bytes} bytes, and {name} takes {limit}")]
    TooLarge {
        /// The device's name.
        name: String,
        /// Which part of the scene.
        what: &'static str,
        /// Bytes that are needed.
        bytes: u64,
        /// Bytes that there are.
        limit: u64,
    },
    /// The device has no memory left.
    #[error("{name} has no memory for {bytes} bytes of {what}")]
    OutOfMemory {
        /// The device's name.
        name: String,
        /// Which part of the scene, or of a launch.
        what: &'static str,
        /// Bytes that are needed.
        bytes: u64,
    },
    /// The host has none left.
    #[error("there is no memory for {bytes} bytes of {what} on their way to the GPU")]
    HostMemory {
        /// Which part of the scene.
        what: &'static str,
        /// Bytes that are needed.
        bytes: usize,
    },
    /// There is no memory for a world on the host.
    #[error(transparent)]
    Host(#[from] WorldError),
    /// What this backend cannot trace.
    #[error("the GPU cannot trace {0}")]
    Unsupported(String),
    /// All that would run on the device is what it cannot do.
    #[error("from the stage {first} on, the GPU has nothing to do: {why}")]
    Nothing {
        /// The first stage that it should run.
        first: &'static str,
        /// What is done elsewhere, and why.
        why: String,
    },
    /// A stage was rejected, or failed.
    #[error("{name} failed: {}", on_one_line(why))]
    Failed {
        /// The device's name.
        name: String,
        /// In the driver's words.
        why: String,
    },
    /// The device is gone.
    #[error("{name} is lost: {}", on_one_line(why))]
    Lost {
        /// The device's name.
        name: String,
        /// In the driver's words.
        why: String,
    },
}

/// What a driver says in lines, most of which tell where it was said; without its full stop, since more may follow.
fn on_one_line(words: &str) -> String {
    let words: Vec<&str> = words.split_whitespace().collect();
    words.join(" ").trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_drivers_stand_on_one_line() {
        let (name, why) = (
            "a GPU".to_owned(),
            "Error\n\nCaused by:\n  a cause\n".to_owned(),
        );
        let failed = GpuError::Failed { name, why };
        assert_eq!(failed.to_string(), "a GPU failed: Error Caused by: a cause");
        let (name, why) = ("a GPU".to_owned(), "Not enough memory left.\n".to_owned());
        let refused = GpuError::Refused { name, why };
        let line = "a GPU cannot be opened: Not enough memory left";
        assert_eq!(refused.to_string(), line);
    }
}
