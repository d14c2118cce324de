//! Sends and receives bytes between the processes of an MPI world, and counts bytes and seconds.
//!
//! A process that waits sleeps between two looks, since MPI itself would keep a core busy that other processes may need.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mpi::collective::SystemOperation;
use mpi::request;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Destination, Source};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Largest message: MPI counts in 32 bits.
const LARGEST: usize = 1 << 28;
/// Shortest and longest sleep of a process that waits.
const SLEEP: (Duration, Duration) = (Duration::from_micros(20), Duration::from_millis(1));

/// The connections of a process to all others.
#[derive(Default)]
pub struct Link {
    bytes_sent: AtomicU64,
    /// Nanoseconds of sending, receiving, and waiting for others to do so.
    transfer: AtomicU64,
}

fn world() -> SimpleCommunicator {
    SimpleCommunicator::world()
}

impl Link {
    /// Returns the number of this process, from 0.
    pub fn rank(&self) -> usize {
        world().rank() as usize
    }

    /// Returns the number of processes.
    pub fn size(&self) -> usize {
        world().size() as usize
    }

    pub fn bytes_sent(&self) -> u64 {
        self.bytes_sent.load(Ordering::Relaxed)
    }

    /// Returns the seconds of sending, receiving, and waiting for others to do so.
    pub fn transfer_seconds(&self) -> f64 {
        Duration::from_nanos(self.transfer.load(Ordering::Relaxed)).as_secs_f64()
    }

    /// Sends messages to other processes, each with the process that it goes to, and lets `receive` take theirs.
    pub fn send_all<T>(&self, messages: &[(usize, Vec<u8>)], receive: impl FnOnce() -> T) -> T {
        let world = world();
        request::scope(|scope| {
            let pieces =
                messages.iter().flat_map(|(to, bytes)| bytes.chunks(LARGEST).map(move |piece| (*to, piece)));
            let requests: Vec<_> = pieces
                .map(|(to, piece)| {
                    self.bytes_sent.fetch_add(piece.len() as u64, Ordering::Relaxed);
                    world.process_at_rank(to as i32).immediate_send(scope, piece)
                })
                .collect();
            let received = receive();
            self.timed(|| requests.into_iter().for_each(request::Request::wait_without_status));
            received
        })
    }

    /// Receives the message of a process, of this length.
    pub fn receive(&self, from: usize, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        self.timed(|| {
            for piece in bytes.chunks_mut(LARGEST) {
                self.wait_for(from);
                world().process_at_rank(from as i32).receive_into(piece);
            }
        });
        bytes
    }

    /// Sends a value that is small.
    pub fn tell(&self, to: usize, value: &impl Serialize) {
        let text = serde_json::to_vec(value).expect("messages have no keys other than text");
        self.bytes_sent.fetch_add(text.len() as u64, Ordering::Relaxed);
        world().process_at_rank(to as i32).send(&text[..]);
    }

    /// Receives a value of [`Self::tell`].
    pub fn hear<T: DeserializeOwned>(&self, from: usize) -> T {
        self.timed(|| self.next(from))
    }

    /// Does the same without counting the time: the process has nothing to do until then.
    pub fn next<T: DeserializeOwned>(&self, from: usize) -> T {
        self.wait_for(from);
        let (text, _) = world().process_at_rank(from as i32).receive_vec::<u8>();
        serde_json::from_slice(&text).expect("all processes are of the same version")
    }

    /// Adds up the numbers of all processes, which all call it.
    pub fn sum(&self, numbers: &mut [i64]) {
        let own = numbers.to_vec();
        self.timed(|| world().all_reduce_into(&own[..], numbers, SystemOperation::sum()));
    }

    /// Returns the largest number of all processes, which all call it.
    pub fn max(&self, number: f32) -> f32 {
        let mut largest = number;
        self.timed(|| world().all_reduce_into(&number, &mut largest, SystemOperation::max()));
        largest
    }

    /// Waits for a message of a process.
    fn wait_for(&self, from: usize) {
        let world = world();
        let process = world.process_at_rank(from as i32);
        let mut sleep = SLEEP.0;
        while process.immediate_probe().is_none() {
            std::thread::sleep(sleep);
            sleep = (sleep + sleep / 4).min(SLEEP.1);
        }
    }

    fn timed<T>(&self, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = work();
        self.transfer.fetch_add(started.elapsed().as_nanos() as u64, Ordering::Relaxed);
        result
    }
}
