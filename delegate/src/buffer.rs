//! AOVs as hosts show them: in a format and at a place of theirs, over a background.

use half::f16;
use hdtrapeze_core::aov::{AovData, AovImage};

use crate::error::Error;
use crate::progress::State;
use crate::render_loop::RenderLoop;

/// Most components of a pixel.
const MOST_COMPONENTS: usize = 4;

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// f32.
    Float32,
    /// f16.
    Float16,
    /// i32.
    Int32,
    /// 0 to 1 in a byte.
    Unorm8,
    /// -1 to 1 in a signed byte.
    Snorm8,
}

impl Component {
    /// Bytes.
    pub fn size(self) -> usize {
        match self {
            Component::Float32 | Component::Int32 => 4,
            Component::Float16 => 2,
            Component::Unorm8 | Component::Snorm8 => 1,
        }
    }

    /// Values beyond what the type has become the nearest that it has.
    fn write(self, out: &mut [u8], value: f64) {
        match self {
            Component::Float32 => out.copy_from_slice(&(value as f32).to_ne_bytes()),
            Component::Float16 => out.copy_from_slice(&f16::from_f64(value).to_ne_bytes()),
            Component::Int32 => out.copy_from_slice(&(value as i32).to_ne_bytes()),
            Component::Unorm8 => out.fill((value.clamp(0.0, 1.0) * 255.0).round() as u8),
            Component::Snorm8 => {
                let byte = (value.clamp(-1.0, 1.0) * 127.0).round() as i8;
                out.fill(byte.cast_unsigned());
            }
        }
    }
}

/// What a buffer is like.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Values a pixel.
    pub components: usize,
    /// Type of each.
    pub component: Component,
    /// Rows are from the bottom up; else from the top down.
    pub bottom_up: bool,
    /// The image's pixel that the buffer's top left is, x right and y down.
    pub origin: [i32; 2],
    /// What it shows where nothing was rendered, and behind a colour; 0 for what is left out.
    pub clear: Vec<f64>,
}

impl Layout {
    fn pixel_size(&self) -> usize {
        self.components * self.component.size()
    }

    /// Bytes of all pixels.
    pub fn bytes(&self) -> Option<usize> {
        let pixels = (self.width as usize).checked_mul(self.height as usize)?;
        pixels.checked_mul(self.pixel_size())
    }

    fn fill_with_clear(&self, data: &mut [u8]) {
        let mut pixel = vec![0; self.pixel_size()];
        let parts = pixel.chunks_exact_mut(self.component.size());
        for (part, &value) in parts.zip(&self.clear) {
            self.component.write(part, value);
        }
        for out in data.chunks_exact_mut(pixel.len().max(1)) {
            out.copy_from_slice(&pixel);
        }
    }

    /// Shows an AOV; `is_color` goes over the clear value where that is not black.
    fn fill(&self, data: &mut [u8], image: &AovImage, is_color: bool) {
        self.fill_with_clear(data);
        let given = image.components;
        let over = is_color && given == 4 && self.clear.len() >= 3;
        let over = over && self.clear.iter().any(|&c| c != 0.0);
        let rows = data.chunks_exact_mut((self.width as usize * self.pixel_size()).max(1));
        for (row, out) in (0_i64..).zip(rows) {
            let down = match self.bottom_up {
                true => i64::from(self.height) - 1 - row,
                false => row,
            };
            let y = down + i64::from(self.origin[1]) - i64::from(image.origin[1]);
            if !(0..i64::from(image.height)).contains(&y) {
                continue;
            }
            for (column, out) in (0_i64..).zip(out.chunks_exact_mut(self.pixel_size())) {
                let x = column + i64::from(self.origin[0]) - i64::from(image.origin[0]);
                if !(0..i64::from(image.width)).contains(&x) {
                    continue;
                }
                let first = (y * i64::from(image.width) + x) as usize * given;
                let mut pixel = [0.0; MOST_COMPONENTS];
                for (c, value) in pixel.iter_mut().enumerate().take(given) {
                    *value = match &image.data {
                        AovData::F32(values) => f64::from(values[first + c]),
                        AovData::I32(values) => f64::from(values[first + c]),
                    };
                }
                if over {
                    let behind = 1.0 - pixel[3];
                    // Nothing of what is no number either, where nothing is seen of it.
                    for (value, clear) in pixel.iter_mut().zip(&self.clear) {
                        *value += if behind == 0.0 { 0.0 } else { behind * clear };
                    }
                } else if given == 3 {
                    pixel[3] = 1.0;
                }
                for (part, value) in out.chunks_exact_mut(self.component.size()).zip(pixel) {
                    self.component.write(part, value);
                }
            }
        }
    }
}

/// What a buffer shows: nothing yet by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// It has pixels, if only clear values.
    pub filled: bool,
    /// The render of the loop; 0 for none.
    pub render: u64,
    /// Samples of it.
    pub samples: u32,
    /// It had come to its end.
    pub ended: bool,
}

