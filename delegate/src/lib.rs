//! hdTrapeze: delegate.
