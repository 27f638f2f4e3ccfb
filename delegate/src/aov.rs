//! Size and type of an AOV, known without its pixels.

use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::render::Frame;

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AovShape {
    /// The image's pixel that the first one is, x right and y down.
    pub origin: [i32; 2],
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
    pub(crate) fn new(aov: &Aov, frame: &Frame) -> Self {
        let [x0, y0, x1, y1] = frame.window();
        Self {
            origin: [x0, y0],
            width: x0.abs_diff(x1),
            height: y0.abs_diff(y1),
            components: aov.components() as u32,
            integer: aov.is_integer(),
        }
    }

    /// Bytes of its values.
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.components) * u64::from(self.width) * u64::from(self.height)
    }
}
