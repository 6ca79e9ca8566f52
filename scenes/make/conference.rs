//! A conference room, 9 × 6 × 3.2 m, at night: lacquered table, mirrors, glass, four lamps.

use super::figure::figure;
use super::furniture::{door, panel_lamp, picture, plant, rod, shell_chair, skirting};
use super::glb::{Document, Model};
use super::shape::{Dice, Shape, curve, superellipse};
use super::shell::{Shell, Side, recess};
use glam::{DAffine3, DVec3, dvec2, dvec3};

const WIDTH: f64 = 9.0;
const DEPTH: f64 = 6.0;
const HEIGHT: f64 = 3.2;
/// Rise of the ceiling inside a coffer.
const COFFER: f64 = 0.22;
/// Middles of the coffers.
const COFFERS: [[f64; 2]; 4] = [[2.5, 1.7], [6.5, 1.7], [2.5, 4.3], [6.5, 4.3]];

/// Walls with two window niches in the north, ceiling with four coffers.
fn shell(d: &mut Document) {
    let (wall, ceiling, screed) =
        (d.matte("wall", 0xd6cdbb), d.matte("ceiling", 0xe5e2da), d.matte("screed", 0x77736c));
    let (accent, coffer, night) =
        (d.matte("accent wall", 0x8a9aa5), d.matte("coffer", 0xdcd6c8), d.matte("night sky", 0x5a6a8c));
    let shell = Shell {
        x: &[0.0, 0.9, 4.1, 4.9, 8.1, WIDTH],
        y: &[-0.013, 0.5, 2.5, HEIGHT],
        z: &[0.0, 0.8, 2.6, 3.4, 5.2, DEPTH],
    };
    let hole = |k: usize| k == 1 || k == 3;
    let mut m = shell.model(|side, i, j| match side {
        Side::North if hole(i) && j == 1 => None,
        Side::Ceiling if hole(i) && hole(j) => None,
        Side::Ceiling => Some(ceiling),
        Side::Floor => Some(screed),
        Side::East => Some(accent),
        _ => Some(wall),
    });
    for i in [1, 3] {
        recess(&mut m, shell.cell(Side::North, i, 1), dvec3(0.0, 0.0, -0.35), wall, night);
        for j in [1, 3] {
            recess(&mut m, shell.cell(Side::Ceiling, i, j), dvec3(0.0, COFFER, 0.0), coffer, ceiling);
        }
    }
    d.add("shell", &m);
}

/// Carpet tiles laid in turns.
fn carpet(d: &mut Document) {
    let tones = [0x7c8288, 0x71777f, 0x868a8c].map(|hex| d.tone("carpet", hex));
    let mut m = Model::new();
    let mut dice = Dice(3);
    for (i, j) in (0..18).flat_map(|i| (0..12).map(move |j| (0.5 * f64::from(i), 0.5 * f64::from(j)))) {
        m.add(
            dice.pick(&tones),
            Shape::cuboid([i + 0.0006, -0.012, j + 0.0006], [i + 0.4994, 0.0, j + 0.4994]),
        );
    }
    d.add("carpet", &m);
}

/// Mouldings around the coffers, and their lamps.
fn overhead(d: &mut Document) {
    let trim = d.matte("moulding", 0xe0dccf);
    let mut m = Model::new();
    for [x, z] in COFFERS {
        let (a, b, y) = (1.6, 0.9, HEIGHT);
        for side in [-1.0, 1.0] {
            let bar = Shape::block([-a - 0.06, y - 0.03, -0.035], [a + 0.06, y - 0.001, 0.035], 0.01);
            m.add(trim, bar.at(x, 0.0, z + side * (b + 0.036)));
            let bar = Shape::block([-0.035, y - 0.03, -b], [0.035, y - 0.001, b], 0.01);
            m.add(trim, bar.at(x + side * (a + 0.036), 0.0, z));
            let bar = Shape::block(
                [0.002 - a, y + COFFER - 0.06, -0.025],
                [a - 0.002, y + COFFER - 0.001, 0.025],
                0.012,
            );
            m.add(trim, bar.at(x, 0.0, z + side * (b - 0.027)));
            let bar = Shape::block(
                [-0.025, y + COFFER - 0.06, 0.054 - b],
                [0.025, y + COFFER - 0.001, b - 0.054],
                0.012,
            );
            m.add(trim, bar.at(x + side * (a - 0.027), 0.0, z));
        }
    }
    d.add("mouldings", &m);
    let lamp = panel_lamp(d, 0.75, 0.3);
    let lamp = d.mesh("ceiling lamp", &lamp);
    for (i, [x, z]) in COFFERS.into_iter().enumerate() {
        d.place(&format!("ceiling lamp {}", i + 1), lamp, [x, HEIGHT + COFFER, z], 0.0);
    }
}

