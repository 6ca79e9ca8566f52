use super::{Error, write_file};
use std::io;
use std::path::Path;

/// Writes an sRGB picture with `width` pixels a row: `pixels` are RGBA, alpha is dropped. `texts` are keywords
/// and values for text chunks, in Latin-1.
///
/// # Errors
/// The file cannot be written, the pixels are not whole rows, or a text is not Latin-1.
pub fn write_png(file: &Path, width: u32, pixels: &[u8], texts: &[(&str, String)]) -> Result<(), Error> {
    let rgb: Vec<u8> = pixels.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let height = rgb.len() / 3 / width.max(1) as usize;
    write_file(file, |out| {
        let mut encoder = png::Encoder::new(out, width, u32::try_from(height).map_err(io::Error::other)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        for (keyword, text) in texts {
            encoder.add_text_chunk((*keyword).to_owned(), text.clone()).map_err(io::Error::other)?;
        }
        let mut writer = encoder.write_header().map_err(io::Error::other)?;
        writer.write_image_data(&rgb).map_err(io::Error::other)?;
        writer.finish().map_err(io::Error::other)
    })
}

/// Keywords and values of a picture's text chunks. All of the picture is read, so that one cut short is told.
///
/// # Errors
/// The file can't be read, or is no whole picture.
pub fn read_png_texts(file: &Path) -> Result<Vec<(String, String)>, Error> {
    let read = || {
        let mut decoder = png::Decoder::new(io::BufReader::new(std::fs::File::open(file)?));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().map_err(io::Error::other)?;
        while reader.next_row().map_err(io::Error::other)?.is_some() {}
        let texts = &reader.info().uncompressed_latin1_text;
        Ok(texts.iter().map(|chunk| (chunk.keyword.clone(), chunk.text.clone())).collect())
    };
    read().map_err(|source| Error { file: file.into(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_colour_space_and_texts_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.png");
        let pixels: Vec<u8> = (0..6).flat_map(|p| [p, 10 * p, 255 - p, 255]).collect();
        write_png(&file, 3, &pixels, &[("Exposure", "+1.25 EV".into())]).unwrap();
        let decoder = png::Decoder::new(io::BufReader::new(std::fs::File::open(&file).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut read).unwrap();
        let info = reader.info();
        assert_eq!((info.width, info.height), (3, 2));
        assert_eq!(info.srgb, Some(png::SrgbRenderingIntent::Perceptual));
        assert_eq!(info.uncompressed_latin1_text[0].keyword, "Exposure");
        assert_eq!(info.uncompressed_latin1_text[0].text, "+1.25 EV");
        let expected: Vec<u8> = pixels.chunks(4).flat_map(|p| p[..3].to_vec()).collect();
        assert_eq!(read, expected);
    }

    #[test]
    fn rows_must_be_whole() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_png(&folder.path().join("a.png"), 2, &[0; 12], &[]).is_err());
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
    }
}
