//! Warnings about the scene: each names the prim, a stable code and a sentence.
//!
//! Stages collect them (a parallel stage returns its own list, joined in prim order) and the
//! session emits them once per prim and code, so that a log is the same for any thread count.

use std::fmt;

/// Significant digits of numbers: enough to tell authored f32 apart.
const DIGITS: i32 = 6;

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
    /// The CPU renders, or goes on with, what a GPU was to render.
    Backend,
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
            Code::Backend => "backend",
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

/// A number with six significant digits and nothing superfluous.
pub fn number(x: impl Into<f64>) -> String {
    let x: f64 = x.into();
    if x == 0.0 {
        return "0".to_owned();
    }
    if !x.is_finite() {
        return format!("{x}").to_lowercase();
    }
    let scientific = format!("{x:.*e}", DIGITS as usize - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trim = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    if (-5..DIGITS + 3).contains(&exponent) {
        // Rounded to the same digits, written out.
        let rounded: f64 = scientific.parse().unwrap_or(x);
        let decimals = (DIGITS - 1 - exponent).max(0) as usize;
        trim(&format!("{rounded:.decimals$}"))
    } else {
        format!("{}e{exponent}", trim(mantissa))
    }
}
