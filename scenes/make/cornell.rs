//! The Cornell box: Cornell University's published measurements (public data), 1 unit = 100 of theirs, all
//! surfaces Lambertian, lit by a point below the middle of the ceiling in place of the area light.

use super::glb::{Document, Model, Moved, Paint};
use super::shape::Shape;
use glam::{DQuat, DVec3};

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

/// Floor, ceiling and walls.
fn room(d: &mut Document) -> Paint {
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
    white
}

const SHORT: [[f64; 2]; 4] = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
const TALL: [[f64; 2]; 4] = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];

/// The lamp and what sees the box.
fn seen(d: &mut Document) {
    d.light("lamp", [2.78, 5.0, 2.795], [1.0, 0.8, 0.5], 20.0);
    // A 25 mm square film behind a 35 mm lens.
    let fov = 2.0 * (12.5f64 / 35.0).atan().to_degrees();
    d.camera("camera", [2.78, 2.73, -8.0], [2.78, 2.73, 0.0], fov, 1.0);
    d.camera("blocks", [4.2, 3.9, -1.2], [2.6, 1.1, 2.6], 50.0, 4.0 / 3.0);
}

pub(crate) fn cornell() -> Vec<u8> {
    let mut d = Document::new("cornell");
    let white = room(&mut d);
    d.add("short block", Model::new().add(white, block(SHORT, 165.0)));
    d.add("tall block", Model::new().add(white, block(TALL, 330.0)));
    seen(&mut d);
    d.into_glb()
}

/// The same box for 4 s: the tall block turns, the short one grows by a morph target, the lamp dims and the walls change
/// their colours by pointers.
pub(crate) fn moving() -> Vec<u8> {
    let mut d = Document::new("cornell-moving");
    let white = room(&mut d);
    let short = Model::new().add(white, block(SHORT, 165.0)).clone();
    let short = d.morphing("short block", &short, |p| p * DVec3::new(1.0, 1.6, 1.0));
    d.place("short block", short, [0.0; 3], 0.0);
    let short = d.last();
    let centre = [3.685, 0.0, 3.5125];
    let at_centre = TALL.map(|[x, z]| [x - 100.0 * centre[0], z - 100.0 * centre[2]]);
    let tall = d.mesh("tall block", Model::new().add(white, block(at_centre, 330.0)));
    d.place("tall block", tall, centre, 0.0);
    let tall = d.last();
    seen(&mut d);

    let turn = |time: i32| {
        let angle = f64::from(time) * 90.0_f64.to_radians();
        (f64::from(time), DQuat::from_rotation_y(angle).to_array().to_vec())
    };
    d.animate("blocks", Moved::Rotation(tall), &(0..=4).map(turn).collect::<Vec<_>>());
    d.animate("blocks", Moved::Weight(short), &[(0.0, vec![0.0]), (2.0, vec![1.0]), (4.0, vec![0.0])]);
    let intensity = "/extensions/KHR_lights_punctual/lights/0/intensity";
    d.animate(
        "light",
        Moved::Pointer(intensity.into(), 1),
        &[(0.0, vec![20.0]), (2.0, vec![5.0]), (4.0, vec![20.0])],
    );
    let (red, green) = (vec![0.63, 0.065, 0.05, 1.0], vec![0.14, 0.45, 0.091, 1.0]);
    for (material, from, to) in [(1, &red, &green), (2, &green, &red)] {
        let pointer = format!("/materials/{material}/pbrMetallicRoughness/baseColorFactor");
        d.animate("light", Moved::Pointer(pointer, 4), &[(0.0, from.clone()), (4.0, to.clone())]);
    }
    d.into_glb()
}
