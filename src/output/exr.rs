use super::{Error, write_file};
use crate::memory::Budget;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{Compression, ReadChannels, ReadLayers, WritableImage, read};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// Linear data for an OpenEXR file of one part.
#[derive(Clone, Debug)]
pub struct Picture<'a> {
    /// Width and height of the whole picture (pixels): the display window.
    pub size: [u32; 2],
    /// The part that is there, x0, y0, x1, y1 (pixels, ends exclusive): the data window.
    pub window: [u32; 4],
    /// All channels of the part.
    pub channels: Vec<Channels<'a>>,
    /// Attributes; names are at most 31 bytes, for readers that know no longer ones.
    pub attributes: Vec<(&'static str, Attribute)>,
}

/// Channels that lie interleaved in memory.
#[derive(Clone, Debug)]
pub struct Channels<'a> {
    /// Full names, in order: `albedo.R`, `albedo.G`, `albedo.B`.
    pub names: Vec<String>,
    /// Rows from the top, `names.len()` numbers a pixel of the window.
    pub data: &'a [f32],
}

/// Value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// UTF-8.
    Text(String),
    /// A number.
    Number(f64),
}

/// Writes 32-bit floats with ZIP compression and Rec. 709 chromaticities.
///
/// # Errors
/// The file cannot be written, or a channel does not fill the window.
pub fn write_exr(file: &Path, picture: &Picture<'_>) -> Result<(), Error> {
    let [x0, y0, x1, y1] = picture.window;
    let size = Vec2(x1.saturating_sub(x0) as usize, y1.saturating_sub(y0) as usize);
    let display = Vec2(picture.size[0] as usize, picture.size[1] as usize);
    let position = (i32::try_from(x0), i32::try_from(y0));

    write_file(file, |out| {
        let mut channels = Vec::new();
        for Channels { names, data } in &picture.channels {
            if data.len() != size.area() * names.len() {
                return Err(io::Error::other(format!(
                    "channels {} do not fill the window",
                    names.join(", ")
                )));
            }
            channels.extend(names.iter().enumerate().map(|(index, name)| {
                let samples = data.iter().skip(index).step_by(names.len()).copied().collect();
                AnyChannel::new(text(name), FlatSamples::F32(samples))
            }));
        }
        let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions(display));
        attributes.chromaticities = Some(Chromaticities {
            red: Vec2(0.64, 0.33),
            green: Vec2(0.3, 0.6),
            blue: Vec2(0.15, 0.06),
            white: Vec2(0.3127, 0.329),
        });
        let (Ok(x), Ok(y)) = position else { return Err(io::Error::other("the window is too far out")) };
        let mut layer = LayerAttributes { layer_position: Vec2(x, y), ..LayerAttributes::default() };
        layer.other = picture
            .attributes
            .iter()
            .map(|(name, value)| {
                let value = match value {
                    Attribute::Text(value) => AttributeValue::Text(text(value)),
                    Attribute::Number(value) => AttributeValue::F64(*value),
                };
                (text(name), value)
            })
            .collect();
        let encoding = Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        };
        let layer = Layer::new(size, layer, encoding, AnyChannels::sort(channels.into()));
        let image = Image { attributes, layer_data: layer };
        image.write().to_buffered(out).map_err(|error| match error {
            exr::error::Error::Io(error) => error,
            other => io::Error::other(other.to_string()),
        })
    })
}

/// What a file of one part holds.
#[derive(Clone, Debug, Default)]
pub struct ReadPicture {
    /// Width and height of the whole picture (pixels): the display window.
    pub size: [u32; 2],
    /// The part that is there, x0, y0, x1, y1 (pixels, ends exclusive): the data window.
    pub window: [u32; 4],
    /// Channels by their full names, rows from the top.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// Attributes that are texts or numbers.
    pub attributes: BTreeMap<String, Attribute>,
}

impl ReadPicture {
    /// Channels side by side; `None` where one is missing.
    #[must_use]
    pub fn interleaved(&self, names: &[&str]) -> Option<Vec<f32>> {
        let channels: Vec<_> = names.iter().map(|name| self.channels.get(*name)).collect::<Option<_>>()?;
        let count = channels.first().map_or(0, |channel| channel.len());
        Some((0..count).flat_map(|i| channels.iter().map(move |channel| channel[i])).collect())
    }
}

