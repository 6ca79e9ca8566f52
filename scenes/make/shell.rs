//! Walls, floor and ceiling of a box-shaped room as one closed surface seen from inside.

use super::glb::{Model, Paint};
use super::shape::Shape;
use glam::{DVec3, dvec3};

/// One of the room's six sides; north is towards −Z, east towards +X.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Floor,
    Ceiling,
    North,
    South,
    West,
    East,
}

/// Every side is cut along all of these planes, so that edges meet edges and no ray slips through.
pub(crate) struct Shell<'a> {
    pub(crate) x: &'a [f64],
    pub(crate) y: &'a [f64],
    pub(crate) z: &'a [f64],
}

impl Shell<'_> {
    /// Cell (i, j) of a side, counted along (x, z), (x, y) or (z, y); counter-clockwise seen from inside.
    pub(crate) fn cell(&self, side: Side, i: usize, j: usize) -> [DVec3; 4] {
        let (x, y, z) = (self.x, self.y, self.z);
        let ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let end = |planes: &[f64]| planes[planes.len() - 1];
        let mut corners = ring.map(|(a, b)| match side {
            Side::Floor => dvec3(x[a], y[0], z[b]),
            Side::Ceiling => dvec3(x[a], end(y), z[b]),
            Side::North => dvec3(x[a], y[b], z[0]),
            Side::South => dvec3(x[a], y[b], end(z)),
            Side::West => dvec3(x[0], y[b], z[a]),
            Side::East => dvec3(end(x), y[b], z[a]),
        });
        if matches!(side, Side::Floor | Side::South | Side::West) {
            corners.reverse();
        }
        corners
    }

    /// All sides; `paint` gives each cell's material, or none for a hole to be closed by [`recess`].
    pub(crate) fn model(&self, paint: impl Fn(Side, usize, usize) -> Option<Paint>) -> Model {
        let mut model = Model::new();
        let (nx, ny, nz) = (self.x.len() - 1, self.y.len() - 1, self.z.len() - 1);
        for (side, nu, nv) in [
            (Side::Floor, nx, nz),
            (Side::Ceiling, nx, nz),
            (Side::North, nx, ny),
            (Side::South, nx, ny),
            (Side::West, nz, ny),
            (Side::East, nz, ny),
        ] {
            for (i, j) in (0..nu).flat_map(|i| (0..nv).map(move |j| (i, j))) {
                if let Some(paint) = paint(side, i, j) {
                    model.add(paint, Shape::polygon(&self.cell(side, i, j)));
                }
            }
        }
        model
    }
}

/// A niche behind the hole `corners`: sides of depth `offset` in one material, the back in another.
pub(crate) fn recess(model: &mut Model, corners: [DVec3; 4], offset: DVec3, sides: Paint, back: Paint) {
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        model.add(sides, Shape::quad(a, b, b + offset, a + offset));
    }
    model.add(back, Shape::polygon(&corners.map(|c| c + offset)));
}
