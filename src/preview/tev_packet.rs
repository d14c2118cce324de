//! Packets of tev's network protocol: opening an image and updating a tile of it.
//!
//! Takes encoded frames; gives bytes. Source: tev's `Ipc.h` (Müller, <https://github.com/Tom94/tev>). Numbers are little
//! endian; the length of a packet comes first and includes itself.

use half::f16;
use half::slice::HalfFloatSliceExt;

use super::preview_frame::{HEADER, PreviewFrame};

/// Side of the tiles that are sent, in pixels.
const TILE: usize = 64;
/// Type of a packet that opens an image.
pub const CREATE_IMAGE: u8 = 4;
/// Type of a packet that updates a tile, in its third version.
pub const UPDATE_IMAGE: u8 = 6;
/// Names of the channels.
pub const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Columns and rows of a tile, half open.
pub type Tile = [std::ops::Range<usize>; 2];

/// Returns the tiles in which a frame differs from an old one of the same size; all of them without an old one.
pub fn changed_tiles<'a>(
    frame: &'a PreviewFrame,
    old: Option<&'a PreviewFrame>,
) -> impl Iterator<Item = Tile> + 'a {
    let tiles =
        (0..frame.height).step_by(TILE).flat_map(|y| (0..frame.width).step_by(TILE).map(move |x| (x, y)));
    let tile = |(x, y): (usize, usize)| [x..(x + TILE).min(frame.width), y..(y + TILE).min(frame.height)];
    tiles.map(tile).filter(move |[columns, rows]| {
        old.is_none_or(|old| rows.clone().any(|y| pixels(frame, columns, y) != pixels(old, columns, y)))
    })
}

/// Returns the bytes of some columns of row `y`.
fn pixels<'a>(frame: &'a PreviewFrame, columns: &std::ops::Range<usize>, y: usize) -> &'a [u8] {
    let at = |x: usize| HEADER + (y * frame.width + x) * frame.channels * size_of::<u16>();
    &frame.bytes[at(columns.start)..at(columns.end)]
}

/// A packet under construction; its length comes first.
struct Packet(Vec<u8>);

impl Packet {
    fn new(kind: u8, title: &str) -> Self {
        let grab_focus = u8::from(kind == CREATE_IMAGE);
        Self(vec![0, 0, 0, 0, kind, grab_focus]).text(title)
    }

    fn text(mut self, text: &str) -> Self {
        self.0.extend(text.bytes().filter(|byte| *byte != 0));
        self.0.push(0);
        self
    }

    fn numbers(mut self, numbers: &[usize]) -> Self {
        self.0.extend(numbers.iter().flat_map(|&n| (n as i32).to_le_bytes()));
        self
    }

    fn channels(self) -> Self {
        CHANNELS.iter().fold(self.numbers(&[CHANNELS.len()]), |packet, name| packet.text(name))
    }

    fn finish(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

/// Builds the packet that opens an image in tev: size, number and names of channels.
pub fn create_image(title: &str, width: usize, height: usize) -> Vec<u8> {
    Packet::new(CREATE_IMAGE, title).numbers(&[width, height]).channels().finish()
}

/// Builds the packet that replaces a tile: channels, position and size, the offset and the stride of each channel's
/// values, then all values.
pub fn update_image(title: &str, frame: &PreviewFrame, [columns, rows]: Tile) -> Vec<u8> {
    let rectangle = [columns.start, rows.start, columns.len(), rows.len()];
    let mut packet = Packet::new(UPDATE_IMAGE, title).channels().numbers(&rectangle);
    for channel in 0..CHANNELS.len() {
        packet.0.extend((channel as i64).to_le_bytes());
    }
    for _ in CHANNELS {
        packet.0.extend((CHANNELS.len() as i64).to_le_bytes());
    }
    for y in rows {
        let halves = pixels(frame, &columns, y).as_chunks::<2>().0;
        let halves: Vec<f16> = halves.iter().map(|&pair| f16::from_le_bytes(pair)).collect();
        let mut values = vec![0.0; halves.len()];
        halves.convert_to_f32_slice(&mut values);
        packet.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    packet.finish()
}
