//! A furnished office, 4.8 × 4.2 × 2.7 m, two lamps.

use super::furniture::{
    blind, books, desk_lamp, door, door_in_parts, mug, panel_lamp, picture, plant, put, rod, side_chair,
    skirting, task_chair,
};
use super::glb::{Document, Model, Moved, NodeId, Paint};
use super::shape::{Dice, Shape, curve};
use super::shell::{Shell, Side, recess};
use glam::{DAffine3, DQuat, DVec3, dvec2, dvec3};

const WIDTH: f64 = 4.8;
const DEPTH: f64 = 4.2;
const HEIGHT: f64 = 2.7;

/// Walls with a window niche in the north and, if the door `opens`, what is behind it.
fn shell(d: &mut Document, opens: bool) {
    let (wall, ceiling, screed) =
        (d.matte("wall", 0xd9d3c4), d.matte("ceiling", 0xe4e2dc), d.matte("screed", 0x8a7d6d));
    let (accent, sky) = (d.matte("accent wall", 0x9fb0a4), d.matte("sky", 0xa9c4dd));
    let x = [0.0, 0.9, 3.1, WIDTH];
    let still = Shell { x: &x, y: &[-0.013, 0.95, 2.3, HEIGHT], z: &[0.0, 2.1, DEPTH] };
    let opening = Shell { x: &x, y: &[-0.013, 0.95, 2.09, 2.3, HEIGHT], z: &[0.0, 1.55, 2.45, DEPTH] };
    let shell = if opens { opening } else { still };
    let mut m = shell.model(|side, i, j| match side {
        Side::North if i == 1 && (j == 1 || opens && j == 2) => None,
        Side::East if opens && i == 1 && j < 2 => None,
        Side::Floor => Some(screed),
        Side::Ceiling => Some(ceiling),
        Side::East => Some(accent),
        _ => Some(wall),
    });
    let hole = |side, i, j, upper| {
        let ([a, b, ..], [.., c, e]) = (shell.cell(side, i, j), shell.cell(side, i, upper));
        [a, b, c, e]
    };
    recess(&mut m, hole(Side::North, 1, 1, if opens { 2 } else { 1 }), dvec3(0.0, 0.0, -0.3), wall, sky);
    if opens {
        let corridor = d.matte("corridor", 0x8f9aa8);
        recess(&mut m, hole(Side::East, 1, 0, 1), dvec3(0.9, 0.0, 0.0), wall, corridor);
    }
    d.add("shell", &m);
}

/// Oak boards along X in staggered lengths, their tops at y = 0.
fn floor(d: &mut Document) {
    let tones = [0xa9855b, 0xb28e63, 0x9f7b52, 0xba9669];
    let tones: Vec<_> = tones.iter().map(|&hex| d.tone("oak", hex)).collect();
    let mut m = Model::new();
    let mut dice = Dice(7);
    let (rows, gap) = (20, 0.0008);
    let pitch = DEPTH / f64::from(rows);
    for row in 0..rows {
        let (low, high) = (f64::from(row) * pitch + gap, f64::from(row + 1) * pitch - gap);
        let mut x = 0.0;
        while x < WIDTH {
            let mut end = x + if x == 0.0 { dice.roll(0.5, 1.8) } else { 1.8 };
            if end > WIDTH - 0.3 {
                end = WIDTH;
            }
            m.add(dice.pick(&tones), Shape::cuboid([x + gap, -0.012, low], [end - gap, 0.0, high]));
            x = end;
        }
    }
    d.add("floor boards", &m);
}

