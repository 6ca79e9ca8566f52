//! Things that stand in rooms. Each is modelled standing on y = 0 around the origin, its front towards +Z,
//! unless it says otherwise.

use super::glb::{Document, Model, Paint};
use super::shape::{Dice, Shape, curve, superellipse};
use glam::{DAffine3, DVec3, dvec2, dvec3};

/// A move by (x, y, z) after a turn by `degrees` about Y.
pub(crate) fn put(x: f64, y: f64, z: f64, degrees: f64) -> DAffine3 {
    DAffine3::from_translation(dvec3(x, y, z)) * DAffine3::from_rotation_y(degrees.to_radians())
}

/// A straight bar.
pub(crate) fn rod(a: [f64; 3], b: [f64; 3], radius: f64, sides: usize) -> Shape {
    Shape::tube(&[DVec3::from(a), DVec3::from(b)], radius, sides)
}

/// Five-armed swivel base with castors and a gas spring up to `height`.
fn swivel_base(arms: Paint, dark: Paint, height: f64, sides: usize) -> Model {
    let mut m = Model::new();
    let wheel =
        Shape::lathe(&[(0.0, -0.009), (0.028, -0.009), (0.028, 0.009), (0.0, 0.009)], sides + 4).turn_z(90.0);
    for arm in 0..5 {
        let turn = 72.0 * f64::from(arm) + 18.0;
        let path = [[0.02, 0.115, 0.0], [0.16, 0.1, 0.0], [0.31, 0.075, 0.0]];
        let section = [dvec2(-0.013, -0.02), dvec2(0.016, -0.02), dvec2(0.013, 0.02), dvec2(-0.013, 0.02)];
        m.add(arms, Shape::sweep(&curve(&path, 2), &section).turn_y(turn));
        let castor = wheel.clone().at(0.014, 0.0, 0.0).and(wheel.clone().at(-0.014, 0.0, 0.0));
        let castor = castor.turn_y(35.0 + 50.0 * f64::from(arm)).at(0.305, 0.029, 0.0);
        m.add(dark, castor.and(rod([0.305, 0.03, 0.0], [0.305, 0.074, 0.0], 0.007, 5)).turn_y(turn));
    }
    m.add(dark, Shape::cylinder([0.0, 0.08, 0.0], 0.036, 0.06, 2 * sides));
    m.add(dark, Shape::cylinder([0.0, 0.141, 0.0], 0.026, 0.5 * (height - 0.14), 2 * sides));
    m.add(arms, Shape::cylinder([0.0, 0.13, 0.0], 0.016, height - 0.14, 2 * sides));
    m
}

/// A task chair with padded seat, bent back and arm rests.
pub(crate) fn task_chair(d: &mut Document, name: &str, hex: u32) -> Model {
    let fabric = d.matte(name, hex);
    let (dark, frame) = (d.matte("black plastic", 0x3a3b3e), d.matte("grey plastic", 0x6d7076));
    let mut m = swivel_base(frame, dark, 0.43, 6);
    let seat = Shape::cushion([0.25, 0.042, 0.24], 4.0, [8, 3, 8]);
    m.add(fabric, seat.warp(|p| p + DVec3::Y * (0.47 - 0.5 * p.z.max(0.1).powi(2) + 0.35 * p.x * p.x)));
    m.add(dark, Shape::block([-0.17, 0.4, -0.17], [0.17, 0.437, 0.17], 0.012));
    let back = Shape::cushion([0.225, 0.29, 0.032], 4.5, [8, 10, 3]);
    let bend = |p: DVec3| {
        dvec3(p.x, p.y + 0.86, p.z - 0.27 + 0.9 * p.x * p.x - 0.05 * (7.0 * p.y).sin() - 0.16 * p.y)
    };
    m.add(fabric, back.warp(bend));
    let spine = [[0.0, 0.41, -0.1], [0.0, 0.43, -0.27], [0.0, 0.6, -0.31], [0.0, 0.82, -0.315]];
    let section = [dvec2(-0.011, -0.04), dvec2(0.011, -0.04), dvec2(0.011, 0.04), dvec2(-0.011, 0.04)];
    m.add(dark, Shape::sweep(&curve(&spine, 3), &section));
    for side in [-1.0, 1.0] {
        let x = 0.285 * side;
        let bar = [[0.16 * side, 0.415, 0.02], [0.26 * side, 0.425, 0.02], [x, 0.5, 0.01], [x, 0.655, 0.0]];
        m.add(frame, Shape::tube(&curve(&bar, 3), 0.014, 6));
        m.add(dark, Shape::cushion([0.04, 0.017, 0.13], 4.0, [3, 2, 5]).at(x, 0.665, 0.03));
    }
    m
}

