//! Image files: EXR for compositing, PNG for looking at.
//!
//! Where: the last step of a render that writes files; AOV buffers come in whole, as the film resolved them, and a
//! file appears under its name complete or not at all.
//!
//! Conventions of the pixels here: rows from the top down, the full image (not only the data window) in each
//! channel, colour linear and premultiplied by alpha.

mod error;
mod exr_file;
mod png_file;
mod replace;
#[cfg(test)]
mod tests;

pub use error::ImageError;
pub use exr_file::{ExrCompression, ExrOptions, ExrPixelType, write_exr};
pub use png_file::{PngColor, PngOptions, write_png};

/// Pixels of one channel, `width * height` of them, rows from the top down.
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
    /// The part that was rendered: x0, y0, x1, y1, half open, y down from the top; inside the image, not empty.
    pub data_window: [u32; 4],
    /// AOVs.
    pub layers: Vec<Layer>,
    /// Names and values: camera, frame, settings, timings. EXR stores values that are written as numbers as numbers.
    pub metadata: Vec<(String, String)>,
}

impl Image {
    /// An image without layers, square pixels, all of it rendered.
    pub fn new(width: u32, height: u32) -> Image {
        Image {
            width,
            height,
            pixel_aspect: 1.0,
            data_window: [0, 0, width, height],
            layers: Vec::new(),
            metadata: Vec::new(),
        }
    }

    /// Width and height of the data window.
    fn window_size(&self) -> [usize; 2] {
        let [x0, y0, x1, y1] = self.data_window;
        [(x1 - x0) as usize, (y1 - y0) as usize]
    }

    /// Says what is wrong with the image, if anything.
    fn validate(&self) -> Result<(), String> {
        let [x0, y0, x1, y1] = self.data_window;
        if self.width == 0 || self.height == 0 {
            return Err(format!(
                "the image is {} by {} pixels",
                self.width, self.height
            ));
        }
        if self.width > i32::MAX as u32 || self.height > i32::MAX as u32 {
            return Err("the image is too large".to_owned());
        }
        if x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height {
            return Err(format!(
                "data window {x0} {y0} {x1} {y1} is empty or not inside {} by {} pixels",
                self.width, self.height
            ));
        }
        if !(self.pixel_aspect.is_finite() && self.pixel_aspect > 0.0) {
            return Err(format!("pixel aspect ratio {}", self.pixel_aspect));
        }
        let pixels = self.width as usize * self.height as usize;
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

/// The pixels of `data`, a full image of `width`, that lie in `window`.
fn crop<T: Copy>(data: &[T], width: u32, window: [u32; 4]) -> impl Iterator<Item = T> {
    let [x0, y0, x1, y1] = window.map(|v| v as usize);
    data.chunks_exact(width as usize)
        .take(y1)
        .skip(y0)
        .flat_map(move |row| row[x0..x1].iter().copied())
}
