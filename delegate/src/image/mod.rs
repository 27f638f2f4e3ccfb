//! Image files: EXR for compositing, PNG for looking at.
//!
//! Where: the last step of a render that writes files; AOV buffers come in whole, as the film resolved them, and a
//! file appears under its name complete or not at all.
//!
//! Conventions of the pixels here: rows from the top down, all of the image's window in each channel, colour
//! linear and premultiplied by alpha. Rectangles are x0, y0, x1, y1, half open, relative to the picture's top left, y
//! down: the *display window* is the picture, the *data window* what was rendered of it and around it.

mod error;
mod exr_file;
mod png_file;
mod replace;
#[cfg(test)]
mod tests;

pub use error::ImageError;
pub use exr_file::{ExrCompression, ExrOptions, ExrPixelType, write_exr};
pub use png_file::{PngColor, PngOptions, write_png};
pub(crate) use replace::write_bytes;

/// Pixels of one channel, rows from the top down.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelData {
    /// Real numbers.
    F32(Vec<f32>),
    /// Signed integers: ids, -1 for none.
    I32(Vec<i32>),
    /// Unsigned integers: counts.
    U32(Vec<u32>),
}

impl ChannelData {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            ChannelData::F32(v) => v.len(),
            ChannelData::I32(v) => v.len(),
            ChannelData::U32(v) => v.len(),
        }
    }

    /// True without pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Bits of a layer's real numbers. Integers always have 32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// As the file's pixel type says.
    #[default]
    File,
    /// 16.
    Half,
    /// 32.
    Float,
}

/// Channels that belong together: one AOV.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name of the AOV. The layers named "color" or "" have their channels named plainly in an EXR (`R`), all others
    /// with the layer in front (`normal.X`).
    pub name: String,
    /// Names and pixels.
    pub channels: Vec<(String, ChannelData)>,
    /// 32 bits whatever the file's pixel type: depth, positions, costs.
    pub precision: Precision,
}

impl Layer {
    /// A layer from the interleaved buffer of the AOV `name`, with the channel names and the precision that suit it:
    /// colours (`color`, 4 components, and other AOVs of 4) are R, G, B, A; vectors and positions X, Y, Z;
    /// depths Z; other single values X. Depths, `P`, `sampleCount` and `cost` keep 32 bits.
    ///
    /// `components` of 0 counts as 1; pixels beyond a whole multiple of it are dropped (writing then
    /// reports the wrong length).
    pub fn from_interleaved(name: &str, components: usize, pixels: &[f32]) -> Layer {
        let components = components.max(1);
        let channels = (0..components)
            .map(|c| {
                let plane = pixels.chunks_exact(components).map(|p| p[c]).collect();
                (channel_name(name, components, c), ChannelData::F32(plane))
            })
            .collect();
        Layer {
            name: name.to_owned(),
            channels,
            precision: match name {
                "depth" | "cameraDepth" | "P" | "sampleCount" | "cost" => Precision::Float,
                _ => Precision::File,
            },
        }
    }

    /// A layer of one integer channel, X.
    pub fn from_ids(name: &str, ids: Vec<i32>) -> Layer {
        Layer {
            name: name.to_owned(),
            channels: vec![(channel_name(name, 1, 0), ChannelData::I32(ids))],
            precision: Precision::Float,
        }
    }

    /// The channels' names in a file.
    pub fn channel_names(&self) -> impl Iterator<Item = String> {
        let full = |name: &String| match self.name.as_str() {
            "" | "color" => name.clone(),
            prefix => format!("{prefix}.{name}"),
        };
        self.channels.iter().map(move |(name, _)| full(name))
    }
}

fn channel_name(layer: &str, components: usize, index: usize) -> String {
    let names: &[&str] = match components {
        1 if matches!(layer, "depth" | "cameraDepth") => &["Z"],
        1 | 2 => &["X", "Y"],
        3 if layer == "color" => &["R", "G", "B"],
        3 => &["X", "Y", "Z"],
        4 => &["R", "G", "B", "A"],
        _ => &[],
    };
    names
        .get(index)
        .map_or_else(|| format!("c{index}"), |&n| n.to_owned())
}

/// All that goes into a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels across (the display window).
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Pixel width over height.
    pub pixel_aspect: f32,
    /// The pixels that channels have.
    pub window: [i32; 4],
    /// The part that was rendered, inside `window`; not empty.
    pub data_window: [i32; 4],
    /// AOVs.
    pub layers: Vec<Layer>,
    /// Names and values: camera, frame, settings, timings. EXR stores values that are written as numbers as numbers.
    pub metadata: Vec<(String, String)>,
}

impl Image {
    /// An image without layers, square pixels, all of it rendered and nothing around it.
    pub fn new(width: u32, height: u32) -> Image {
        let whole = [0, 0, width.cast_signed(), height.cast_signed()];
        Image {
            width,
            height,
            pixel_aspect: 1.0,
            window: whole,
            data_window: whole,
            layers: Vec::new(),
            metadata: Vec::new(),
        }
    }

    /// Says what is wrong with the image, if anything.
    fn validate(&self) -> Result<(), String> {
        if self.width == 0 || self.height == 0 {
            return Err(format!(
                "the image is {} by {} pixels",
                self.width, self.height
            ));
        }
        let farthest = self.window.iter().map(|x| x.unsigned_abs()).max();
        if self.width.max(self.height).max(farthest.unwrap_or(0)) > FARTHEST {
            return Err("the image is too large".to_owned());
        }
        let [x0, y0, x1, y1] = self.data_window;
        let [left, top, right, bottom] = self.window;
        if x0 >= x1 || y0 >= y1 || x0 < left || y0 < top || x1 > right || y1 > bottom {
            return Err(format!(
                "data window {x0} {y0} {x1} {y1} is empty or not inside {left} {top} {right} {bottom}"
            ));
        }
        if !(self.pixel_aspect.is_finite() && self.pixel_aspect > 0.0) {
            return Err(format!("pixel aspect ratio {}", self.pixel_aspect));
        }
        let [width, height] = size(self.window);
        let pixels = width * height;
        for layer in &self.layers {
            for (name, data) in &layer.channels {
                if data.len() != pixels {
                    return Err(format!(
                        "channel {name} of layer {:?} has {} pixels, not {pixels}",
                        layer.name,
                        data.len()
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Farthest that a pixel is from the picture's corner.
const FARTHEST: u32 = 1 << 30;

/// Width and height.
fn size([x0, y0, x1, y1]: [i32; 4]) -> [usize; 2] {
    [x0.abs_diff(x1) as usize, y0.abs_diff(y1) as usize]
}

/// The pixels of `data`, which covers `window`, that lie in `part`.
fn crop<T: Copy>(data: &[T], window: [i32; 4], part: [i32; 4]) -> impl Iterator<Item = T> {
    let [left, top, ..] = window;
    let (x, y) = (
        left.abs_diff(part[0]) as usize,
        top.abs_diff(part[1]) as usize,
    );
    let [width, height] = size(part);
    data.chunks_exact(size(window)[0])
        .skip(y)
        .take(height)
        .flat_map(move |row| row[x..x + width].iter().copied())
}
