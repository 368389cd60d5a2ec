//! The picture of a question: drawn where the terminal can, told in words where it cannot be drawn, and gone afterwards.

use std::io::Cursor;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::Arc;

use gnc_bench::fixture::{Ask, QuestionAsked, Reply};
use gnc_executive::plan::{Question, QuestionKind};
use gnc_executive::quantity::Unit;
use gnc_records::store::digest;
use image::{DynamicImage, ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};
use ratatui::buffer::{Buffer, CellDiffOption};
use ratatui::layout::{Rect, Size};
use tempfile::TempDir;

use super::super::decode::Key;
use super::super::graphics::Graphics;
use super::super::keymap::bindings;
use super::super::lang::Lang;
use super::super::model::MessageWeight;
use super::super::pictures::PictureTrouble;
use super::super::scene::Scene;
use super::super::session::pictures::{decode, make};
use super::super::show::next_picture;
use super::super::update::{Effect, Msg};
use super::super::view::picture_wanted;
use super::prompts::{asked, question};

const ALL: [Graphics; 3] = [Graphics::Kitty, Graphics::Iterm2, Graphics::Sixel];

/// How each way to draw begins.
fn begin(graphics: Graphics) -> &'static str {
    match graphics {
        Graphics::Kitty => "\x1b_G",
        Graphics::Iterm2 => "\x1b]1337;File=",
        Graphics::Sixel => "\x1bP",
    }
}

pub(super) fn two_colours(width: u32, height: u32) -> DynamicImage {
    let red_or_blue = |x, _| if x < width / 2 { Rgb([255, 0, 0]) } else { Rgb([0, 0, 255]) };
    DynamicImage::ImageRgb8(RgbImage::from_fn(width, height, red_or_blue))
}

pub(super) fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("memory");
    bytes.into_inner()
}

fn png() -> Vec<u8> {
    encoded(&two_colours(400, 300), ImageFormat::Png)
}

/// A question that shows the picture at a path, on a terminal that can draw.
fn pictured(lang: Lang, kind: QuestionKind, path: &Path, sha256: Option<String>, graphics: Graphics) -> Scene {
    let Ask::Question(template) = question(kind, true) else { panic!("a question") };
    let picture = Some(path.display().to_string());
    let shown = Question { picture, picture_sha256: sha256, ..(*template.question).clone() };
    let ask = Ask::Question(Box::new(QuestionAsked { question: Arc::new(shown), ..*template }));
    let mut scene = asked(lang, ask);
    scene.model.pictures.terminal = Some(graphics);
    scene
}

/// Does what the loop of the screen does after a drawing.
fn after_drawing(scene: &mut Scene) -> Option<PictureTrouble> {
    let area = scene.frame().area;
    let wanted = next_picture(&mut scene.model, area)?;
    assert_eq!(next_picture(&mut scene.model, area), None, "one at a time");
    let made = make(&wanted);
    let trouble = made.as_ref().err().cloned();
    scene.tell(Msg::Drawn { wanted, made });
    trouble
}

/// The cells of the picture in a frame: from the one that has its beginning to the last one that is not written.
fn place_of(frame: &Buffer, graphics: Graphics) -> Option<Rect> {
    let is_part = |symbol: &str, option: CellDiffOption| match graphics {
        Graphics::Kitty => symbol.contains('\u{10eeee}'),
        _ => option == CellDiffOption::Skip || symbol.contains(begin(graphics)),
    };
    let cells = frame.area.positions().filter(|at| is_part(frame[*at].symbol(), frame[*at].diff_option));
    cells.map(|at| Rect::new(at.x, at.y, 1, 1)).reduce(Rect::union)
}

/// A row of a frame without the cells of a picture.
fn row(frame: &Buffer, picture: Option<Rect>, y: u16) -> String {
    let cells = (0..frame.area.width).filter(|x| picture.is_none_or(|picture| !picture.contains((*x, y).into())));
    cells.map(|x| frame[(x, y)].symbol()).collect()
}

/// The letters of the question in a frame.
fn inside(frame: &Buffer, picture: Option<Rect>) -> String {
    let between = |row: String| Some(row.split_once('║')?.1.rsplit_once('║')?.0.to_owned());
    let rows = (0..frame.area.height).filter_map(|y| between(row(frame, picture, y)));
    letters(&rows.collect::<String>())
}

fn letters(text: &str) -> String {
    text.chars().filter(|c| c.is_alphanumeric()).collect()
}

fn volts() -> QuestionKind {
    QuestionKind::Number { unit: Unit::Volt }
}

fn choices() -> QuestionKind {
    QuestionKind::Choice { of: vec!["clean".into(), "worn".into()] }
}

pub(super) fn folder() -> TempDir {
    TempDir::new().expect("a folder")
}

