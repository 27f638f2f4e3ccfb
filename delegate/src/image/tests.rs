//! Files are read back with the libraries' own readers, and failures must leave the old file alone.

use std::fs;
use std::io::{self, BufReader, Cursor, Seek, SeekFrom, Write};
use std::path::Path;

use exr::prelude::{
    AttributeValue, FlatSamples, ReadChannels, ReadLayers, Vec2, read_all_data_from_file,
};

use super::error::EncodeError;
use super::replace::replace_file;
use super::*;

/// A smooth ramp with values that tell rows, columns and channels apart.
fn ramp(width: u32, height: u32, components: usize) -> Vec<f32> {
    (0..width as usize * height as usize)
        .flat_map(|i| {
            let (x, y) = (i % width as usize, i / width as usize);
            (0..components).map(move |c| x as f32 + 100.0 * y as f32 + 0.25 * c as f32)
        })
        .collect()
}

fn sample(width: u32, height: u32) -> Image {
    let pixels = (width * height) as usize;
    let mut image = Image::new(width, height);
    image.layers = vec![
        Layer::from_interleaved("color", 4, &ramp(width, height, 4)),
        Layer::from_interleaved("depth", 1, &vec![0.1; pixels]),
        Layer::from_interleaved("normal", 3, &ramp(width, height, 3)),
        Layer::from_ids(
            "primId",
            (0..pixels as i32)
                .map(|i| i.wrapping_mul(20_000_001) - 1)
                .collect(),
        ),
    ];
    image
}

struct ReadBack {
    image: exr::prelude::FlatImage,
}

impl ReadBack {
    fn new(path: &Path) -> Self {
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_file(path)
            .unwrap();
        assert_eq!(image.layer_data.len(), 1, "a single part");
        Self { image }
    }

    fn names(&self) -> Vec<String> {
        let list = &self.image.layer_data[0].channel_data.list;
        list.iter().map(|c| c.name.to_string()).collect()
    }

    fn samples(&self, name: &str) -> &FlatSamples {
        let list = &self.image.layer_data[0].channel_data.list;
        &list.iter().find(|c| c.name.eq(name)).unwrap().sample_data
    }

    fn attribute(&self, name: &str) -> Option<AttributeValue> {
        let key = exr::prelude::Text::from(name);
        let layer = self.image.layer_data[0].attributes.other.get(&key);
        layer
            .or_else(|| self.image.attributes.other.get(&key))
            .cloned()
    }
}

/// Nothing but `files` may be in the folder: no temporary file is left.
fn assert_only(folder: &Path, files: &[&str]) {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, files);
}

#[test]
fn exr_round_trip_in_every_compression_and_type() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    let (width, height) = (37, 41);
    let image = sample(width, height);
    for pixel_type in [ExrPixelType::Half, ExrPixelType::Float] {
        for compression in [
            ExrCompression::None,
            ExrCompression::Rle,
            ExrCompression::Zips,
            ExrCompression::Zip,
            ExrCompression::Piz,
        ] {
            write_exr(
                &path,
                &image,
                &ExrOptions {
                    pixel_type,
                    compression,
                },
            )
            .unwrap();
            let read = ReadBack::new(&path);
            assert_eq!(
                read.names(),
                [
                    "A", "B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z", "primId.X"
                ]
            );
            for (c, name) in ["R", "G", "B", "A"].iter().enumerate() {
                let expected = ramp(width, height, 4).into_iter().skip(c).step_by(4);
                let samples = read.samples(name);
                match (pixel_type, samples) {
                    (ExrPixelType::Half, FlatSamples::F16(_)) => {}
                    (ExrPixelType::Float, FlatSamples::F32(_)) => {}
                    other => panic!("{other:?}"),
                }
                for (value, expected) in samples.values_as_f32().zip(expected) {
                    let tolerance = match pixel_type {
                        ExrPixelType::Half => expected * 2f32.powi(-11),
                        ExrPixelType::Float => 0.0,
                    };
                    assert!(
                        (value - expected).abs() <= tolerance,
                        "{name} {value} {expected}"
                    );
                }
            }
            let FlatSamples::F32(depth) = read.samples("depth.Z") else {
                panic!("depth must keep 32 bits");
            };
            assert!(depth.iter().all(|&d| d == 0.1));
            let FlatSamples::U32(ids) = read.samples("primId.X") else {
                panic!("ids must be UINT");
            };
            for (i, &id) in ids.iter().enumerate() {
                assert_eq!(id.cast_signed(), (i as i32).wrapping_mul(20_000_001) - 1);
            }
            assert_only(folder.path(), &["out.exr"]);
        }
    }
}