/// Frame, sill and a thin pane in each niche; curtains before them.
fn windows(d: &mut Document) {
    let (white, stone, glass) =
        (d.matte("window paint", 0x6b655c), d.matte("sill", 0xc9c3b6), d.pane("window glass"));
    let (brass, cloth) = (d.matte("brass", 0xb0935a), d.matte("curtain", 0x9c5a4a));
    let mut m = Model::new();
    let (a, low, high, z) = (1.599, 0.501, 2.499, -0.24);
    for (y0, y1) in [(low, low + 0.07), (high - 0.07, high)] {
        m.add(white, Shape::block([-a, y0, z - 0.05], [a, y1, z + 0.02], 0.01));
    }
    for x in [0.035 - a, -0.54, 0.54, a - 0.035] {
        m.add(
            white,
            Shape::block([x - 0.035, low + 0.0705, z - 0.05], [x + 0.035, high - 0.0705, z + 0.02], 0.01),
        );
    }
    for (x0, x1) in [(-1.528, -0.576), (-0.504, 0.504), (0.576, 1.528)] {
        let corner = |x: f64, y: f64| dvec3(x, y, z - 0.015);
        let (y0, y1) = (low + 0.071, high - 0.071);
        m.add(glass, Shape::quad(corner(x0, y0), corner(x1, y0), corner(x1, y1), corner(x0, y1)));
    }
    m.add(stone, Shape::block([-1.68, 0.46, 0.001], [1.68, 0.5, 0.14], 0.01));
    m.add(brass, rod([-1.95, 2.72, 0.1], [1.95, 2.72, 0.1], 0.014, 12));
    for side in [-1.0, 1.0] {
        m.add(brass, Shape::cushion([0.03, 0.03, 0.03], 2.0, [5, 5, 5]).at(1.97 * side, 2.72, 0.1));
        m.add(brass, rod([1.86 * side, 2.72, 0.001], [1.86 * side, 2.72, 0.09], 0.008, 8));
    }
    let window = d.mesh("window", &m);
    let drape = Shape::sheet(96, 16, 80.0, |u, v| {
        let wave = (2.0 * std::f64::consts::PI * 8.0 * u).sin();
        let spread = 0.62 + 0.1 * (1.0 - v).powi(2) - 0.06 * (std::f64::consts::PI * v).sin();
        let depth = 0.02 + 0.025 * (1.0 - 0.4 * v) * (1.0 + 0.3 * (9.0 * u + 3.0 * v).sin());
        dvec3(spread * u, 0.03 + 2.66 * v, depth * wave + 0.012 * (5.0 * v + 8.0 * u).sin())
    });
    let mut m = Model::new();
    m.add(cloth, drape);
    for i in 0..8 {
        let ring: Vec<_> = (0..=12)
            .map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 12.3).sin_cos();
                dvec3(0.04 + 0.0775 * f64::from(i), 2.708 + 0.026 * cos, 0.026 * sin)
            })
            .collect();
        m.add(brass, Shape::tube(&ring, 0.003, 5));
    }
    let curtain = d.mesh("curtain", &m);
    for (i, x) in [2.5, 6.5].into_iter().enumerate() {
        d.place(&format!("window {}", i + 1), window, [x, 0.0, 0.0], 0.0);
        d.place(&format!("curtain {} left", i + 1), curtain, [x - 1.9, 0.0, 0.1], 0.0);
        d.place(&format!("curtain {} right", i + 1), curtain, [x + 1.9, 0.0, 0.1], 180.0);
    }
}

