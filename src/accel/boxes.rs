//! Triangles' bounding boxes in the world: what imperfect visibility tests in place of triangles (Marques and
//! Santos 2010, §4.1), whole or split.

use super::{Error, Geometry, WorldTriangle};
use glam::{DVec3, Vec3};

/// Most boxes that splitting may add to the one of each triangle: 200 MB on the device.
pub const MAX_SPLIT_BOXES: u64 = 1 << 22;

/// How boxes are made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoxOptions {
    /// Longest edge of a box (m): triangles are halved until none is longer. Absent: one box for each triangle.
    pub split: Option<f32>,
    /// Whether each box comes with its triangle's plane.
    pub planes: bool,
    /// Whether panes have boxes, too.
    pub panes: bool,
}

/// A box, as `glsl/trace/boxes.glsl` reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Bounds {
    /// Lowest coordinates (m).
    pub low: Vec3,
    /// Highest coordinates (m).
    pub high: Vec3,
}

impl Bounds {
    /// The smallest box around a triangle.
    #[must_use]
    pub fn of(vertices: [Vec3; 3]) -> Self {
        let [a, b, c] = vertices;
        Self { low: a.min(b).min(c), high: a.max(b).max(c) }
    }

    /// Whether a point is inside or on the surface.
    #[must_use]
    pub fn holds(&self, point: Vec3) -> bool {
        self.low.cmple(point).all() && self.high.cmpge(point).all()
    }
}

/// The boxes of all world triangles that have area, instances flattened.
#[derive(Clone, Debug, Default)]
pub struct Boxes {
    /// In order of instance and primitive; the pieces of one triangle follow each other.
    pub bounds: Vec<Bounds>,
    /// The plane of each box's triangle: unit normal and the distance (m) along it from the origin. Empty where
    /// not asked for.
    pub planes: Vec<[f32; 4]>,
}

impl Boxes {
    /// Bounds all triangles, and splits those whose boxes are too large: halved on the longest axis again and
    /// again, the triangle clipped to the half before it is bounded anew.
    ///
    /// # Errors
    /// [`Error::TooFine`] where splitting adds more than [`MAX_SPLIT_BOXES`], [`Error::NoRoom`] if the host's memory can't
    /// hold them.
    pub fn of(geometry: &Geometry, options: &BoxOptions) -> Result<Self, Error> {
        let limit = geometry.world_triangle_count() + MAX_SPLIT_BOXES;
        // Twice while an array grows.
        let most = if options.split.is_some() { limit } else { geometry.world_triangle_count() };
        super::room("triangles' boxes", most, 2 * size_of::<(Bounds, [f32; 4])>() as u64)?;
        let mut boxes = Self::default();
        let blocks = |triangle: &WorldTriangle| {
            (options.panes || !triangle.blocks.pane) && super::has_area(triangle.vertices)
        };
        for triangle in geometry.world_triangles().filter(blocks) {
            match options.split {
                None => boxes.bounds.push(Bounds::of(triangle.vertices)),
                Some(longest) => split(triangle.vertices, longest, limit, &mut boxes.bounds)?,
            }
            if options.planes {
                boxes.planes.resize(boxes.bounds.len(), plane(triangle.vertices));
            }
        }
        Ok(boxes)
    }
}

fn plane(vertices: [Vec3; 3]) -> [f32; 4] {
    let [a, b, c] = vertices.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let distance = normal.as_dvec3().dot((a + b + c) / 3.0);
    normal.extend(distance as f32).to_array()
}

fn split(vertices: [Vec3; 3], longest: f32, limit: u64, pieces: &mut Vec<Bounds>) -> Result<(), Error> {
    let mut rest = vec![(Bounds::of(vertices), vertices.map(Vec3::as_dvec3).to_vec())];
    while let Some((bounds, polygon)) = rest.pop() {
        let axis = (bounds.high - bounds.low).max_position();
        let (low, high) = (bounds.low[axis], bounds.high[axis]);
        let middle = low * 0.5 + high * 0.5;
        // Neighbouring numbers have none between them.
        if high - low <= longest || middle <= low || middle >= high {
            pieces.push(bounds);
            if pieces.len() as u64 > limit {
                return Err(Error::TooFine { longest, limit });
            }
            continue;
        }
        let (mut below, mut above) = (bounds, bounds);
        below.high[axis] = middle;
        above.low[axis] = middle;
        for (half, sign) in [(above, 1.0), (below, -1.0)] {
            let part = clip(&polygon, axis, f64::from(middle), sign);
            rest.push((bound(&part, &half), part));
        }
    }
    Ok(())
}

