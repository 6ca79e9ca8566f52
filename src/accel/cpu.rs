//! Brute force: the oracle that the backends are tested against. Cost: one test a triangle and ray.
//!
//! Triangles in 64 bits: Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997). Boxes in 32,
//! operation for operation as `glsl/trace/box.glsl`.

use super::boxes::{Bounds, Boxes};
use super::{Geometry, WorldTriangle};
use glam::{DVec3, Vec3, Vec4};

/// A ray as kernels pass it to `trace_closest`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start (m).
    pub origin: Vec3,
    /// Direction, of any length; `t` counts in its length.
    pub direction: Vec3,
    /// Hits at or before it do not count.
    pub t_min: f32,
    /// Hits at or beyond it do not count; may be infinite.
    pub t_max: f32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f64,
    /// Instance, as in [`Geometry`].
    pub instance: u32,
    /// Primitive, as in [`Geometry`].
    pub primitive: u32,
    /// Weights of the triangle's second and third vertex.
    pub barycentrics: [f64; 2],
}

/// Where a ray meets the plane of a triangle, inside it or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The hit it would be.
    pub hit: Hit,
    /// Distance (m) in the plane to the nearest edge; negative outside.
    pub inside: f64,
    /// |cosine| between ray and the triangle's normal.
    pub cosine: f64,
}

/// The triangles of a scene in the world, exactly as the backends hold them. Alpha is ignored.
#[derive(Clone, Debug)]
pub struct BruteForce {
    triangles: Vec<WorldTriangle>,
}

impl BruteForce {
    /// Collects all world triangles.
    #[must_use]
    pub fn new(geometry: &Geometry) -> Self {
        Self { triangles: geometry.world_triangles().collect() }
    }

    /// The triangle with these ids.
    #[must_use]
    pub fn triangle(&self, instance: u32, primitive: u32) -> Option<&WorldTriangle> {
        let ids = |triangle: &WorldTriangle| (triangle.instance, triangle.primitive);
        let index = self.triangles.binary_search_by_key(&(instance, primitive), ids).ok()?;
        Some(&self.triangles[index])
    }

    /// The nearest hit; at equal distance that of the lowest instance and primitive.
    #[must_use]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.hits(ray).reduce(|best, hit| if hit.t < best.t { hit } else { best })
    }

    /// Whether anything is hit.
    #[must_use]
    pub fn any(&self, ray: &Ray) -> bool {
        self.hits(ray).next().is_some()
    }

    fn hits<'a>(&'a self, ray: &'a Ray) -> impl Iterator<Item = Hit> + 'a {
        let within = |t: f64| t > f64::from(ray.t_min) && t < f64::from(ray.t_max);
        self.crossings(ray).filter(move |c| c.inside >= 0.0 && within(c.hit.t)).map(|c| c.hit)
    }

    /// Every triangle whose plane the ray's line crosses, in order of instance and primitive. Triangles
    /// without area and triangles parallel to the ray are crossed nowhere.
    pub fn crossings<'a>(&'a self, ray: &'a Ray) -> impl Iterator<Item = Crossing> + 'a {
        self.triangles.iter().filter_map(|triangle| crossing(ray, triangle))
    }
}

/// The boxes of a scene, each tested against each ray.
#[derive(Clone, Debug)]
pub struct BoxBruteForce {
    boxes: Boxes,
    ray_epsilon: f32,
}

impl BoxBruteForce {
    /// Takes boxes, with planes for the visibility `boxes-plane`, and the scene's
    /// [`ray_epsilon`](Geometry::ray_epsilon).
    #[must_use]
    pub fn new(boxes: Boxes, ray_epsilon: f32) -> Self {
        Self { boxes, ray_epsilon }
    }

    /// Whether any box blocks the ray between its ends.
    #[must_use]
    pub fn any(&self, ray: &Ray) -> bool {
        let segment = Segment::new(ray);
        let planes = self.boxes.planes.iter().map(Some).chain(std::iter::repeat(None));
        self.boxes.bounds.iter().zip(planes).any(|(bounds, plane)| {
            segment.passage(bounds).is_some_and(|passage| {
                let flat = (bounds.high - bounds.low).min_element() <= 4.0 * self.ray_epsilon;
                plane.is_none_or(|&plane| flat || segment.crosses(passage, plane.into()))
            })
        })
    }
}

struct Segment {
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
    start: Vec3,
    end: Vec3,
}

impl Segment {
    fn new(ray: &Ray) -> Self {
        let tiny = ray.direction.abs().max_element() * (-60.0_f32).exp2();
        let tiny_like = |d: f32| if d < 0.0 { -tiny } else { tiny };
        let direction = ray.direction.map(|d| if d.abs() < tiny { tiny_like(d) } else { d });
        Self {
            origin: ray.origin,
            direction,
            inverse: 1.0 / direction,
            start: ray.origin + ray.t_min * direction,
            end: ray.origin + ray.t_max * direction,
        }
    }

    /// Where the line enters and leaves a box that blocks the segment.
    fn passage(&self, bounds: &Bounds) -> Option<[f32; 2]> {
        let a = (bounds.low - self.origin) * self.inverse;
        let b = (bounds.high - self.origin) * self.inverse;
        let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
        let (low, high) = (self.start.min(self.end), self.start.max(self.end));
        let beside = low.cmpgt(bounds.high).any() || high.cmplt(bounds.low).any();
        let ends = bounds.holds(self.start) || bounds.holds(self.end);
        (enter <= leave && !beside && !ends).then_some([enter, leave])
    }

    fn crosses(&self, passage: [f32; 2], plane: Vec4) -> bool {
        let [enters_below, leaves_below] = passage.map(|t| {
            let p = self.origin + t * self.direction;
            plane.x * p.x + plane.y * p.y + plane.z * p.z < plane.w
        });
        enters_below != leaves_below
    }
}

fn crossing(ray: &Ray, triangle: &WorldTriangle) -> Option<Crossing> {
    let [a, b, c] = triangle.vertices.map(Vec3::as_dvec3);
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 || !determinant.is_finite() {
        return None;
    }
    let s = origin - a;
    let q = s.cross(ab);
    let v = s.dot(p) / determinant;
    let w = direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    let doubled_area = ab.cross(ac).length();
    let height = |edge: DVec3| doubled_area / edge.length();
    let inside = ((1.0 - v - w) * height(c - b)).min(v * height(ac)).min(w * height(ab));
    let hit = Hit { t, instance: triangle.instance, primitive: triangle.primitive, barycentrics: [v, w] };
    Some(Crossing { hit, inside, cosine: determinant.abs() / (doubled_area * direction.length()) })
}
