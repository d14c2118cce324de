//! `curve` (hair, fur, grass) as triangles: tubes of [`SIDES`] sides, and strips for ribbons.
//!
//! pbrt's `flat` and `cylinder` curves face every ray; a tube of the same width has the same
//! silhouette. `flat` curves are shaded as round ones here. Each segment is cut into enough pieces
//! that its error is at most [`TOLERANCE`] of its width at the middle.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};

use super::mesh_description::MeshDescription;
use super::triangle_grid::{MAX_TRIANGLES, grid_triangles};
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};

/// Sides of a tube.
const SIDES: u32 = 6;
/// Widens a tube so that its mean width over all directions is the curve's. The mean width of a
/// convex outline is its perimeter over π; for an inscribed hexagon that is 6 radii over π instead
/// of 2 radii.
const WIDENING: f64 = PI / 3.0;
/// Largest error of a curve's position, as a fraction of its width.
const TOLERANCE: f64 = 0.05;
/// Largest number of pieces of a segment.
const MAX_PIECES: f64 = 64.0;

/// Largest number of segments of a curve.
const MAX_SEGMENTS: usize = 1 << 16;

/// The control points of a cubic Bézier segment.
type Bezier = [DVec3; 4];

/// The mesh of `curve`.
pub fn mesh(params: &ParameterDictionary) -> Result<MeshDescription> {
    let error = |message: String| ParseError::new(params.loc, message);
    let points =
        params.triples("P")?.ok_or_else(|| error("curve without points; expected \"point3 P\"".into()))?;
    let widths = widths(params)?;
    let degree = params.integer_in("degree", 3, 2..=3)? as usize;
    let segments = match params.string("basis")? {
        None | Some("bezier") if points.len() > degree && points.len() % degree == 1 => {
            points.windows(degree + 1).step_by(degree).map(bezier).collect::<Vec<_>>()
        }
        Some("bspline") if points.len() > degree => points.windows(degree + 1).map(bspline).collect(),
        None | Some("bezier" | "bspline") => {
            let expected = format!("{}, or more by a multiple that suits its basis", degree + 1);
            return Err(error(format!("curve with {} points; expected {expected}", points.len())));
        }
        Some(other) => {
            return Err(error(format!("unknown curve basis \"{other}\"; expected bezier or bspline")));
        }
    };
    if segments.len() > MAX_SEGMENTS {
        let found = segments.len();
        return Err(error(format!("curve with {found} segments; expected at most {MAX_SEGMENTS}")));
    }

    // Read the normals of a ribbon
    params.get("splitdepth");
    let normals = params.triples("N")?;
    let ribbon = match params.string("type")? {
        None | Some("flat" | "cylinder") => None,
        Some("ribbon") => match normals {
            Some(normals) if normals.len() == segments.len() + 1 => Some(normals),
            _ => {
                let count = segments.len() + 1;
                return Err(error(format!("ribbon without {count} normals; expected \"normal N\"")));
            }
        },
        Some(other) => {
            return Err(error(format!("unknown curve type \"{other}\"; expected flat, cylinder or ribbon")));
        }
    };

    // Sweep the outline along the curve
    let sections = sections(&segments, widths, ribbon.as_deref());
    let triangles = 2 * if ribbon.is_some() { 1 } else { SIDES as usize } * (sections.len() - 1);
    if triangles > MAX_TRIANGLES {
        return Err(error(format!("curve of {triangles} triangles; expected at most {MAX_TRIANGLES}")));
    }
    Ok(sweep(&sections, ribbon.is_some()))
}

/// Width at the start and at the end. One of them may be 0: a blade of grass ends in a point.
fn widths(params: &ParameterDictionary) -> Result<[f64; 2]> {
    let width = params.float_or("width", 1.0)?;
    let widths = [params.float_or("width0", width)?, params.float_or("width1", width)?];
    // Compare as `f32`, the precision of the scene
    if widths.iter().all(|&width| width >= 0.0) && widths.iter().any(|&width| width as f32 > 0.0) {
        return Ok(widths);
    }
    let expected = "numbers of at least 0, one of them above 0";
    Err(ParseError::new(
        params.loc,
        format!("curve with the widths {} and {}; expected {expected}", widths[0], widths[1]),
    ))
}

/// Whether the curve is of pbrt's default type, which faces every ray.
pub fn is_flat(params: &ParameterDictionary) -> Result<bool> {
    Ok(matches!(params.string("type")?, None | Some("flat")))
}

/// The cubic form of a quadratic or cubic Bézier segment.
fn bezier(points: &[DVec3]) -> Bezier {
    match *points {
        [a, b, c] => [a, a.lerp(b, 2.0 / 3.0), c.lerp(b, 2.0 / 3.0), c],
        _ => [points[0], points[1], points[2], points[3]],
    }
}

/// The Bézier form of a segment of a uniform B-spline.
fn bspline(points: &[DVec3]) -> Bezier {
    match *points {
        [a, b, c] => bezier(&[(a + b) / 2.0, b, (b + c) / 2.0]),
        _ => {
            let [a, b, c, d] = [points[0], points[1], points[2], points[3]];
            [(a + 4.0 * b + c) / 6.0, (2.0 * b + c) / 3.0, (b + 2.0 * c) / 3.0, (b + 4.0 * c + d) / 6.0]
        }
    }
}

