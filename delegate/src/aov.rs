//! Size and type of an AOV, known without its pixels.

use hdtrapeze_core::aov::Aov;

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AovShape {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Values a pixel, 4 bytes each.
    pub components: u32,
    /// i32 values; f32 otherwise.
    pub integer: bool,
}

impl AovShape {
    pub(crate) fn new(aov: Aov, [width, height]: [u32; 2]) -> Self {
        Self {
            width,
            height,
            components: aov.components() as u32,
            integer: aov.is_integer(),
        }
    }

    /// Bytes of its values.
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.components) * u64::from(self.width) * u64::from(self.height)
    }
}