/// A conference chair: a bent upholstered shell on a polished swivel base.
pub(crate) fn shell_chair(d: &mut Document) -> Model {
    let leather = d.matte("leather", 0x76503c);
    let piping = d.matte("leather edge", 0x543627);
    let (steel, dark) = (d.matte("brushed steel", 0x9a9da1), d.matte("black plastic", 0x3a3b3e));
    let mut m = swivel_base(steel, dark, 0.41, 8);
    m.add(dark, Shape::block([-0.13, 0.385, -0.15], [0.13, 0.415, 0.13], 0.01));
    let seat = Shape::cushion([0.255, 0.05, 0.25], 4.0, [20, 5, 20]);
    m.add(leather, seat.warp(|p| p + DVec3::Y * (0.465 - 0.6 * p.z.max(0.08).powi(2) + 0.4 * p.x * p.x)));
    let wrap = |p: DVec3| {
        let angle = p.x / 0.34;
        let radius = 0.34 - p.z;
        let lean = 0.22 * (p.y - 0.5).max(0.0);
        let drop = 0.16 * angle * angle * (p.y - 0.42).max(0.0) * 1.3;
        dvec3(radius * angle.sin(), p.y - drop, 0.1 - radius * angle.cos() - lean)
    };
    let back = Shape::cushion([0.47, 0.26, 0.03], 6.0, [36, 20, 4]).at(0.0, 0.74, 0.0);
    m.add(leather, back.warp(wrap));
    for row in 0..3 {
        let y = 0.62 + 0.1 * f64::from(row);
        let seam = Shape::cushion([0.21, 0.038, 0.012], 3.0, [14, 4, 3]).at(0.0, y, 0.034);
        m.add(leather, seam.warp(wrap));
    }
    let rim: Vec<_> = (0..=40)
        .map(|i| {
            let x = -0.45 + 0.9 * f64::from(i) / 40.0;
            wrap(dvec3(x, 1.0 - 0.1 * (x / 0.45).abs().powi(7), 0.0))
        })
        .collect();
    m.add(piping, Shape::tube(&rim, 0.009, 6));
    for side in [-1.0, 1.0] {
        let post = [
            [0.1 * side, 0.4, 0.0],
            [0.22 * side, 0.4, -0.03],
            [0.315 * side, 0.47, -0.02],
            [0.34 * side, 0.56, 0.0],
        ];
        m.add(steel, Shape::tube(&curve(&post, 5), 0.012, 8));
    }
    m
}

/// A stackable chair on four bent steel legs.
pub(crate) fn side_chair(d: &mut Document, name: &str, hex: u32) -> Model {
    let (fabric, steel) = (d.matte(name, hex), d.matte("brushed steel", 0x9a9da1));
    let mut m = Model::new();
    m.add(fabric, Shape::cushion([0.225, 0.028, 0.22], 5.0, [6, 2, 6]).at(0.0, 0.46, 0.01));
    let back = Shape::cushion([0.215, 0.15, 0.02], 5.0, [6, 5, 2]);
    m.add(fabric, back.warp(|p| dvec3(p.x, p.y + 0.74, p.z - 0.235 + 0.8 * p.x * p.x - 0.2 * p.y)));
    for side in [-1.0, 1.0] {
        let front = [
            [0.23 * side, 0.005, 0.23],
            [0.222 * side, 0.25, 0.22],
            [0.215 * side, 0.425, 0.19],
            [0.21 * side, 0.43, -0.16],
        ];
        let rear = [
            [0.23 * side, 0.005, -0.27],
            [0.22 * side, 0.3, -0.21],
            [0.205 * side, 0.55, -0.2],
            [0.19 * side, 0.85, -0.26],
        ];
        m.add(steel, Shape::tube(&curve(&front, 2), 0.0105, 6))
            .add(steel, Shape::tube(&curve(&rear, 2), 0.0105, 6));
    }
    m.add(steel, rod([-0.21, 0.415, 0.1], [0.21, 0.415, 0.1], 0.008, 6));
    m.add(steel, rod([-0.21, 0.415, -0.19], [0.21, 0.415, -0.19], 0.008, 6));
    m
}