#[test]
fn exr_stores_the_crop_as_its_data_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("crop.exr");
    let mut image = sample(20, 10);
    image.data_window = [3, 2, 15, 9];
    image.pixel_aspect = 2.0;
    let options = ExrOptions {
        pixel_type: ExrPixelType::Float,
        ..ExrOptions::default()
    };
    write_exr(&path, &image, &options).unwrap();
    let read = ReadBack::new(&path);
    let layer = &read.image.layer_data[0];
    assert_eq!(layer.attributes.layer_position, Vec2(3, 2));
    assert_eq!(layer.size, Vec2(12, 7));
    assert_eq!(read.image.attributes.display_window.position, Vec2(0, 0));
    assert_eq!(read.image.attributes.display_window.size, Vec2(20, 10));
    assert_eq!(read.image.attributes.pixel_aspect, 2.0);
    for (i, value) in read.samples("R").values_as_f32().enumerate() {
        assert_eq!(value, (3 + i % 12) as f32 + 100.0 * (2 + i / 12) as f32);
    }
}

#[test]
fn overscan_reaches_out_of_the_display_window() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = Image::new(6, 5);
    image.window = [-3, -2, 8, 9];
    for data_window in [[-3, -2, 8, 9], [-1, -2, 4, 3], [6, 5, 8, 9]] {
        let [x0, y0, x1, y1] = data_window;
        image.data_window = data_window;
        image.layers = vec![Layer::from_interleaved("color", 4, &ramp(11, 11, 4))];
        let path = folder.path().join("over.exr");
        let options = ExrOptions {
            pixel_type: ExrPixelType::Float,
            ..ExrOptions::default()
        };
        write_exr(&path, &image, &options).unwrap();
        let read = ReadBack::new(&path);
        let layer = &read.image.layer_data[0];
        assert_eq!(layer.attributes.layer_position, Vec2(x0, y0));
        let (width, height) = ((x1 - x0) as usize, (y1 - y0) as usize);
        assert_eq!(layer.size, Vec2(width, height));
        let display = read.image.attributes.display_window;
        assert_eq!((display.position, display.size), (Vec2(0, 0), Vec2(6, 5)));
        for (i, value) in read.samples("R").values_as_f32().enumerate() {
            let x = x0 + 3 + (i % width) as i32;
            let y = y0 + 2 + (i / width) as i32;
            assert_eq!(value, x as f32 + 100.0 * y as f32);
        }

        let path = folder.path().join("over.png");
        let white = Layer::from_interleaved("color", 4, &[1.0; 11 * 11 * 4]);
        image.layers = vec![white];
        write_png(&path, &image, &PngOptions::default()).unwrap();
        let (info, bytes) = read_png(&path);
        assert_eq!((info.width, info.height), (6, 5));
        for (i, pixel) in bytes.as_chunks::<4>().0.iter().enumerate() {
            let (x, y) = (i as i32 % 6, i as i32 / 6);
            let inside = (x0..x1).contains(&x) && (y0..y1).contains(&y);
            assert_eq!(*pixel, if inside { [255; 4] } else { [0; 4] }, "{x} {y}");
        }
    }
}

#[test]
fn half_saturates_and_nothing_is_nan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("range.exr");
    let values = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        65504.0,
        65519.9,
        65520.0,
        1e30,
        -1e30,
        6e-8,
        1e-9,
    ];
    let mut image = Image::new(values.len() as u32, 1);
    image.layers = vec![
        Layer::from_interleaved("heat", 1, &values),
        Layer::from_interleaved("depth", 1, &values),
    ];
    write_exr(&path, &image, &ExrOptions::default()).unwrap();
    let read = ReadBack::new(&path);
    let half: Vec<f32> = read.samples("heat.X").values_as_f32().collect();
    assert_eq!(
        half[..8],
        [
            0.0, 65504.0, -65504.0, 65504.0, 65504.0, 65504.0, 65504.0, -65504.0
        ]
    );
    assert!(half[8] > 0.0 && half[9] == 0.0);
    let float: Vec<f32> = read.samples("depth.Z").values_as_f32().collect();
    assert_eq!(float[..3], [0.0, f32::MAX, f32::MIN]);
    assert_eq!(float[3..], values[3..]);
}