/// Ceiling tiles, lamps and a smoke detector.
fn overhead(d: &mut Document) {
    let (tile, plastic) = (d.matte("ceiling tile", 0xe6e5e0), d.matte("white plastic", 0xdedcd6));
    let mut m = Model::new();
    for (i, j) in (0..4).flat_map(|i| (0..7).map(move |j| (f64::from(i), f64::from(j)))) {
        m.add(
            tile,
            Shape::cuboid(
                [1.2 * i + 0.006, HEIGHT - 0.012, 0.6 * j + 0.006],
                [1.2 * i + 1.194, HEIGHT - 0.001, 0.6 * j + 0.594],
            ),
        );
    }
    let detector = [(0.0, -0.035), (0.035, -0.035), (0.05, -0.02), (0.055, 0.0), (0.0, 0.0)];
    m.add(plastic, Shape::lathe(&detector, 16).at(2.7, HEIGHT - 0.013, 2.7));
    d.add("ceiling tiles", &m);
    let lamp = panel_lamp(d, 0.58, 0.145);
    let lamp = d.mesh("ceiling lamp", &lamp);
    d.place("ceiling lamp north", lamp, [1.5, HEIGHT - 0.013, 1.5], 0.0);
    d.place("ceiling lamp south", lamp, [3.3, HEIGHT - 0.013, 2.7], 0.0);
}

/// A sash of four bars around glass-less panes: the blind and the sky stand behind.
fn window(d: &mut Document) {
    let (white, stone, steel) =
        (d.matte("window paint", 0xe4e1d8), d.matte("sill", 0xc9c3b6), d.matte("brushed steel", 0x9a9da1));
    let mut m = Model::new();
    let (x0, x1, y0, y1, z) = (0.901, 3.099, 0.951, 2.299, -0.18);
    let mut bar = |min: [f64; 3], max: [f64; 3]| {
        m.add(white, Shape::block(min, max, 0.008));
    };
    bar([x0, y0, z - 0.06], [x1, y0 + 0.06, z]);
    bar([x0, y1 - 0.06, z - 0.06], [x1, y1, z]);
    for x in [x0, 1.965, x1 - 0.07] {
        bar([x, y0 + 0.0605, z - 0.06], [x + 0.07, y1 - 0.0605, z]);
    }
    for (left, right) in [(x0 + 0.0705, 1.9645), (2.0355, x1 - 0.0705)] {
        bar([left, y0 + 0.061, z - 0.05], [right, y0 + 0.11, z + 0.012]);
        bar([left, y1 - 0.11, z - 0.05], [right, y1 - 0.061, z + 0.012]);
        bar([left, y0 + 0.1105, z - 0.05], [left + 0.05, y1 - 0.1105, z + 0.012]);
        bar([right - 0.05, y0 + 0.1105, z - 0.05], [right, y1 - 0.1105, z + 0.012]);
    }
    let handle =
        [[1.94, 1.62, z + 0.012], [1.94, 1.62, z + 0.04], [1.94, 1.6, z + 0.05], [1.94, 1.5, z + 0.05]];
    m.add(steel, Shape::tube(&curve(&handle, 3), 0.008, 7));
    m.add(stone, Shape::block([0.84, 0.915, 0.001], [3.16, 0.95, 0.17], 0.008));
    for (a, b) in [([0.84, 0.951], [0.899, 2.36]), ([3.101, 0.951], [3.16, 2.36])] {
        m.add(white, Shape::block([a[0], a[1], 0.001], [b[0], b[1], 0.018], 0.004));
    }
    m.add(white, Shape::block([0.8995, 2.301, 0.001], [3.1005, 2.36, 0.018], 0.004));
    d.add("window", &m);
    let blind = blind(d, 2.16, 21, -42.0);
    let blind = d.mesh("blind", &blind);
    d.place("blind", blind, [2.0, 2.285, -0.09], 0.0);
}

/// A column radiator under the window.
fn radiator(d: &mut Document) {
    let (paint, copper) = (d.matte("radiator", 0xdcd8ce), d.matte("copper", 0xa5744f));
    let mut m = Model::new();
    for i in 0..13 {
        let x = 1.36 + 0.06 * f64::from(i);
        m.add(paint, Shape::block([x, 0.14, 0.05], [x + 0.045, 0.74, 0.15], 0.014));
    }
    for y in [0.2, 0.68] {
        m.add(paint, rod([1.35, y, 0.1], [2.136, y, 0.1], 0.018, 8));
    }
    let pipe = [[2.13, 0.2, 0.1], [2.21, 0.2, 0.1], [2.24, 0.17, 0.1], [2.24, 0.001, 0.1]];
    m.add(copper, Shape::tube(&curve(&pipe, 3), 0.009, 7));
    m.add(
        d.matte("white plastic", 0xdedcd6),
        Shape::cylinder([0.0, 0.0, 0.0], 0.022, 0.06, 12).turn_z(-90.0).at(2.14, 0.68, 0.1),
    );
    d.add("radiator", &m);
}

