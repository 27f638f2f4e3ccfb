//! Warnings about the scene: each names the prim, a stable code and a sentence.
//!
//! Stages collect them (a parallel stage returns its own list, joined in prim order) and the
//! session emits them once per prim and code, so that a log is the same for any thread count.

use std::fmt;

/// What went wrong with a prim, as a stable code that hosts and tests can match.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Code {
    /// Face counts, indices or array lengths contradict each other.
    Topology,
    /// NaN, infinity or an absurd magnitude in points, transforms or settings.
    NotFinite,
    /// A primvar whose element count does not fit its interpolation.
    PrimvarLength,
    /// Time samples that cannot be combined (different lengths, unsorted, duplicate).
    TimeSamples,
    /// Something the renderer does not support.
    Unsupported,
    /// A limit or budget was reached and the result was coarsened.
    Budget,
}

impl Code {
    /// The code as hosts see it.
    pub fn name(self) -> &'static str {
        match self {
            Code::Topology => "topology",
            Code::NotFinite => "not-finite",
            Code::PrimvarLength => "primvar-length",
            Code::TimeSamples => "time-samples",
            Code::Unsupported => "unsupported",
            Code::Budget => "budget",
        }
    }
}

/// One warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Path of the prim, as the host gave it.
    pub prim: String,
    /// Stable code.
    pub code: Code,
    /// What is wrong and what was done about it, one sentence.
    pub text: String,
}

impl Warning {
    /// A warning about `prim`.
    pub fn new(prim: impl Into<String>, code: Code, text: impl Into<String>) -> Self {
        Self {
            prim: prim.into(),
            code,
            text: text.into(),
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} [{}]", self.prim, self.text, self.code.name())
    }
}