#[test]
fn exr_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("meta.exr");
    let mut image = sample(4, 4);
    let long = "n".repeat(300);
    for (name, value) in [
        ("camera", "/cameras/主"),
        ("samples", "64"),
        ("seconds", "1.5"),
        ("frame", "0101"),
        ("hash", "4294967295"),
        ("build", "1e400"),
        ("empty", ""),
        ("compression", "none of it"),
        ("exposure", "bright"),
        ("aperture", "wide"),
        ("software", "hdTrapeze"),
        (long.as_str(), "long"),
        ("", "nameless"),
    ] {
        image.metadata.push((name.to_owned(), value.to_owned()));
    }
    write_exr(&path, &image, &ExrOptions::default()).unwrap();
    let read = ReadBack::new(&path);
    let text = |s: &str| {
        Some(AttributeValue::Text(
            exr::prelude::Text::from_slice_unchecked(s.as_bytes()),
        ))
    };
    assert_eq!(read.attribute("camera"), text("/cameras/主"));
    assert_eq!(read.attribute("samples"), Some(AttributeValue::I32(64)));
    assert_eq!(read.attribute("seconds"), Some(AttributeValue::F32(1.5)));
    assert_eq!(read.attribute("frame"), text("0101"));
    assert_eq!(read.attribute("hash"), text("4294967295"));
    assert_eq!(read.attribute("build"), text("1e400"));
    assert_eq!(read.attribute("hdtrapeze/compression"), text("none of it"));
    assert_eq!(read.attribute("hdtrapeze/aperture"), text("wide"));
    assert_eq!(read.attribute("exposure"), text("bright"));
    assert_eq!(read.attribute("hdtrapeze/"), text("nameless"));
    assert_eq!(read.attribute(&"n".repeat(255)), text("long"));
    let software = read.image.layer_data[0].attributes.software_name.clone();
    assert_eq!(software, Some("hdTrapeze".into()));
}

#[test]
fn exr_is_readable_as_a_plain_rgba_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rgba.exr");
    write_exr(&path, &sample(8, 8), &ExrOptions::default()).unwrap();
    assert_eq!(read_all_data_from_file(&path).unwrap().layer_data.len(), 1);
    let picture = exr::prelude::read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![[0f32; 4]; size.area()],
        |pixels, at, (r, g, b, a): (f32, f32, f32, f32)| pixels[at.y() * 8 + at.x()] = [r, g, b, a],
    )
    .unwrap();
    assert_eq!(
        picture.layer_data.channel_data.pixels[2],
        [2.0, 2.25, 2.5, 2.75]
    );
}

