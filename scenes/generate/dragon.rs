//! A wingless dragon, coiled with its head raised, as an implicit surface: scales, belly plates and
//! spines follow the curve of its body. Facing -z, about 1.35 high, standing on y = 0.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::implicit::polygonise;
use crate::mesh::Mesh;
use crate::sdf::{cone, ellipsoid, smooth_difference, smooth_union, smoothstep, sphere};

/// Scales around the body.
const SCALES_AROUND: f64 = 16.0;
/// Height of scales and of belly plates, in radii of the body.
const SCALE_HEIGHT: f64 = 0.085;
/// Points of the body's curve for each span between control points.
const STEPS: usize = 12;

/// Along the spine from tail to head: position, radius, direction of the back.
const SPINE: [([f64; 3], f64, [f64; 3]); 17] = [
    ([0.86, 0.10, -0.30], 0.012, [-0.3, 1.0, 0.0]),
    ([0.74, 0.045, -0.16], 0.026, [0.0, 1.0, 0.0]),
    ([0.62, 0.055, 0.08], 0.048, [0.2, 1.0, 0.0]),
    ([0.44, 0.075, 0.33], 0.07, [0.2, 1.0, 0.2]),
    ([0.12, 0.095, 0.48], 0.09, [0.0, 1.0, 0.3]),
    ([-0.28, 0.108, 0.40], 0.105, [-0.2, 1.0, 0.2]),
    ([-0.50, 0.118, 0.03], 0.118, [-0.3, 1.0, 0.0]),
    ([-0.31, 0.128, -0.35], 0.127, [-0.2, 1.0, -0.2]),
    ([0.09, 0.135, -0.44], 0.132, [0.0, 1.0, -0.3]),
    ([0.40, 0.16, -0.18], 0.133, [0.3, 1.0, 0.0]),
    ([0.36, 0.25, 0.16], 0.13, [0.3, 1.0, 0.1]),
    ([0.08, 0.37, 0.29], 0.125, [0.3, 0.7, 0.7]),
    ([-0.13, 0.56, 0.17], 0.115, [-0.2, 0.2, 1.0]),
    ([-0.09, 0.78, 0.03], 0.104, [0.0, 0.3, 1.0]),
    ([0.02, 0.97, 0.05], 0.092, [0.0, 0.0, 1.0]),
    ([0.05, 1.13, 0.04], 0.082, [0.0, 0.6, 0.8]),
    ([0.03, 1.19, -0.08], 0.07, [0.0, 1.0, 0.2]),
];

/// The statue, meshed with cells of a given size.
pub fn mesh(cell: f64) -> Mesh {
    let dragon = Dragon::new();
    polygonise(|p| dragon.field(p), DVec3::new(-0.72, -0.04, -0.72), DVec3::new(1.0, 1.5, 0.72), cell)
}

/// A point of the spine with its frame.
struct Vertebra {
    position: DVec3,
    radius: f64,
    back: DVec3,
    tangent: DVec3,
    /// Length from the tail, measured in local radii, so that scales keep their shape.
    along: f64,
}

struct Dragon {
    spine: Vec<Vertebra>,
    /// Ends and end radii of the cones along the back.
    spines: Vec<(DVec3, DVec3, f64)>,
    head: DVec3,
    /// Columns: right, up, forward.
    head_frame: DMat3,
}

impl Dragon {
    fn new() -> Self {
        let spine = spine();
        let last = spine.last().expect("the spine has points");
        let head = last.position + DVec3::new(0.0, 0.01, -0.04);
        let forward = DVec3::new(-0.18, -0.16, -1.0).normalize();
        let right = DVec3::Y.cross(forward).normalize();
        let head_frame = DMat3::from_cols(right, forward.cross(right), forward);
        let spines = spines(&spine);
        Self { spine, spines, head, head_frame }
    }

    fn field(&self, p: DVec3) -> f64 {
        let (body, skin) = self.body(p);
        let spines =
            self.spines.iter().fold(f64::INFINITY, |d, &(a, b, r)| d.min(cone(p, a, b, r, 0.25 * r)));
        let body = smooth_union(body - skin, spines, 0.014);
        let local = self.head_frame.transpose() * (p - self.head);
        smooth_union(body, head(local), 0.03)
    }

