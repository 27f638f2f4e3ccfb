//! hdTrapeze: osd.
