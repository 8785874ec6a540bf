//! OpenEXR: one part with the float channels `R`, `G`, `B`, `A` (linear Rec. 709, premultiplied), `depth` and `id`, and what else there is,
//! losslessly compressed. A part of a larger picture is the data window in that picture's display window.
//!
//! `depth` is infinite where nothing was met. `id` is a float while all ids are exact as one, else an unsigned integer in which -1
//! is 4294967295; ids beyond 32 bits have their upper half in `idHigh`. The attribute `tyndall:id` says which.
//! Source: The OpenEXR File Layout, openexr.com.

use std::io;
use std::path::Path;

use exr::meta::header::standard_names;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image as ExrImage, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, SmallVec, Text, Vec2, WritableImage,
};
use tyndall::{Image, Result};

use super::{ImageOptions, atomically};

/// Integers up to this one are exact as 32-bit floats.
const EXACT: i64 = 1 << 24;
/// Writes the picture. The options were checked by the caller.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let channel = |name: &str, samples| AnyChannel::new(name, samples);
    let color = |c: usize| FlatSamples::F32(image.color.iter().map(|pixel| pixel[c]).collect());
    let colors = ["R", "G", "B", "A"].into_iter().enumerate().map(|(c, name)| channel(name, color(c)));
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = colors.collect();
    if options.has_depth {
        channels.push(channel("depth", FlatSamples::F32(image.depth.clone())));
    }
    let ids = options.has_ids.then(|| id_channels(&image.id));
    let (ids, meaning) = ids.unzip();
    channels.extend(ids.into_iter().flatten());
    let further = options.channels.iter();
    channels.extend(further.map(|(name, values)| channel(name, FlatSamples::F32(values.clone()))));

    let size = Vec2(image.width as usize, image.height as usize);
    let mut layer =
        LayerAttributes { horizontal_density: options.dpi.map(|dpi| dpi as f32), ..Default::default() };
    for (key, text) in options.metadata.iter().map(|(key, text)| (key.as_str(), text.as_str())) {
        // A text must not take the place of what the format itself says, such as `type`.
        let key =
            if standard_names::ALL.contains(&key.as_bytes()) { format!("tyndall:{key}") } else { key.into() };
        layer.other.insert(utf8(&key), AttributeValue::Text(utf8(text)));
    }
    layer.other.extend(meaning.map(|meaning| (utf8("tyndall:id"), AttributeValue::Text(utf8(meaning)))));
    let whole = match options.part_of {
        Some((window, [width, height])) => {
            layer.layer_position = Vec2(window.x as i32, window.y as i32);
            IntegerBounds::from_dimensions(Vec2(width as usize, height as usize))
        }
        None => IntegerBounds::from_dimensions(size),
    };
    let picture = ExrImage::new(
        ImageAttributes::new(whole),
        Layer::new(size, layer, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels)),
    );
    atomically(path, |file| picture.write().to_buffered(file).map_err(io_error))
}

/// The channels that hold the ids, and what they mean.
fn id_channels(ids: &[i64]) -> (Vec<AnyChannel<FlatSamples>>, &'static str) {
    let most = ids.iter().copied().max().unwrap_or(-1);
    if most <= EXACT {
        let samples = FlatSamples::F32(ids.iter().map(|&id| id as f32).collect());
        return (vec![AnyChannel::new("id", samples)], "float, -1 is nothing");
    }
    // Two's complement: the lower half of -1 is 4294967295.
    let half = |shift: u32| FlatSamples::U32(ids.iter().map(|&id| (id >> shift) as u32).collect());
    let low = AnyChannel::new("id", half(0));
    if most < u32::MAX as i64 {
        return (vec![low], "uint32, 4294967295 is nothing");
    }
    let high = AnyChannel::new("idHigh", half(32));
    (vec![low, high], "uint32, the lower half; idHigh has the upper half; 4294967295 in both is nothing")
}

