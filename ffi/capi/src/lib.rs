//! hdTrapeze: capi.
