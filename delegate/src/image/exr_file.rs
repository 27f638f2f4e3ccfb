//! OpenEXR files: one part, scan lines, layers as prefixes of channel names.
//!
//! Decisions:
//! * Layers are `layer.channel` in a single part, colour is plain `R G B A`: what every compositing package reads
//!   (multi-part files are not read everywhere).
//! * Ids are UINT, the type that OpenEXR has for them, and exact. A signed -1 (no object) is its bit
//!   pattern, 4294967295: readers with integers cast back to signed; readers that convert all channels to float, such
//!   as Nuke, see ids exactly up to 2^24 and 4294967296 for no object. HALF and FLOAT would round ids, which no
//!   reader could undo.
//! * Half precision saturates at 65504, the largest finite half: an infinite pixel spreads through every
//!   blur and resize downstream. For the same reason infinities become the largest finite number in 32 bits, and NaN,
//!   a defect of the renderer in any case, becomes 0.
//! * Metadata: a value written as a whole number that fits 32 bits becomes an int attribute, as another decimal
//!   number a float, all else a string. The names `owner`, `comments`, `capDate` and `software` are OpenEXR's own string
//!   attributes; other names that OpenEXR gives a meaning and a type get `hdtrapeze/` in front.

use std::io::{Seek, Write};
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Compression, Encoding, FlatSamples, ImageAttributes,
    IntegerBounds, LayerAttributes, Text, Vec2, WritableImage,
};
use half::f16;

use super::error::{EncodeError, ImageError};
use super::replace::replace_file;
use super::{ChannelData, Image, Precision, crop, size};

/// How real numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ExrPixelType {
    /// 16 bits, except for layers of full precision.
    #[default]
    Half,
    /// 32 bits.
    Float,
}

/// Lossless compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ExrCompression {
    /// None.
    None,
    /// Run lengths.
    Rle,
    /// Deflate, one line a block: fast to read by lines.
    Zips,
    /// Deflate, 16 lines a block.
    #[default]
    Zip,
    /// Wavelets: smallest for noisy images.
    Piz,
}

/// How to write an EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ExrOptions {
    /// Precision of layers that do not ask for all of it.
    pub pixel_type: ExrPixelType,
    /// Compression.
    pub compression: ExrCompression,
}

/// Writes all layers of `image` to the EXR file `path`, replacing an existing file only once all is written.
///
/// The data window of the file is the image's, whether inside the display window, around it or beside it.
///
/// # Errors
/// [`ImageError::Io`] where the system refuses (no such folder, no permission, disk full), and
/// [`ImageError::Invalid`] for an image that contradicts itself, that has no channel, or two of one name.
pub fn write_exr(path: &Path, image: &Image, options: &ExrOptions) -> Result<(), ImageError> {
    image
        .validate()
        .map_err(|reason| ImageError::invalid(path, reason))?;
    replace_file(path, |writer| encode(image, options, writer))
}

/// Writes the file's bytes.
pub(super) fn encode(
    image: &Image,
    options: &ExrOptions,
    writer: impl Write + Seek,
) -> Result<(), EncodeError> {
    let mut channels = Vec::new();
    for layer in &image.layers {
        for (name, (_, data)) in layer.channel_names().zip(&layer.channels) {
            let is_half = match layer.precision {
                Precision::File => options.pixel_type == ExrPixelType::Half,
                Precision::Half => true,
                Precision::Float => false,
            };
            channels.push(channel(image, &name, data, is_half)?);
        }
    }
    if channels.is_empty() {
        return Err(EncodeError::Invalid("no channel to write".to_owned()));
    }
    channels.sort_by(|a, b| a.name.as_slice().cmp(b.name.as_slice()));
    if let Some(pair) = channels.windows(2).find(|w| w[0].name == w[1].name) {
        let name = String::from_utf8_lossy(pair[0].name.as_slice()).into_owned();
        return Err(EncodeError::Invalid(format!(
            "two channels are named {name}"
        )));
    }

    let [width, height] = size(image.data_window);
    let mut layer_attributes = LayerAttributes {
        layer_position: Vec2(image.data_window[0], image.data_window[1]),
        ..LayerAttributes::default()
    };
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((
        image.width as usize,
        image.height as usize,
    )));
    attributes.pixel_aspect = image.pixel_aspect;
    for (name, value) in &image.metadata {
        add_metadata(&mut layer_attributes, name, value);
    }

    let encoding = Encoding {
        compression: match options.compression {
            ExrCompression::None => Compression::Uncompressed,
            ExrCompression::Rle => Compression::RLE,
            ExrCompression::Zips => Compression::ZIP1,
            ExrCompression::Zip => Compression::ZIP16,
            ExrCompression::Piz => Compression::PIZ,
        },
        ..Encoding::SMALL_LOSSLESS
    };
    let layer = exr::prelude::Layer::new(
        (width, height),
        layer_attributes,
        encoding,
        AnyChannels::sort(channels.into()),
    );
    exr::prelude::Image::empty(attributes)
        .with_layer(layer)
        .write()
        .to_buffered(writer)?;
    Ok(())
}