/// A desk of 1.7 × 0.8 m with three drawers under its left end.
fn desk(d: &mut Document) -> Model {
    let (top, body, steel) =
        (d.matte("desk top", 0xb98d5c), d.matte("desk body", 0xcfc9bc), d.matte("brushed steel", 0x9a9da1));
    let edge = d.matte("desk edge", 0x8f6a43);
    let mut m = Model::new();
    m.add(top, Shape::block([-0.85, 0.722, -0.4], [0.85, 0.75, 0.394], 0.004));
    m.add(edge, Shape::block([-0.85, 0.722, 0.3945], [0.85, 0.75, 0.404], 0.004));
    m.add(body, Shape::block([-0.82, 0.06, -0.33], [-0.4, 0.7215, 0.33], 0.005));
    m.add(d.matte("black plastic", 0x3a3b3e), Shape::block([-0.8, 0.001, -0.3], [-0.42, 0.0595, 0.3], 0.004));
    for (low, high) in [(0.07, 0.36), (0.366, 0.54), (0.546, 0.715)] {
        m.add(body, Shape::block([-0.815, low, 0.3305], [-0.405, high, 0.35], 0.006));
        let y = high - 0.06;
        let pull = [
            [-0.68, y, 0.348],
            [-0.68, y, 0.375],
            [-0.66, y, 0.382],
            [-0.56, y, 0.382],
            [-0.54, y, 0.375],
            [-0.54, y, 0.348],
        ];
        m.add(steel, Shape::tube(&curve(&pull, 2), 0.006, 5));
    }
    m.add(steel, Shape::cylinder([0.0, 0.0, 0.0], 0.009, 0.004, 10).turn_x(90.0).at(-0.44, 0.655, 0.3503));
    for z in [-0.34, 0.34] {
        m.add(steel, Shape::block([0.76, 0.03, z - 0.025], [0.81, 0.7215, z + 0.025], 0.006));
    }
    m.add(steel, Shape::block([0.755, 0.001, -0.38], [0.815, 0.0295, 0.38], 0.008));
    m.add(body, Shape::block([-0.3995, 0.3, -0.34], [0.7595, 0.7, -0.322], 0.004));
    m
}