pub(super) fn file(folder: &TempDir, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.path().join("p");
    std::fs::write(&path, bytes).expect("a picture");
    path
}

/// The first cell has the whole picture, and nothing is written over the others. When the question is answered, or another
/// one stands before it, each of these cells is written again.
#[test]
fn a_picture_is_drawn_once_and_goes_with_its_question() {
    let (folder, bytes) = (folder(), png());
    let path = file(&folder, &bytes);
    for graphics in ALL {
        for covered in [false, true] {
            let mut scene = pictured(Lang::En, volts(), &path, Some(digest::of_bytes(&bytes)), graphics);
            scene.resize(120, 40);
            assert_eq!(place_of(&scene.frame(), graphics), None);
            assert!(scene.text().contains(Lang::En.texts().picture_loading), "{}", scene.text());
            assert_eq!(after_drawing(&mut scene), None);
            let with = scene.frame();
            let place = place_of(&with, graphics).unwrap_or_else(|| panic!("{graphics:?}: no picture"));
            // 400 x 300 pixels in cells of 8 x 16.
            assert_eq!(place.as_size(), Size::new(50, 19), "{graphics:?}");
            assert!(with[place.as_position()].symbol().contains(begin(graphics)), "{graphics:?}");
            for at in place.positions().skip(1) {
                assert!(!with[at].symbol().contains(begin(graphics)), "{graphics:?}: again at {at:?}");
            }
            assert_eq!(after_drawing(&mut scene), None);
            // A drawing of the same screen sends the picture no second time.
            let again = scene.frame();
            let second = with.diff(&again).into_iter().filter(|(_, _, cell)| cell.symbol().contains(begin(graphics)));
            assert_eq!(second.count(), 0, "{graphics:?}");
            if covered {
                scene.key(Key::F(10));
                assert!(scene.text().contains(Lang::En.texts().leave_title), "{}", scene.text());
            } else {
                scene.types("5");
                assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Text("5".into()))));
            }
            let without = scene.frame();
            assert_eq!(place_of(&without, graphics), None, "{graphics:?}");
            let written: Vec<_> = again.diff(&without).into_iter().map(|(x, y, _)| (x, y)).collect();
            for at in place.positions() {
                assert!(written.contains(&(at.x, at.y)), "{graphics:?} {covered}: {at:?} is not written again");
            }
            if covered {
                // The picture that was made is kept meanwhile.
                assert_eq!(next_picture(&mut scene.model, without.area), None);
                scene.key(Key::Esc);
                assert_eq!(place_of(&scene.frame(), graphics), Some(place), "{graphics:?}");
            }
        }
    }
}

/// Another size of the window has another picture; the old one is not drawn at the wrong size.
#[test]
fn another_size_makes_another_picture() {
    let folder = folder();
    let path = file(&folder, &png());
    let mut scene = pictured(Lang::En, volts(), &path, None, Graphics::Sixel);
    scene.resize(120, 40);
    after_drawing(&mut scene);
    let large = place_of(&scene.frame(), Graphics::Sixel).expect("a picture");
    scene.resize(80, 26);
    assert_eq!(place_of(&scene.frame(), Graphics::Sixel), None);
    after_drawing(&mut scene);
    let small = place_of(&scene.frame(), Graphics::Sixel).expect("a picture");
    assert!(small.height < large.height, "{small:?} {large:?}");
    // A window whose cells are known to be larger takes fewer of them.
    scene.resize(120, 40);
    scene.model.pictures.window(Size::new(120, 40), Size::new(1200, 800));
    after_drawing(&mut scene);
    let known = place_of(&scene.frame(), Graphics::Sixel).expect("a picture");
    assert_eq!(known.as_size(), Size::new(40, 15));
    // Without room the path is enough.
    for (width, height) in [(80, 16), (60, 16), (40, 12), (20, 6)] {
        scene.resize(width, height);
        let area = scene.frame().area;
        assert_eq!(next_picture(&mut scene.model, area), None, "{width}x{height}");
    }
}

