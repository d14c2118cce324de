//! What happens to paths at surfaces: they find light, are remembered, gather light from a sampled
//! light and are scattered. Plain materials ([`Plain`](crate::render::bsdf::Plain)) in lanes, others
//! one by one.

use glam::{Vec2, Vec3};

use super::PathTracer;
use super::direct::{MAX_PASSES, turned};
use super::events::{receive, scattered_on};
use super::flights::{Flights, LIGHT_SAMPLING, SCATTERED, Waiting};
use super::path::{Wavefront, add, place, share};
use crate::geometry::{HitLanes, LANES, Lanes3, PointLanes, SurfacePoint, lanes_of, mask_of};
use crate::render::bsdf::{Bsdf, Evaluated, PlainSurfaces, Scattered};
use crate::render::lights::Receivers;
use crate::render::record::Records;
use crate::render::sampler::{Addresses, BounceNumbers, Source};
use crate::scene::texture::TexturePoint;

/// A path on a surface that is not plain.
pub struct Other<'s> {
    lane: usize,
    point: SurfacePoint,
    bsdf: Option<Bsdf<'s>>,
}

/// What is known of the surfaces at which a packet of paths arrived.
pub(super) struct Places<'a> {
    pub points: PointLanes,
    /// After bump or normal maps.
    pub normals: Lanes3,
    pub surfaces: PlainSurfaces<'a>,
    /// Lanes with paths on plain surfaces.
    pub plain: u32,
    /// Where light is received.
    pub receivers: Receivers,
}

impl<'s> PathTracer<'s> {
    /// Shades the first `count` paths of a packet, which arrived. Those that go on wait again afterwards.
    pub(super) fn shade<S: Source>(
        &self,
        wave: &mut Wavefront<'s>,
        flights: &Flights,
        hits: &HitLanes,
        count: usize,
    ) {
        let all = (1 << count) - 1;
        let Wavefront { samples, records, waiting, shadows, others, next, .. } = wave;
        let mut places = Places {
            points: PointLanes::NONE,
            normals: Lanes3::ZERO,
            surfaces: PlainSurfaces::new(&self.plain_materials),
            plain: 0,
            receivers: Receivers::NONE,
        };
        self.find_places(flights, hits, all, others, &mut places);
        for lane in 0..count {
            if self.lights.is_light(hits.primitive[lane]) {
                let point = point_at(others, &places.points, hits, lane);
                self.gather_emission(flights, &point, lane, records);
            }
        }

        // Nothing scatters at the last hit, but light may shine through it.
        let ends = all & mask_of(|lane| self.ends_at_hit(flights, lane));
        let starts = mask_of(|lane| flights.depth[lane] == 0);
        let looked_at = if self.has_interfaces { all } else { all & !(ends & !starts) };
        for lane in lanes_of(all & !looked_at) {
            self.record_second_hit(flights, &places.points, lane, records);
        }
        if looked_at == 0 {
            return;
        }
        let mut addresses = Addresses::NONE;
        for lane in 0..count {
            let (packet, place) = place(flights.path[lane]);
            addresses.set(lane, samples[packet].at(place));
        }
        let numbers = self.dimensions.bounce::<S>(&addresses, &flights.depth);

        let mut stays = looked_at & places.plain;
        for lane in lanes_of(stays) {
            let material = self.material(hits.primitive[lane]);
            places.surfaces.set(lane, material, &self.scene.textures, || TexturePoint {
                uv: hits.at(lane).map_or(Vec2::ZERO, |hit| self.accel.uv_of_triangle(&hit)),
                position: places.points.position.at(lane),
            });
        }
        let mut lit = stays;
        for other in others.iter_mut().filter(|other| looked_at >> other.lane & 1 == 1) {
            let lane = other.lane;
            let wo = -flights.rays.direction.at(lane);
            let material = self.scene.primitives[hits.primitive[lane] as usize].material;
            other.bsdf = Bsdf::new(
                self.scene,
                material,
                &other.point,
                wo,
                numbers.mix_after(lane, flights.passes[lane], addresses.at(lane)),
            );
            let Some(bsdf) = &other.bsdf else {
                self.pass(flights, lane, &other.point, waiting);
                continue;
            };
            places.normals.set(lane, bsdf.shading_normal());
            places.receivers.transmits[lane] = u32::from(bsdf.transmits());
            stays |= 1 << lane;
            lit |= u32::from(!bsdf.is_specular()) << lane;
        }
        for lane in lanes_of(stays & starts) {
            self.record_first_hit(flights, hits, &places, others, lane, records);
        }
        for lane in lanes_of(stays & !starts) {
            self.record_second_hit(flights, &places.points, lane, records);
        }

        let scatters = stays & !ends;
        if scatters == 0 {
            return;
        }
        receive(&flights.rays, &places.points, &places.normals, &mut places.receivers);
        self.sample_lights(scatters & lit, flights, &places, others, &numbers, shadows, records);
        if self.follows {
            let alive = self.scatter(scatters, flights, &places, others, &numbers, next);
            waiting.push_packet(next, alive);
        }
    }

    /// The points at which paths arrived, and which of them are plain; the others are listed.
    fn find_places(
        &self,
        flights: &Flights,
        hits: &HitLanes,
        all: u32,
        others: &mut Vec<Other>,
        places: &mut Places,
    ) {
        for lane in lanes_of(all) {
            places.plain |= u32::from(self.is_plain[hits.primitive[lane] as usize]) << lane;
        }
        self.accel.plain_surfaces(&flights.rays, hits, places.plain, &mut places.points);
        others.clear();
        for lane in lanes_of(all & !places.plain) {
            let (ray, hit) = (flights.rays.at(lane), hits.at(lane).expect("the path arrived"));
            let point = if self.parametrised[self.material(hit.primitive) as usize] {
                self.accel.surface(&ray, &hit)
            } else {
                self.accel.plain_surface(&ray, &hit)
            };
            places.points.set(lane, &point);
            others.push(Other { lane, point, bsdf: None });
        }
        places.normals = places.points.shading_normal;
    }