/// What lies on the desk, in the desk's frame, y = 0 its top.
fn desk_things(d: &mut Document) -> Model {
    let (dark, key, screen) =
        (d.matte("black plastic", 0x3a3b3e), d.matte("key", 0x5a5c61), d.lacquer("screen", 0x23272e));
    let (paper, note) = (d.matte("paper", 0xe2ddcf), d.matte("sticky note", 0xe3cf6a));
    let mut m = Model::new();
    // Monitor.
    let mut monitor = Model::new();
    monitor.add(dark, Shape::block([-0.12, 0.001, -0.09], [0.12, 0.014, 0.09], 0.006));
    monitor.add(dark, Shape::block([-0.03, 0.0145, -0.045], [0.03, 0.3, -0.025], 0.006));
    monitor.add(dark, Shape::block([-0.29, 0.15, -0.0245], [0.29, 0.5, 0.008], 0.008));
    monitor.add(dark, Shape::block([-0.29, 0.15, 0.0085], [0.29, 0.168, 0.018], 0.004));
    monitor.add(dark, Shape::block([-0.29, 0.488, 0.0085], [0.29, 0.5, 0.018], 0.004));
    for side in [-1.0, 1.0] {
        monitor.add(
            dark,
            Shape::block([-0.006, 0.1685, 0.0085], [0.006, 0.4875, 0.018], 0.003).at(0.284 * side, 0.0, 0.0),
        );
    }
    monitor.add(screen, Shape::cuboid([-0.2775, 0.169, 0.0085], [0.2775, 0.487, 0.012]));
    monitor.add(note, Shape::cuboid([0.2, 0.19, 0.0185], [0.27, 0.26, 0.0195]).turn_z(-3.0));
    m.merge(&monitor, put(0.1, 0.0, -0.17, -8.0));
    // Keyboard: four rows of caps and a space bar.
    let mut keyboard = Model::new();
    keyboard.add(dark, Shape::block([-0.22, 0.001, -0.07], [0.22, 0.016, 0.07], 0.005));
    let cap = |x: f64, z: f64, w: f64| {
        let outline = [dvec2(-w, -0.0082), dvec2(w, -0.0082), dvec2(w, 0.0082), dvec2(-w, 0.0082)];
        Shape::prism(&outline, &[(0.0, 0.0165), (0.002, 0.0225)]).at(x, 0.0, z)
    };
    for row in 0..4 {
        for column in 0..14 {
            keyboard.add(
                key,
                cap(
                    -0.2 + 0.0195 * f64::from(column) + 0.004 * f64::from(row),
                    -0.052 + 0.0195 * f64::from(row),
                    0.0085,
                ),
            );
        }
        for column in 0..3 {
            keyboard
                .add(key, cap(0.166 + 0.0195 * f64::from(column), -0.052 + 0.0195 * f64::from(row), 0.0085));
        }
    }
    for (x, w) in [(-0.19, 0.0125), (-0.155, 0.0125), (-0.06, 0.068), (0.03, 0.0125), (0.065, 0.0125)] {
        keyboard.add(key, cap(x, 0.026, w));
    }
    m.merge(&keyboard, put(0.08, 0.0, 0.17, -2.0));
    let mouse = Shape::cushion([0.032, 0.019, 0.055], 2.6, [4, 3, 5])
        .warp(|p| dvec3(p.x, p.y.max(-0.008) - 0.05 * p.z, p.z));
    m.add(dark, mouse.turn_y(12.0).at(0.42, 0.0135, 0.19));
    m.add(d.matte("mouse pad", 0x58687a), Shape::block([0.33, 0.001, 0.07], [0.54, 0.004, 0.31], 0.001));
    // Paper, a notebook, pens in a pot.
    let mut dice = Dice(3);
    for sheet in 0..6 {
        let y = 0.001 + 0.0015 * f64::from(sheet);
        m.add(
            paper,
            Shape::cuboid([-0.105, y, -0.148], [0.105, y + 0.001, 0.148])
                .turn_y(dice.roll(-7.0, 9.0))
                .at(-0.36, 0.0, 0.1),
        );
    }
    m.add(
        d.matte("notebook", 0x8c3b32),
        Shape::block([-0.075, 0.001, -0.105], [0.075, 0.016, 0.105], 0.003).turn_y(24.0).at(-0.66, 0.0, 0.17),
    );
    let pens = [0x35577d, 0xa8623a, 0x486b4a].map(|hex| d.tone("pen", hex));
    let pot =
        [(0.0, 0.0), (0.038, 0.0), (0.04, 0.003), (0.04, 0.1), (0.037, 0.1), (0.036, 0.006), (0.0, 0.006)];
    m.add(d.tone("pot", 0x5d6f7d), Shape::lathe(&pot, 14).at(0.62, 0.001, -0.2));
    for (i, &pen) in pens.iter().enumerate() {
        let a = 2.1 * i as f64 + 0.4;
        m.add(
            pen,
            rod(
                [0.62 - 0.012 * a.cos(), 0.009, -0.2 - 0.012 * a.sin()],
                [0.62 + 0.03 * a.cos(), 0.165, -0.2 + 0.03 * a.sin()],
                0.004,
                6,
            ),
        );
    }
    let cup = mug(d, "mug blue", 0x4f7fa3);
    m.merge(&cup, put(0.62, 0.001, 0.05, 30.0));
    let lamp = desk_lamp(d);
    m.merge(&lamp, put(-0.66, 0.001, -0.22, -25.0));
    m
}

