//! Image files of a render: AOVs to layers, what was rendered to metadata.

use std::path::{Path, PathBuf};

use hdtrapeze_core::aov::{Aov, AovData, AovImage, PrimvarAov, primvar_of};
use hdtrapeze_core::diagnostics::Warning;
use hdtrapeze_core::scene::{CameraDesc, RenderSettings};

use crate::error::Error;
use crate::image::{
    ChannelData, ExrOptions, Image, ImageError, Layer, PngColor, PngOptions, Precision,
    write_bytes, write_exr, write_png,
};
use crate::product::{self, RenderVar};

/// Kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// OpenEXR, a layer an AOV.
    Exr(ExrOptions),
    /// PNG, 8 bits, one AOV.
    Png,
}

/// How an image file is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageOptions {
    /// Kind of file.
    pub file: FileType,
    /// What the color AOV is encoded to; other AOVs stay as they are.
    pub color: PngColor,
    /// AOVs to write; none for all that were rendered (PNG: color).
    pub aovs: Vec<String>,
    /// Render vars to write, in place of AOVs (PNG: the first of color).
    pub vars: Vec<RenderVar>,
    /// Names and values that are added to the session's own, or take their place.
    pub metadata: Vec<(String, String)>,
    /// What an interrupted render had: goes beside the place of the whole file, and says so.
    pub partial: bool,
}

/// Where what an interrupted render had is kept: name.partial.exr beside name.exr, which stays.
pub(crate) fn partial(path: &Path) -> PathBuf {
    let [stem, suffix] = [path.file_stem(), path.extension()].map(Option::unwrap_or_default);
    let mut name = stem.to_owned();
    name.push(".partial.");
    name.push(suffix);
    path.with_file_name(name)
}

/// AOVs that `options` asks for, of those that were rendered.
pub(crate) fn choose(options: &ImageOptions, rendered: &[Aov]) -> Result<Vec<Aov>, Error> {
    let find = |name: &str| find(name, rendered);
    if !options.vars.is_empty() {
        if !options.aovs.is_empty() {
            let text = "an image holds AOVs or render vars, not both";
            return Err(Error::InvalidArgument(text.to_owned()));
        }
        let source = |var: &RenderVar| {
            let source = var.source().map_err(Error::Unsupported)?;
            match find(&source.aov) {
                Err(Error::NotFound(_)) if source.is_primvar() => Ok(None),
                found => found.map(Some),
            }
        };
        let found: Result<Vec<_>, Error> = match options.file {
            FileType::Exr(_) => options.vars.iter().map(source).collect(),
            FileType::Png => Ok(vec![source(product::picture(&options.vars)?)?]),
        };
        return Ok(found?.into_iter().flatten().collect());
    }
    match (options.file, options.aovs.as_slice()) {
        (FileType::Exr(_), []) => Ok(rendered.to_vec()),
        (FileType::Png, []) => Ok(vec![find(Aov::Color.name())?]),
        (FileType::Png, [_, _, ..]) => Err(Error::InvalidArgument(
            "a PNG holds one AOV; name one".to_owned(),
        )),
        (_, names) => names.iter().map(|name| find(name)).collect(),
    }
}

fn find(name: &str, rendered: &[Aov]) -> Result<Aov, Error> {
    let aov = rendered.iter().find(|aov| aov.name() == name).cloned();
    aov.ok_or_else(|| not_rendered(name))
}

/// What the file holds; `pixels` gives an AOV that was rendered.
pub(crate) fn layers(
    options: &ImageOptions,
    rendered: &[Aov],
    pixels: impl Fn(&Aov) -> Option<AovImage>,
) -> Result<(Vec<Layer>, Vec<Warning>), Error> {
    let as_layer = |aov: Aov| {
        let image = pixels(&aov).ok_or_else(|| not_rendered(aov.name()))?;
        Ok(layer(&aov, image, options))
    };
    let named = |name: &str| as_layer(find(name, rendered)?);
    match (options.vars.as_slice(), options.file) {
        ([], _) => {
            let aovs = choose(options, rendered)?;
            let layers: Result<_, Error> = aovs.into_iter().map(as_layer).collect();
            Ok((layers?, Vec::new()))
        }
        (vars, FileType::Exr(_)) => product::layers(vars, named),
        (vars, FileType::Png) => product::layers(&[product::picture(vars)?.clone()], named),
    }
}

pub(crate) fn not_rendered(name: &str) -> Error {
    Error::NotFound(format!("AOV {name} was not rendered"))
}