/// Reads the first part of a file.
///
/// # Errors
/// The file cannot be read, or is not an OpenEXR file of pixels.
pub fn read_exr(file: &Path) -> Result<ReadPicture, Error> {
    let fail = |source| Error { file: file.into(), source };
    // A pipe cannot be sought in, and opening one may never return.
    let metadata = file.metadata().map_err(fail)?;
    if !metadata.is_file() {
        return Err(fail(io::Error::new(io::ErrorKind::InvalidInput, "is not a file")));
    }
    let meta = exr::meta::MetaData::read_from_file(file, false).map_err(|error| fail(io_error(error)))?;
    // Once more as 32-bit floats.
    let bytes = crate::read::exr_bytes(&meta, metadata.len())
        .map_err(|problem| fail(io::Error::new(io::ErrorKind::InvalidData, problem)))?;
    let room = Budget::of_process().take(bytes.saturating_mul(3));
    room.map_err(|shortage| fail(io::Error::new(io::ErrorKind::OutOfMemory, shortage)))?;
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = image.all_attributes().from_file(file).map_err(|error| fail(io_error(error)))?;
    let layer = &image.layer_data;
    let display = image.attributes.display_window.size;
    let (Vec2(x, y), Vec2(width, height)) = (layer.attributes.layer_position, layer.size);
    let outside =
        |_| fail(io::Error::new(io::ErrorKind::InvalidData, "its data window begins left of or above 0"));
    let (x, y) = (u32::try_from(x).map_err(outside)?, u32::try_from(y).map_err(outside)?);
    let channels = layer.channel_data.list.iter();
    let utf8 = |text: &Text| String::from_utf8_lossy(text.as_slice()).into_owned();
    let attributes = layer.attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(value) => Some((utf8(name), Attribute::Text(utf8(value)))),
        AttributeValue::F64(value) => Some((utf8(name), Attribute::Number(*value))),
        _ => None,
    });
    Ok(ReadPicture {
        size: [display.0 as u32, display.1 as u32],
        window: [x, y, x.saturating_add(width as u32), y.saturating_add(height as u32)],
        channels: channels
            .map(|channel| (utf8(&channel.name), channel.sample_data.values_as_f32().collect()))
            .collect(),
        attributes: attributes.collect(),
    })
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidData, other.to_string()),
    }
}

/// OpenEXR's strings are bytes; UTF-8 passes through.
fn text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_windows_and_attributes_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let beauty: Vec<f32> = (0..18).map(|v| v as f32 * 1e5).collect();
        let depth: Vec<f32> = (0..6).map(|v| -(v as f32)).collect();
        let picture = Picture {
            size: [8, 6],
            window: [2, 1, 5, 3],
            channels: vec![
                Channels { names: ["R", "G", "B"].map(String::from).into(), data: &beauty },
                Channels { names: vec!["Z".into()], data: &depth },
            ],
            attributes: vec![
                ("parhelion:scene", Attribute::Text("Büro".into())),
                ("parhelion:seed", Attribute::Number(7.0)),
            ],
        };
        write_exr(&file, &picture).unwrap();

        let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let image = image.all_attributes().from_file(&file).unwrap();
        let layer = &image.layer_data;
        assert_eq!(image.attributes.display_window, IntegerBounds::from_dimensions(Vec2(8, 6)));
        assert_eq!((layer.attributes.layer_position, layer.size), (Vec2(2, 1), Vec2(3, 2)));
        assert!(layer.attributes.layer_name.is_none());
        assert_eq!(image.attributes.chromaticities.unwrap().green, Vec2(0.3, 0.6));
        let other = &layer.attributes.other;
        assert_eq!(other[&text("parhelion:scene")], AttributeValue::Text(text("Büro")));
        assert_eq!(other[&text("parhelion:seed")], AttributeValue::F64(7.0));
        let channel = |name: &str| {
            let found = layer.channel_data.list.iter().find(|c| c.name == text(name)).unwrap();
            found.sample_data.values_as_f32().collect::<Vec<_>>()
        };
        assert_eq!(channel("Z"), depth);
        for (index, name) in ["R", "G", "B"].iter().enumerate() {
            assert_eq!(channel(name), beauty.iter().skip(index).step_by(3).copied().collect::<Vec<_>>());
        }

        let back = read_exr(&file).unwrap();
        assert_eq!((back.size, back.window), (picture.size, picture.window));
        assert_eq!(back.interleaved(&["R", "G", "B"]).unwrap(), beauty);
        assert_eq!(back.interleaved(&["Z"]).unwrap(), depth);
        assert!(back.interleaved(&["R", "A"]).is_none());
        for (name, value) in &picture.attributes {
            assert_eq!(&back.attributes[*name], value);
        }
        // A window that no such file could fill is refused before there is room for it.
        let mut bytes = std::fs::read(&file).unwrap();
        let window = b"dataWindow\0box2i\0";
        let at = bytes.windows(window.len()).position(|part| part == window).unwrap() + window.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&0x0fff_ffff_i32.to_le_bytes());
        std::fs::write(&file, bytes).unwrap();
        let error = read_exr(&file).unwrap_err().to_string();
        assert!(error.contains("a.exr: 268435454x2 pixels can't be in a file of"), "{error}");
        std::fs::write(&file, "no picture").unwrap();
        assert!(read_exr(&file).unwrap_err().to_string().contains("a.exr: "));
    }

    #[test]
    fn data_must_fill_the_window() {
        let folder = tempfile::tempdir().unwrap();
        let channels = vec![Channels { names: vec!["Z".into()], data: &[0.0; 5] }];
        let picture = Picture { size: [3, 2], window: [0, 0, 3, 2], channels, attributes: Vec::new() };
        assert!(write_exr(&folder.path().join("a.exr"), &picture).is_err());
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
    }
}
