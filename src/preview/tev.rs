//! Sends the image to a running tev viewer (Müller, <https://github.com/Tom94/tev>) as it converges.
//!
//! A thread of its own looks at the hub like any other viewer and sends the tiles that have changed.
//! A viewer that is absent, hangs or goes away costs the render nothing: there are time-outs
//! everywhere, and a new attempt now and then, which begins with the whole image.

use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam::channel::{Receiver, bounded};
use half::f16;
use half::slice::HalfFloatSliceExt;

use super::frame::{Frame, HEADER};
use super::hub::{Hub, Viewer};
use super::view::View;

/// Side of the tiles that are sent, in pixels.
const TILE: usize = 64;
/// How long connecting or sending may take.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two attempts to connect.
const RETRY: Duration = Duration::from_secs(1);
/// Time between two looks at the hub.
const POLL: Duration = Duration::from_millis(50);
/// How long the end of a render waits for the last image to be sent.
const FAREWELL: Duration = Duration::from_secs(3);
/// Types of packets in tev's protocol: a new image, and version 3 of an update.
const CREATE_IMAGE: u8 = 4;
const UPDATE_IMAGE: u8 = 6;
const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// What is sent: the newest image of each.
const VIEWS: [(View, &str); 2] = [(View::Filtered, "filtered"), (View::Raw, "unfiltered")];

/// A connection to a display server, kept up until dropped; then the last image is still sent.
pub struct Display {
    closing: Arc<AtomicBool>,
    closed: Receiver<()>,
}

impl Display {
    /// Starts sending what `hub` shows to `address` (`HOST:PORT`); `name` is how the viewer calls it.
    /// `warn` is told once if the viewer cannot be reached.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        hub: Arc<Hub>,
        address: String,
        name: String,
        mut warn: impl FnMut(&str) + Send + 'static,
    ) -> io::Result<Self> {
        let closing = Arc::new(AtomicBool::new(false));
        let (alive, closed) = bounded(0);
        let ends = closing.clone();
        std::thread::Builder::new().name("display".to_owned()).spawn(move || {
            // Its end is what the other side of the channel waits for.
            let _alive = alive;
            serve(&hub, &address, &name, &mut warn, &ends);
        })?;
        Ok(Self { closing, closed })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        let _ = self.closed.recv_timeout(FAREWELL);
    }
}

fn serve(hub: &Arc<Hub>, address: &str, name: &str, warn: &mut dyn FnMut(&str), closing: &AtomicBool) {
    let mut warned = false;
    while !closing.load(Ordering::Relaxed) {
        match connect(address) {
            Ok(stream) => {
                if send_all(hub, stream, name, closing).is_ok() {
                    return;
                }
            }
            Err(_) if warned => {}
            Err(problem) => {
                warned = true;
                warn(&format!("no display server at {address}: {problem}; it will be tried again"));
            }
        }
        let mut waited = Duration::ZERO;
        while waited < RETRY && !closing.load(Ordering::Relaxed) {
            std::thread::sleep(POLL);
            waited += POLL;
        }
    }
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let mut problem = io::ErrorKind::NotFound.into();
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, TIMEOUT) {
            Ok(stream) => {
                stream.set_write_timeout(Some(TIMEOUT))?;
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => problem = error,
        }
    }
    Err(problem)
}

/// Sends images until the render ends (`Ok`) or the connection fails.
fn send_all(hub: &Arc<Hub>, mut stream: TcpStream, name: &str, closing: &AtomicBool) -> io::Result<()> {
    let mut viewer = Viewer::new(hub.clone());
    viewer.look(&VIEWS.map(|(view, _)| view));
    viewer.ready(true);
    let mut frames = hub.frames();
    let mut sent: [Option<Arc<Frame>>; VIEWS.len()] = Default::default();
    loop {
        let ends = closing.load(Ordering::Relaxed);
        let Some(frame) = viewer.take(&mut frames) else {
            if ends {
                return Ok(());
            }
            std::thread::sleep(POLL);
            continue;
        };
        let Some(k) = VIEWS.iter().position(|(view, _)| *view == frame.view) else { continue };
        let title = format!("{name} ({})", VIEWS[k].1);
        let same_shape = |old: &Arc<Frame>| (old.width, old.height) == (frame.width, frame.height);
        let old = sent[k].take().filter(same_shape);
        if old.is_none() {
            stream.write_all(&create(&title, frame.width, frame.height))?;
        }
        for tile in changed_tiles(&frame, old.as_deref()) {
            stream.write_all(&update(&title, &frame, tile))?;
        }
        sent[k] = Some(frame);
    }
}