/// An AOV as a layer; color is encoded unless the file does it.
fn layer(aov: &Aov, image: AovImage, options: &ImageOptions) -> Layer {
    let encode = *aov == Aov::Color
        && options.color == PngColor::Srgb
        && matches!(options.file, FileType::Exr(_));
    let mut layer = match (aov, image.data) {
        (Aov::Primvar(primvar), data) => primvar_layer(primvar, data),
        (aov, AovData::F32(values)) => {
            Layer::from_interleaved(aov.name(), image.components, &values)
        }
        (aov, AovData::I32(values)) => Layer::from_ids(aov.name(), values),
    };
    if encode {
        encode_srgb(&mut layer);
    }
    layer
}

/// A primvar's layer has the primvar's own name, with the prefix only where another AOV has that
/// name. Colours have channels R, G, B, A, other values X, Y, Z, W in 32 bits.
fn primvar_layer(primvar: &PrimvarAov, data: AovData) -> Layer {
    let name = primvar_of(&primvar.name).unwrap_or(&primvar.name);
    let taken = Aov::from_name(name).is_some();
    let letters = match primvar.is_color && primvar.components > 1 {
        true => ["R", "G", "B", "A"],
        false => ["X", "Y", "Z", "W"],
    };
    let plane = |c: usize| match &data {
        AovData::F32(values) => {
            let pixels = values.chunks_exact(primvar.components);
            ChannelData::F32(pixels.map(|p| p[c]).collect())
        }
        AovData::I32(values) => {
            let pixels = values.chunks_exact(primvar.components);
            ChannelData::I32(pixels.map(|p| p[c]).collect())
        }
    };
    let channels = letters.iter().enumerate().take(primvar.components);
    Layer {
        name: if taken { &primvar.name } else { name }.to_owned(),
        channels: channels
            .map(|(c, letter)| ((*letter).to_owned(), plane(c)))
            .collect(),
        precision: match primvar.is_color {
            true => Precision::File,
            false => Precision::Float,
        },
    }
}

/// Encodes premultiplied colour: divided by alpha, encoded, multiplied again.
fn encode_srgb(layer: &mut Layer) {
    let [
        (_, ChannelData::F32(r)),
        (_, ChannelData::F32(g)),
        (_, ChannelData::F32(b)),
        (_, ChannelData::F32(a)),
    ] = layer.channels.as_mut_slice()
    else {
        return;
    };
    for channel in [r, g, b] {
        for (value, &alpha) in channel.iter_mut().zip(&*a) {
            if alpha > 0.0 {
                *value = srgb(*value / alpha) * alpha;
            }
        }
    }
}

/// sRGB's transfer function (IEC 61966-2-1), continued as an odd function.
fn srgb(linear: f32) -> f32 {
    let size = linear.abs();
    let encoded = match size <= 0.003_130_8 {
        true => 12.92 * size,
        false => 1.055 * size.powf(1.0 / 2.4) - 0.055,
    };
    encoded.copysign(linear)
}