/// A lacquered top with a paler band, on two pedestals, 5.4 × 1.6 m.
fn table(d: &mut Document) -> Model {
    let (top, band, foot) = (
        d.lacquer("table lacquer", 0x8a4f2d),
        d.matte("table band", 0x4f2f1e),
        d.matte("pedestal", 0x5b3824),
    );
    let metal = d.matte("brushed steel", 0x9a9da1);
    let mut m = Model::new();
    let outline = superellipse(2.7, 0.8, 3.2, 128);
    m.add(
        top,
        Shape::prism(
            &outline,
            &[(0.006, 0.728), (0.0, 0.732), (0.0, 0.744), (0.0018, 0.7485), (0.006, 0.75)],
        ),
    );
    m.add(band, Shape::prism(&outline, &[(0.06, 0.69), (0.03, 0.7), (0.025, 0.7275)]));
    for side in [-1.0, 1.0] {
        let leg = superellipse(0.34, 0.22, 4.0, 40);
        let body = Shape::prism(&leg, &[(0.03, 0.09), (0.05, 0.4), (0.0, 0.6895)]);
        let base =
            Shape::prism(&superellipse(0.5, 0.34, 4.0, 40), &[(0.0, 0.001), (0.0, 0.04), (0.1, 0.0895)]);
        m.add(foot, body.and(base).at(1.5 * side, 0.0, 0.0));
        m.add(
            metal,
            Shape::block([-0.16, 0.7505, -0.07], [0.16, 0.756, 0.07], 0.002).at(1.5 * side, 0.0, 0.0),
        );
    }
    m
}

/// A thin-walled tumbler: one sheet of glass.
fn tumbler(d: &mut Document) -> Model {
    let glass = d.pane("tumbler glass");
    let mut m = Model::new();
    m.add(
        glass,
        Shape::lathe(&[(0.0, 0.002), (0.026, 0.002), (0.031, 0.008), (0.034, 0.05), (0.037, 0.11)], 28),
    );
    m
}

/// A carafe with walls of solid glass.
fn carafe(d: &mut Document) -> Model {
    let (glass, cork) = (d.glass("carafe glass", 0.004, 0xd5efe6), d.matte("cork", 0xb28a60));
    let outside = [
        (0.0, 0.001),
        (0.05, 0.001),
        (0.06, 0.008),
        (0.064, 0.06),
        (0.058, 0.12),
        (0.034, 0.18),
        (0.029, 0.22),
        (0.037, 0.27),
    ];
    let inside = [
        (0.033, 0.27),
        (0.025, 0.22),
        (0.03, 0.178),
        (0.054, 0.118),
        (0.06, 0.06),
        (0.056, 0.014),
        (0.0, 0.009),
    ];
    let mut m = Model::new();
    m.add(glass, Shape::lathe(&[&outside[..], &inside[..]].concat(), 40));
    m.add(cork, Shape::cushion([0.022, 0.02, 0.022], 3.0, [4, 4, 4]).at(0.0, 0.262, 0.0));
    m
}

/// A pad with a pen across it.
fn notepad(d: &mut Document) -> Model {
    let (paper, board, pen) =
        (d.matte("paper", 0xe2ddcf), d.matte("pad board", 0x6e6250), d.matte("pen", 0x2f4f7d));
    let mut m = Model::new();
    m.add(board, Shape::block([-0.108, 0.0005, -0.152], [0.108, 0.003, 0.152], 0.0008));
    m.add(paper, Shape::block([-0.105, 0.0032, -0.15], [0.105, 0.012, 0.15], 0.001));
    m.add(pen, rod([0.03, 0.0175, -0.09], [0.075, 0.0175, 0.05], 0.005, 10));
    m
}

/// A three-armed conference telephone.
fn telephone(d: &mut Document) -> Model {
    let (dark, key) = (d.matte("black plastic", 0x3a3b3e), d.matte("key", 0x8b8e93));
    let mut m = Model::new();
    for arm in 0..3 {
        let turn = 120.0 * f64::from(arm);
        let path = curve(&[[0.02, 0.028, 0.0], [0.09, 0.022, 0.0], [0.15, 0.012, 0.0]], 4);
        let section =
            [dvec2(-0.006, -0.028), dvec2(0.008, -0.022), dvec2(0.008, 0.022), dvec2(-0.006, 0.028)];
        m.add(dark, Shape::sweep(&path, &section).turn_y(turn));
    }
    m.add(
        dark,
        Shape::lathe(&[(0.0, 0.002), (0.07, 0.002), (0.078, 0.012), (0.06, 0.038), (0.0, 0.044)], 32),
    );
    for i in 0..12 {
        let (x, z) = (0.016 * f64::from(i % 3 - 1), 0.016 * f64::from(i / 3) - 0.024);
        m.add(key, Shape::block([x - 0.006, 0.0425, z - 0.005], [x + 0.006, 0.047, z + 0.005], 0.0015));
    }
    m
}

