//! Modelling: triangles with normals, made by boxes, lathes, tubes and sheets. Metres, Y up, fronts
//! counter-clockwise.

use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Position and shading normal.
type Corner = (DVec3, DVec3);

/// Triangles.
#[derive(Clone, Default)]
pub(crate) struct Shape(Vec<[Corner; 3]>);

fn key(p: DVec3) -> [i64; 3] {
    (p * 65536.0).round().as_i64vec3().to_array()
}

fn scaled_normal(t: &[Corner; 3]) -> DVec3 {
    (t[1].0 - t[0].0).cross(t[2].0 - t[0].0)
}

impl Shape {
    pub(crate) fn triangles(&self) -> &[[Corner; 3]] {
        &self.0
    }

    /// Every shading normal is its triangle's own.
    pub(crate) fn is_flat(&self) -> bool {
        self.0.iter().all(|t| {
            let normal = scaled_normal(t).normalize_or_zero();
            t.iter().all(|corner| corner.1.dot(normal) > 1.0 - 1e-6)
        })
    }

    pub(crate) fn append(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// This and `other`.
    pub(crate) fn and(mut self, other: Self) -> Self {
        self.append(other);
        self
    }

    pub(crate) fn transform(mut self, transform: DAffine3) -> Self {
        let normals = transform.matrix3.inverse().transpose();
        for corner in self.0.iter_mut().flatten() {
            *corner = (transform.transform_point3(corner.0), (normals * corner.1).normalize_or_zero());
        }
        self
    }

    pub(crate) fn at(self, x: f64, y: f64, z: f64) -> Self {
        self.transform(DAffine3::from_translation(dvec3(x, y, z)))
    }

    /// Turned about X, Y or Z through the origin.
    pub(crate) fn turn_x(self, degrees: f64) -> Self {
        self.transform(DAffine3::from_rotation_x(degrees.to_radians()))
    }

    pub(crate) fn turn_y(self, degrees: f64) -> Self {
        self.transform(DAffine3::from_rotation_y(degrees.to_radians()))
    }

    pub(crate) fn turn_z(self, degrees: f64) -> Self {
        self.transform(DAffine3::from_rotation_z(degrees.to_radians()))
    }

    /// Bent by `f`, which keeps orientation; normals are found anew, smooth below 50°.
    pub(crate) fn warp(mut self, f: impl Fn(DVec3) -> DVec3) -> Self {
        for corner in self.0.iter_mut().flatten() {
            corner.0 = f(corner.0);
        }
        self.smooth(50.0)
    }

    /// Area-weighted normals across edges that bend by less than `degrees`.
    pub(crate) fn smooth(mut self, degrees: f64) -> Self {
        let limit = degrees.to_radians().cos();
        let faces: Vec<DVec3> = self.0.iter().map(scaled_normal).collect();
        let mut around: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (index, triangle) in self.0.iter().enumerate() {
            for corner in triangle {
                around.entry(key(corner.0)).or_default().push(index);
            }
        }
        for (index, triangle) in self.0.iter_mut().enumerate() {
            let own = faces[index].normalize_or_zero();
            for corner in triangle {
                let near = around[&key(corner.0)].iter().map(|&i| faces[i]);
                let sum: DVec3 = near.filter(|n| n.normalize_or_zero().dot(own) > limit).sum();
                corner.1 = sum.normalize_or(own);
            }
        }
        self
    }

    /// A flat convex polygon, counter-clockwise seen from its front.
    pub(crate) fn polygon(points: &[DVec3]) -> Self {
        let mut shape = Self::default();
        for pair in points[1..].windows(2) {
            let normal = (pair[0] - points[0]).cross(pair[1] - points[0]).normalize_or_zero();
            shape.0.push([points[0], pair[0], pair[1]].map(|p| (p, normal)));
        }
        shape
    }

    pub(crate) fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Self {
        Self::polygon(&[a, b, c, d])
    }

    /// Keeps the given normals and turns the winding so that the front looks along `outward`.
    fn push_facing(&mut self, corners: &[Corner], outward: DVec3) {
        for pair in corners[1..].windows(2) {
            let mut triangle = [corners[0], pair[0], pair[1]];
            if scaled_normal(&triangle).dot(outward) < 0.0 {
                triangle.swap(1, 2);
            }
            self.0.push(triangle);
        }
    }

    /// A box with sharp edges between two corners.
    pub(crate) fn cuboid(min: [f64; 3], max: [f64; 3]) -> Self {
        let (min, max) = (DVec3::from(min), DVec3::from(max));
        let mut shape = Self::default();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut normal = DVec3::ZERO;
                normal[axis] = side;
                let ring = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
                    let mut p = if side < 0.0 { min } else { max };
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    p[u] = if i == 0 { min[u] } else { max[u] };
                    p[v] = if j == 0 { min[v] } else { max[v] };
                    (p, normal)
                });
                shape.push_facing(&ring, normal);
            }
        }
        shape
    }

    /// A box between two corners whose edges are cut by `bevel`; the cuts shade as if round.
    pub(crate) fn block(min: [f64; 3], max: [f64; 3], bevel: f64) -> Self {
        let (min, max) = (DVec3::from(min), DVec3::from(max));
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        let corner = |axis: usize, signs: DVec3| {
            let mut inset = DVec3::splat(bevel);
            inset[axis] = 0.0;
            let mut normal = DVec3::ZERO;
            normal[axis] = signs[axis];
            (center + signs * (half - inset), normal)
        };
        let signs = |axis: usize, own: f64, a: f64, b: f64| {
            let mut s = DVec3::ZERO;
            (s[axis], s[(axis + 1) % 3], s[(axis + 2) % 3]) = (own, a, b);
            s
        };
        let mut shape = Self::default();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for own in [-1.0, 1.0] {
                let ring = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let ring = ring.map(|(a, b)| corner(axis, signs(axis, own, a, b)));
                shape.push_facing(&ring, ring[0].1);
            }
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let (low, high) = (signs(axis, -1.0, a, b), signs(axis, 1.0, a, b));
                let ring = [corner(u, low), corner(u, high), corner(v, high), corner(v, low)];
                shape.push_facing(&ring, signs(axis, 0.0, a, b));
            }
        }
        for index in 0..8 {
            let s = DVec3::from([0, 1, 2].map(|bit| if index >> bit & 1 == 0 { -1.0 } else { 1.0 }));
            shape.push_facing(&[0, 1, 2].map(|axis| corner(axis, s)), s);
        }
        shape
    }

    /// A sheet f(u, v) over [0, 1]², its front along ∂f/∂u × ∂f/∂v, shaded smooth below `crease` degrees.
    pub(crate) fn sheet(nu: usize, nv: usize, crease: f64, f: impl Fn(f64, f64) -> DVec3) -> Self {
        let at = |i: usize, j: usize| f(i as f64 / nu as f64, j as f64 / nv as f64);
        let mut shape = Self::default();
        for j in 0..nv {
            for i in 0..nu {
                let ring = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                for triangle in [[ring[0], ring[1], ring[2]], [ring[0], ring[2], ring[3]]] {
                    let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
                    if normal.length() > 1e-10 {
                        shape.0.push(triangle.map(|p| (p, normal.normalize())));
                    }
                }
            }
        }
        shape.smooth(crease)
    }

    /// Turns a profile of (radius, height) about Y; its front is on the right of the profile's direction
    /// of travel, so a solid's profile runs from the bottom centre up its outside.
    pub(crate) fn lathe(profile: &[(f64, f64)], segments: usize) -> Self {
        let rows = profile.len() - 1;
        Self::sheet(segments, rows, 40.0, |u, v| {
            let (radius, height) = profile[(v * rows as f64).round() as usize];
            let turn = (u * segments as f64).round() as usize % segments;
            let (sin, cos) = (turn as f64 / segments as f64 * TAU).sin_cos();
            dvec3(radius * cos, height, -radius * sin)
        })
    }

    /// A closed cylinder standing on `base`, its rims cut by a tenth of its radius.
    pub(crate) fn cylinder(base: [f64; 3], radius: f64, height: f64, segments: usize) -> Self {
        let cut = (0.1 * radius).min(0.2 * height);
        let profile = [
            (0.0, 0.0),
            (radius - cut, 0.0),
            (radius, cut),
            (radius, height - cut),
            (radius - cut, height),
            (0.0, height),
        ];
        Self::lathe(&profile, segments).at(base[0], base[1], base[2])
    }

    /// A round bar along `path`, closed by flat ends.
    pub(crate) fn tube(path: &[DVec3], radius: f64, sides: usize) -> Self {
        let section: Vec<_> = (0..sides)
            .map(|i| {
                let (sin, cos) = (i as f64 / sides as f64 * TAU).sin_cos();
                radius * dvec2(cos, sin)
            })
            .collect();
        Self::sweep(path, &section)
    }

    /// A bar of a convex counter-clockwise section along `path`, closed by flat ends.
    pub(crate) fn sweep(path: &[DVec3], section: &[DVec2]) -> Self {
        let last = path.len() - 1;
        let tangent = |i: usize| (path[(i + 1).min(last)] - path[i.saturating_sub(1)]).normalize();
        let mut normal = tangent(0).any_orthonormal_vector();
        if tangent(0).cross(DVec3::Y).length() > 0.1 {
            normal = tangent(0).cross(DVec3::Y).normalize();
        }
        let rings: Vec<Vec<DVec3>> = (0..=last)
            .map(|i| {
                normal = normal.reject_from(tangent(i)).normalize();
                let binormal = tangent(i).cross(normal);
                section.iter().map(|s| path[i] + normal * s.x + binormal * s.y).collect()
            })
            .collect();
        let sides = section.len();
        let body = Self::sheet(sides, last, 50.0, |u, v| {
            let side = (u * sides as f64).round() as usize % sides;
            rings[(v * last as f64).round() as usize][side]
        });
        let start: Vec<_> = rings[0].iter().rev().copied().collect();
        body.and(Self::polygon(&start)).and(Self::polygon(&rings[last]))
    }

    /// A body over a convex outline in (x, −z), counter-clockwise seen from above: `rings` of (inset,
    /// height) from the bottom up, closed by flat faces.
    pub(crate) fn prism(outline: &[DVec2], rings: &[(f64, f64)]) -> Self {
        let count = outline.len();
        let ring = |(inset, height): (f64, f64)| -> Vec<DVec3> {
            (0..count)
                .map(|i| {
                    let along = (outline[(i + 1) % count] - outline[(i + count - 1) % count]).normalize();
                    let p = outline[i] - inset * dvec2(along.y, -along.x);
                    dvec3(p.x, height, -p.y)
                })
                .collect()
        };
        let levels: Vec<_> = rings.iter().map(|&level| ring(level)).collect();
        let rows = levels.len() - 1;
        let side = Self::sheet(count, rows, 50.0, |u, v| {
            levels[(v * rows as f64).round() as usize][(u * count as f64).round() as usize % count]
        });
        let bottom: Vec<_> = levels[0].iter().rev().copied().collect();
        side.and(Self::polygon(&bottom)).and(Self::polygon(&levels[rows]))
    }

    /// A padded body inside ±`half`: the ball of the L^`power` norm, 2 an ellipsoid, more squarer. `cells`
    /// counts divisions along each axis.
    pub(crate) fn cushion(half: [f64; 3], power: f64, cells: [usize; 3]) -> Self {
        let half = DVec3::from(half);
        let mut shape = Self::default();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [-1.0, 1.0] {
                shape.append(Self::sheet(cells[u], cells[v], 0.0, |a, b| {
                    let mut p = DVec3::ZERO;
                    p[axis] = side;
                    p[u] = side * (2.0 * a - 1.0);
                    p[v] = 2.0 * b - 1.0;
                    let norm: f64 = p.to_array().iter().map(|c| c.abs().powf(power)).sum();
                    half * p / norm.powf(1.0 / power)
                }));
            }
        }
        shape.smooth(70.0)
    }
}