/// A bookcase of `width` × 2.0 m, open to the front, six shelves of books and things.
fn bookcase(d: &mut Document, width: f64, seed: u64) -> Model {
    let wood = d.matte("birch", 0xc9a878);
    let mut m = Model::new();
    let (x, t) = (0.5 * width, 0.022);
    for side in [-1.0, 1.0] {
        m.add(
            wood,
            Shape::block([-0.5 * t, 0.001, -0.15], [0.5 * t, 2.0, 0.15], 0.003).at(
                side * (x - 0.5 * t),
                0.0,
                0.0,
            ),
        );
    }
    m.add(wood, Shape::cuboid([t - x + 0.0005, 0.06, -0.15], [x - t - 0.0005, 1.999, -0.142]));
    m.add(wood, Shape::block([t - x + 0.0005, 0.001, 0.1], [x - t - 0.0005, 0.0595, 0.118], 0.002));
    let levels = [0.06, 0.42, 0.76, 1.08, 1.4, 1.7, 1.978];
    for y in levels {
        m.add(wood, Shape::block([t - x + 0.0005, y, -0.1415], [x - t - 0.0005, y + t, 0.145], 0.003));
    }
    let mut dice = Dice(seed);
    let inner = width - 2.0 * t - 0.01;
    let box_paint = d.matte("box file", 0x6e8795);
    for (level, pair) in levels.windows(2).enumerate() {
        let (base, room) = (pair[0] + t + 0.0005, pair[1] - pair[0] - t);
        let used = inner * if level == 3 { 0.45 } else { dice.roll(0.6, 0.98) };
        let row = books(d, used, (room - 0.03).min(0.3), &mut dice);
        m.merge(&row, put(0.005 + t - x, base, 0.1, 0.0));
        let left = used + t - x + 0.03;
        let space = x - t - 0.02 - left;
        if level == 0 && space > 0.1 {
            m.add(box_paint, Shape::block([left, base, -0.12], [left + 0.09, base + 0.28, 0.09], 0.004));
        }
        if level == 3 {
            let vase = [
                (0.0, 0.0),
                (0.04, 0.0),
                (0.075, 0.06),
                (0.08, 0.1),
                (0.045, 0.18),
                (0.03, 0.2),
                (0.038, 0.23),
                (0.033, 0.23),
                (0.025, 0.2),
                (0.0, 0.19),
            ];
            m.add(d.matte("vase", 0xb4583c), Shape::lathe(&vase, 20).at(left + 0.5 * space, base, 0.0));
        }
    }
    let crate_paint = d.matte("card box", 0xb09067);
    m.add(crate_paint, Shape::block([-0.3, 2.0005, -0.12], [0.05, 2.2, 0.12], 0.004).turn_y(4.0));
    m
}

/// A low cabinet with two doors, a printer on top.
fn cabinet(d: &mut Document) -> Model {
    let (body, steel, grey) = (
        d.matte("desk body", 0xcfc9bc),
        d.matte("brushed steel", 0x9a9da1),
        d.matte("grey plastic", 0x6d7076),
    );
    let (light, paper, top) =
        (d.matte("white plastic", 0xdedcd6), d.matte("paper", 0xe2ddcf), d.matte("birch", 0xc9a878));
    let mut m = Model::new();
    m.add(body, Shape::block([-0.6, 0.06, -0.22], [0.6, 0.75, 0.2], 0.004));
    m.add(grey, Shape::block([-0.57, 0.001, -0.2], [0.57, 0.0595, 0.17], 0.003));
    m.add(top, Shape::block([-0.61, 0.7505, -0.225], [0.61, 0.775, 0.23], 0.004));
    for side in [-1.0, 1.0] {
        m.add(
            body,
            Shape::block([-0.296, 0.07, 0.2005], [0.296, 0.742, 0.218], 0.004).at(0.299 * side, 0.0, 0.0),
        );
        m.add(steel, rod([0.05 * side, 0.4, 0.235], [0.05 * side, 0.56, 0.235], 0.006, 7));
    }
    m.add(light, Shape::block([-0.45, 0.7755, -0.18], [0.0, 0.93, 0.17], 0.02));
    m.add(grey, Shape::block([-0.42, 0.9305, -0.16], [-0.03, 0.965, 0.1], 0.012));
    m.add(grey, Shape::block([-0.38, 0.81, 0.1705], [-0.07, 0.822, 0.29], 0.004));
    m.add(paper, Shape::cuboid([-0.33, 0.8225, 0.1], [-0.12, 0.828, 0.3]));
    let mut dice = Dice(11);
    for i in 0..3 {
        let y = 0.776 + 0.036 * f64::from(i);
        let cover = d.tone("cover", [0x35577d, 0xb59a5b, 0x8c3b32][i as usize]);
        m.add(
            cover,
            Shape::block([-0.11, y, -0.15], [0.11, y + 0.035, 0.15], 0.004)
                .turn_y(dice.roll(-12.0, 12.0))
                .at(0.2, 0.0, 0.0),
        );
    }
    m
}