/// A pot plant of `leaves` arching leaves, each `rows` cells long.
pub(crate) fn plant(d: &mut Document, pot: u32, leaves: usize, rows: usize, height: f64) -> Model {
    let clay = d.tone("pot", pot);
    let (soil, stem) = (d.matte("soil", 0x59432f), d.matte("stem", 0x6a7d3a));
    let greens = [d.matte("leaf", 0x4f8a3c), d.matte("young leaf", 0x74a64a), d.matte("old leaf", 0x3f6f3a)];
    let mut m = Model::new();
    let outline = [
        (0.0, 0.0),
        (0.1, 0.0),
        (0.115, 0.02),
        (0.15, 0.25),
        (0.162, 0.255),
        (0.162, 0.29),
        (0.14, 0.29),
        (0.135, 0.25),
        (0.0, 0.25),
    ];
    m.add(clay, Shape::lathe(&outline, 16))
        .add(soil, Shape::lathe(&[(0.133, 0.255), (0.07, 0.262), (0.0, 0.265)], 12));
    let mut dice = Dice(leaves as u64);
    for leaf in 0..leaves {
        let turn = 137.508 * leaf as f64;
        let rise = height * (0.45 + 0.55 * (leaf as f64 + 0.5) / leaves as f64);
        let reach = dice.roll(0.16, 0.3) * (1.25 - rise / height * 0.6);
        let (length, width) = (dice.roll(0.2, 0.34), dice.roll(0.045, 0.075));
        let base = dvec3(0.02, 0.255, 0.0);
        let tip = dvec3(0.45 * reach, 0.255 + rise, 0.0);
        let stalk = [base, base.lerp(tip, 0.5) - DVec3::X * 0.03, tip].map(|p| p.to_array());
        m.add(stem, Shape::tube(&curve(&stalk, 2), 0.004, 4).turn_y(turn));
        let droop = dice.roll(0.5, 1.5);
        let blade = Shape::sheet(4, rows, 80.0, |u, v| {
            let across = 2.0 * u - 1.0;
            let half = width * (std::f64::consts::PI * v.powf(0.8)).sin().max(0.02 * (1.0 - v));
            let (along, fold) = (length * v, 0.35 * half * across.abs());
            dvec3(
                tip.x + along * (1.0 - 0.25 * droop * v),
                tip.y + fold + along * (0.55 - droop * v),
                -across * half,
            )
        });
        m.add(dice.pick(&greens), blade.turn_y(turn));
    }
    m
}

/// A mug with a handle at +X.
pub(crate) fn mug(d: &mut Document, name: &str, hex: u32) -> Model {
    let glaze = d.matte(name, hex);
    let outline = [
        (0.0, 0.0),
        (0.034, 0.0),
        (0.038, 0.005),
        (0.04, 0.09),
        (0.0385, 0.093),
        (0.0365, 0.09),
        (0.035, 0.01),
        (0.0, 0.008),
    ];
    let handle = [
        [0.038, 0.075, 0.0],
        [0.058, 0.076, 0.0],
        [0.066, 0.05, 0.0],
        [0.056, 0.024, 0.0],
        [0.038, 0.022, 0.0],
    ];
    let mut m = Model::new();
    m.add(glaze, Shape::lathe(&outline, 18)).add(glaze, Shape::tube(&curve(&handle, 3), 0.0045, 6));
    m.add(d.matte("coffee", 0x5a3a22), Shape::cylinder([0.0, 0.066, 0.0], 0.034, 0.004, 16));
    m
}