fn read_png(path: &Path) -> (png::Info<'static>, Vec<u8>) {
    let decoder = png::Decoder::new(BufReader::new(fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    (reader.info().clone(), bytes)
}

#[test]
fn png_holds_straight_colour() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.png");
    let mut image = Image::new(3, 2);
    image
        .metadata
        .push(("camera".to_owned(), "/cam/主".to_owned()));
    let pixels = [
        [0.5, 0.25, 0.0, 1.0],
        [0.25, 0.125, 0.0, 0.5],
        [3.0, -1.0, f32::NAN, 1.0],
        [0.1, 0.1, 0.1, 0.0],
        [0.2, 0.2, 0.2, 0.2],
        [0.0, 0.0, 0.0, f32::NAN],
    ];
    image.layers = vec![Layer::from_interleaved("color", 4, pixels.as_flattened())];

    let linear = PngOptions {
        color: PngColor::Linear,
        layer: None,
    };
    write_png(&path, &image, &linear).unwrap();
    let (info, bytes) = read_png(&path);
    assert_eq!(
        (info.width, info.height, info.color_type),
        (3, 2, png::ColorType::Rgba)
    );
    assert_eq!(info.srgb, None);
    assert_eq!(info.gamma(), Some(png::ScaledFloat::new(1.0)));
    assert_eq!(info.utf8_text[0].keyword, "camera");
    assert_eq!(info.utf8_text[0].get_text().unwrap(), "/cam/主");
    assert_eq!(
        bytes.as_chunks::<4>().0,
        [
            [128, 64, 0, 255],
            [128, 64, 0, 128],
            [255, 0, 0, 255],
            [0, 0, 0, 0],
            [255, 255, 255, 51],
            [0, 0, 0, 0]
        ]
    );

    write_png(&path, &image, &PngOptions::default()).unwrap();
    let (info, bytes) = read_png(&path);
    assert!(info.srgb.is_some());
    // 0.5 is 188 and 0.25 is 137 in sRGB; alpha stays linear.
    assert_eq!(bytes[..8], [188, 137, 0, 255, 188, 137, 0, 128]);
    assert_only(folder.path(), &["out.png"]);
}

#[test]
fn png_crops_greys_and_pixel_aspect() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.png");
    let mut image = Image::new(4, 3);
    image.data_window = [1, 1, 3, 3];
    image.pixel_aspect = 2.0;
    image.layers = vec![
        Layer::from_interleaved("color", 4, &[1.0; 48]),
        Layer::from_interleaved("depth", 1, &[0.5; 12]),
        Layer::from_interleaved("normal", 3, &[0.25; 36]),
        Layer::from_ids("primId", vec![0; 12]),
    ];
    let with = |layer: &str| PngOptions {
        color: PngColor::Linear,
        layer: Some(layer.to_owned()),
    };
    for (layer, inside) in [
        ("color", [255, 255, 255, 255]),
        ("depth", [128, 128, 128, 255]),
        ("normal", [64, 64, 64, 255]),
    ] {
        write_png(&path, &image, &with(layer)).unwrap();
        let (info, bytes) = read_png(&path);
        let dims = info.pixel_dims.unwrap();
        assert_eq!(dims.yppu, 2 * dims.xppu);
        for (i, pixel) in bytes.as_chunks::<4>().0.iter().enumerate() {
            let rendered = (1..3).contains(&(i % 4)) && (1..3).contains(&(i / 4));
            assert_eq!(
                *pixel,
                if rendered { inside } else { [0; 4] },
                "{layer} {i}"
            );
        }
    }
    for (layer, reason) in [("primId", "integers"), ("nothing", "no layer")] {
        let error = write_png(&path, &image, &with(layer))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(reason) && error.contains("out.png"),
            "{error}"
        );
    }
}

#[test]
fn contradictory_images_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.exr");
    type Edit = (&'static str, fn(&mut Image));
    let edits: [Edit; 12] = [
        ("0 by 4", |i| i.width = 0),
        ("data window", |i| i.data_window = [2, 2, 2, 4]),
        ("data window", |i| i.data_window = [0, 0, 5, 4]),
        ("aspect", |i| i.pixel_aspect = f32::NAN),
        ("data window", |i| i.data_window = [-1, 0, 4, 4]),
        ("too large", |i| i.window = [i32::MIN, 0, 4, 4]),
        ("pixels, not 20", |i| i.window = [0, -1, 4, 4]),
        ("15 pixels", |i| {
            i.layers[0].channels[1].1 = ChannelData::F32(vec![0.0; 15])
        }),
        ("no channel", |i| i.layers.clear()),
        ("two channels", |i| {
            i.layers[0].channels[1].0 = "R".to_owned()
        }),
        ("channel name", |i| {
            i.layers[0].channels[1].0 = String::new()
        }),
        ("channel name", |i| i.layers[2].name = "n".repeat(255)),
    ];
    for (reason, edit) in edits {
        let mut image = sample(4, 4);
        edit(&mut image);
        let error = write_exr(&path, &image, &ExrOptions::default()).unwrap_err();
        assert!(matches!(error, ImageError::Invalid { .. }));
        let message = error.to_string();
        assert!(
            message.contains(reason) && message.contains("bad.exr"),
            "{message}"
        );
    }
    assert_only(folder.path(), &[]);
}