/// A woven rug with a striped field.
fn rug(d: &mut Document) -> Model {
    let stripes = [0x8e4a3f, 0xc8b391, 0x5d6b73, 0xc8b391, 0xa8763f, 0xc8b391].map(|hex| d.tone("wool", hex));
    let mut m = Model::new();
    for row in 0..24 {
        let x = -1.08 + 0.09 * f64::from(row);
        m.add(stripes[row as usize % 6], Shape::cuboid([x + 0.0002, 0.001, -0.75], [x + 0.0898, 0.01, 0.75]));
    }
    m
}

/// Lathe-turned tapered bin with some crumpled paper.
fn bin(d: &mut Document) -> Model {
    let (metal, paper) = (d.matte("bin", 0x4d6a5c), d.matte("paper", 0xe2ddcf));
    let mut m = Model::new();
    let outline = [
        (0.0, 0.001),
        (0.11, 0.001),
        (0.115, 0.006),
        (0.145, 0.3),
        (0.149, 0.306),
        (0.145, 0.31),
        (0.138, 0.3),
        (0.11, 0.012),
        (0.0, 0.012),
    ];
    m.add(metal, Shape::lathe(&outline, 20));
    let mut dice = Dice(5);
    for i in 0..2 {
        let seed = 10.0 * f64::from(i);
        let ball = Shape::cushion([0.045, 0.04, 0.045], 2.0, [3, 3, 3]);
        let crumple =
            |p: DVec3| p * (1.0 + 0.25 * (90.0 * p.x + seed).sin() * (80.0 * p.y + 70.0 * p.z).cos());
        let ball = ball.warp(crumple).smooth(10.0);
        m.add(paper, ball.at(dice.roll(-0.06, 0.06), 0.2 + 0.02 * f64::from(i), dice.roll(-0.06, 0.06)));
    }
    m
}

/// A wall clock, its back at z = 0.
fn clock(d: &mut Document) -> Model {
    let (rim, face, hand) =
        (d.matte("black plastic", 0x3a3b3e), d.matte("mount", 0xe6e1d6), d.matte("clock hand", 0x2c2d30));
    let mut m = Model::new();
    let outline = [(0.135, 0.001), (0.15, 0.004), (0.15, 0.03), (0.14, 0.034), (0.135, 0.02), (0.135, 0.001)];
    m.add(rim, Shape::lathe(&outline, 24).turn_x(90.0))
        .add(face, Shape::cylinder([0.0, 0.001, 0.0], 0.137, 0.015, 24).turn_x(90.0));
    for hour in 0..12 {
        let mark = Shape::cuboid([-0.003, 0.1, 0.0165], [0.003, 0.122, 0.018]);
        m.add(hand, mark.turn_z(30.0 * f64::from(hour)));
    }
    m.add(hand, Shape::cuboid([-0.004, -0.015, 0.0185], [0.004, 0.07, 0.02]).turn_z(-305.0));
    m.add(hand, Shape::cuboid([-0.003, -0.02, 0.0205], [0.003, 0.1, 0.022]).turn_z(-60.0));
    m
}

/// A small wall plate, its back at z = 0.
fn plate(paint: Paint, knob: Paint) -> Model {
    let mut m = Model::new();
    m.add(paint, Shape::block([-0.04, -0.04, 0.001], [0.04, 0.04, 0.009], 0.003));
    m.add(knob, Shape::block([-0.022, -0.03, 0.0095], [0.022, 0.03, 0.014], 0.002));
    m
}

pub(crate) fn office() -> Vec<u8> {
    let mut document = Document::new("office");
    furnish(&mut document, None);
    document.into_glb()
}