/// A cross-section along the curve.
#[derive(Clone, Copy)]
struct CrossSection {
    at: DVec3,
    tangent: DVec3,
    /// Normal of a ribbon; unused for tubes.
    normal: DVec3,
    width: f64,
    /// Texture coordinate along the segment, in [0, 1].
    u: f64,
}

/// Cross-sections along a curve, close enough that the chords meet [`TOLERANCE`]. As in pbrt, u runs from 0
/// to 1 in every segment, so two segments meet in two cross-sections that differ in u alone.
fn sections(segments: &[Bezier], widths: [f64; 2], ribbon: Option<&[DVec3]>) -> Vec<CrossSection> {
    let mut sections: Vec<CrossSection> = Vec::new();
    let width_at = |u: f64| widths[0] + (widths[1] - widths[0]) * u;
    for (i, &[a, b, c, d]) in segments.iter().enumerate() {
        // The distance of a cubic from its chord is at most an eighth of its largest second derivative
        let bend = 6.0 * (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
        let middle = width_at((i as f64 + 0.5) / segments.len() as f64);
        let pieces = (bend / (8.0 * TOLERANCE * middle)).sqrt().ceil().clamp(1.0, MAX_PIECES) as u32;
        let first = match sections.last() {
            Some(&last) => {
                sections.push(CrossSection { u: 0.0, ..last });
                1
            }
            None => 0,
        };
        for k in first..=pieces {
            let t = f64::from(k) / f64::from(pieces);
            let s = 1.0 - t;
            let tangent = (b - a) * (s * s) + (c - b) * (2.0 * s * t) + (d - c) * (t * t);
            sections.push(CrossSection {
                at: a * s.powi(3) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * t.powi(3),
                tangent: tangent.try_normalize().unwrap_or((d - a).normalize_or(DVec3::Z)),
                normal: ribbon.map_or(DVec3::ZERO, |normals| normals[i].lerp(normals[i + 1], t)),
                width: width_at((i as f64 + t) / segments.len() as f64),
                u: t,
            });
        }
    }
    sections
}

/// The surface that sweeps through the cross-sections.
fn sweep(sections: &[CrossSection], ribbon: bool) -> MeshDescription {
    let mut mesh = MeshDescription::default();
    let columns = if ribbon { 1 } else { SIDES };
    let mut side = sections[0].tangent.any_orthonormal_vector();
    for section in sections {
        let CrossSection { at, tangent, normal, width, u } = *section;
        // Transport the frame along the curve without twist. Where two segments meet, it stays the same, so that
        // the triangles between have no area and are dropped with others of that kind
        if u > 0.0 {
            side = (side - tangent * side.dot(tangent)).normalize_or(tangent.any_orthonormal_vector());
        }
        for column in 0..=columns {
            let v = f64::from(column) / f64::from(columns);
            let (offset, facing) = if ribbon {
                let across = tangent.cross(normal).normalize_or(side);
                (across * (width * (v - 0.5)), across.cross(tangent))
            } else {
                let out = DMat3::from_axis_angle(tangent, TAU * v) * side;
                (out * (WIDENING * width / 2.0), out)
            };
            mesh.positions.push(at + offset);
            mesh.normals.push(facing);
            mesh.uvs.push(DVec2::new(u, v));
        }
    }
    mesh.indices = grid_triangles(sections.len() as u32 - 1, columns);
    mesh
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::{SIDES, WIDENING};
    use crate::scene::pbrt::read_str;
    use crate::scene::{Shape, TriangleMesh};

    fn curve(parameters: &str) -> Result<TriangleMesh, String> {
        let text = format!("WorldBegin Shape \"curve\" {parameters}");
        let scene = read_str(&text, Path::new("")).map_err(|error| error.to_string())?;
        match &scene.primitives[0].shape {
            Shape::Mesh(mesh) => Ok((**mesh).clone()),
            other => panic!("{other:?}"),
        }
    }

    const STRAIGHT: &str = "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]";

    #[test]
    fn a_straight_curve_is_a_tube_of_its_widths() {
        let mesh = curve(&format!("{STRAIGHT} \"float width0\" .2 \"float width1\" .1")).unwrap();
        assert_eq!(mesh.indices.len(), 12);
        for p in &mesh.positions {
            let radius = p.y.hypot(p.z);
            let expected = WIDENING as f32 * if p.x < 1.0 { 0.1 } else { 0.05 };
            assert!((radius - expected).abs() < 1e-6, "{p}");
        }
        assert!(mesh.positions.iter().zip(&mesh.normals).all(|(p, n)| p.with_x(0.0).dot(*n) > 0.0));
    }

    #[test]
    fn one_end_of_a_curve_may_have_width_zero() {
        let bent = "\"point3 P\" [0 0 0 0 1 0 1 2 0 3 2 0]";
        for widths in ["\"float width1\" 0", "\"float width0\" 0", "\"float width\" 0 \"float width1\" 1"] {
            let mesh = curve(&format!("{bent} {widths}")).unwrap();
            let ring = if widths.contains("width1\" 0") { mesh.positions.len() - 7 } else { 0 };
            let end = &mesh.positions[ring..ring + 7];
            assert!(end.iter().all(|p| *p == end[0]), "{widths}: {end:?}");
            // Twelve triangles between two hexagons, six at the tip
            assert_eq!(mesh.indices.len() % 12, 6, "{widths}");
            assert!(mesh.positions.len() < 7 * 10, "{}", mesh.positions.len());
        }
        for widths in ["\"float width\" 0", "\"float width1\" -1"] {
            assert!(
                curve(&format!("{bent} {widths}")).unwrap_err().contains("curve with the widths"),
                "{widths}"
            );
        }
    }

    #[test]
    fn the_mean_width_of_a_tube_is_the_curves_width() {
        let mesh = curve(&format!("{STRAIGHT} \"float width\" .2")).unwrap();
        let ring = &mesh.positions[..SIDES as usize];
        let width = |angle: f32| {
            let along = |p: &Vec3| p.y * angle.cos() + p.z * angle.sin();
            let all = ring.iter().map(along);
            all.clone().fold(f32::MIN, f32::max) - all.fold(f32::MAX, f32::min)
        };
        let mean = (0..1000).map(|i| width(i as f32 * 0.002 * std::f32::consts::PI)).sum::<f32>() / 1000.0;
        assert!((mean - 0.2).abs() < 1e-4, "{mean}");
    }

    #[test]
    fn a_bent_curve_meets_its_tolerance() {
        let mesh = curve("\"point3 P\" [0 0 0 0 1 0 1 2 0 3 2 0] \"float width\" .02").unwrap();
        // Compare the midpoints of pieces with the Bézier curve
        let b = |t: f32| {
            let s = 1.0 - t;
            Vec3::new(
                3.0 * s * t * t + 3.0 * t.powi(3),
                3.0 * s * s * t + 6.0 * s * t * t + 2.0 * t.powi(3),
                0.0,
            )
        };
        let rings: Vec<Vec3> =
            mesh.positions.chunks(7).map(|ring| ring[..6].iter().sum::<Vec3>() / 6.0).collect();
        for pair in rings.windows(2) {
            let middle = (pair[0] + pair[1]) / 2.0;
            let distance =
                (0..=20_000).map(|i| b(i as f32 / 20_000.0).distance(middle)).fold(f32::MAX, f32::min);
            assert!(distance < 0.0011, "{distance}");
        }
    }

    #[test]
    fn splines_and_quadratic_curves_have_the_right_ends() {
        let spline =
            curve("\"string basis\" \"bspline\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0]").unwrap();
        let ends = |mesh: &TriangleMesh| {
            let x = mesh.positions.iter().map(|p| p.x);
            (x.clone().fold(f32::MAX, f32::min), x.fold(f32::MIN, f32::max))
        };
        assert_eq!(ends(&spline), (1.0, 3.0));
        let quadratic = curve("\"integer degree\" 2 \"point3 P\" [0 0 0 1 0 0 2 0 0]").unwrap();
        assert_eq!(ends(&quadratic), (0.0, 2.0));
    }

    #[test]
    fn u_runs_over_each_segment_and_the_width_over_the_whole_curve() {
        let mesh = curve(
            "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6 0 0] \"float width0\" .2 \"float width1\" .1",
        )
        .unwrap();
        assert_eq!(mesh.indices.len(), 2 * 12);
        let rings: Vec<&[Vec3]> = mesh.positions.chunks(7).collect();
        assert_eq!(rings[1], rings[2], "no gap between the segments");
        let at = |ring: usize| (mesh.positions[7 * ring].x, mesh.uvs[7 * ring].x);
        assert_eq!([0, 1, 2, 3].map(at), [(0.0, 0.0), (3.0, 1.0), (3.0, 0.0), (6.0, 1.0)]);
        let radius = mesh.positions[7].with_x(0.0).length();
        assert!((radius - WIDENING as f32 * 0.075).abs() < 1e-6, "{radius}");
    }

    #[test]
    fn flat_curves_are_warned_about() {
        let warnings = |kind: &str| {
            let text = format!("WorldBegin Shape \"curve\" {STRAIGHT} {kind}");
            crate::scene::pbrt::read_str(&text, std::path::Path::new("")).unwrap().warnings.len()
        };
        assert_eq!(["", "\"string type\" \"flat\"", "\"string type\" \"cylinder\""].map(warnings), [1, 1, 0]);
    }

    #[test]
    fn a_ribbon_faces_its_normals() {
        let mesh =
            curve(&format!("{STRAIGHT} \"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1]")).unwrap();
        assert_eq!(mesh.indices.len(), 2);
        assert!(mesh.normals.iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
    }

    #[test]
    fn invalid_curves_are_errors() {
        for parameters in [
            "",
            "\"point3 P\" [0 0 0 1 0 0]",
            "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0]",
            "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"string type\" \"ribbon\"",
            "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"string basis\" \"hermite\"",
        ] {
            assert!(curve(parameters).is_err(), "{parameters}");
        }
    }
}