/// Books side by side along +X from the origin up to `width`, spines at z = 0, bodies towards −Z.
pub(crate) fn books(d: &mut Document, width: f64, tallest: f64, dice: &mut Dice) -> Model {
    let covers: Vec<_> =
        [0x8c3b32, 0x35577d, 0x486b4a, 0xb59a5b, 0xcfc7b4, 0x6b4a6e, 0x3f4a55, 0xa8623a, 0x7d8f9c, 0xd8d3c8]
            .iter()
            .map(|&hex| d.tone("cover", hex))
            .collect();
    let (paper, label) = (d.matte("paper", 0xe2ddcf), d.matte("label", 0xd9c48e));
    let mut m = Model::new();
    let mut x = 0.0;
    loop {
        let (thick, height, depth) =
            (dice.roll(0.02, 0.056), tallest * dice.roll(0.72, 1.0), dice.roll(0.15, 0.21));
        if x + thick > width {
            return m;
        }
        let cover = dice.pick(&covers);
        let back = -dice.roll(0.0, 0.025);
        let mut book = Model::new();
        let (round, pull) = (0.003, depth - back);
        // In (x, -z), counter-clockwise from the rounded spine.
        let outline = [
            dvec2(round, -back),
            dvec2(thick - round, -back),
            dvec2(thick, round - back),
            dvec2(thick, pull),
            dvec2(0.0, pull),
            dvec2(0.0, round - back),
        ];
        book.add(cover, Shape::prism(&outline, &[(0.0, 0.0), (0.0, height)]));
        let (x0, x1, z0, z1) = (0.0025, thick - 0.0025, 0.002 - pull, back - 0.004);
        let pages = [(x0, z1), (x1, z1), (x1, z0), (x0, z0)];
        book.add(paper, Shape::polygon(&pages.map(|(x, z)| dvec3(x, height + 0.0005, z))));
        if dice.roll(0.0, 1.0) < 0.6 {
            let corner = |u: f64, v: f64| dvec3(u * thick, v * height, back + 0.0005);
            book.add(
                label,
                Shape::quad(corner(0.2, 0.62), corner(0.8, 0.62), corner(0.8, 0.8), corner(0.2, 0.8)),
            );
        }
        let lean = if dice.roll(0.0, 1.0) < 0.1 { dice.roll(3.0, 7.0) } else { 0.0 };
        let shift = height * f64::to_radians(lean).sin();
        if x + thick + shift > width {
            return m;
        }
        m.merge(
            &book,
            DAffine3::from_translation(dvec3(x + shift, 0.0, 0.0))
                * DAffine3::from_rotation_z(f64::to_radians(lean)),
        );
        x += thick / f64::to_radians(lean).cos() + shift + 0.0015;
    }
}

/// A framed abstract painting of `width` by `height`, its back at z = 0 and its middle at the origin.
pub(crate) fn picture(d: &mut Document, width: f64, height: f64, frame: Paint, dice: &mut Dice) -> Model {
    let mount = d.matte("mount", 0xe6e1d6);
    let colors: Vec<_> = [0xc65f3d, 0x2f5f78, 0xe0b050, 0x7f9c8a, 0x3c3f58, 0xd8cfc0, 0x9c4a52]
        .iter()
        .map(|&hex| d.tone("pigment", hex))
        .collect();
    let (x, y, rim) = (0.5 * width, 0.5 * height, 0.025);
    let mut m = Model::new();
    for side in [-1.0, 1.0] {
        let bar = Shape::block([-x, -rim * 0.5, 0.001], [x, rim * 0.5, 0.028], 0.005);
        m.add(frame, bar.at(0.0, side * (y - 0.5 * rim), 0.0));
        let post =
            Shape::block([-rim * 0.5, rim - y + 0.0003, 0.001], [rim * 0.5, y - rim - 0.0003, 0.028], 0.005);
        m.add(frame, post.at(side * (x - 0.5 * rim), 0.0, 0.0));
    }
    m.add(
        mount,
        Shape::cuboid(
            [rim - x + 0.0005, rim - y + 0.0005, 0.003],
            [x - rim - 0.0005, y - rim - 0.0005, 0.012],
        ),
    );
    let (inner_x, inner_y) = (x - rim - 0.16 * width, y - rim - 0.16 * height);
    m.add(dice.pick(&colors), Shape::cuboid([-inner_x, -inner_y, 0.0118], [inner_x, inner_y, 0.0135]));
    for layer in 0..7 {
        let (w, h) = (dice.roll(0.12, 0.5) * inner_x, dice.roll(0.12, 0.5) * inner_y);
        let (cx, cy) = (dice.roll(w - inner_x, inner_x - w), dice.roll(h - inner_y, inner_y - h));
        let front = 0.0145 + 0.001 * f64::from(layer);
        let patch = if layer % 2 == 0 {
            let corner = |u: f64, v: f64| dvec3(cx + u * w, cy + v * h, front);
            Shape::quad(corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0))
        } else {
            let radius = w.min(h);
            let rim = superellipse(radius, radius, 2.0, 20);
            Shape::polygon(&rim.iter().map(|p| dvec3(cx + p.x, cy + p.y, front)).collect::<Vec<_>>())
        };
        m.add(dice.pick(&colors), patch);
    }
    m
}