/// The same for 6 s: the chair turns, the door opens and a lamp is carried through.
pub(crate) fn moving() -> Vec<u8> {
    let mut document = Document::new("office-moving");
    let mut moved = None;
    let d = &mut document;
    furnish(d, Some(&mut moved));
    let (chair, leaf) = moved.expect("they were placed");
    let steel = d.matte("brushed steel", 0x9a9da1);
    let mut lamp = Model::new();
    lamp.add(d.matte("lamp shade", 0xd8c9a3), Shape::lathe(&[(0.05, 0.3), (0.09, 0.16)], 24));
    lamp.add(steel, Shape::tube(&curve(&[[0.0, 0.3, 0.0], [0.0, 0.5, 0.0]], 2), 0.004, 6));
    lamp.add(steel, Shape::cylinder([0.0, 0.29, 0.0], 0.05, 0.012, 24));
    let mesh = d.mesh("carried lamp", &lamp);
    d.place("carried lamp", mesh, [4.2, 1.3, 2.0], 0.0);
    let carried = d.last();
    d.light("carried light", [0.0, 0.0, 0.0], [1.0, 0.86, 0.62], 14.0);
    d.hang(carried, 1);

    let turn = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians()).to_array().to_vec();
    let round = (0..=12).map(|i| (0.5 * f64::from(i), turn(205.0 + 60.0 * f64::from(i))));
    d.animate("chair", Moved::Rotation(chair), &round.collect::<Vec<_>>());
    let swing = [(0.0, 0.0), (0.5, 0.0), (1.5, -35.0), (2.5, -82.0), (4.5, -82.0), (6.0, 0.0)];
    d.animate("door", Moved::Rotation(leaf), &swing.map(|(time, degrees)| (time, turn(degrees))));
    let way = [
        [4.2, 1.3, 2.0],
        [3.8, 1.32, 2.5],
        [3.1, 1.3, 2.9],
        [2.3, 1.34, 3.0],
        [1.5, 1.3, 2.8],
        [1.0, 1.33, 2.2],
        [0.95, 1.3, 1.5],
    ];
    let steps = curve(&way, 4);
    let last = steps.len() - 1;
    let keys = steps.iter().enumerate().map(|(i, at)| (6.0 * i as f64 / last as f64, at.to_array().to_vec()));
    d.animate("lamp", Moved::Translation(carried), &keys.collect::<Vec<_>>());
    document.into_glb()
}

