//! Sends the image to a running tev viewer (Müller, <https://github.com/Tom94/tev>) as it converges.
//!
//! A thread of its own takes frames from the hub like any other viewer and sends the tiles that have changed.
//! A tev that is absent, hangs or quits costs the render nothing: every call has a time-out, and the client connects
//! again every second, starting with the whole image.

use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam::channel::{Receiver, bounded};

use super::hub::Hub;
use super::preview_frame::PreviewFrame;
use super::tev_packet::{changed_tiles, create_image, update_image};
use super::view::View;
use super::viewer::Viewer;

/// Longest time to connect or to send a packet.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two attempts to connect.
const RETRY: Duration = Duration::from_secs(1);
/// Time between two looks at the hub.
const POLL: Duration = Duration::from_millis(50);
/// Longest time that the end of a render waits for the last image to be sent.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(3);
/// The views that are sent, and their names in tev.
const VIEWS: [(View, &str); 2] = [(View::Filtered, "filtered"), (View::Raw, "unfiltered")];

/// A connection to tev; dropping it sends the last image first.
pub struct TevClient {
    closing: Arc<AtomicBool>,
    closed: Receiver<()>,
}

impl TevClient {
    /// Starts to send the images of `hub` to `address` (`HOST:PORT`), under the title `name`. Calls `warn` once if
    /// the viewer cannot be reached.
    ///
    /// # Errors
    /// The system provides no thread.
    pub fn start(
        hub: Arc<Hub>,
        address: String,
        name: String,
        mut warn: impl FnMut(&str) + Send + 'static,
    ) -> io::Result<Self> {
        let closing = Arc::new(AtomicBool::new(false));
        let (running, closed) = bounded(0);
        let is_closing = closing.clone();
        std::thread::Builder::new().name("display".to_owned()).spawn(move || {
            // The other side of the channel waits until this is dropped.
            let _running = running;
            keep_connected(&hub, &address, &name, &mut warn, &is_closing);
        })?;
        Ok(Self { closing, closed })
    }
}

impl Drop for TevClient {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        let _ = self.closed.recv_timeout(CLOSE_TIMEOUT);
    }
}

/// Connects and sends images, again and again, until the render ends.
fn keep_connected(
    hub: &Arc<Hub>,
    address: &str,
    name: &str,
    warn: &mut dyn FnMut(&str),
    closing: &AtomicBool,
) {
    let mut warned = false;
    while !closing.load(Ordering::Relaxed) {
        match connect(address) {
            Ok(stream) => {
                if send_images(hub, stream, name, closing).is_ok() {
                    return;
                }
            }
            Err(_) if warned => {}
            Err(problem) => {
                warned = true;
                warn(&format!(
                    "no display server at {address}: {problem}; the connection is tried again every second"
                ));
            }
        }
        let mut waited = Duration::ZERO;
        while waited < RETRY && !closing.load(Ordering::Relaxed) {
            std::thread::sleep(POLL);
            waited += POLL;
        }
    }
}

/// Connects to the first address of a host that answers.
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
fn send_images(hub: &Arc<Hub>, mut stream: TcpStream, name: &str, closing: &AtomicBool) -> io::Result<()> {
    let mut viewer = Viewer::new(hub.clone());
    viewer.select(&VIEWS.map(|(view, _)| view));
    viewer.set_ready(true);
    let mut frames = hub.frames();
    let mut sent: [Option<Arc<PreviewFrame>>; VIEWS.len()] = Default::default();
    loop {
        // Wait for a frame
        let ends = closing.load(Ordering::Relaxed);
        let Some(frame) = viewer.take(&mut frames) else {
            if ends {
                return Ok(());
            }
            std::thread::sleep(POLL);
            continue;
        };

        // Send the changed tiles
        let frame = if frame.grid > 1 { Arc::new(frame.enlarged()) } else { frame };
        let Some(k) = VIEWS.iter().position(|(view, _)| *view == frame.view) else { continue };
        let title = format!("{name} ({})", VIEWS[k].1);
        let same_shape = |old: &Arc<PreviewFrame>| (old.width, old.height) == (frame.width, frame.height);
        let old = sent[k].take().filter(same_shape);
        if old.is_none() {
            stream.write_all(&create_image(&title, frame.width, frame.height))?;
        }
        for tile in changed_tiles(&frame, old.as_deref()) {
            stream.write_all(&update_image(&title, &frame, tile))?;
        }
        sent[k] = Some(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::super::preview_frame::FrameInfo;
    use super::super::tev_packet::{CHANNELS, CREATE_IMAGE, UPDATE_IMAGE};
    use super::*;
    use crate::image::Planes;
    use std::collections::BTreeMap;
    use std::io::Read;
    use std::net::TcpListener;

    /// The images that the viewer has received, decoded as tev does.
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

    fn frame(values: &Planes, sequence: u32) -> PreviewFrame {
        let info = FrameInfo { generation: 1, sequence, spp: 1.0, seconds: 1.0, side: 1 };
        PreviewFrame::new(View::Raw, values, None, info)
    }

    #[test]
    fn a_viewer_gets_the_image_then_only_what_changed_and_all_of_it_again_after_a_break() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let hub = Arc::new(Hub::default());
        let client = TevClient::start(hub.clone(), address, "scene".to_owned(), |_| ()).unwrap();
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
        drop(client);
        assert!(received.images.contains_key("scene (unfiltered)"));
    }

    #[test]
    fn an_absent_viewer_is_warned_of_once_and_does_not_delay_the_end() {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let hub = Arc::new(Hub::default());
        let (sender, warnings) = crossbeam::channel::unbounded();
        let warn = move |warning: &str| sender.send(warning.to_owned()).unwrap();
        let client = TevClient::start(hub.clone(), free.to_string(), "scene".to_owned(), warn).unwrap();
        hub.publish(frame(&Planes::new(4, 4, 3), 1));
        let warning = warnings.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(warning.contains(&free.to_string()), "{warning}");
        // Beyond the second attempt.
        std::thread::sleep(RETRY + 4 * POLL);
        drop(client);
        assert!(!hub.has_viewers());
        assert!(warnings.try_recv().is_err());
    }
}