/// Words and keys of a question stay whole beside its picture, at every size, and the picture stays inside the borders.
#[test]
fn a_picture_leaves_the_words_of_its_question_whole() {
    let folder = folder();
    // So high that it takes all rows that it is given.
    let path = file(&folder, &encoded(&two_colours(300, 900), ImageFormat::Png));
    let mut drawn = 0;
    for (graphics, lang) in ALL.into_iter().flat_map(|graphics| Lang::ALL.map(|lang| (graphics, lang))) {
        for kind in [volts(), choices(), QuestionKind::Done] {
            let mut scene = pictured(lang, kind, &path, None, graphics);
            for (width, height) in [(160, 50), (120, 40), (100, 30), (80, 28), (80, 24), (80, 23), (80, 16), (60, 16)] {
                scene.resize(width, height);
                after_drawing(&mut scene);
                let frame = scene.frame();
                let place = place_of(&frame, graphics);
                let shown = inside(&frame, place);
                let prompt = scene.model.run.as_ref().and_then(|run| run.prompt.as_ref()).expect("a question");
                let words = letters(&(lang.texts().ask)(&prompt.ask));
                assert!(shown.contains(&words), "{graphics:?} {lang:?} {width}x{height}: {words} in {shown}");
                for binding in bindings(scene.model.place()).filter(|binding| binding.footer) {
                    let word = super::super::view::key_label(&scene.model, binding.action);
                    let is_there = shown.contains(&letters(word));
                    let is_key = binding.action != super::super::keymap::KeyAction::Stop;
                    assert!(is_there || !is_key, "{graphics:?} {lang:?} {width}x{height}: no {word}");
                }
                let wanted = picture_wanted(&scene.model, frame.area);
                assert_eq!(wanted.is_some(), place.is_some(), "{graphics:?} {lang:?} {width}x{height}");
                let Some(place) = place else { continue };
                let on_no = letters(&lang.texts().on_no.replace("{}", "by-hand"));
                assert!(shown.contains(&on_no), "{graphics:?} {lang:?} {width}x{height}: {on_no} in {shown}");
                drawn += 1;
                assert!(place.width <= 62 && (6..=24).contains(&place.height), "{place:?}");
                for y in place.top()..place.bottom() {
                    assert_eq!(
                        row(&frame, Some(place), y).matches('║').count(),
                        2,
                        "{graphics:?} {lang:?} {width}x{height}: {}",
                        row(&frame, Some(place), y)
                    );
                }
            }
        }
    }
    assert!(drawn >= 9 * 4, "pictures are drawn: {drawn}");
}

/// A terminal that can draw nothing, and a bench file that wants nothing drawn, ask for no picture.
#[test]
fn without_graphics_the_path_is_enough() {
    use gnc_executive::bench::DrawPictures;
    let folder = folder();
    let path = file(&folder, &png());
    let wants = |terminal: Option<Graphics>, chosen: DrawPictures| {
        let mut scene = pictured(Lang::En, volts(), &path, None, Graphics::Kitty);
        scene.resize(120, 40);
        scene.model.pictures.terminal = terminal;
        if let super::super::model::Loaded::Ready(bench) = &mut scene.model.bench {
            bench.pictures = chosen;
        }
        let area = scene.frame().area;
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        assert!(scene.text().contains(&name), "{}", scene.text());
        next_picture(&mut scene.model, area).map(|wanted| wanted.graphics)
    };
    assert_eq!(wants(None, DrawPictures::Auto), None);
    assert_eq!(wants(Some(Graphics::Iterm2), DrawPictures::Auto), Some(Graphics::Iterm2));
    assert_eq!(wants(None, DrawPictures::Sixel), Some(Graphics::Sixel));
    assert_eq!(wants(Some(Graphics::Sixel), DrawPictures::Kitty), Some(Graphics::Kitty));
    assert_eq!(wants(Some(Graphics::Kitty), DrawPictures::Iterm2), Some(Graphics::Iterm2));
    assert_eq!(wants(Some(Graphics::Kitty), DrawPictures::Off), None);
}

/// A PNG file that claims a size and has no pixels.
fn claims(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let bit = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    let crc = header.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| bit(crc)));
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    png.extend(&header);
    png.extend((!crc).to_be_bytes());
    png.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    png
}

/// Room for each picture as it is.
pub(super) const PLACE: (u32, u32) = (500, 500);

#[test]
fn what_is_no_picture_is_told() {
    let (whole, photo) = (png(), encoded(&two_colours(400, 300), ImageFormat::Jpeg));
    let mut flipped = whole.clone();
    flipped[60] ^= 0x55;
    for (bytes, expected) in [
        (&b""[..], PictureTrouble::OtherFormat),
        (b"a picture", PictureTrouble::OtherFormat),
        (b"GIF89a\x01\0\x01\0\0\0\0;", PictureTrouble::OtherFormat),
        (b"<svg xmlns=\"http://www.w3.org/2000/svg\"/>", PictureTrouble::OtherFormat),
        (&whole[..8], PictureTrouble::Broken),
        (&whole[..whole.len() / 2], PictureTrouble::Broken),
        (&flipped, PictureTrouble::Broken),
        (&photo[..20], PictureTrouble::Broken),
        (&photo[..photo.len() / 2], PictureTrouble::Broken),
        (&photo[..photo.len() - 2], PictureTrouble::Broken),
        (&claims(0, 0), PictureTrouble::Broken),
        (&claims(0, 10), PictureTrouble::Broken),
        (&claims(100_000, 100_000), PictureTrouble::TooLarge),
        (&claims(u32::MAX >> 1, u32::MAX >> 1), PictureTrouble::TooLarge),
        (&claims(8000, 5001), PictureTrouble::TooLarge),
    ] {
        assert_eq!(decode(bytes, PLACE).map(drop), Err(expected), "{:?}", &bytes[..bytes.len().min(40)]);
    }
    for picture in [&whole, &photo] {
        assert_eq!(decode(picture, PLACE).map(|image| image.dimensions()), Ok((400, 300)));
    }
}