/// A projection screen on a wall at z = 0, its middle at x = 0, with casing and weight bar.
fn screen(d: &mut Document) -> Model {
    let (white, case, border) =
        (d.matte("screen", 0xe8e8e6), d.matte("white plastic", 0xdedcd6), d.matte("screen border", 0x2f3032));
    let mut m = Model::new();
    m.add(case, Shape::block([-1.3, 2.62, 0.001], [1.3, 2.74, 0.12], 0.02));
    m.add(border, Shape::cuboid([-1.2, 0.98, 0.055], [1.2, 2.6195, 0.058]));
    m.add(white, Shape::cuboid([-1.15, 1.04, 0.0585], [1.15, 2.6, 0.0595]));
    m.add(case, Shape::block([-1.21, 0.945, 0.04], [1.21, 0.9795, 0.072], 0.008));
    m
}

/// A framed mirror, back at z = 0, standing from y = 0.25 to 2.45.
fn looking_glass(d: &mut Document) -> Model {
    let (silver, frame) = (d.mirror("mirror", 0xf2f3f2), d.matte("walnut", 0x70482f));
    let mut m = Model::new();
    for side in [-1.0, 1.0] {
        m.add(frame, Shape::block([-0.03, 0.25, 0.001], [0.03, 2.45, 0.045], 0.01).at(0.42 * side, 0.0, 0.0));
        m.add(
            frame,
            Shape::block([-0.3895, -0.03, 0.001], [0.3895, 0.03, 0.045], 0.01).at(
                0.0,
                1.35 + 1.07 * side,
                0.0,
            ),
        );
    }
    m.add(silver, Shape::cuboid([-0.3895, 0.311, 0.002], [0.3895, 2.389, 0.02]));
    m
}

/// Wall panelling 0.9 m wide: two framed fields under a rail.
fn panelling(d: &mut Document) -> Model {
    let (wood, field) = (d.matte("panelling", 0x9a6f4a), d.matte("panel field", 0xa87c55));
    let mut m = Model::new();
    m.add(wood, Shape::cuboid([-0.4495, 0.09, 0.001], [0.4495, 2.4, 0.012]));
    for side in [-1.0, 1.0] {
        m.add(
            wood,
            Shape::block([-0.04, 0.09, 0.0125], [0.04, 2.4, 0.026], 0.005).at(0.409 * side, 0.0, 0.0),
        );
    }
    for (low, high) in [(0.09, 0.2), (0.95, 1.05), (2.28, 2.4)] {
        m.add(wood, Shape::block([-0.3685, low, 0.0125], [0.3685, high, 0.026], 0.005));
    }
    for (low, high) in [(0.235, 0.915), (1.085, 2.245)] {
        m.add(field, Shape::block([-0.33, low, 0.003], [0.33, high, 0.023], 0.009));
    }
    m.add(wood, Shape::block([-0.4495, 2.4005, 0.001], [0.4495, 2.44, 0.045], 0.008));
    m
}

/// A sideboard of 2.4 m with four doors.
fn sideboard(d: &mut Document) -> Model {
    let (wood, top, steel) = (
        d.matte("walnut", 0x70482f),
        d.lacquer("sideboard top", 0x3c2a20),
        d.matte("brushed steel", 0x9a9da1),
    );
    let mut m = Model::new();
    m.add(wood, Shape::block([-1.2, 0.12, -0.24], [1.2, 0.82, 0.2], 0.006));
    m.add(top, Shape::block([-1.22, 0.8205, -0.245], [1.22, 0.85, 0.23], 0.006));
    for i in 0..4 {
        let x = -0.9 + 0.6 * f64::from(i);
        m.add(wood, Shape::block([x - 0.292, 0.13, 0.2005], [x + 0.292, 0.81, 0.218], 0.006));
        let side = if i % 2 == 0 { 0.24 } else { -0.24 };
        m.add(steel, rod([x + side, 0.38, 0.24], [x + side, 0.58, 0.24], 0.007, 10));
        for y in [0.39, 0.57] {
            m.add(steel, rod([x + side, y, 0.217], [x + side, y, 0.238], 0.005, 8));
        }
    }
    for (x, z) in [(-1.1, -0.17), (-1.1, 0.15), (1.1, -0.17), (1.1, 0.15)] {
        m.add(steel, Shape::cylinder([x, 0.001, z], 0.025, 0.1185, 16));
    }
    m
}

