//! Pictures of questions: read, decoded, made smaller and encoded for the terminal, on a thread of their own.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use gnc_records::store::digest;
use image::{
    DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits, RgbaImage, imageops, metadata::Orientation,
};
use ratatui::layout::Size;
use ratatui_image::protocol::Protocol;
use ratatui_image::protocol::iterm2::Iterm2;
use ratatui_image::protocol::kitty::Kitty;
use ratatui_image::protocol::sixel::Sixel;

use super::jpeg;
use crate::files::{self, PictureFileError};
use crate::tui::graphics::Graphics;
use crate::tui::pictures::{DrawnPicture, PictureTrouble, PictureWanted};
use crate::tui::terminal::PICTURE_THREAD;

/// Most pixels of a picture: more than cameras at a bench have.
pub(in crate::tui) const MAX_MEGAPIXELS: u64 = 40;
/// Most memory that a decoder takes: that many pixels of 16 bits in four channels, 320 MB. A JPEG file has three channels of
/// 8 bits, 120 MB; if its scans are not those of a plain photograph, its coefficients take at most 320 MB more meanwhile.
/// What comes afterwards has the size of the place.
const MAX_DECODER_BYTES: u64 = 8 * MAX_MEGAPIXELS * 1_000_000;
/// The name of the picture within a terminal of the kind of kitty. One picture at a time: the next one takes its place.
const KITTY_ID: u32 = 0x676e_6301;
/// Least width: a picture of a single cell would leave the cursor where the next cell is drawn.
const MIN_COLUMNS: u16 = 2;
/// What shows through transparent parts. Drawings have dark lines, and terminals are dark.
const PAPER: u8 = 255;

/// Makes a picture. A decoder that fails badly ends its thread, and nothing else.
pub(in crate::tui) fn make(wanted: &PictureWanted) -> Result<DrawnPicture, PictureTrouble> {
    let work = {
        let wanted = wanted.clone();
        move || {
            let most = most_pixels(&wanted).ok_or(PictureTrouble::Broken)?;
            let image = decode(&read(&wanted)?, most)?;
            encode(image, &wanted)
        }
    };
    let thread = std::thread::Builder::new().name(PICTURE_THREAD.to_owned()).spawn(work);
    let thread = thread.map_err(|error| PictureTrouble::Unreadable(error.to_string()))?;
    thread.join().unwrap_or(Err(PictureTrouble::Broken))
}

fn read(wanted: &PictureWanted) -> Result<Vec<u8>, PictureTrouble> {
    let bytes = files::picture(Path::new(&wanted.path)).map_err(|error| match error {
        PictureFileError::Missing | PictureFileError::Outside => PictureTrouble::Gone,
        // What has taken its place is no picture.
        PictureFileError::Unreadable(error) if gnc_files::is_refused(&error).is_some() => PictureTrouble::Gone,
        // It was not as large when the plan was checked.
        PictureFileError::TooLarge => PictureTrouble::Changed,
        PictureFileError::Unreadable(error) => PictureTrouble::Unreadable(error.to_string()),
    })?;
    let is_it = wanted.sha256.as_ref().is_none_or(|sha256| *sha256 == digest::of_bytes(&bytes));
    if is_it { Ok(bytes) } else { Err(PictureTrouble::Changed) }
}

/// Most pixels that fit the place of a picture, in width and height; `None` if it has no room at all.
fn most_pixels(PictureWanted { room, cell, .. }: &PictureWanted) -> Option<(u32, u32)> {
    let most = (u32::from(room.width) * u32::from(cell.width), u32::from(room.height) * u32::from(cell.height));
    (most.0 > 0 && most.1 > 0).then_some(most)
}

/// Decodes a picture, no larger than `most`, and turns it upright.
pub(in crate::tui) fn decode(bytes: &[u8], most: (u32, u32)) -> Result<RgbaImage, PictureTrouble> {
    let format = image::guess_format(bytes).ok();
    let format = format.filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Jpeg));
    let format = format.ok_or(PictureTrouble::OtherFormat)?;
    let bytes = match format {
        ImageFormat::Jpeg => jpeg::image(bytes).ok_or(PictureTrouble::Broken)?,
        _ => bytes,
    };
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(|error| trouble(&error))?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MAX_MEGAPIXELS * 1_000_000 {
        return Err(PictureTrouble::TooLarge);
    }
    // A camera that was held upright says so beside the pixels.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let image = DynamicImage::from_decoder(decoder).map_err(|error| trouble(&error))?;
    if image.width() == 0 || image.height() == 0 {
        return Err(PictureTrouble::Broken);
    }
    // Smaller first: to turn a picture takes its memory a second time.
    let most = if lies_on_its_side(orientation) { (most.1, most.0) } else { most };
    let is_larger = image.width() > most.0 || image.height() > most.1;
    let pixels = if is_larger { image.thumbnail(most.0, most.1).into_rgba8() } else { image.into_rgba8() };
    let mut image = DynamicImage::ImageRgba8(pixels);
    image.apply_orientation(orientation);
    Ok(image.into_rgba8())
}

fn lies_on_its_side(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

fn trouble(error: &image::ImageError) -> PictureTrouble {
    match error {
        image::ImageError::Limits(_) => PictureTrouble::TooLarge,
        _ => PictureTrouble::Broken,
    }
}

fn encode(mut pixels: RgbaImage, wanted: &PictureWanted) -> Result<DrawnPicture, PictureTrouble> {
    let PictureWanted { cell, graphics, .. } = wanted;
    let (width, height) = (u32::from(cell.width), u32::from(cell.height));
    lay_on_paper(&mut pixels);
    let cells = |pixels: u32, cell: u32| u16::try_from(pixels.div_ceil(cell)).unwrap_or(u16::MAX);
    let size = Size::new(cells(pixels.width(), width).max(MIN_COLUMNS), cells(pixels.height(), height));
    // Whole cells, transparent where the picture ends.
    let mut whole = RgbaImage::new(u32::from(size.width) * width, u32::from(size.height) * height);
    imageops::replace(&mut whole, &pixels, 0, 0);
    let whole = DynamicImage::ImageRgba8(whole);
    let protocol = match graphics {
        Graphics::Kitty => Kitty::new(whole, size, KITTY_ID, false, false).map(Protocol::Kitty),
        Graphics::Iterm2 => Iterm2::new(whole, size, false).map(Protocol::ITerm2),
        Graphics::Sixel => Sixel::new(whole, size, false).map(Protocol::Sixel),
    };
    protocol.map(|protocol| DrawnPicture(Arc::new(protocol))).map_err(|_| PictureTrouble::Broken)
}

fn lay_on_paper(pixels: &mut RgbaImage) {
    for pixel in pixels.pixels_mut() {
        let [.., alpha] = pixel.0;
        let share = u16::from(alpha);
        for channel in &mut pixel.0[..3] {
            let mixed = (u16::from(*channel) * share + u16::from(PAPER) * (255 - share)) / 255;
            *channel = u8::try_from(mixed).unwrap_or(PAPER);
        }
        pixel.0[3] = 255;
    }
}
