//! Photographs as cameras and phones write them: turned, with a video behind them, cut off, and of many scans.

use image::{DynamicImage, ImageFormat};

use super::super::pictures::PictureTrouble;
use super::super::session::jpeg::{self, MAX_SCANS};
use super::super::session::pictures::decode;
use super::pictures::{PLACE, encoded, file, folder, two_colours};

/// A photograph as a camera that was held upright writes it: orientation 6, the first row of pixels is the right side.
fn on_its_side(jpeg: &[u8]) -> Vec<u8> {
    let exif = b"\xff\xe1\0\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    [&jpeg[..2], &exif[..], &jpeg[2..]].concat()
}

#[test]
fn a_photograph_is_turned_upright() {
    let turned = on_its_side(&encoded(&two_colours(40, 20), ImageFormat::Jpeg));
    let image = DynamicImage::ImageRgba8(decode(&turned, PLACE).expect("a picture")).into_rgb8();
    assert_eq!(image.dimensions(), (20, 40));
    let [top, bottom] = [5, 35].map(|y| image.get_pixel(10, y).0);
    assert!(top[0] > 200 && top[2] < 60 && bottom[0] < 60 && bottom[2] > 200, "{top:?} {bottom:?}");
    // Upright it takes as much of the place as it can.
    assert_eq!(decode(&turned, (30, 30)).map(|image| image.dimensions()), Ok((15, 30)));
    assert_eq!(decode(&turned, (10, 50)).map(|image| image.dimensions()), Ok((10, 20)));
}

/// The most memory that this process had, in MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("of this process");
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB"));
    peak.and_then(|peak| peak.trim().parse::<f64>().ok()).expect("a number") / 1024.0
}

/// Twelve million pixels take 36 MB. Other tests of this process would be counted, too, so another process decodes.
#[test]
fn a_photograph_that_is_turned_takes_its_memory_once() {
    const PHOTO: &str = "GNC_TEST_PHOTO";
    if let Some(path) = std::env::var_os(PHOTO) {
        let bytes = std::fs::read(path).expect("a picture");
        let before = peak_mb();
        let image = decode(&bytes, PLACE).expect("a picture");
        println!("took {} {:?}", peak_mb() - before, image.dimensions());
        return;
    }
    let folder = folder();
    let photo = file(&folder, &on_its_side(&encoded(&two_colours(4000, 3000), ImageFormat::Jpeg)));
    let name = module_path!().split_once("::").expect("a crate").1;
    let name = format!("{name}::a_photograph_that_is_turned_takes_its_memory_once");
    let mut alone = std::process::Command::new(std::env::current_exe().expect("this program"));
    let output = alone.args(["--exact", &name, "--nocapture"]).env(PHOTO, photo).output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let (_, took) = text.split_once("took ").unwrap_or_else(|| panic!("{text}"));
    assert!(took.contains("(375, 500)"), "{took}");
    let took: f64 = took.split(' ').next().and_then(|took| took.parse().ok()).expect("a number");
    assert!((30.0..60.0).contains(&took), "{took} MB");
}

/// Phones append a video to a photograph. What follows the image is no part of it, whatever it holds.
#[test]
fn what_follows_a_photograph_does_not_matter() {
    let photo = encoded(&two_colours(400, 300), ImageFormat::Jpeg);
    for after in
        [&b"video \xff\xda more"[..], b"\xff\xda\xff\xda", b"\xff\xd8\xff\xd9\xff\xda", &photo[..photo.len() / 2]]
    {
        let with = [&photo, after].concat();
        assert_eq!(jpeg::image(&with).map(<[u8]>::len), Some(photo.len()));
        assert_eq!(decode(&with, PLACE), decode(&photo, PLACE));
    }
    for lost in [1, 2, 3, photo.len() / 2] {
        let cut = decode(&photo[..photo.len() - lost], PLACE);
        assert_eq!(cut.map(|image| image.dimensions()), Err(PictureTrouble::Broken), "{lost}");
    }
    // A small picture within the head has an end of its own.
    let small = encoded(&two_colours(16, 16), ImageFormat::Jpeg);
    let length = u16::try_from(small.len() + 2).expect("small").to_be_bytes();
    let with = [&photo[..2], b"\xff\xe1", &length, &small, &photo[2..]].concat();
    assert_eq!(jpeg::image(&with).map(<[u8]>::len), Some(with.len()));
    assert_eq!(decode(&with, PLACE), decode(&photo, PLACE));
    for kept in 2..with.len() {
        assert_eq!(jpeg::image(&with[..kept]), None, "{kept}");
    }
}

/// Restarts, a byte of ones, and markers with more than one of them before their code are data.
#[test]
fn data_of_a_scan_is_no_end() {
    let stream = b"\xff\xd8\xff\xff\xda\0\x04ab\x01\xff\0\xd9\xff\xd0\xff\xd7\xff\xff\xc4\0\x04\xff\xd9\xff\xda\0\x02\xff\xff\0\xff\xff\xd9";
    assert_eq!(jpeg::image(&[stream, &b"\xff\xd9"[..]].concat()), Some(&stream[..]));
}

/// Blocks of a run of which the file says nothing more than that they are all zeros, if all its bits are zeros.
const RUN: usize = 1 << 14;

/// A file of little size whose scans go over many pixels again and again.
fn many_scans(kind: u8, (width, height): (u16, u16), scans: usize) -> Vec<u8> {
    let mut jpeg = b"\xff\xd8\xff\xdb\0\x43\0".to_vec();
    jpeg.extend([1; 64]);
    jpeg.extend([0xff, kind, 0, 11, 8]);
    jpeg.extend([height.to_be_bytes(), width.to_be_bytes()].concat());
    jpeg.extend(b"\x01\x01\x11\0");
    // One code of one bit in each table: no difference, and a run of blocks.
    for (class, symbol) in [(0, 0), (0x10, 0xe0)] {
        jpeg.extend([0xff, 0xc4, 0, 20, class, 1]);
        jpeg.extend([0; 15]);
        jpeg.push(symbol);
    }
    let blocks = usize::from(width).div_ceil(8) * usize::from(height).div_ceil(8);
    for scan in 0..scans {
        let (first, last) = if scan == 0 { (0, 0) } else { (1, 63) };
        // The first scan of its coefficients, then those that make them finer.
        let approximation = if scan < 2 { 0x01 } else { 0x10 };
        jpeg.extend([0xff, 0xda, 0, 8, 1, 1, 0, first, last, approximation]);
        jpeg.resize(jpeg.len() + if scan == 0 { blocks.div_ceil(8) } else { 15 * blocks.div_ceil(RUN) / 8 + 1 }, 0);
    }
    jpeg.extend([0xff, 0xd9]);
    jpeg
}

#[test]
fn a_picture_of_very_many_scans_is_not_drawn() {
    for kind in [0xc0, 0xc2] {
        let most = many_scans(kind, (64, 64), MAX_SCANS);
        assert_eq!(jpeg::image(&most).map(<[u8]>::len), Some(most.len()));
        let more = many_scans(kind, (64, 64), MAX_SCANS + 1);
        assert_eq!(decode(&more, PLACE).map(|image| image.dimensions()), Err(PictureTrouble::Broken));
    }
    assert!(decode(&many_scans(0xc2, (64, 64), 10), PLACE).is_ok());
}