#[test]
fn an_unreachable_folder_is_an_error_with_the_path() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "x").unwrap();
    for place in ["missing/out.exr", "file/out.exr"] {
        let path = folder.path().join(place);
        let error = write_exr(&path, &sample(4, 4), &ExrOptions::default()).unwrap_err();
        assert!(matches!(error, ImageError::Io { .. }), "{error}");
        assert!(error.to_string().contains(place), "{error}");
    }
    assert!(write_exr(Path::new("/"), &sample(4, 4), &ExrOptions::default()).is_err());
    // A folder, or a device, is never replaced.
    let error = write_exr(folder.path(), &sample(4, 4), &ExrOptions::default()).unwrap_err();
    assert!(error.to_string().contains("not a regular file"), "{error}");
    assert_only(folder.path(), &["file"]);
}

#[cfg(unix)]
#[test]
fn unwritable_places_keep_the_old_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    fs::write(&path, "old").unwrap();

    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    let error = write_exr(&path, &sample(4, 4), &ExrOptions::default()).unwrap_err();
    assert!(error.to_string().contains("read-only"), "{error}");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();

    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
    let privileged = fs::write(folder.path().join("probe"), "").is_ok();
    let result = write_exr(&path, &sample(4, 4), &ExrOptions::default());
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    if privileged {
        // The superuser may write anywhere; then the file is replaced and keeps its permissions.
        fs::remove_file(folder.path().join("probe")).unwrap();
        result.unwrap();
    } else {
        assert!(matches!(result, Err(ImageError::Io { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        write_exr(&path, &sample(4, 4), &ExrOptions::default()).unwrap();
    }
    assert_eq!(
        fs::metadata(&path).unwrap().permissions().mode() & 0o777,
        0o640
    );
    ReadBack::new(&path);
    assert_only(folder.path(), &["out.exr"]);
}

#[cfg(unix)]
#[test]
fn a_link_survives_and_its_target_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("target.exr");
    let link = folder.path().join("link.exr");
    fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_exr(&link, &sample(4, 4), &ExrOptions::default()).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    ReadBack::new(&target);
    assert_only(folder.path(), &["link.exr", "target.exr"]);
}

/// A disk with room for so many bytes.
struct Full<W> {
    inner: W,
    room: usize,
}

impl<W: Write> Write for Full<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.room == 0 {
            return Err(io::Error::new(io::ErrorKind::StorageFull, "no room"));
        }
        let n = self.inner.write(&bytes[..bytes.len().min(self.room)])?;
        self.room -= n;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Full<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

#[test]
fn a_full_disk_keeps_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    let image = sample(64, 64);
    let mut whole = Cursor::new(Vec::new());
    exr_file::encode(&image, &ExrOptions::default(), &mut whole).unwrap();
    let size = whole.into_inner().len();
    for room in [0, 1, 100, size / 4, size / 2, size - 1] {
        fs::write(&path, "old").unwrap();
        for png in [false, true] {
            let result = replace_file(&path, |writer| {
                let room = if png { room.min(50) } else { room };
                let full = Full {
                    inner: writer,
                    room,
                };
                if png {
                    png_file::encode(&image, &PngOptions::default(), full)
                } else {
                    exr_file::encode(&image, &ExrOptions::default(), full)
                }
            });
            let error = result.unwrap_err();
            assert!(matches!(error, ImageError::Io { .. }), "{room}: {error}");
            assert!(error.to_string().contains("no room"), "{error}");
            assert_eq!(fs::read(&path).unwrap(), b"old");
            assert_only(folder.path(), &["out"]);
        }
    }
}

#[test]
fn a_failure_after_the_last_byte_keeps_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    let error = replace_file(&path, |writer| {
        writer.write_all(b"half an image")?;
        Err(EncodeError::Invalid("changed my mind".to_owned()))
    })
    .unwrap_err();
    assert!(error.to_string().ends_with("changed my mind"));
    assert_only(folder.path(), &[]);
}

#[test]
fn a_name_without_a_folder_is_in_the_current_one() {
    let name = format!("hdtrapeze-image-test-{}.exr", std::process::id());
    write_exr(Path::new(&name), &sample(4, 4), &ExrOptions::default()).unwrap();
    fs::remove_file(&name).unwrap();
}