/// What stands on the sideboard, y = 0 its top.
fn sideboard_things(d: &mut Document) -> Model {
    let (prism, ball) = (d.glass("award glass", 0.06, 0xdff1f4), d.glass("ball glass", 0.12, 0xe9f2df));
    let (stone, clay, tray) =
        (d.matte("award base", 0x55534f), d.matte("vase", 0xc08a4a), d.matte("tray", 0x7d5638));
    let (orange, lime) = (d.matte("orange", 0xd98a2f), d.matte("lime", 0x9db83f));
    let mut m = Model::new();
    m.add(stone, Shape::block([0.3, 0.001, -0.08], [0.5, 0.04, 0.08], 0.006));
    let outline = [dvec2(-0.075, -0.03), dvec2(0.075, -0.03), dvec2(0.075, 0.03), dvec2(-0.075, 0.03)];
    m.add(prism, Shape::prism(&outline, &[(0.0, 0.041), (0.012, 0.3)]).at(0.4, 0.0, 0.0));
    m.add(ball, Shape::cushion([0.07, 0.07, 0.07], 2.0, [14, 14, 14]).at(0.75, 0.084, 0.05));
    m.add(
        stone,
        Shape::lathe(&[(0.0, 0.001), (0.05, 0.001), (0.05, 0.012), (0.032, 0.02), (0.0, 0.0135)], 28)
            .at(0.75, 0.0, 0.05),
    );
    let vase = [
        (0.0, 0.001),
        (0.06, 0.001),
        (0.1, 0.06),
        (0.11, 0.14),
        (0.08, 0.26),
        (0.045, 0.33),
        (0.055, 0.38),
        (0.049, 0.38),
        (0.038, 0.33),
        (0.0, 0.31),
    ];
    m.add(clay, Shape::lathe(&vase, 40).at(-0.85, 0.0, 0.0));
    let bowl = [
        (0.0, 0.001),
        (0.06, 0.001),
        (0.07, 0.008),
        (0.15, 0.07),
        (0.17, 0.085),
        (0.165, 0.089),
        (0.14, 0.074),
        (0.0, 0.014),
    ];
    m.add(tray, Shape::lathe(&bowl, 40).at(-0.2, 0.0, 0.02));
    for (i, (x, y, z)) in
        [(0.06, 0.062, 0.0), (-0.03, 0.062, 0.055), (-0.035, 0.062, -0.05), (0.0, 0.118, 0.0)]
            .into_iter()
            .enumerate()
    {
        let fruit = Shape::cushion([0.038, 0.036, 0.038], 2.0, [6, 6, 6]).at(x - 0.2, y, z + 0.02);
        m.add(if i == 1 { lime } else { orange }, fruit);
    }
    m
}

/// A projector under the ceiling: its mount at y = 0, lens towards +Z.
fn projector(d: &mut Document) -> Model {
    let (case, dark, steel) = (
        d.matte("white plastic", 0xdedcd6),
        d.matte("black plastic", 0x3a3b3e),
        d.matte("brushed steel", 0x9a9da1),
    );
    let mut m = Model::new();
    m.add(steel, Shape::cylinder([0.0, -0.016, 0.0], 0.06, 0.015, 20))
        .add(steel, rod([0.0, -0.32, 0.0], [0.0, -0.0165, 0.0], 0.018, 12));
    m.add(case, Shape::cushion([0.19, 0.06, 0.15], 8.0, [10, 4, 8]).at(0.0, -0.36, 0.0));
    m.add(dark, Shape::cylinder([0.0, 0.0, 0.0], 0.036, 0.03, 24).turn_x(90.0).at(-0.07, -0.36, 0.14));
    m
}

