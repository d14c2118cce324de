//! Path tracing (Kajiya 1986) with light sampling, multiple importance sampling and Russian
//! roulette, in the conventions of pbrt-v4's `path`: `max_depth` counts scattering events, so that
//! 0 shows emission only and 1 adds direct light.
//!
//! Many paths go on together (a *wavefront*: Laine, Karras and Aila 2013), sixteen of them in a packet,
//! a lane for each. They move to other packets between one stage and the next, so that those are full:
//! paths that [wait](Waiting) fly to a surface, those that [arrived](Arrivals) there are
//! [shaded](super::shade), and so on.

use glam::Vec3;

use super::PathTracer;
use super::direct::power_heuristic;
use super::flights::{Arrivals, Flights, SEEN_DIRECTLY, Shadows, Waiting};
use super::shade::Other;
use crate::geometry::{HitLanes, LANES, Lanes3, RayLanes, lanes_of, mask_of};
use crate::render::lights::{Receiver, Receivers};
use crate::render::record::Records;
use crate::render::sampler::{Addresses, Source};

/// Distance, in scene diameters, at which a path that leaves the scene is recorded.
const FAR: f32 = 2.0;

/// Paths that are followed together.
pub struct Wavefront<'s> {
    /// Where the numbers of each path come from, and what is remembered of it.
    pub(super) samples: Vec<Addresses>,
    pub(super) records: Vec<Records>,
    pub(super) waiting: Waiting,
    pub(super) arrivals: Box<Arrivals>,
    /// What arrivals are gathered in while others are shaded.
    pub(super) spare: Option<Box<Arrivals>>,
    pub(super) shadows: Shadows,
    pub(super) others: Vec<Other<'s>>,
    /// The packet that is being shaded, after that.
    pub(super) next: Box<Flights>,
}

impl Default for Wavefront<'_> {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            records: Vec::new(),
            waiting: Waiting::default(),
            arrivals: Box::new(Arrivals::NONE),
            spare: None,
            shadows: Shadows::NONE,
            others: Vec::new(),
            next: Box::new(Flights::NONE),
        }
    }
}

impl Wavefront<'_> {
    pub fn clear(&mut self) {
        self.samples.clear();
        self.records.clear();
    }

    /// Adds some paths that start at the camera: those whose bit is set. What is remembered of them is empty.
    pub fn start(&mut self, rays: &RayLanes, samples: &Addresses, present: u32) -> &mut Records {
        let first = (self.records.len() * LANES) as u32;
        let mut flights = Flights {
            rays: *rays,
            throughput: Lanes3 { x: [1.0; LANES], y: [1.0; LANES], z: [1.0; LANES] },
            flags: [SEEN_DIRECTLY; LANES],
            from: Receivers { position: rays.origin, ..Receivers::NONE },
            ..Flights::NONE
        };
        (first..).zip(&mut flights.path).for_each(|(path, lane)| *lane = path);
        self.waiting.push_packet(&flights, present);
        self.samples.push(*samples);
        let packet = self.records.len();
        self.records.push(Records::NONE);
        &mut self.records[packet]
    }

    /// What is remembered of the paths, in the packets in which they were started.
    pub fn records(&self) -> &[Records] {
        &self.records
    }
}

/// Packet and lane of a path among the records.
#[inline(always)]
pub(super) fn place(path: u32) -> (usize, usize) {
    (path as usize / LANES, path as usize % LANES)
}

impl<'s> PathTracer<'s> {
    /// Follows all paths to their ends and fills in their records.
    pub fn trace<S: Source>(&self, wave: &mut Wavefront<'s>) {
        loop {
            if let Some((flights, count)) = wave.waiting.pop() {
                self.fly::<S>(wave, &flights, count);
                wave.waiting.give_back(flights);
            } else if wave.arrivals.count > 0 {
                self.shade_arrivals::<S>(wave);
            } else {
                break;
            }
        }
        self.add_visible_light(&mut wave.shadows, &mut wave.records);
    }

    /// Follows the first `count` of a packet to the next surfaces.
    fn fly<S: Source>(&self, wave: &mut Wavefront<'s>, flights: &Flights, count: usize) {
        let mut hits = HitLanes::NONE;
        self.accel.intersect_lanes(&flights.rays, count, &mut hits);
        let missed = |lane| hits.primitive[lane] == HitLanes::NOTHING;
        let escapes = mask_of(|lane| lane < count && missed(lane));
        if escapes == 0 && count == LANES {
            return self.shade::<S>(wave, flights, &hits, count);
        }
        if escapes != 0 {
            let within = self.lights.expected_within(&flights.from);
            lanes_of(escapes).for_each(|lane| self.escape(flights, within[lane], lane, &mut wave.records));
        }
        for lane in (0..count).filter(|&lane| !missed(lane)) {
            wave.arrivals.push(flights, &hits, lane);
            if wave.arrivals.count == LANES {
                self.shade_arrivals::<S>(wave);
            }
        }
    }

    fn shade_arrivals<S: Source>(&self, wave: &mut Wavefront<'s>) {
        let empty = wave.spare.take().unwrap_or_else(|| Box::new(Arrivals::NONE));
        let mut arrivals = std::mem::replace(&mut wave.arrivals, empty);
        let count = std::mem::take(&mut arrivals.count);
        self.shade::<S>(wave, &arrivals.flights, &arrivals.hits, count);
        wave.spare = Some(arrivals);
    }

    /// Light from around the scene, where nothing is hit.
    #[inline]
    fn escape(&self, flights: &Flights, within: f32, lane: usize, records: &mut [Records]) {
        let (packet, place) = place(flights.path[lane]);
        let records = &mut records[packet];
        let direction = flights.rays.direction.at(lane);
        // From where the path was scattered, whatever boundaries it has passed since.
        for (i, radiance) in self.lights.environments(flights.from.position.at(lane), direction) {
            let share = share(flights, lane, |from| self.lights.pdf_environment(from, within, i, direction));
            add(records, place, flights, lane, radiance * share);
        }
        match flights.depth[lane] {
            0 => {
                let position = flights.rays.origin.at(lane) * self.inverse_diameter + FAR * direction;
                records.position1.set(place, position);
                records.position2.set(place, position);
                records.albedo.set(place, Vec3::ONE);
            }
            1 => records.position2.set(place, records.position1.at(place) + FAR * direction),
            _ => {}
        }
    }
}

/// Adds radiance that a path finds at its end to what is remembered of it.
#[inline]
pub(super) fn add(records: &mut Records, place: usize, flights: &Flights, lane: usize, radiance: Vec3) {
    let seen_directly = flights.flags[lane] & SEEN_DIRECTLY != 0;
    let sum = if seen_directly { &mut records.visible } else { &mut records.found };
    sum.set(place, sum.at(place) + flights.throughput.at(lane) * radiance);
}

/// Share of light found by a path, where light sampling finds it with the density given by
/// `light_pdf`, from where the path was scattered.
#[inline]
pub(super) fn share(flights: &Flights, lane: usize, light_pdf: impl FnOnce(&Receiver) -> f32) -> f32 {
    flights.origin(lane).map_or(1.0, |from| power_heuristic(flights.pdf[lane], light_pdf(&from)))
}
