//! The picture of a question as far as the screen knows it: what is to be drawn, and what came of it.

use std::fmt;
use std::sync::Arc;

use gnc_executive::bench::DrawPictures;
use ratatui::layout::Size;
use ratatui_image::protocol::Protocol;

use super::graphics::Graphics;
use super::model::ScreenModel;

/// Size of a cell, if the terminal does not say it. Small, since a picture for larger cells than there are would cover the
/// text below it.
const USUAL_CELL: CellPixels = CellPixels { width: 8, height: 16 };
/// Largest side of a cell that is believed.
const MAX_CELL: u16 = 128;

/// Size of a cell in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CellPixels {
    pub width: u16,
    pub height: u16,
}

impl CellPixels {
    /// The cell of a window; `None` if it does not know its pixels.
    fn of(cells: Size, pixels: Size) -> Option<Self> {
        let width = pixels.width.checked_div(cells.width)?;
        let height = pixels.height.checked_div(cells.height)?;
        let possible = 1..=MAX_CELL;
        (possible.contains(&width) && possible.contains(&height)).then_some(Self { width, height })
    }
}

/// A picture that is to be drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PictureWanted {
    pub path: String,
    /// Its digest as it was when the plan was checked.
    pub sha256: Option<String>,
    /// Most cells that it may take.
    pub room: Size,
    pub cell: CellPixels,
    pub graphics: Graphics,
}

/// A picture as the terminal takes it.
#[derive(Clone)]
pub(crate) struct DrawnPicture(pub Arc<Protocol>);

impl DrawnPicture {
    pub(crate) fn size(&self) -> Size {
        self.0.size()
    }
}

impl fmt::Debug for DrawnPicture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("DrawnPicture").field(&self.size()).finish()
    }
}

/// Why a picture is not drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PictureTrouble {
    /// There is no file any more.
    Gone,
    Unreadable(String),
    /// It is not the file that was checked with the plan.
    Changed,
    /// Neither PNG nor JPEG.
    OtherFormat,
    Broken,
    TooLarge,
}

/// The picture of the question on the screen.
#[derive(Debug)]
pub(crate) struct Pictures {
    /// What the terminal can draw, by its environment.
    pub terminal: Option<Graphics>,
    cell: CellPixels,
    /// One is being made. Another one waits for its end, so that no storm of sizes makes more than one at a time.
    under_way: bool,
    made: Option<(PictureWanted, Result<DrawnPicture, PictureTrouble>)>,
}

impl Default for Pictures {
    fn default() -> Self {
        Self { terminal: None, cell: USUAL_CELL, under_way: false, made: None }
    }
}

impl Pictures {
    /// Takes the size of the window. The terminal may have lost what was drawn.
    pub(crate) fn window(&mut self, cells: Size, pixels: Size) {
        self.cell = CellPixels::of(cells, pixels).unwrap_or(USUAL_CELL);
        self.made = None;
    }

    pub(crate) fn cell(&self) -> CellPixels {
        self.cell
    }

    /// Takes a picture that was made.
    pub(crate) fn take(&mut self, wanted: PictureWanted, made: Result<DrawnPicture, PictureTrouble>) {
        self.under_way = false;
        self.made = Some((wanted, made));
    }

    /// What came of a picture; `None` if it is not made yet.
    pub(crate) fn made(&self, wanted: &PictureWanted) -> Option<&Result<DrawnPicture, PictureTrouble>> {
        self.made.as_ref().filter(|(made, _)| made == wanted).map(|(_, made)| made)
    }

    /// Returns the picture that is to be made next. One that a dialog covers for a while is kept.
    pub(crate) fn next(&mut self, is_asked: bool, wanted: Option<PictureWanted>) -> Option<PictureWanted> {
        if !is_asked {
            self.made = None;
        }
        let wanted = wanted.filter(|wanted| !self.under_way && self.made(wanted).is_none())?;
        self.under_way = true;
        Some(wanted)
    }
}

/// How pictures are drawn: as the bench file says, else as the terminal can.
pub(crate) fn graphics(model: &ScreenModel) -> Option<Graphics> {
    let chosen = model.bench.ready().map(|bench| bench.pictures).unwrap_or_default();
    let graphics = match chosen {
        DrawPictures::Auto => model.pictures.terminal,
        DrawPictures::Kitty => Some(Graphics::Kitty),
        DrawPictures::Iterm2 => Some(Graphics::Iterm2),
        DrawPictures::Sixel => Some(Graphics::Sixel),
        DrawPictures::Off => None,
    };
    graphics.filter(|graphics| graphics.works(model.look))
}