    /// Distance to the smooth body, and the height of the skin over it.
    fn body(&self, p: DVec3) -> (f64, f64) {
        // The nearest piece of the curve, with its share.
        let mut nearest = (f64::INFINITY, 0, 0.0);
        for (i, pair) in self.spine.windows(2).enumerate() {
            let (a, axis) = (pair[0].position, pair[1].position - pair[0].position);
            let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
            let radius = pair[0].radius + (pair[1].radius - pair[0].radius) * t;
            let distance = p.distance(a + axis * t) - radius;
            if distance < nearest.0 {
                nearest = (distance, i, t);
            }
        }
        let (distance, i, t) = nearest;
        if distance.abs() > 0.05 {
            return (distance, 0.0);
        }
        let (a, b) = (&self.spine[i], &self.spine[i + 1]);
        let radius = a.radius + (b.radius - a.radius) * t;
        let back = a.back.lerp(b.back, t);
        let side = a.tangent.lerp(b.tangent, t).cross(back);
        let radial = p - a.position.lerp(b.position, t);
        let angle = radial.dot(side).atan2(radial.dot(back));
        let along = a.along + (b.along - a.along) * t;
        (distance, radius * skin(along, angle))
    }
}

/// The curve through the control points (Catmull-Rom), with frames.
fn spine() -> Vec<Vertebra> {
    let control = |i: usize| {
        let (position, radius, back) = SPINE[i.min(SPINE.len() - 1)];
        (DVec3::from(position), radius, DVec3::from(back))
    };
    let mut spine: Vec<Vertebra> = Vec::new();
    for span in 0..SPINE.len() - 1 {
        let [a, b, c, d] =
            [control(span.saturating_sub(1)), control(span), control(span + 1), control(span + 2)];
        for step in 0..STEPS {
            let t = step as f64 / STEPS as f64;
            let weights = [
                -0.5 * t + t * t - 0.5 * t * t * t,
                1.0 - 2.5 * t * t + 1.5 * t * t * t,
                0.5 * t + 2.0 * t * t - 1.5 * t * t * t,
                -0.5 * t * t + 0.5 * t * t * t,
            ];
            let position = a.0 * weights[0] + b.0 * weights[1] + c.0 * weights[2] + d.0 * weights[3];
            let radius = b.1 + (c.1 - b.1) * t;
            let along = spine.last().map_or(0.0, |v| v.along + v.position.distance(position) / radius);
            spine.push(Vertebra { position, radius, back: b.2.lerp(c.2, t), tangent: DVec3::ZERO, along });
        }
    }
    for i in 0..spine.len() {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(spine.len() - 1));
        let tangent = (spine[after].position - spine[before].position).normalize();
        let back = spine[i].back;
        spine[i].tangent = tangent;
        spine[i].back = (back - tangent * back.dot(tangent)).normalize();
    }
    spine
}

/// Cones along the back, leaning towards the tail.
fn spines(spine: &[Vertebra]) -> Vec<(DVec3, DVec3, f64)> {
    const SPACING: f64 = 0.62;
    let mut spines = Vec::new();
    let mut next = 2.0;
    for v in spine {
        if v.along < next {
            continue;
        }
        next += SPACING;
        let base = v.position + v.back * (0.85 * v.radius);
        let tip = v.position + v.back * (1.62 * v.radius) - v.tangent * (0.55 * v.radius);
        spines.push((base, tip, 0.19 * v.radius + 0.002));
    }
    spines
}

/// Height of the skin in radii: staggered scales on back and flanks, plates on the belly.
fn skin(along: f64, angle: f64) -> f64 {
    let size = TAU / SCALES_AROUND;
    let dome = |shift: f64| {
        let a = (along / (1.25 * size) + shift).rem_euclid(1.0) - 0.5;
        let b = (angle / size + shift).rem_euclid(1.0) - 0.5;
        // Higher towards the tail, as if each scale overlapped the next.
        (1.0 - 2.6 * (a * a + b * b)).max(0.0) * (1.0 - 0.5 * a)
    };
    let scales = dome(0.0).max(dome(0.5));
    let plate = {
        let a = (along / (1.1 * size)).rem_euclid(1.0);
        0.25 + 0.75 * smoothstep(0.0, 0.2, a) * (1.0 - 0.6 * a)
    };
    let belly = smoothstep(0.70 * PI, 0.74 * PI, angle.abs());
    SCALE_HEIGHT * (scales + (plate - scales) * belly)
}