/// One channel, cropped and converted.
fn channel(
    image: &Image,
    name: &str,
    data: &ChannelData,
    is_half: bool,
) -> Result<AnyChannel<FlatSamples>, EncodeError> {
    if name.is_empty() || name.ends_with('.') || name.len() > 255 || name.contains('\0') {
        return Err(EncodeError::Invalid(format!("channel name {name:?}")));
    }
    let (window, part) = (image.window, image.data_window);
    let samples = match data {
        ChannelData::U32(v) => FlatSamples::U32(crop(v, window, part).collect()),
        ChannelData::I32(v) => {
            FlatSamples::U32(crop(v, window, part).map(i32::cast_unsigned).collect())
        }
        ChannelData::F32(v) if is_half => {
            FlatSamples::F16(crop(v, window, part).map(finite_half).collect())
        }
        ChannelData::F32(v) => FlatSamples::F32(crop(v, window, part).map(finite).collect()),
    };
    Ok(AnyChannel::new(text(name), samples))
}

/// `x` without infinities and NaN.
fn finite(x: f32) -> f32 {
    if x.is_nan() {
        0.0
    } else {
        x.clamp(f32::MIN, f32::MAX)
    }
}

/// The nearest finite half.
fn finite_half(x: f32) -> f16 {
    f16::from_f32(finite(x).clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

/// UTF-8, as OpenEXR wants strings.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

/// Attributes that OpenEXR defines with other types than string, or that describe the file itself.
const RESERVED: &[&str] = &[
    "adoptedNeutral",
    "altitude",
    "aperture",
    "bytesPerDeepSample",
    "channels",
    "chromaticities",
    "chunkCount",
    "compression",
    "dataWindow",
    "deepImageState",
    "displayWindow",
    "dwaCompressionLevel",
    "envmap",
    "expTime",
    "far",
    "fieldOfViewHorizontal",
    "fieldOfViewVertical",
    "focus",
    "framesPerSecond",
    "isoSpeed",
    "keyCode",
    "latitude",
    "lineOrder",
    "longitude",
    "lookModTransform",
    "maxSamplesPerPixel",
    "multiView",
    "name",
    "near",
    "originalDataWindow",
    "pixelAspectRatio",
    "preview",
    "renderingTransform",
    "screenWindowCenter",
    "screenWindowWidth",
    "tiles",
    "timeCode",
    "type",
    "utcOffset",
    "version",
    "view",
    "whiteLuminance",
    "worldToCamera",
    "worldToNDC",
    "wrapmodes",
    "xDensity",
];

fn add_metadata(attributes: &mut LayerAttributes, name: &str, value: &str) {
    let standard = match name {
        "owner" => Some(&mut attributes.owner),
        "comments" => Some(&mut attributes.comments),
        "capDate" => Some(&mut attributes.capture_date),
        "software" => Some(&mut attributes.software_name),
        _ => None,
    };
    if let Some(field) = standard {
        *field = Some(text(value));
        return;
    }
    let mut name = name.replace('\0', "");
    if RESERVED.contains(&name.as_str()) || name.is_empty() {
        name.insert_str(0, "hdtrapeze/");
    }
    // 255 bytes is OpenEXR's limit.
    while name.len() > 255 {
        name.pop();
    }
    attributes.other.insert(text(&name), attribute(value));
}

/// A number where `value` is written as one and the attribute says the same, else a string.
fn attribute(value: &str) -> AttributeValue {
    let digits = value.strip_prefix('-').unwrap_or(value);
    let decimal = digits.starts_with(|c: char| c.is_ascii_digit())
        && digits
            .chars()
            .all(|c| c.is_ascii_digit() || matches!(c, '.' | 'e' | 'E' | '+' | '-'))
        && !(digits.len() > 1 && digits.starts_with('0') && !digits.starts_with("0."));
    if decimal {
        let whole = digits.bytes().all(|c| c.is_ascii_digit());
        if let Ok(integer) = value.parse::<i32>() {
            return AttributeValue::I32(integer);
        }
        match value.parse::<f32>() {
            Ok(real) if !whole && real.is_finite() => return AttributeValue::F32(real),
            _ => {}
        }
    }
    AttributeValue::Text(text(value))
}
