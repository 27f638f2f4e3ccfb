//! PNG files: 8 bits of R, G, B and A for looking at.
//!
//! PNG wants colour that is not premultiplied, so it is divided by alpha; where alpha is 0 the pixel
//! is transparent black, as outside the data window. Values are cut to [0, 1] and rounded, not dithered. sRGB colour
//! carries an sRGB chunk, linear colour a gAMA chunk of 1; metadata become international text chunks.

use std::io::Write;
use std::path::Path;

use super::error::{EncodeError, ImageError};
use super::replace::replace_file;
use super::{ChannelData, Image, Layer, crop};

/// How colour is encoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PngColor {
    /// Values as rendered.
    Linear,
    /// The sRGB curve.
    #[default]
    Srgb,
}

/// How to write a PNG.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct PngOptions {
    /// Encoding of R, G and B; alpha is always linear.
    pub color: PngColor,
    /// Layer to write; the first of the image where none is named.
    pub layer: Option<String>,
}

/// Writes one layer of `image` to the PNG file `path`, replacing an existing file only once all is written.
///
/// Layers of four or more channels are colour and alpha (premultiplied), of three or two opaque colour, of one an opaque grey.
/// The file has the size of the image, without what was rendered around it; outside the data window it is
/// transparent.
///
/// # Errors
/// [`ImageError::Io`] where the system refuses (no such folder, no permission, disk full), and
/// [`ImageError::Invalid`] for an image that contradicts itself, without that layer, or with integers in it.
pub fn write_png(path: &Path, image: &Image, options: &PngOptions) -> Result<(), ImageError> {
    image
        .validate()
        .map_err(|reason| ImageError::invalid(path, reason))?;
    replace_file(path, |writer| encode(image, options, writer))
}

/// Writes the file's bytes.
pub(super) fn encode(
    image: &Image,
    options: &PngOptions,
    writer: impl Write,
) -> Result<(), EncodeError> {
    let layer = match &options.layer {
        None => image.layers.first(),
        Some(name) => image.layers.iter().find(|l| l.name == *name),
    };
    let layer = layer.ok_or_else(|| {
        EncodeError::Invalid(match &options.layer {
            Some(name) => format!("no layer {name:?} to write"),
            None => "no layer to write".to_owned(),
        })
    })?;
    let bytes = pixels(image, layer, options.color)?;

    let mut encoder = png::Encoder::new(writer, image.width, image.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    match options.color {
        PngColor::Srgb => encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric),
        PngColor::Linear => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
    }
    if image.pixel_aspect != 1.0 {
        // Wide pixels: fewer of them in a unit of length.
        let scale = f64::from(image.pixel_aspect);
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: (10_000.0 / scale.max(1.0)).round().max(1.0) as u32,
            yppu: (10_000.0 * scale.min(1.0)).round().max(1.0) as u32,
            unit: png::Unit::Unspecified,
        }));
    }
    for (name, value) in &image.metadata {
        // PNG's keywords: 1 to 79 printable Latin-1 characters; others are left out.
        if (1..=79).contains(&name.len())
            && name.bytes().all(|c| c.is_ascii_graphic() || c == b' ')
            && name.trim() == name
            && !value.contains('\0')
        {
            encoder.add_itxt_chunk(name.clone(), value.clone())?;
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&bytes)?;
    writer.finish()?;
    Ok(())
}

/// Rows of RGBA, the full image.
fn pixels(image: &Image, layer: &Layer, color: PngColor) -> Result<Vec<u8>, EncodeError> {
    let planes = layer
        .channels
        .iter()
        .take(4)
        .map(|(name, data)| match data {
            ChannelData::F32(v) => Ok(v.as_slice()),
            _ => Err(EncodeError::Invalid(format!(
                "channel {name} of layer {:?} has integers, which a PNG of colours cannot hold",
                layer.name
            ))),
        })
        .collect::<Result<Vec<_>, _>>()?;
    if planes.is_empty() {
        return Err(EncodeError::Invalid(format!(
            "layer {:?} has no channel",
            layer.name
        )));
    }

    let (width, height) = (image.width as usize, image.height as usize);
    let mut bytes = vec![0; width * height * 4];
    // What was rendered of the picture itself.
    let [x0, y0, x1, y1] = image.data_window;
    let x1 = x1.min(image.width.cast_signed());
    let y1 = y1.min(image.height.cast_signed());
    let part = [x0.max(0), y0.max(0), x1, y1];
    if part[0] >= part[2] || part[1] >= part[3] {
        return Ok(bytes);
    }
    let window = |plane: usize| crop(planes[plane], image.window, part);
    let [left, top, right, _] = part.map(|x| x.unsigned_abs() as usize);
    let mut fill = |channel: usize, values: &mut dyn Iterator<Item = u8>| {
        for (i, value) in values.enumerate() {
            let (x, y) = (left + i % (right - left), top + i / (right - left));
            bytes[(y * width + x) * 4 + channel] = value;
        }
    };
    for channel in 0..3 {
        // Grey repeats its only plane; of two planes, blue stays 0.
        let plane = if planes.len() == 1 { 0 } else { channel };
        if plane >= planes.len() {
            continue;
        }
        if planes.len() == 4 {
            let straight = window(plane)
                .zip(window(3))
                .map(|(c, a)| if a > 0.0 { c / a } else { 0.0 });
            fill(
                channel,
                &mut straight.map(|c| quantize(encode_color(c, color))),
            );
        } else {
            fill(
                channel,
                &mut window(plane).map(|c| quantize(encode_color(c, color))),
            );
        }
    }
    if planes.len() == 4 {
        fill(3, &mut window(3).map(quantize));
    } else {
        fill(3, &mut window(0).map(|_| 255));
    }
    Ok(bytes)
}

/// IEC 61966-2-1, above 0.
fn encode_color(linear: f32, color: PngColor) -> f32 {
    match color {
        PngColor::Linear => linear,
        PngColor::Srgb if linear <= 0.003_130_8 => 12.92 * linear,
        PngColor::Srgb => 1.055 * linear.min(1.0).powf(1.0 / 2.4) - 0.055,
    }
}

/// The nearest of 256 levels; NaN is 0.
fn quantize(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}
