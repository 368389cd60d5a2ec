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

use crate::files::{self, PictureFileError};
use crate::tui::graphics::Graphics;
use crate::tui::pictures::{DrawnPicture, PictureTrouble, PictureWanted};
use crate::tui::terminal::PICTURE_THREAD;

/// Most pixels of a picture: more than cameras at a bench have.
pub(in crate::tui) const MAX_MEGAPIXELS: u64 = 40;
/// Most memory that a decoder takes: that many pixels of 16 bits in four channels.
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
        move || read(&wanted).and_then(|bytes| decode(&bytes)).and_then(|image| encode(image, &wanted))
    };
    let thread = std::thread::Builder::new().name(PICTURE_THREAD.to_owned()).spawn(work);
    let thread = thread.map_err(|error| PictureTrouble::Unreadable(error.to_string()))?;
    thread.join().unwrap_or(Err(PictureTrouble::Broken))
}

fn read(wanted: &PictureWanted) -> Result<Vec<u8>, PictureTrouble> {
    let bytes = files::picture(Path::new(&wanted.path)).map_err(|error| match error {
        PictureFileError::Missing => PictureTrouble::Gone,
        // It was not as large when the plan was checked.
        PictureFileError::TooLarge => PictureTrouble::Changed,
        PictureFileError::Unreadable(error) => PictureTrouble::Unreadable(error.to_string()),
    })?;
    let is_it = wanted.sha256.as_ref().is_none_or(|sha256| *sha256 == digest::of_bytes(&bytes));
    if is_it { Ok(bytes) } else { Err(PictureTrouble::Changed) }
}

pub(in crate::tui) fn decode(bytes: &[u8]) -> Result<DynamicImage, PictureTrouble> {
    let format = image::guess_format(bytes).ok();
    let format = format.filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Jpeg));
    let format = format.ok_or(PictureTrouble::OtherFormat)?;
    if format == ImageFormat::Jpeg && is_cut_off(bytes) {
        return Err(PictureTrouble::Broken);
    }
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
    let mut image = DynamicImage::from_decoder(decoder).map_err(|error| trouble(&error))?;
    image.apply_orientation(orientation);
    Ok(image)
}

fn trouble(error: &image::ImageError) -> PictureTrouble {
    match error {
        image::ImageError::Limits(_) => PictureTrouble::TooLarge,
        _ => PictureTrouble::Broken,
    }
}

/// Whether the end of a JPEG file is missing: its last scan has no end. The decoder would draw the missing part grey.
fn is_cut_off(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    last(0xd9) < last(0xda)
}

fn encode(image: DynamicImage, wanted: &PictureWanted) -> Result<DrawnPicture, PictureTrouble> {
    let PictureWanted { room, cell, graphics, .. } = wanted;
    let (width, height) = (u32::from(cell.width), u32::from(cell.height));
    let most = (u32::from(room.width) * width, u32::from(room.height) * height);
    if most.0 == 0 || most.1 == 0 || image.width() == 0 || image.height() == 0 {
        return Err(PictureTrouble::Broken);
    }
    let is_larger = image.width() > most.0 || image.height() > most.1;
    let mut pixels = if is_larger { image.thumbnail(most.0, most.1).into_rgba8() } else { image.into_rgba8() };
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
