//! hdTrapeze: shaders.