/// Everything in the room; of one that `moves` the chair and the door's leaf are told.
fn furnish(d: &mut Document, moves: Option<&mut Option<(NodeId, NodeId)>>) {
    let opens = moves.is_some();
    shell(d, opens);
    floor(d);
    overhead(d);
    window(d);
    radiator(d);

    let trim = d.matte("skirting", 0xdad6cb);
    let mut base = Model::new();
    let inset = 0.0145;
    for (from, to) in [
        ([WIDTH - 0.001, 0.0], [0.001, 0.0]),
        ([0.001, DEPTH], [WIDTH - 0.001, DEPTH]),
        ([0.0, inset], [0.0, DEPTH - inset]),
        ([WIDTH, DEPTH - inset], [WIDTH, 2.54]),
        ([WIDTH, 1.46], [WIDTH, inset]),
    ] {
        base.merge(&skirting(trim, from, to), DAffine3::IDENTITY);
    }
    d.add("skirting", &base);

    let (leaf, walnut) = (d.matte("door leaf", 0xb9b29f), d.matte("walnut", 0x7d5638));
    let mut hinged = None;
    if opens {
        let (frame, panel) = door_in_parts(d, leaf, trim);
        let mesh = d.mesh("door frame", &frame);
        d.place("door frame", mesh, [WIDTH, 0.0, 2.0], -90.0);
        // Hinges are at the leaf's left edge.
        let mut on_hinges = Model::new();
        on_hinges.merge(&panel, DAffine3::from_translation(DVec3::new(0.452, 0.0, -0.032)));
        let mesh = d.mesh("door", &on_hinges);
        d.place("door hinges", mesh, [WIDTH - 0.032, 0.0, 2.0 - 0.452], -90.0);
        hinged = Some(d.last());
    } else {
        let model = door(d, leaf, trim);
        let mesh = d.mesh("door", &model);
        d.place("door", mesh, [WIDTH, 0.0, 2.0], -90.0);
    }
    let (white, grey) = (d.matte("white plastic", 0xdedcd6), d.matte("lamp rim", 0xb9bbbd));
    let mesh = d.mesh("wall plate", &plate(white, grey));
    d.place("light switch", mesh, [WIDTH, 1.1, 2.65], -90.0);
    d.place("socket east", mesh, [WIDTH, 0.3, 3.2], -90.0);
    d.place("socket west", mesh, [0.0, 0.3, 1.3], 90.0);

    let model = desk(d);
    let mesh = d.mesh("desk", &model);
    let desk_at = [1.95, 0.0, 0.72];
    d.place("desk", mesh, desk_at, 0.0);
    let model = desk_things(d);
    let mesh = d.mesh("things on the desk", &model);
    d.place("things on the desk", mesh, [desk_at[0], 0.75, desk_at[2]], 0.0);
    let model = rug(d);
    let mesh = d.mesh("rug", &model);
    d.place("rug", mesh, [2.1, 0.0, 2.15], 0.0);
    let model = task_chair(d, "chair fabric", 0x46688a);
    let mesh = d.mesh("task chair", &model);
    d.place("task chair", mesh, [2.15, 0.011, 1.62], 205.0);
    if let Some(moves) = moves {
        *moves = hinged.map(|hinged| (d.last(), hinged));
    }
    let model = side_chair(d, "visitor fabric", 0xb0603c);
    let mesh = d.mesh("visitor chair", &model);
    d.place("visitor chair", mesh, [4.32, 0.0, 0.95], -75.0);
    d.place("spare chair", mesh, [0.42, 0.0, 1.2], 80.0);

    let model = bookcase(d, 1.1, 21);
    let mesh = d.mesh("bookcase", &model);
    d.place("bookcase", mesh, [4.02, 0.0, 0.17], 0.0);
    let model = cabinet(d);
    let mesh = d.mesh("cabinet", &model);
    d.place("cabinet", mesh, [0.25, 0.0, 2.5], 90.0);
    let model = plant(d, 0xa4674a, 15, 5, 0.75);
    let mesh = d.mesh("plant", &model);
    d.place("plant", mesh, [0.45, 0.001, 0.5], 20.0);
    let model = plant(d, 0xd2cbbb, 7, 3, 0.22);
    let mut small = Model::new();
    small.merge(&model, DAffine3::from_scale(DVec3::splat(0.5)));
    let mesh = d.mesh("small plant", &small);
    d.place("small plant", mesh, [2.86, 0.951, 0.02], 0.0);
    let model = bin(d);
    let mesh = d.mesh("waste bin", &model);
    d.place("waste bin", mesh, [3.1, 0.0, 0.75], 0.0);

    let mut dice = Dice(42);
    for (name, width, height, at, turn) in [
        ("picture east", 0.7, 0.9, [WIDTH, 1.6, 0.92], -90.0),
        ("picture west", 0.9, 0.6, [0.0, 1.55, 2.2], 90.0),
        ("picture west small", 0.4, 0.5, [0.0, 1.55, 3.1], 90.0),
        ("picture south", 1.2, 0.8, [1.8, 1.6, DEPTH], 180.0),
    ] {
        let model = picture(d, width, height, walnut, &mut dice);
        let mesh = d.mesh(name, &model);
        d.place(name, mesh, at, turn);
    }
    let model = clock(d);
    let mesh = d.mesh("clock", &model);
    d.place("clock", mesh, [WIDTH, 2.4, 2.0], -90.0);

    let (warm, intensity) = ([1.0, 0.93, 0.82], if opens { 8.0 } else { 30.0 });
    d.light("lamp north", [1.5, 2.2, 1.5], warm, intensity);
    d.light("lamp south", [3.3, 2.2, 2.7], warm, intensity);
    d.camera("main", [0.7, 1.6, 4.0], [2.6, 0.88, 0.75], 57.0, 4.0 / 3.0);
    d.camera("door", [4.45, 1.6, 3.4], [1.1, 0.85, 1.0], 55.0, 4.0 / 3.0);
    d.camera("desk", [2.95, 1.3, 1.75], [1.75, 0.82, 0.5], 42.0, 4.0 / 3.0);
}
