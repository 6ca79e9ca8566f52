//! The Cornell box: Cornell University's published measurements (public data), 1 unit = 100 of theirs, all
//! surfaces Lambertian, lit by a point below the middle of the ceiling in place of the area light.

use super::glb::{Document, Model};
use super::shape::Shape;
use glam::DVec3;

/// A quadrilateral in the published unit.
fn face(points: [[f64; 3]; 4]) -> Shape {
    Shape::polygon(&points.map(|p| DVec3::from(p) / 100.0))
}

/// A block without its bottom, from the corners of its top (counter-clockwise seen from above) in (x, z).
fn block(top: [[f64; 2]; 4], height: f64) -> Shape {
    let mut shape = face(top.map(|[x, z]| [x, height, z]));
    for i in 0..4 {
        let ([ax, az], [bx, bz]) = (top[i], top[(i + 1) % 4]);
        shape.append(face([[ax, 0.0, az], [bx, 0.0, bz], [bx, height, bz], [ax, height, az]]));
    }
    shape
}

pub(crate) fn cornell() -> Vec<u8> {
    let mut d = Document::new("cornell");
    let white = d.lambert("white", [0.73, 0.73, 0.73]);
    let red = d.lambert("red", [0.63, 0.065, 0.05]);
    let green = d.lambert("green", [0.14, 0.45, 0.091]);
    let mut room = Model::new();
    let floor = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
    let ceiling = [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]];
    let back = [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]];
    let right = [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]];
    let left = [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]];
    room.add(white, face(floor)).add(white, face(ceiling)).add(white, face(back));
    room.add(green, face(right)).add(red, face(left));
    d.add("room", &room);
    let short = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let tall = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];
    d.add("short block", Model::new().add(white, block(short, 165.0)));
    d.add("tall block", Model::new().add(white, block(tall, 330.0)));
    d.light("lamp", [2.78, 5.0, 2.795], [1.0, 0.8, 0.5], 20.0);
    // A 25 mm square film behind a 35 mm lens.
    let fov = 2.0 * (12.5f64 / 35.0).atan().to_degrees();
    d.camera("camera", [2.78, 2.73, -8.0], [2.78, 2.73, 0.0], fov, 1.0);
    d.camera("blocks", [4.2, 3.9, -1.2], [2.6, 1.1, 2.6], 50.0, 4.0 / 3.0);
    d.into_glb()
}