/// A panelled door of 0.9 × 2.05 m with its frame, standing before a wall at z = 0; hinges at −X.
pub(crate) fn door(d: &mut Document, leaf: Paint, trim: Paint) -> Model {
    let (mut frame, panel) = door_in_parts(d, leaf, trim);
    frame.merge(&panel, DAffine3::IDENTITY);
    frame
}

/// Its frame, and its leaf with hinges and handle.
pub(crate) fn door_in_parts(d: &mut Document, leaf: Paint, trim: Paint) -> (Model, Model) {
    let metal = d.matte("brass", 0xb0935a);
    let mut frame = Model::new();
    let mut m = Model::new();
    for side in [-1.0, 1.0] {
        frame.add(
            trim,
            Shape::block([-0.04, 0.001, 0.001], [0.04, 2.09, 0.035], 0.006).at(0.495 * side, 0.0, 0.0),
        );
    }
    frame.add(trim, Shape::block([-0.535, 2.0905, 0.001], [0.535, 2.17, 0.035], 0.006));
    m.add(leaf, Shape::block([-0.45, 0.008, 0.001], [0.45, 2.085, 0.016], 0.002));
    // Stiles and rails proud of the leaf leave three sunk panels.
    for (min, max) in [
        ([-0.45, 0.008], [-0.33, 2.085]),
        ([0.33, 0.008], [0.45, 2.085]),
        ([-0.3295, 0.008], [0.3295, 0.22]),
        ([-0.3295, 0.86], [0.3295, 1.0]),
        ([-0.3295, 1.5], [0.3295, 1.6]),
        ([-0.3295, 1.96], [0.3295, 2.085]),
    ] {
        m.add(leaf, Shape::block([min[0], min[1], 0.0165], [max[0], max[1], 0.026], 0.004));
    }
    for (low, high) in [(0.26, 0.82), (1.04, 1.46), (1.64, 1.92)] {
        m.add(leaf, Shape::block([-0.29, low, 0.008], [0.29, high, 0.022], 0.005));
    }
    m.add(metal, Shape::block([0.365, 0.93, 0.0265], [0.41, 1.13, 0.031], 0.002));
    let lever = [
        [0.388, 1.06, 0.03],
        [0.388, 1.06, 0.06],
        [0.375, 1.06, 0.073],
        [0.33, 1.06, 0.076],
        [0.265, 1.055, 0.076],
    ];
    m.add(metal, Shape::tube(&curve(&lever, 3), 0.009, 6));
    m.add(metal, Shape::cylinder([0.0, 0.0, 0.0], 0.011, 0.005, 10).turn_x(90.0).at(0.388, 0.98, 0.0313));
    for height in [0.25, 1.03, 1.82] {
        m.add(metal, Shape::cylinder([-0.452, height, 0.032], 0.008, 0.09, 8));
    }
    (frame, m)
}

/// A venetian blind hanging down from the origin: `slats` bent slats, turned by `tilt` degrees.
pub(crate) fn blind(d: &mut Document, width: f64, slats: usize, tilt: f64) -> Model {
    let (paint, cord) = (d.matte("slat", 0xd9d2c0), d.matte("cord", 0xbdb6a5));
    let (x, pitch) = (0.5 * width, 0.042);
    let mut m = Model::new();
    m.add(paint, Shape::block([-x, -0.04, -0.025], [x, 0.0, 0.025], 0.004));
    let slat = Shape::sheet(4, 1, 80.0, |u, v| {
        let across = u - 0.5;
        dvec3(x * (1.0 - 2.0 * v), 0.007 * (1.0 - 4.0 * across * across), 0.05 * across)
    })
    .turn_x(tilt);
    for i in 0..slats {
        m.add(paint, slat.clone().at(0.0, -0.07 - pitch * i as f64, 0.0));
    }
    let bottom = -0.07 - pitch * slats as f64;
    m.add(paint, Shape::block([-x, bottom - 0.008, -0.025], [x, bottom + 0.008, 0.025], 0.004));
    for side in [-0.7, 0.0, 0.7] {
        for z in [-0.027, 0.027] {
            m.add(
                cord,
                Shape::cuboid([side * x - 0.001, bottom, z - 0.0008], [side * x + 0.001, -0.04, z + 0.0008]),
            );
        }
    }
    m.add(cord, rod([-0.93 * x, -0.75, 0.03], [-0.93 * x, -0.04, 0.03], 0.003, 5));
    m
}