/// A flip chart on three legs with a drawing begun.
fn flip_chart(d: &mut Document) -> Model {
    let (steel, paper, board) =
        (d.matte("brushed steel", 0x9a9da1), d.matte("paper", 0xe2ddcf), d.matte("board", 0xb8bcc0));
    let inks = [0xb03a2e, 0x2f5f8a, 0x3f7d4f].map(|hex| d.tone("ink", hex));
    let mut m = Model::new();
    m.add(board, Shape::block([-0.35, 0.85, -0.012], [0.35, 1.88, 0.0], 0.004));
    m.add(paper, Shape::cuboid([-0.33, 0.9, 0.0005], [0.33, 1.84, 0.008]));
    m.add(steel, Shape::block([-0.34, 1.8405, 0.0005], [0.34, 1.87, 0.02], 0.005));
    m.add(steel, Shape::block([-0.34, 0.84, 0.0005], [0.34, 0.852, 0.05], 0.003));
    for i in 0..5 {
        let (x, h) = (-0.22 + 0.11 * f64::from(i), [0.18, 0.3, 0.25, 0.44, 0.52][i as usize]);
        m.add(inks[i as usize % 3], Shape::cuboid([x - 0.035, 1.05, 0.0083], [x + 0.035, 1.05 + h, 0.0095]));
    }
    m.add(inks[1], Shape::cuboid([-0.28, 1.035, 0.0083], [0.28, 1.044, 0.0095]));
    m.add(inks[0], Shape::cuboid([-0.2, 1.7, 0.0083], [0.12, 1.72, 0.0095]));
    for x in [-0.3, 0.3] {
        m.add(steel, rod([x, 0.002, 0.12], [0.8 * x, 1.82, -0.025], 0.012, 10));
    }
    m.add(steel, rod([0.0, 0.002, -0.55], [0.0, 1.82, -0.04], 0.012, 10));
    m
}

/// Table and what people left on it, chairs around it.
fn meeting(d: &mut Document) {
    let (cx, cz) = (4.5, 3.0);
    let model = table(d);
    let mesh = d.mesh("table", &model);
    d.place("table", mesh, [cx, 0.0, cz], 0.0);
    let model = shell_chair(d);
    let chair = d.mesh("chair", &model);
    let model = tumbler(d);
    let tumbler = d.mesh("tumbler", &model);
    let model = notepad(d);
    let pad = d.mesh("notepad", &model);
    let mut dice = Dice(17);
    let mut seat = 0;
    for side in [-1.0, 1.0] {
        for i in 0..6 {
            seat += 1;
            let x = cx + 0.84 * (f64::from(i) - 2.5);
            let half = 0.8 * (1.0 - ((x - cx).abs() / 2.7).powf(3.2)).powf(1.0 / 3.2);
            let turn = if side < 0.0 { 0.0 } else { 180.0 } + dice.roll(-16.0, 16.0);
            d.place(
                &format!("chair {seat}"),
                chair,
                [x, 0.001, cz + side * (half + dice.roll(0.2, 0.34))],
                turn,
            );
            let across = cz + side * (half - 0.24);
            d.place(&format!("notepad {seat}"), pad, [x, 0.75, across], dice.roll(-10.0, 10.0));
            d.place(&format!("tumbler {seat}"), tumbler, [x + 0.22, 0.75, cz + side * (half - 0.3)], 0.0);
        }
    }
    for side in [-1.0, 1.0] {
        seat += 1;
        let turn = -90.0 * side + dice.roll(-15.0, 15.0);
        d.place(&format!("chair {seat}"), chair, [cx + side * 3.1, 0.001, cz + dice.roll(-0.1, 0.1)], turn);
        d.place(&format!("notepad {seat}"), pad, [cx + side * 2.42, 0.75, cz], 90.0 + dice.roll(-8.0, 8.0));
        d.place(&format!("tumbler {seat}"), tumbler, [cx + side * 2.36, 0.75, cz + 0.2], 0.0);
    }
    let model = carafe(d);
    let mesh = d.mesh("carafe", &model);
    d.place("carafe 1", mesh, [cx - 0.85, 0.75, cz + 0.06], 0.0);
    d.place("carafe 2", mesh, [cx + 0.75, 0.75, cz - 0.1], 0.0);
    let model = telephone(d);
    let mesh = d.mesh("telephone", &model);
    d.place("telephone", mesh, [cx - 0.1, 0.75, cz], 25.0);
}

pub(crate) fn conference() -> Vec<u8> {
    let mut document = Document::new("conference");
    furnish(&mut document);
    document.into_glb()
}