/// Columns and rows of a tile, half open.
type Tile = [std::ops::Range<usize>; 2];

fn changed_tiles<'a>(frame: &'a Frame, old: Option<&'a Frame>) -> impl Iterator<Item = Tile> + 'a {
    let tiles =
        (0..frame.height).step_by(TILE).flat_map(|y| (0..frame.width).step_by(TILE).map(move |x| (x, y)));
    let tile = |(x, y): (usize, usize)| [x..(x + TILE).min(frame.width), y..(y + TILE).min(frame.height)];
    tiles.map(tile).filter(move |[columns, rows]| {
        old.is_none_or(|old| rows.clone().any(|y| pixels(frame, columns, y) != pixels(old, columns, y)))
    })
}

/// Bytes of some pixels of a row.
fn pixels<'a>(frame: &'a Frame, columns: &std::ops::Range<usize>, y: usize) -> &'a [u8] {
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

/// Opens an image in the viewer: size, number and names of channels.
fn create(title: &str, width: usize, height: usize) -> Vec<u8> {
    Packet::new(CREATE_IMAGE, title).numbers(&[width, height]).channels().finish()
}

/// Replaces a tile: channels, place, then for each channel where its values begin and how far apart
/// they are, then all values.
fn update(title: &str, frame: &Frame, [columns, rows]: Tile) -> Vec<u8> {
    let place = [columns.start, rows.start, columns.len(), rows.len()];
    let mut packet = Packet::new(UPDATE_IMAGE, title).channels().numbers(&place);
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

#[cfg(test)]
mod tests {
    use super::super::frame::Stamp;
    use super::*;
    use crate::image::Planes;
    use std::collections::BTreeMap;
    use std::io::Read;
    use std::net::TcpListener;

    /// What a viewer has been told, decoded as tev does.
    #[derive(Default)]
    struct Received {
        images: BTreeMap<String, (usize, Vec<f32>)>,
        updates: usize,
    }

    struct Reader<'a>(&'a [u8]);

    impl Reader<'_> {
        fn bytes<const N: usize>(&mut self) -> [u8; N] {
            let (head, tail) = self.0.split_at(N);
            self.0 = tail;
            head.try_into().unwrap()
        }
        fn int(&mut self) -> usize {
            i32::from_le_bytes(self.bytes()) as usize
        }
        fn long(&mut self) -> usize {
            i64::from_le_bytes(self.bytes()) as usize
        }
        fn text(&mut self) -> String {
            let end = self.0.iter().position(|b| *b == 0).unwrap();
            let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
            self.0 = &self.0[end + 1..];
            text
        }
    }

    impl Received {
        fn take(&mut self, packet: &[u8]) {
            let mut reader = Reader(packet);
            let [kind, _grab_focus] = reader.bytes();
            let title = reader.text();
            if kind == CREATE_IMAGE {
                let (width, height, channels) = (reader.int(), reader.int(), reader.int());
                let names: Vec<_> = (0..channels).map(|_| reader.text()).collect();
                assert_eq!(names, CHANNELS);
                self.images.insert(title, (width, vec![0.0; width * height * channels]));
                return;
            }
            assert_eq!(kind, UPDATE_IMAGE);
            let channels = reader.int();
            let names: Vec<_> = (0..channels).map(|_| reader.text()).collect();
            assert_eq!(names, CHANNELS);
            let [x, y, width, height] = [0; 4].map(|_| reader.int());
            let offsets: Vec<_> = (0..channels).map(|_| reader.long()).collect();
            let strides: Vec<_> = (0..channels).map(|_| reader.long()).collect();
            let values: Vec<f32> =
                reader.0.as_chunks::<4>().0.iter().map(|&value| f32::from_le_bytes(value)).collect();
            assert_eq!(values.len(), width * height * channels);
            let (image_width, image) = self.images.get_mut(&title).expect("created first");
            for i in 0..width * height {
                let at = (y + i / width) * *image_width + x + i % width;
                for c in 0..channels {
                    image[at * channels + c] = values[offsets[c] + i * strides[c]];
                }
            }
            self.updates += 1;
        }

        /// Reads packets until `enough`.
        fn read_from(&mut self, stream: &mut TcpStream, enough: impl Fn(&Self) -> bool) {
            stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            while !enough(self) {
                let mut length = [0; 4];
                stream.read_exact(&mut length).unwrap();
                let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
                stream.read_exact(&mut packet).unwrap();
                self.take(&packet);
            }
        }
    }

    fn frame(values: &Planes, sequence: u32) -> Frame {
        let stamp = Stamp { generation: 1, sequence, spp: 1.0, seconds: 1.0 };
        Frame::new(View::Raw, values, None, stamp)
    }

    #[test]
    fn a_viewer_gets_the_image_then_only_what_changed_and_all_of_it_again_after_a_break() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let hub = Arc::new(Hub::default());
        let display = Display::start(hub.clone(), address, "scene".to_owned(), |_| ()).unwrap();
        let mut values = Planes::new(100, 70, 3);
        values.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = (i % 1000) as f32);
        hub.publish(frame(&values, 1));

        let (mut stream, _) = listener.accept().unwrap();
        let mut received = Received::default();
        // 100×70 pixels are 2×2 tiles.
        received.read_from(&mut stream, |received| received.updates == 4);
        let image = &received.images["scene (unfiltered)"].1;
        let expected = |values: &Planes| -> Vec<f32> {
            (0..7000).flat_map(|i| [0, 1, 2].map(|c| values.plane(c)[i])).collect()
        };
        assert_eq!(*image, expected(&values));

        values.data_mut()[5] = 7.0;
        hub.publish(frame(&values, 2));
        values.data_mut()[6999] = 8.0;
        received.read_from(&mut stream, |received| received.updates == 5);
        hub.publish(frame(&values, 3));
        received.read_from(&mut stream, |received| received.updates == 6);
        assert_eq!(received.images["scene (unfiltered)"].1, expected(&values));

        // The viewer goes and comes back.
        drop(stream);
        let mut sequence = 4;
        listener.set_nonblocking(true).unwrap();
        let mut stream = loop {
            values.data_mut()[0] += 1.0;
            hub.publish(frame(&values, sequence));
            sequence += 1;
            match listener.accept() {
                Ok((stream, _)) => break stream,
                Err(_) => std::thread::sleep(Duration::from_millis(20)),
            }
        };
        stream.set_nonblocking(false).unwrap();
        let mut received = Received::default();
        received.read_from(&mut stream, |received| received.updates >= 4);
        drop(display);
        assert!(received.images.contains_key("scene (unfiltered)"));
    }

    #[test]
    fn an_absent_viewer_is_told_of_once_and_does_not_keep_a_render_from_ending() {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let hub = Arc::new(Hub::default());
        let (said, warnings) = crossbeam::channel::unbounded();
        let warn = move |warning: &str| said.send(warning.to_owned()).unwrap();
        let display = Display::start(hub.clone(), free.to_string(), "scene".to_owned(), warn).unwrap();
        hub.publish(frame(&Planes::new(4, 4, 3), 1));
        let warning = warnings.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(warning.contains(&free.to_string()), "{warning}");
        // Beyond the second attempt.
        std::thread::sleep(RETRY + 4 * POLL);
        drop(display);
        assert!(!hub.has_viewers());
        assert!(warnings.try_recv().is_err());
    }
}
