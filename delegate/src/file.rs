//! How the session writes image files.

/// Kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// OpenEXR, a layer an AOV.
    Exr,
    /// PNG, 8 bits, one AOV.
    Png,
}
/// Type of EXR's pixels; ids and depths are always 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelType {
    /// 16-bit float.
    Half,
    /// 32-bit float.
    Float,
}
/// Compression of EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// None.
    None,
    /// Run lengths.
    Rle,
    /// One line a block.
    Zips,
    /// 16 lines a block.
    Zip,
    /// Wavelets.
    Piz,
}
/// Encoding of the color AOV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// As rendered.
    Linear,
    /// sRGB transfer function.
    Srgb,
}
/// What to write.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageOptions {
    /// Kind of file.
    pub file: FileType,
    /// Type of pixels.
    pub pixel_type: PixelType,
    /// Compression.
    pub compression: Compression,
    /// Encoding of color.
    pub color: ColorSpace,
    /// AOVs to write; none for all that were rendered.
    pub aovs: Vec<String>,
    /// Names and values for the file's header.
    pub metadata: Vec<(String, String)>,
}