/// A smooth curve through `points` (Catmull–Rom), `steps` pieces between neighbours.
pub(crate) fn curve(points: &[[f64; 3]], steps: usize) -> Vec<DVec3> {
    let last = points.len() - 1;
    let at = |i: isize| DVec3::from(points[i.clamp(0, last as isize) as usize]);
    let mut path = vec![at(0)];
    for i in 0..last as isize {
        for step in 1..=steps {
            let t = step as f64 / steps as f64;
            let (p, q, r, s) = (at(i - 1), at(i), at(i + 1), at(i + 2));
            let cubic = (3.0 * (q - r) + s - p) * t.powi(3);
            path.push(0.5 * (2.0 * q + (r - p) * t + (2.0 * p - 5.0 * q + 4.0 * r - s) * t * t + cubic));
        }
    }
    path
}

/// The outline |x/a|^power + |y/b|^power = 1, counter-clockwise.
pub(crate) fn superellipse(a: f64, b: f64, power: f64, count: usize) -> Vec<DVec2> {
    (0..count)
        .map(|i| {
            let (sin, cos) = (i as f64 / count as f64 * TAU).sin_cos();
            let norm = (cos.abs().powf(power) + sin.abs().powf(power)).powf(1.0 / power);
            dvec2(a * cos, b * sin) / norm
        })
        .collect()
}

/// Repeatable variety: a small generator (splitmix64).
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// Uniform in [low, high).
    pub(crate) fn roll(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// One of `items`.
    pub(crate) fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[(self.roll(0.0, items.len() as f64) as usize).min(items.len() - 1)]
    }
}