/// The part of a convex polygon where `sign · (coordinate − middle) ≥ 0` (Sutherland and Hodgman 1974).
fn clip(polygon: &[DVec3], axis: usize, middle: f64, sign: f64) -> Vec<DVec3> {
    let height = |point: DVec3| sign * (point[axis] - middle);
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (&a, &b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
        let (from, to) = (height(a), height(b));
        if from >= 0.0 {
            part.push(a);
        }
        if (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0) {
            let mut crossing = a + (b - a) * (from / (from - to));
            crossing[axis] = middle;
            part.push(crossing);
        }
    }
    part
}

/// The box around a polygon, rounded outwards, as far as it lies in `within`.
fn bound(polygon: &[DVec3], within: &Bounds) -> Bounds {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &point in polygon {
        (low, high) = (low.min(point), high.max(point));
    }
    let down = |x: f64| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
    let up = |x: f64| if f64::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
    Bounds {
        low: Vec3::from(low.to_array().map(down)).max(within.low),
        high: Vec3::from(high.to_array().map(up)).min(within.high),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;
    use glam::vec3;

    fn pieces(vertices: [Vec3; 3], longest: f32) -> Vec<Bounds> {
        let mut pieces = Vec::new();
        split(vertices, longest, u64::MAX, &mut pieces).unwrap();
        pieces
    }

    #[test]
    fn unsplit_there_is_one_box_a_triangle_with_its_plane() {
        let geometry = Geometry::of(&builtin::sphere(2, Vec3::ONE)).unwrap();
        for split in [None, Some(10.0)] {
            let boxes = Boxes::of(&geometry, &BoxOptions { split, planes: true, panes: false }).unwrap();
            let expected: Vec<_> = geometry.world_triangles().map(|t| Bounds::of(t.vertices)).collect();
            assert_eq!(boxes.bounds, expected);
            for (triangle, &[x, y, z, distance]) in geometry.world_triangles().zip(&boxes.planes) {
                for vertex in triangle.vertices {
                    assert!((vec3(x, y, z).dot(vertex) - distance).abs() < 1e-6);
                }
            }
        }
        assert!(Boxes::of(&geometry, &BoxOptions::default()).unwrap().planes.is_empty());
    }

    /// Every point of a triangle is in one of its pieces; they are small, inside the whole, and flat where it is.
    #[test]
    fn pieces_cover_their_triangle() {
        let slanted = [vec3(0.1, -0.3, 0.2), vec3(1.3, 0.4, -0.5), vec3(-0.2, 0.9, 0.7)];
        let flat = slanted.map(|v| vec3(v.x, 0.3, v.z));
        let sliver = [vec3(0.0, 0.0, 0.0), vec3(1.0, 1.0, 1.0), vec3(0.5, 0.5, 0.5001)];
        for (triangle, most) in [(slanted, 600), (flat, 150), (sliver, 40)] {
            let pieces = pieces(triangle, 0.1);
            assert!(pieces.len() < most, "{} pieces: clipped to what the triangle fills", pieces.len());
            let whole = Bounds::of(triangle);
            for piece in &pieces {
                let (extent, thickness) = (piece.high - piece.low, whole.high - whole.low);
                assert!(extent.min_element() >= 0.0 && extent.max_element() <= 0.1);
                assert!(whole.holds(piece.low) && whole.holds(piece.high));
                assert!((0..3).all(|axis| thickness[axis] > 0.0 || extent[axis] == 0.0));
            }
            let [a, b, c] = triangle;
            for (i, j) in (0..=100_u16).flat_map(|i| (0..=100 - i).map(move |j| (i, j))) {
                let point = a + (b - a) * (f32::from(i) / 100.0) + (c - a) * (f32::from(j) / 100.0);
                // The point itself is rounded.
                let near = |piece: &Bounds| point.clamp(piece.low, piece.high).distance(point) < 1e-6;
                assert!(pieces.iter().any(near), "{point}");
            }
        }
    }

    #[test]
    fn numbers_without_any_between_are_not_halved() {
        let tiny = [Vec3::ONE, Vec3::ONE.with_x(1.0_f32.next_up()), Vec3::ONE.with_y(1.0_f32.next_up())];
        assert_eq!(pieces(tiny, 1e-30).len(), 1);
    }

    #[test]
    fn too_many_pieces_say_what_to_raise() {
        let geometry = Geometry::of(&builtin::sphere(0, Vec3::ONE)).unwrap();
        let error =
            Boxes::of(&geometry, &BoxOptions { split: Some(1e-6), ..BoxOptions::default() }).unwrap_err();
        assert!(matches!(error, Error::TooFine { .. }) && error.to_string().contains("box_split"), "{error}");
    }
}