/// A desk lamp with a jointed arm that reaches towards +X, shade turned down.
pub(crate) fn desk_lamp(d: &mut Document) -> Model {
    let (enamel, steel, bulb) =
        (d.matte("lamp enamel", 0xb8402f), d.matte("brushed steel", 0x9a9da1), d.matte("bulb", 0xeeeae0));
    let mut m = Model::new();
    m.add(
        enamel,
        Shape::lathe(
            &[
                (0.0, 0.0),
                (0.085, 0.0),
                (0.09, 0.006),
                (0.088, 0.016),
                (0.03, 0.026),
                (0.012, 0.045),
                (0.0, 0.045),
            ],
            18,
        ),
    );
    m.add(steel, rod([0.0, 0.04, 0.0], [-0.1, 0.36, 0.0], 0.006, 8))
        .add(steel, rod([-0.1, 0.36, 0.0], [0.15, 0.52, 0.0], 0.006, 8));
    m.add(enamel, Shape::cylinder([0.0, -0.012, 0.0], 0.014, 0.024, 12).turn_x(90.0).at(-0.1, 0.36, 0.0));
    let shade =
        [(0.0, 0.0), (0.022, 0.0), (0.09, -0.11), (0.092, -0.11), (0.027, 0.0), (0.024, 0.035), (0.0, 0.04)];
    let head = Shape::lathe(&shade, 18).turn_z(25.0).at(0.155, 0.51, 0.0);
    m.add(enamel, head)
        .add(bulb, Shape::cushion([0.026, 0.032, 0.026], 2.0, [3, 3, 3]).turn_z(25.0).at(0.172, 0.468, 0.0));
    m
}

/// A flat ceiling lamp: a rim and a white diffuser, hanging down from y = 0.
pub(crate) fn panel_lamp(d: &mut Document, x: f64, z: f64) -> Model {
    let (rim, diffuser) = (d.matte("lamp rim", 0xb9bbbd), d.matte("diffuser", 0xe7e7e2));
    let mut m = Model::new();
    for side in [-1.0, 1.0] {
        m.add(
            rim,
            Shape::block([-x, -0.05, -0.012], [x, -0.001, 0.012], 0.003).at(0.0, 0.0, side * (z - 0.012)),
        );
        m.add(
            rim,
            Shape::block([-0.012, -0.05, 0.0245 - z], [0.012, -0.001, z - 0.0245], 0.003).at(
                side * (x - 0.012),
                0.0,
                0.0,
            ),
        );
    }
    m.add(diffuser, Shape::cuboid([0.0245 - x, -0.042, 0.0245 - z], [x - 0.0245, -0.001, z - 0.0245]));
    m
}

/// Skirting along a wall from (x0, z0) to (x1, z1), the room on the left of that direction seen from above.
pub(crate) fn skirting(paint: Paint, from: [f64; 2], to: [f64; 2]) -> Model {
    let (a, b) = (dvec2(from[0], from[1]), dvec2(to[0], to[1]));
    let length = a.distance(b);
    let turn = -(b - a).to_angle().to_degrees();
    let mut m = Model::new();
    let profile = [
        dvec2(0.001, 0.001),
        dvec2(0.014, 0.001),
        dvec2(0.014, 0.065),
        dvec2(0.008, 0.085),
        dvec2(0.001, 0.085),
    ];
    let bar = |p: &[glam::DVec2]| {
        let ring = |x: f64| -> Vec<DVec3> { p.iter().map(|s| dvec3(x, s.y, -s.x)).collect() };
        let (start, end) = (ring(0.0), ring(length));
        let mut shape = Shape::polygon(&end);
        shape.append(Shape::polygon(&start.iter().rev().copied().collect::<Vec<_>>()));
        for i in 0..p.len() {
            let j = (i + 1) % p.len();
            shape.append(Shape::quad(start[j], end[j], end[i], start[i]));
        }
        shape
    };
    m.add(paint, bar(&profile).turn_y(turn).at(a.x, 0.0, a.y));
    m
}