/// Metadata that every file of a render has.
pub(crate) fn facts(camera: &CameraDesc, settings: &RenderSettings) -> Vec<(String, String)> {
    let [open, close] = settings.shutter.unwrap_or(camera.shutter);
    let filter_width = match settings.filter_width {
        0.0 => settings.filter.default_width(),
        width => width,
    };
    let version = env!("CARGO_PKG_VERSION");
    [
        ("software", format!("hdTrapeze {version}")),
        ("hdtrapeze/camera", camera.path.clone()),
        ("hdtrapeze/samples", settings.samples.to_string()),
        ("hdtrapeze/shadingRate", settings.shading_rate.to_string()),
        ("hdtrapeze/filter", format!("{:?}", settings.filter)),
        ("hdtrapeze/filterWidth", filter_width.to_string()),
        ("hdtrapeze/seed", settings.seed.to_string()),
        ("hdtrapeze/shutterOpen", open.to_string()),
        ("hdtrapeze/shutterClose", close.to_string()),
        (
            "hdtrapeze/motionBlur",
            (!settings.disable_motion_blur).to_string(),
        ),
        ("hdtrapeze/defocus", (!settings.disable_defocus).to_string()),
        ("hdtrapeze/backend", "cpu".to_owned()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

/// Sets a name's value, in place where it has one.
pub(crate) fn set_fact(facts: &mut Vec<(String, String)>, name: &str, value: String) {
    match facts.iter_mut().find(|(known, _)| known == name) {
        Some((_, old)) => *old = value,
        None => facts.push((name.to_owned(), value)),
    }
}

/// Writes the file whole, or leaves what was there.
pub(crate) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<(), Error> {
    let written = match options.file {
        FileType::Exr(exr) => write_exr(path, image, &exr),
        FileType::Png => {
            let color = match image.layers.first() {
                Some(layer) if layer.name == Aov::Color.name() => options.color,
                _ => PngColor::Linear,
            };
            write_png(path, image, &PngOptions { color, layer: None })
        }
    };
    written.map_err(error)
}

/// The same of a text.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    write_bytes(path, text.as_bytes()).map_err(error)
}

fn error(error: ImageError) -> Error {
    match error {
        ImageError::Io { .. } => Error::Io(error.to_string()),
        ImageError::Invalid { .. } => Error::InvalidArgument(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(file: FileType, aovs: &[&str]) -> ImageOptions {
        ImageOptions {
            file,
            color: PngColor::Srgb,
            aovs: aovs.iter().map(|name| (*name).to_owned()).collect(),
            vars: Vec::new(),
            metadata: Vec::new(),
            partial: false,
        }
    }

    #[test]
    fn partial_files_are_beside_the_whole_ones() {
        let beside = |path: &str| partial(path.as_ref()).display().to_string();
        assert_eq!(beside("a/b.0001.exr"), "a/b.0001.partial.exr");
        assert_eq!(beside("shot.png"), "shot.partial.png");
    }

    #[test]
    fn files_hold_what_was_asked_for() {
        let rendered = [Aov::Color, Aov::P];
        let exr = FileType::Exr(ExrOptions::default());
        let chosen = |file, aovs: &[&str]| choose(&options(file, aovs), &rendered);
        assert_eq!(chosen(exr, &[]).unwrap(), rendered);
        assert_eq!(chosen(exr, &["P"]).unwrap(), [Aov::P]);
        assert_eq!(chosen(FileType::Png, &[]).unwrap(), [Aov::Color]);
        assert_eq!(chosen(FileType::Png, &["P"]).unwrap(), [Aov::P]);
        let not_found = |result| matches!(result, Err(Error::NotFound(_)));
        assert!(not_found(chosen(exr, &["normal"])));
        assert!(not_found(chosen(exr, &["nonsense"])));
        assert!(matches!(
            chosen(FileType::Png, &["P", "color"]),
            Err(Error::InvalidArgument(_))
        ));
        let with_vars = |file, sources: &[&str], aovs: &[&str]| {
            let var = |source: &&str| RenderVar {
                source_name: (*source).to_owned(),
                ..RenderVar::default()
            };
            let mut options = options(file, aovs);
            options.vars = sources.iter().map(var).collect();
            choose(&options, &rendered)
        };
        let both = [Aov::P, Aov::Color];
        assert_eq!(with_vars(exr, &["P", "Ci"], &[]).unwrap(), both);
        assert_eq!(
            with_vars(FileType::Png, &["P", "Ci"], &[]).unwrap(),
            [Aov::Color]
        );
        assert!(not_found(with_vars(exr, &["normal"], &[])));
        for (file, sources, aovs) in [(exr, "P", &["P"][..]), (FileType::Png, "P", &[])] {
            let refused = with_vars(file, &[sources], aovs);
            assert!(matches!(refused, Err(Error::InvalidArgument(_))));
        }
        let only_p = choose(&options(FileType::Png, &[]), &[Aov::P]);
        assert!(not_found(only_p));
    }

    #[test]
    fn colour_is_encoded_without_its_alpha() {
        // sRGB of 0.25 and 0.5, and of a value on the straight part.
        let expected = [0.537_099, 0.735_357, 12.92 * 0.001];
        let image = AovImage {
            origin: [0, 0],
            width: 1,
            height: 1,
            components: 4,
            data: AovData::F32(vec![0.125, 0.25, 0.0005, 0.5]),
        };
        let exr = FileType::Exr(ExrOptions::default());
        let encoded = layer(&Aov::Color, image.clone(), &options(exr, &[]));
        for ((_, channel), expected) in encoded.channels.iter().zip(expected) {
            let ChannelData::F32(values) = channel else {
                panic!("floats");
            };
            assert!((values[0] - 0.5 * expected).abs() < 1e-5, "{values:?}");
        }
        // PNG encodes by itself.
        let png = layer(&Aov::Color, image, &options(FileType::Png, &[]));
        assert_eq!(png.channels[0].1, ChannelData::F32(vec![0.125]));
    }

    #[test]
    fn the_host_overrides_facts() {
        let mut facts = facts(&CameraDesc::default(), &RenderSettings::default());
        let count = facts.len();
        set_fact(&mut facts, "software", "other".to_owned());
        set_fact(&mut facts, "frame", "7".to_owned());
        assert_eq!(facts[0].1, "other");
        assert_eq!(facts.len(), count + 1);
    }
}
