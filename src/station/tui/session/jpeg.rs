//! Where the stream of a JPEG file ends, found by its markers.

/// What begins a marker.
const MARK: u8 = 0xff;
/// The end of the image.
const END: u8 = 0xd9;
/// The beginning of a scan.
const SCAN: u8 = 0xda;
/// Most scans of an image. Progressive files of cameras and programs have about ten. Each scan needs few bytes and may go over
/// all pixels, 0.1 s for forty million: the decoder would take 100 of them, and no other picture is drawn meanwhile.
pub(in crate::tui) const MAX_SCANS: usize = 50;

/// Returns the image of a file, from its beginning to its end. Phones append a video, or a second image, which may hold any
/// bytes. `None`: the end is missing, so the decoder would draw the missing part grey, or there are too many scans.
pub(in crate::tui) fn image(bytes: &[u8]) -> Option<&[u8]> {
    let (mut at, mut scans) = (0, 0);
    loop {
        // What is neither a marker nor its segment is data of a scan.
        at += bytes.get(at..)?.iter().position(|byte| *byte == MARK)? + 1;
        match *bytes.get(at)? {
            // Any number of these may stand before the code of a marker.
            MARK => {}
            END => return bytes.get(..=at),
            code if has_segment(code) => {
                scans += usize::from(code == SCAN);
                if scans > MAX_SCANS {
                    return None;
                }
                let length = u16::from_be_bytes([*bytes.get(at + 1)?, *bytes.get(at + 2)?]);
                at += 1 + usize::from(length);
            }
            // A byte of data that looks like a marker, a restart, or the beginning of the image.
            _ => at += 1,
        }
    }
}

/// Whether a length and as many bytes follow the code of a marker.
fn has_segment(code: u8) -> bool {
    matches!(code, 0xc0..=0xcf | SCAN..=0xfe)
}