impl RenderLoop {
    /// Fills a buffer with an AOV of what can be read, where that is more than what it shows. A render
    /// that has not been everywhere yet leaves the one before it, and all that there is once it has ended.
    pub fn show(
        &self,
        aov: &str,
        layout: &Layout,
        data: &mut [u8],
        shown: Shown,
    ) -> Result<Shown, Error> {
        if !shown.filled {
            layout.fill_with_clear(data);
        }
        let before = Shown {
            filled: true,
            ..shown
        };
        let progress = self.session().progress()?;
        let now = Shown {
            filled: true,
            render: self.progress().readable,
            samples: progress.samples_done,
            ended: !progress.state.is_running(),
        };
        let has_some = progress.state != State::Preparing && (now.ended || now.samples > 0);
        if now.render == 0 || !has_some || now == before {
            return Ok(before);
        }
        match self.session().aov(aov) {
            Ok(image) => {
                layout.fill(data, &image, aov == "color");
                Ok(now)
            }
            // Another render has begun, or has no such AOV.
            Err(Error::NotFound(_)) => Ok(before),
            Err(error) => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(component: Component, components: usize) -> Layout {
        Layout {
            width: 2,
            height: 2,
            components,
            component,
            bottom_up: true,
            origin: [0, 0],
            clear: Vec::new(),
        }
    }

    fn image(origin: [i32; 2], side: u32, values: &[f32]) -> AovImage {
        AovImage {
            origin,
            width: side,
            height: side,
            components: values.len() / (side * side) as usize,
            data: AovData::F32(values.to_vec()),
        }
    }

    fn filled(layout: &Layout, image: &AovImage, is_color: bool) -> Vec<u8> {
        let mut data = vec![7; layout.bytes().unwrap()];
        layout.fill(&mut data, image, is_color);
        data
    }

    #[test]
    fn rows_go_up_or_down_and_pixels_have_places() {
        let bytes = |layout: &Layout, origin| {
            filled(layout, &image(origin, 2, &[0.0, 0.2, 0.4, 0.6]), false)
        };
        let mut one = layout(Component::Unorm8, 1);
        assert_eq!(bytes(&one, [0, 0]), [102, 153, 0, 51]);
        one.bottom_up = false;
        assert_eq!(bytes(&one, [0, 0]), [0, 51, 102, 153]);
        // With overscan to the left and above, and a buffer further right.
        one.clear = vec![1.0];
        assert_eq!(bytes(&one, [-1, -1]), [153, 255, 255, 255]);
        one.origin = [-1, -1];
        assert_eq!(bytes(&one, [0, 0]), [255, 255, 255, 0]);
    }

    #[test]
    fn buffers_without_pixels_are_filled() {
        let image = image([0, 0], 2, &[0.0, 0.2, 0.4, 0.6]);
        for (width, height) in [(0, 2), (2, 0)] {
            let layout = Layout {
                width,
                height,
                ..layout(Component::Float32, 1)
            };
            assert!(filled(&layout, &image, false).is_empty());
        }
    }

    #[test]
    fn components_of_all_types() {
        let image = image([0, 0], 1, &[0.5, -2.0, 1.0, f32::NAN]);
        let bytes = |component, components| {
            let layout = Layout {
                width: 1,
                height: 1,
                ..layout(component, components)
            };
            filled(&layout, &image, false)
        };
        assert_eq!(bytes(Component::Unorm8, 4), [128, 0, 255, 0]);
        assert_eq!(bytes(Component::Snorm8, 3), [64, 129, 127]);
        let whole = [0_i32, -2].map(i32::to_ne_bytes).concat();
        assert_eq!(bytes(Component::Int32, 2), whole);
        let halves = [0.5_f32, -2.0]
            .map(|v| f16::from_f32(v).to_ne_bytes())
            .concat();
        assert_eq!(bytes(Component::Float16, 2), halves);
        let floats = [0.5_f32, -2.0].map(f32::to_ne_bytes).concat();
        assert_eq!(bytes(Component::Float32, 2), floats);
    }

    #[test]
    fn colour_goes_over_the_clear_value_and_others_are_opaque() {
        let mut layout = Layout {
            width: 1,
            height: 1,
            ..layout(Component::Unorm8, 4)
        };
        let half = [0.2, 0.2, 0.2, 0.6];
        let four = image([0, 0], 1, &half);
        assert_eq!(filled(&layout, &four, true), [51, 51, 51, 153]);
        layout.clear = vec![1.0, 0.0, 0.0, 1.0];
        assert_eq!(filled(&layout, &four, true), [153, 51, 51, 255]);
        assert_eq!(filled(&layout, &four, false), [51, 51, 51, 153]);
        let three = image([0, 0], 1, &half[..3]);
        assert_eq!(filled(&layout, &three, false), [51, 51, 51, 255]);
    }
}