    /// Draws directions to go on in; returns the lanes of the paths that do.
    fn scatter(
        &self,
        mask: u32,
        flights: &Flights,
        places: &Places,
        others: &[Other],
        numbers: &BounceNumbers,
        next: &mut Flights,
    ) -> u32 {
        let mut scattered = Scattered::NOTHING;
        let (surfaces, normals) = (&places.surfaces, &places.normals);
        surfaces.sample(mask & places.plain, &flights.rays, normals, &numbers.bsdf_uv, &mut scattered);
        for Other { lane, bsdf, .. } in others.iter().filter(|other| mask >> other.lane & 1 == 1) {
            let wo = -flights.rays.direction.at(*lane);
            let u = numbers.bsdf_uv_at(*lane);
            scattered.set(*lane, bsdf.as_ref().and_then(|bsdf| bsdf.sample(wo, numbers.lobe[*lane], u)));
        }
        scattered_on(mask, &self.rules, flights, places, &scattered, &numbers.roulette, next)
    }

    /// What the BSDFs of paths that are not plain say to light from `wi`.
    pub(super) fn eval_others(
        others: &[Other],
        mask: u32,
        flights: &Flights,
        wi: &Lanes3,
        into: &mut Evaluated,
    ) {
        for Other { lane, bsdf, .. } in others.iter().filter(|other| mask >> other.lane & 1 == 1) {
            let wo = -flights.rays.direction.at(*lane);
            let value = bsdf.as_ref().map(|bsdf| bsdf.eval_and_pdf(wo, wi.at(*lane)));
            into.set(*lane, value.unwrap_or((Vec3::ZERO, 0.0)));
        }
    }

    /// Whether the path may not scatter where it arrives.
    #[inline(always)]
    fn ends_at_hit(&self, flights: &Flights, lane: usize) -> bool {
        self.rules.ends_at_hit(flights.depth[lane], flights.flags[lane] & SCATTERED != 0)
    }

    /// Goes straight on through a boundary without effect.
    fn pass(&self, flights: &Flights, lane: usize, point: &SurfacePoint, waiting: &mut Waiting) {
        let mut next = *flights;
        next.passes[lane] += 1;
        if next.passes[lane] > MAX_PASSES {
            return;
        }
        let origin = point.offset_origin(flights.rays.direction.at(lane));
        next.rays.origin.set(lane, origin);
        // Light sampling sees through plain boundaries, but not through mixes with one.
        if !self.is_interface(point) {
            next.flags[lane] &= !LIGHT_SAMPLING;
        }
        waiting.push(&next, lane);
    }

    /// Light from a surface that is hit.
    fn gather_emission(&self, flights: &Flights, point: &SurfacePoint, lane: usize, records: &mut [Records]) {
        if let Some(emitted) = self.lights.emitted(point, -flights.rays.direction.at(lane)) {
            let share = share(flights, lane, |from| self.lights.pdf_surface(from, point));
            let (packet, place) = place(flights.path[lane]);
            add(&mut records[packet], place, flights, lane, emitted * share);
        }
    }

    fn record_first_hit(
        &self,
        flights: &Flights,
        hits: &HitLanes,
        places: &Places,
        others: &[Other],
        lane: usize,
        records: &mut [Records],
    ) {
        let (packet, place) = place(flights.path[lane]);
        let records = &mut records[packet];
        let wo = -flights.rays.direction.at(lane);
        let (position, normal) = (places.points.position.at(lane), places.normals.at(lane));
        records.hit[place] = 1.0;
        records.position1.set(place, position * self.inverse_diameter);
        records.position2.set(place, position * self.inverse_diameter);
        records.normal1.set(place, turned(normal, wo));
        if self.records_albedo {
            let other = others.iter().find(|other| other.lane == lane).and_then(|other| other.bsdf.as_ref());
            let albedo = match other {
                None => places.surfaces.albedo(lane, normal, wo),
                Some(bsdf) if bsdf.is_specular() => Vec3::ONE,
                Some(bsdf) => bsdf.albedo(),
            };
            let emits = || {
                let point = point_at(others, &places.points, hits, lane);
                self.lights.is_light(point.primitive) && self.lights.emitted(&point, wo).is_some()
            };
            let only_emits = albedo == Vec3::ZERO && emits();
            records.albedo.set(place, if only_emits { Vec3::ONE } else { albedo });
        }
    }

    /// Position and normal of the hit, if it is the path's second. The normal is the interpolated
    /// one: what bends it further is not looked up where a path ends.
    #[inline]
    fn record_second_hit(
        &self,
        flights: &Flights,
        points: &PointLanes,
        lane: usize,
        records: &mut [Records],
    ) {
        if flights.depth[lane] == 1 {
            let (packet, place) = place(flights.path[lane]);
            let records = &mut records[packet];
            records.position2.set(place, points.position.at(lane) * self.inverse_diameter);
            let normal = turned(points.shading_normal.at(lane), -flights.rays.direction.at(lane));
            records.normal2.set(place, normal);
        }
    }
}

/// The point at which a path arrived, as far as it is known.
fn point_at(others: &[Other], points: &PointLanes, hits: &HitLanes, lane: usize) -> SurfacePoint {
    let other = others.iter().find(|other| other.lane == lane);
    other.map_or_else(|| points.at(lane, hits.primitive[lane]), |other| other.point)
}

const _: () = assert!(LANES < u32::BITS as usize, "a mask has a bit for every lane");