/// The same, and somebody who walks along the panelling.
pub(crate) fn walk() -> Vec<u8> {
    let mut document = Document::new("conference-walk");
    let d = &mut document;
    furnish(d);
    figure(d, [7.9, 0.001, 5.25], -90.0, 4.8);
    d.camera("walk", [2.0, 1.5, 4.2], [5.2, 0.9, 5.2], 55.0, 4.0 / 3.0);
    document.into_glb()
}

fn furnish(d: &mut Document) {
    shell(d);
    carpet(d);
    overhead(d);
    windows(d);
    meeting(d);

    let (trim, leaf) = (d.matte("skirting", 0x70482f), d.matte("door leaf", 0x8c6242));
    let mut base = Model::new();
    let inset = 0.0145;
    for (from, to) in [
        ([WIDTH - 0.001, 0.0], [0.001, 0.0]),
        ([0.001, DEPTH], [1.36, DEPTH]),
        ([2.44, DEPTH], [WIDTH - 0.001, DEPTH]),
        ([0.0, inset], [0.0, DEPTH - inset]),
        ([WIDTH, DEPTH - inset], [WIDTH, inset]),
    ] {
        base.merge(&skirting(trim, from, to), DAffine3::IDENTITY);
    }
    d.add("skirting", &base);
    let model = door(d, leaf, trim);
    let mesh = d.mesh("door", &model);
    d.place("door", mesh, [1.9, 0.0, DEPTH], 180.0);
    let model = panelling(d);
    let mesh = d.mesh("panelling", &model);
    for i in 0..7 {
        d.place(&format!("panelling {}", i + 1), mesh, [2.93 + 0.9 * f64::from(i), 0.0, DEPTH], 180.0);
    }
    d.place("panelling 8", mesh, [0.88, 0.0, DEPTH], 180.0);

    let model = screen(d);
    let mesh = d.mesh("screen", &model);
    d.place("screen", mesh, [WIDTH, 0.0, 3.0], -90.0);
    let model = looking_glass(d);
    let mesh = d.mesh("mirror", &model);
    d.place("mirror north", mesh, [WIDTH, 0.0, 1.05], -90.0);
    d.place("mirror south", mesh, [WIDTH, 0.0, 4.95], -90.0);
    let model = projector(d);
    let mesh = d.mesh("projector", &model);
    d.place("projector", mesh, [4.5, HEIGHT, 3.0], 90.0);
    let model = flip_chart(d);
    let mesh = d.mesh("flip chart", &model);
    d.place("flip chart", mesh, [8.3, 0.001, 5.6], -110.0);

    let model = sideboard(d);
    let mesh = d.mesh("sideboard", &model);
    d.place("sideboard", mesh, [0.27, 0.0, 2.6], 90.0);
    let model = sideboard_things(d);
    let mesh = d.mesh("things on the sideboard", &model);
    d.place("things on the sideboard", mesh, [0.27, 0.85, 2.6], 90.0);
    let mut dice = Dice(8);
    for (name, z) in [("picture 1", 1.9), ("picture 2", 3.3)] {
        let model = picture(d, 1.0, 1.2, trim, &mut dice);
        let mesh = d.mesh(name, &model);
        d.place(name, mesh, [0.0, 1.75, z], 90.0);
    }
    let model = plant(d, 0xd2cbbb, 34, 10, 1.15);
    let mut large = Model::new();
    large.merge(&model, DAffine3::from_scale(DVec3::splat(1.25)));
    let mesh = d.mesh("plant", &large);
    d.place("plant north", mesh, [8.45, 0.001, 0.55], 40.0);
    d.place("plant west", mesh, [0.5, 0.001, 4.6], 130.0);

    for (i, [x, z]) in COFFERS.into_iter().enumerate() {
        d.light(&format!("lamp {}", i + 1), [x, 2.9, z], [1.0, 0.92, 0.8], 40.0);
    }
    d.camera("main", [0.75, 1.75, 5.35], [5.6, 0.85, 2.3], 52.0, 4.0 / 3.0);
    d.camera("screen", [8.35, 1.7, 1.5], [2.6, 0.8, 3.9], 52.0, 4.0 / 3.0);
    d.camera("table", [3.0, 1.25, 4.4], [4.6, 0.75, 2.7], 45.0, 4.0 / 3.0);
}