/// Each of them is told beside the path, in the language of the screen, and the question is answered all the same.
#[test]
fn a_picture_that_is_not_drawn_stops_no_question() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("d")).expect("a folder");
    nix::unistd::mkfifo(&at("f"), nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    symlink(at("f"), at("l")).expect("a link");
    std::fs::write(at("t"), "a picture").expect("a file");
    std::fs::write(at("b"), &png()[..40]).expect("a file");
    std::fs::write(at("h"), claims(100_000, 100_000)).expect("a file");
    std::fs::write(at("g"), png()).expect("a file");
    let sha256 = |path: &Path| std::fs::read(path).ok().map(|bytes| digest::of_bytes(&bytes));
    for (path, sha256, expected) in [
        (at("d"), None, PictureTrouble::Gone),
        (at("f"), None, PictureTrouble::Gone),
        (at("l"), None, PictureTrouble::Gone),
        (at("missing"), None, PictureTrouble::Gone),
        ("/dev/zero".into(), None, PictureTrouble::Gone),
        (at("t"), sha256(&at("t")), PictureTrouble::OtherFormat),
        (at("b"), sha256(&at("b")), PictureTrouble::Broken),
        (at("h"), sha256(&at("h")), PictureTrouble::TooLarge),
        (at("g"), Some("00".repeat(32)), PictureTrouble::Changed),
    ] {
        for lang in Lang::ALL {
            let mut scene = pictured(lang, volts(), &path, sha256.clone(), Graphics::Sixel);
            scene.resize(100, 40);
            assert_eq!(after_drawing(&mut scene), Some(expected.clone()), "{}", path.display());
            let texts = lang.texts();
            let told = match &expected {
                PictureTrouble::Gone => texts.picture_gone.to_owned(),
                PictureTrouble::OtherFormat => texts.picture_other_format.to_owned(),
                PictureTrouble::Broken => texts.picture_broken.to_owned(),
                PictureTrouble::TooLarge => texts.picture_large.replace("{}", "40"),
                _ => texts.picture_changed.to_owned(),
            };
            let text = inside(&scene.frame(), None);
            assert!(text.contains(&letters(&told)), "{lang:?} {}: {}", path.display(), scene.text());
            assert!(text.contains(&letters(&path.display().to_string())), "{lang:?}: {}", scene.text());
            // It is not made again and again.
            let area = scene.frame().area;
            assert_eq!(next_picture(&mut scene.model, area), None);
            scene.types("5");
            assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Text("5".into()))));
            assert!(!matches!(scene.model.message, Some((MessageWeight::Error, _))));
        }
    }
}

/// A photograph of twelve million pixels becomes as small as its place.
#[test]
fn photographs_are_made_smaller() {
    let photo = encoded(&two_colours(4000, 3000), ImageFormat::Jpeg);
    let folder = folder();
    let path = file(&folder, &photo);
    let mut scene = pictured(Lang::En, volts(), &path, None, Graphics::Kitty);
    scene.resize(120, 40);
    assert_eq!(after_drawing(&mut scene), None);
    let place = place_of(&scene.frame(), Graphics::Kitty).expect("a picture");
    assert!(place.width <= 62 && place.height <= 24 && place.width > 40, "{place:?}");
}

/// Dark lines on a transparent ground are seen on a dark terminal.
#[test]
fn transparent_parts_are_white() {
    let mut drawing = RgbaImage::from_pixel(16, 16, Rgba([0, 0, 0, 0]));
    drawing.put_pixel(3, 3, Rgba([0, 0, 0, 255]));
    let folder = folder();
    let path = file(&folder, &encoded(&DynamicImage::ImageRgba8(drawing), ImageFormat::Png));
    let mut scene = pictured(Lang::En, volts(), &path, None, Graphics::Kitty);
    scene.resize(120, 40);
    assert_eq!(after_drawing(&mut scene), None);
    let frame = scene.frame();
    let place = place_of(&frame, Graphics::Kitty).expect("a picture");
    let sent = frame[place.as_position()].symbol().to_owned();
    // The first pixel is white, in base64 of four bytes of ones.
    assert!(sent.contains("s=16,v=16,m=0;/////////"), "{:?}", &sent[..60]);
}