/// The crate would take letters for bytes; the format's texts are UTF-8.
fn utf8(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Folder, ramp};
    use super::*;
    use exr::prelude::{FlatImage, Layer, read_all_flat_layers_from_file};

    fn write_and_read(
        test: &str,
        image: &Image,
        metadata: &[(&str, &str)],
    ) -> Layer<AnyChannels<FlatSamples>> {
        let folder = Folder::new(test);
        let path = folder.0.join("a.exr");
        let metadata = metadata.iter().map(|(key, text)| (key.to_string(), text.to_string())).collect();
        super::super::image(&path, image, &ImageOptions { dpi: Some(300.0), metadata, ..Default::default() })
            .unwrap();
        let mut found: FlatImage = read_all_flat_layers_from_file(&path).unwrap();
        assert_eq!(found.layer_data.len(), 1);
        found.layer_data.remove(0)
    }

    fn channel<'a>(layer: &'a Layer<AnyChannels<FlatSamples>>, name: &str) -> &'a FlatSamples {
        &layer.channel_data.list.iter().find(|channel| channel.name.eq(name)).unwrap().sample_data
    }

    fn text(layer: &Layer<AnyChannels<FlatSamples>>, key: &str) -> String {
        match layer.attributes.other.get(&utf8(key)) {
            Some(AttributeValue::Text(text)) => String::from_utf8(text.bytes().to_vec()).unwrap(),
            other => panic!("{key}: {other:?}"),
        }
    }

    #[test]
    fn every_number_comes_back_as_it_was() {
        let mut image = ramp(70, 33, false);
        image.color[5] = [1e6, -0.5, f32::MIN_POSITIVE, 1.0];
        let layer = write_and_read("exr", &image, &[("tyndall:unit", "½ Å"), ("type", "gas")]);
        assert_eq!(layer.size, Vec2(70, 33));
        for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            let wanted = FlatSamples::F32(image.color.iter().map(|pixel| pixel[c]).collect());
            assert!(*channel(&layer, name) == wanted, "{name}");
        }
        assert!(*channel(&layer, "depth") == FlatSamples::F32(image.depth.clone()));
        assert!(*channel(&layer, "id") == FlatSamples::F32(image.id.iter().map(|&id| id as f32).collect()));
        assert_eq!(text(&layer, "tyndall:unit"), "½ Å");
        assert_eq!(text(&layer, "tyndall:type"), "gas");
        assert_eq!(text(&layer, "tyndall:id"), "float, -1 is nothing");
        assert_eq!(layer.attributes.horizontal_density, Some(300.0));
    }

    #[test]
    fn layers_are_those_that_are_wanted_where_they_belong() {
        let folder = Folder::new("exr-layers");
        let path = folder.0.join("a.exr");
        let window = tyndall::film::Window { x: 7, y: 5, width: 4, height: 3 };
        let options = ImageOptions {
            channels: vec![("normal.X".into(), (0..12).map(|it| it as f32).collect())],
            has_depth: false,
            has_ids: false,
            part_of: Some((window, [20, 10])),
            ..Default::default()
        };
        super::super::image(&path, &ramp(4, 3, true), &options).unwrap();
        let mut found: FlatImage = read_all_flat_layers_from_file(&path).unwrap();
        assert_eq!(found.attributes.display_window, IntegerBounds::from_dimensions(Vec2(20, 10)));
        let layer = found.layer_data.remove(0);
        assert_eq!((layer.attributes.layer_position, layer.size), (Vec2(7, 5), Vec2(4, 3)));
        let names: Vec<String> = layer.channel_data.list.iter().map(|it| it.name.to_string()).collect();
        assert_eq!(names, ["A", "B", "G", "R", "normal.X"]);
        assert!(*channel(&layer, "normal.X") == FlatSamples::F32(options.channels[0].1.clone()));
    }

    #[test]
    fn ids_that_no_float_holds_are_integers() {
        let mut image = ramp(2, 2, true);
        image.id = vec![-1, 0, EXACT, EXACT];
        assert!(matches!(channel(&write_and_read("exr-24", &image, &[]), "id"), FlatSamples::F32(_)));
        image.id[3] = EXACT + 1;
        let layer = write_and_read("exr-32", &image, &[]);
        assert!(*channel(&layer, "id") == FlatSamples::U32(vec![u32::MAX, 0, 1 << 24, (1 << 24) + 1]));
        assert!(text(&layer, "tyndall:id").starts_with("uint32"));
        image.id[3] = (7 << 32) + 5;
        let layer = write_and_read("exr-64", &image, &[]);
        assert!(*channel(&layer, "id") == FlatSamples::U32(vec![u32::MAX, 0, 1 << 24, 5]));
        assert!(*channel(&layer, "idHigh") == FlatSamples::U32(vec![u32::MAX, 0, 0, 7]));
    }
}
