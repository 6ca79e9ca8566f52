//! Polygons split into triangles.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Most corners of a polygon whose ears are cut, which in the worst case takes their square in time.
const MAX_EARS: usize = 1 << 16;
/// Share of the area by which triangles may overlap: rounding alone makes as much.
const SLACK: f64 = 1e-6;

/// Splits polygons of any shape.
#[derive(Default)]
pub(super) struct Splitter {
    ears: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
}

impl Splitter {
    /// Triangles between `corners`, of which there are at least three, facing as they do: the fan about the first, where no
    /// triangle of it lies outside or on another, else ears cut off (Meisters, "Polygons Have Ears", 1975) as seen along the
    /// normal of Newell (Sutherland, Sproull and Schumacker 1974). Corners of a hole are joined to those around it by a
    /// double edge. What is wrong with a polygon whose triangles overlap all the same is told.
    ///
    /// # Errors
    /// There are too many corners.
    pub(super) fn split(
        &mut self,
        corners: &[DVec3],
        triangles: &mut Vec<[u32; 3]>,
    ) -> Result<Option<&'static str>, String> {
        let count = corners.len() as u32;
        triangles.clear();
        triangles.extend((1..count - 1).map(|i| [0, i, i + 1]));
        if count == 3 {
            return Ok(None);
        }
        let cross = |&[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|i| corners[i as usize]);
            (b - a).cross(c - a)
        };
        let normal: DVec3 = triangles.iter().map(cross).sum();
        let whole = normal.length();
        let areas: f64 = triangles.iter().map(|t| cross(t).length()).sum();
        if whole <= 1e-9 * areas {
            return Ok((areas > 0.0).then_some("a polygon without an inside"));
        }
        let normal = normal / whole;
        let unsigned = |triangles: &[[u32; 3]]| -> f64 {
            triangles.iter().map(|triangle| cross(triangle).dot(normal).abs()).sum()
        };
        let fan = unsigned(triangles);
        if fan - whole <= SLACK * fan {
            return Ok(None);
        }
        if corners.len() > MAX_EARS {
            return Err(format!(
                "a polygon of {count} corners that is not convex, expected at most {MAX_EARS}"
            ));
        }
        let (x, y) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(corners.iter().map(|&corner| {
            let off = corner - corners[0];
            DVec2::new(off.dot(x), off.dot(y)).to_array()
        }));
        self.ears.earcut(self.flat.iter().copied(), &[], &mut self.cut);
        let mut ears: Vec<[u32; 3]> = self.cut.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        for ear in &mut ears {
            if cross(ear).dot(normal) < 0.0 {
                ear.swap(1, 2);
            }
        }
        let off = (unsigned(&ears) - whole).abs();
        if off < fan - whole {
            *triangles = ears;
        }
        Ok((off > SLACK * fan).then_some("a polygon that crosses itself"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// Area by the shoelace formula.
    fn shoelace(polygon: &[DVec2]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        0.5 * polygon.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
    }

    /// A polygon whose corners lie about a point at growing angles.
    fn star(radii: &[f64]) -> Vec<DVec2> {
        let corner =
            |(i, &radius): (usize, &f64)| radius * DVec2::from_angle(TAU * i as f64 / radii.len() as f64);
        radii.iter().enumerate().map(corner).collect()
    }

    /// Checks that triangles cover a simple polygon, placed anywhere, once, and face as it does.
    fn covers(polygon: &[DVec2], turn: DQuat, offset: DVec3) {
        let placed: Vec<DVec3> = polygon.iter().map(|p| offset + turn * p.extend(0.0)).collect();
        let mut triangles = Vec::new();
        assert_eq!(Splitter::default().split(&placed, &mut triangles), Ok(None));
        let facing = turn * DVec3::Z * shoelace(polygon).signum();
        let (mut signed, mut unsigned) = (0.0, 0.0);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|i| placed[i as usize]);
            let area = 0.5 * (b - a).cross(c - a).dot(facing);
            signed += area;
            unsigned += area.abs();
        }
        let expected = shoelace(polygon).abs();
        assert!((signed - expected).abs() < 1e-5 * expected, "{signed} of {expected}");
        assert!((unsigned - expected).abs() < 1e-5 * expected, "{unsigned} of {expected}");
    }

    fn plane() -> impl Strategy<Value = (DQuat, DVec3)> {
        (prop::array::uniform4(-1.0..1.0), prop::array::uniform3(-50.0..50.0))
            .prop_filter("a direction", |(q, _): &([f64; 4], _)| q.iter().map(|x| x * x).sum::<f64>() > 0.01)
            .prop_map(|(q, t)| (DQuat::from_array(q).normalize(), DVec3::from_array(t)))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn stars_are_covered_once(
            radii in prop::collection::vec(0.2..5.0, 4..40),
            start in any::<prop::sample::Index>(),
            doubled in any::<prop::sample::Index>(),
            reversed in any::<bool>(),
            (turn, offset) in plane(),
        ) {
            let mut polygon = star(&radii);
            polygon.rotate_left(start.index(radii.len()));
            // One corner twice, one on an edge.
            let at = doubled.index(radii.len() - 1);
            polygon.insert(at, polygon[at]);
            polygon.insert(at + 2, polygon[at + 1].midpoint(polygon[(at + 2) % polygon.len()]));
            if reversed {
                polygon.reverse();
            }
            covers(&polygon, turn, offset);
        }

        /// Hills over a jagged ground: neither is convex, and no point sees all of it.
        #[test]
        fn combs_are_covered_once(
            heights in prop::collection::vec((0.0..3.0, 0.1..2.0), 3..30),
            start in any::<prop::sample::Index>(),
            (turn, offset) in plane(),
        ) {
            let at = |i: usize, y: f64| DVec2::new(i as f64, y);
            let ground = heights.iter().enumerate().map(|(i, &(y, _))| at(i, y));
            let hills = heights.iter().enumerate().rev().map(|(i, &(y, height))| at(i, y + height));
            let mut polygon: Vec<DVec2> = ground.chain(hills).collect();
            let start = start.index(polygon.len());
            polygon.rotate_left(start);
            covers(&polygon, turn, offset);
        }

        /// A wall with a window, joined to the corner nearest to it by a double edge.
        #[test]
        fn windows_stay_open(
            outer in prop::collection::vec(2.0..5.0, 5..20),
            inner in prop::collection::vec(0.2..0.9, 3..12),
            start in any::<prop::sample::Index>(),
            (turn, offset) in plane(),
        ) {
            let (wall, mut window) = (star(&outer), star(&inner));
            window.reverse();
            // Seen from the middle, both their corners of angle 0 lie in one direction.
            window.rotate_right(1);
            let mut polygon: Vec<DVec2> = wall.iter().chain(&wall[..1]).chain(&window).chain(&window[..1]).copied().collect();
            prop_assert!((shoelace(&polygon) - (shoelace(&wall) + shoelace(&window))).abs() < 1e-9);
            let start = start.index(polygon.len());
            polygon.rotate_left(start);
            covers(&polygon, turn, offset);
        }

        #[test]
        fn any_corners_give_some_triangles(
            corners in prop::collection::vec(prop::array::uniform3(-3_i32..3), 3..20),
        ) {
            let corners: Vec<DVec3> = corners.iter().map(|c| c.map(f64::from).into()).collect();
            let mut triangles = Vec::new();
            let whole = Splitter::default().split(&corners, &mut triangles);
            let area: f64 = triangles.iter().map(|t| {
                let [a, b, c] = t.map(|i| corners[i as usize]);
                (b - a).cross(c - a).length()
            }).sum();
            let first = corners[0];
            let flat = corners.windows(2).all(|p| (p[0] - first).cross(p[1] - first) == DVec3::ZERO);
            prop_assert!(area > 0.0 || flat, "{whole:?}");
        }
    }

    #[test]
    fn an_ell_has_its_area() {
        let ell =
            [[1, 0], [0, 0], [0, 1], [-1, 1], [-1, -1], [1, -1]].map(|[x, y]| DVec2::new(x.into(), y.into()));
        assert_eq!(shoelace(&ell), 3.0);
        for start in 0..6 {
            let mut ell = ell;
            ell.rotate_left(start);
            covers(&ell, DQuat::IDENTITY, DVec3::ZERO);
        }
    }

    #[test]
    fn convex_polygons_are_fans_and_crossed_ones_are_told() {
        let mut triangles = Vec::new();
        let mut split = |corners: &[[i32; 3]]| {
            let corners: Vec<DVec3> = corners.iter().map(|c| c.map(f64::from).into()).collect();
            let whole = Splitter::default().split(&corners, &mut triangles);
            (whole, triangles.clone())
        };
        let square = split(&[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]);
        assert_eq!(square, (Ok(None), vec![[0, 1, 2], [0, 2, 3]]));
        let bent = split(&[[0, 0, 0], [2, 0, 1], [2, 2, 0], [0, 2, 1]]);
        assert_eq!(bent, (Ok(None), vec![[0, 1, 2], [0, 2, 3]]));
        for crossed in
            [[[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [3, 3, 0], [3, 0, 0], [0, 2, 0]]]
        {
            let (whole, triangles) = split(&crossed);
            assert!(matches!(whole, Ok(Some(_))) && !triangles.is_empty(), "{whole:?} {triangles:?}");
        }
        assert_eq!(split(&[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]).0, Ok(None));
    }
}