/// The head around the end of the neck: x to the right, y up, z forward.
fn head(q: DVec3) -> f64 {
    // Far away a ball stands in for the details.
    let near = sphere(q, DVec3::new(0.0, 0.0, 0.02), 0.36);
    if near > 0.15 {
        return near;
    }
    let v = DVec3::new;
    let m = v(q.x.abs(), q.y, q.z);
    let skull = ellipsoid(q, v(0.0, 0.015, 0.01), v(0.088, 0.078, 0.115));
    let snout = ellipsoid(q, v(0.0, 0.0, 0.15), v(0.062, 0.045, 0.13));
    let nose = sphere(m, v(0.024, 0.022, 0.245), 0.026);
    let bridge = cone(q, v(0.0, 0.045, 0.07), v(0.0, 0.03, 0.22), 0.02, 0.012);
    let cheek = sphere(m, v(0.062, -0.03, 0.035), 0.045);
    let mut face = smooth_union(smooth_union(skull, snout, 0.05), smooth_union(nose, bridge, 0.02), 0.025);
    face = smooth_union(face, cheek, 0.03);
    let nostril = sphere(m, v(0.03, 0.028, 0.268), 0.009);
    face = smooth_difference(face, nostril, 0.006);

    let jaw = cone(m, v(0.045, -0.05, 0.02), v(0.016, -0.105, 0.2), 0.03, 0.02).min(ellipsoid(
        q,
        v(0.0, -0.085, 0.13),
        v(0.035, 0.018, 0.09),
    ));
    face = smooth_union(face, jaw, 0.018);
    let tongue = cone(q, v(0.0, -0.06, 0.08), v(0.0, -0.068, 0.2), 0.018, 0.012);
    face = smooth_union(face, tongue, 0.008);
    let teeth = (0..5).fold(f64::INFINITY, |d, i| {
        let z = 0.12 + 0.027 * f64::from(i);
        let length = if i == 4 { 0.042 } else { 0.024 };
        let x = 0.05 - 0.005 * f64::from(i);
        d.min(cone(m, v(x, -0.022, z), v(x - 0.004, -0.026 - length, z + 0.006), 0.009, 0.003))
    });
    face = smooth_union(face, teeth, 0.004);

    let brow = cone(m, v(0.035, 0.058, 0.12), v(0.078, 0.075, 0.0), 0.016, 0.02);
    let eye = sphere(m, v(0.06, 0.035, 0.075), 0.021);
    face = smooth_union(smooth_union(face, brow, 0.02), eye, 0.004);

    let horn = cone(m, v(0.052, 0.07, -0.04), v(0.085, 0.15, -0.14), 0.027, 0.02)
        .min(cone(m, v(0.085, 0.15, -0.14), v(0.10, 0.17, -0.24), 0.02, 0.012))
        .min(cone(m, v(0.10, 0.17, -0.24), v(0.092, 0.215, -0.32), 0.012, 0.005));
    let rings = 0.0025 * (q.z * 190.0).sin();
    face = smooth_union(face, horn - rings, 0.016);

    // Frills behind the jaw: rays joined by skin.
    let tips = [v(0.17, 0.085, -0.09), v(0.2, 0.02, -0.10), v(0.19, -0.05, -0.09), v(0.15, -0.11, -0.06)];
    let root = v(0.07, -0.015, -0.015);
    let rays = tips.iter().fold(f64::INFINITY, |d, &tip| d.min(cone(m, root, tip, 0.016, 0.006)));
    let frill = smooth_union(rays, ellipsoid(m, v(0.125, -0.015, -0.055), v(0.05, 0.075, 0.011)), 0.02);
    face = smooth_union(face, frill, 0.014);

    let beard = cone(m, v(0.012, -0.115, 0.19), v(0.015, -0.19, 0.165), 0.014, 0.005).min(cone(
        m,
        v(0.03, -0.095, 0.11),
        v(0.04, -0.165, 0.07),
        0.014,
        0.005,
    ));
    face = smooth_union(face, beard, 0.01);
    let whisker = cone(m, v(0.04, 0.015, 0.25), v(0.1, 0.035, 0.27), 0.01, 0.008).min(cone(
        m,
        v(0.1, 0.035, 0.27),
        v(0.15, -0.005, 0.25),
        0.008,
        0.006,
    ));
    smooth_union(face, whisker, 0.008)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_dragon_is_whole() {
        assert!(crate::implicit::tests::is_closed(&super::mesh(0.03)));
    }
}
