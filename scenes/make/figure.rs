//! A figure of about 20 000 triangles that walks: bones, a skin over them and 4 steps of 0.6 s each way.

use super::glb::{Document, Moved, NodeId, Weights};
use super::shape::Shape;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// Name, parent and place at rest (m): it stands at the origin and looks along +Z, its left towards +X.
const JOINTS: [(&str, Option<usize>, [f64; 3]); 16] = [
    ("hips", None, [0.0, 0.95, 0.0]),
    ("spine", Some(0), [0.0, 1.1, 0.0]),
    ("chest", Some(1), [0.0, 1.3, 0.0]),
    ("head", Some(2), [0.0, 1.52, 0.0]),
    ("left thigh", Some(0), [0.1, 0.92, 0.0]),
    ("left shin", Some(4), [0.1, 0.5, 0.0]),
    ("left foot", Some(5), [0.1, 0.09, 0.0]),
    ("right thigh", Some(0), [-0.1, 0.92, 0.0]),
    ("right shin", Some(7), [-0.1, 0.5, 0.0]),
    ("right foot", Some(8), [-0.1, 0.09, 0.0]),
    ("left arm", Some(2), [0.2, 1.42, 0.0]),
    ("left forearm", Some(10), [0.23, 1.14, 0.0]),
    ("left hand", Some(11), [0.26, 0.88, 0.0]),
    ("right arm", Some(2), [-0.2, 1.42, 0.0]),
    ("right forearm", Some(13), [-0.23, 1.14, 0.0]),
    ("right hand", Some(14), [-0.26, 0.88, 0.0]),
];

/// A closed body of elliptical rings: where each is, and its half axes along x and z; smooth between them.
fn rings(segments: usize, rows: usize, rings: &[([f64; 3], f64, f64)]) -> Shape {
    let last = rings.len() - 1;
    Shape::sheet(segments, rows, 60.0, |u, v| {
        let at = v * last as f64;
        let (low, share) = ((at as usize).min(last - 1), at - (at as usize).min(last - 1) as f64);
        let (a, b) = (&rings[low], &rings[low + 1]);
        // Ends are round: there radii grow by a root.
        let grown = match (a.1, b.1) {
            (0.0, _) => (share * (2.0 - share)).sqrt(),
            (_, 0.0) => 1.0 - (1.0 - share * share).sqrt(),
            _ => share * share * (3.0 - 2.0 * share),
        };
        let mix = |a: f64, b: f64, share: f64| a + share * (b - a);
        let [x, y, z] = [0, 1, 2].map(|i| mix(a.0[i], b.0[i], share));
        let turn = (u * segments as f64).round() as usize % segments;
        let (sin, cos) = (turn as f64 / segments as f64 * TAU).sin_cos();
        dvec3(x + mix(a.1, b.1, grown) * cos, y, z - mix(a.2, b.2, grown) * sin)
    })
}

/// Along heights from the top down: which joint, and where the next takes over.
fn by_height(chain: &[(u8, f64)], y: f64) -> ([u8; 2], f64) {
    const BLEND: f64 = 0.06;
    for pair in chain.windows(2) {
        let ((above, _), (below, height)) = (pair[0], pair[1]);
        if y > height + BLEND {
            return ([above, below], 0.0);
        }
        if y > height - BLEND {
            let share = (height + BLEND - y) / (2.0 * BLEND);
            return ([above, below], share * share * (3.0 - 2.0 * share));
        }
    }
    ([chain[chain.len() - 1].0, 0], 0.0)
}

/// Walks from `start` for so many seconds, the way that +Z goes when turned by `degrees` about Y.
pub(crate) fn figure(d: &mut Document, start: [f64; 3], degrees: f64, seconds: f64) {
    let (shirt, trousers) = (d.matte("shirt", 0x8c4a3f), d.matte("trousers", 0x3d4a5c));
    let (skin, shoe) = (d.matte("skin", 0xc69a7c), d.matte("shoe", 0x3a2f28));
    let torso = rings(
        56,
        52,
        &[
            ([0.0, 0.84, 0.0], 0.0, 0.0),
            ([0.0, 0.92, 0.0], 0.165, 0.115),
            ([0.0, 1.1, 0.0], 0.135, 0.1),
            ([0.0, 1.28, 0.0], 0.17, 0.12),
            ([0.0, 1.4, 0.0], 0.185, 0.11),
            ([0.0, 1.47, 0.0], 0.1, 0.075),
            ([0.0, 1.5, 0.0], 0.0, 0.0),
        ],
    );
    let of_torso = |p: DVec3| by_height(&[(3, 2.0), (2, 1.52), (1, 1.24), (0, 1.06)], p.y);
    let head = rings(
        36,
        26,
        &[
            ([0.0, 1.44, -0.01], 0.0, 0.0),
            ([0.0, 1.48, -0.01], 0.055, 0.06),
            ([0.0, 1.56, 0.0], 0.055, 0.065),
            ([0.0, 1.66, 0.01], 0.082, 0.1),
            ([0.0, 1.72, 0.01], 0.08, 0.098),
            ([0.0, 1.8, 0.0], 0.0, 0.0),
        ],
    );
    let of_head = |p: DVec3| by_height(&[(3, 2.0), (2, 1.5)], p.y);
    let mut parts: Vec<(_, Shape, Weights<'_>)> = vec![(shirt, torso, &of_torso), (skin, head, &of_head)];

    let leg = |x: f64| {
        rings(
            36,
            42,
            &[
                ([x, 0.06, -0.01], 0.0, 0.0),
                ([x, 0.1, -0.01], 0.045, 0.05),
                ([x, 0.3, -0.01], 0.055, 0.062),
                ([x, 0.5, 0.0], 0.055, 0.06),
                ([x, 0.75, 0.0], 0.08, 0.085),
                ([x, 0.92, 0.0], 0.085, 0.1),
                ([x, 0.98, 0.0], 0.0, 0.0),
            ],
        )
    };
    let foot = |x: f64| {
        let sole = Shape::cushion([0.048, 0.045, 0.13], 3.0, [8, 4, 14]);
        sole.at(x, 0.0455, 0.055)
    };
    let arm = |side: f64| {
        rings(
            26,
            34,
            &[
                ([side * 0.262, 0.84, 0.0], 0.0, 0.0),
                ([side * 0.26, 0.88, 0.0], 0.03, 0.032),
                ([side * 0.23, 1.14, 0.0], 0.04, 0.042),
                ([side * 0.21, 1.36, 0.0], 0.05, 0.055),
                ([side * 0.19, 1.43, 0.0], 0.05, 0.055),
                ([side * 0.18, 1.47, 0.0], 0.0, 0.0),
            ],
        )
    };
    let hand = |side: f64| {
        let hand = [
            ([side * 0.272, 0.7, 0.015], 0.0, 0.0),
            ([side * 0.27, 0.75, 0.01], 0.018, 0.035),
            ([side * 0.265, 0.82, 0.005], 0.022, 0.042),
            ([side * 0.26, 0.89, 0.0], 0.0, 0.0),
        ];
        rings(20, 14, &hand)
    };
    let of_leg = |first: u8| {
        move |p: DVec3| by_height(&[(0, 2.0), (first, 0.93), (first + 1, 0.5), (first + 2, 0.08)], p.y)
    };
    let of_arm = |first: u8| {
        move |p: DVec3| by_height(&[(2, 2.0), (first, 1.44), (first + 1, 1.14), (first + 2, 0.87)], p.y)
    };
    let of_one = |joint: u8| move |_: DVec3| ([joint, 0], 0.0);
    let (left_leg, right_leg, left_arm, right_arm) = (of_leg(4), of_leg(7), of_arm(10), of_arm(13));
    let (left_foot, right_foot, left_hand, right_hand) = (of_one(6), of_one(9), of_one(12), of_one(15));
    parts.push((trousers, leg(0.1), &left_leg));
    parts.push((trousers, leg(-0.1), &right_leg));
    parts.push((shoe, foot(0.1), &left_foot));
    parts.push((shoe, foot(-0.1), &right_foot));
    parts.push((shirt, arm(1.0), &left_arm));
    parts.push((shirt, arm(-1.0), &right_arm));
    parts.push((skin, hand(1.0), &left_hand));
    parts.push((skin, hand(-1.0), &right_hand));
    let joints = d.skinned("figure", &parts, &JOINTS);
    walk(d, &joints, start, degrees, seconds);
}

/// Steps of 0.6 s. Feet stay level, and the lower one on the floor.
fn walk(d: &mut Document, joints: &[NodeId], start: [f64; 3], degrees: f64, seconds: f64) {
    const PACE: f64 = 1.15; // m/s
    let heading = DQuat::from_rotation_y(degrees.to_radians());
    let count = (seconds / 0.05).round() as usize;
    let times: Vec<f64> = (0..=count).map(|i| 0.05 * i as f64).collect();
    let phase = |time: f64, right: bool| time / 1.2 * TAU + if right { PI } else { 0.0 };
    // Forward is −X's turn of a leg that hangs down.
    let hip = |phase: f64| 24.0 * phase.cos();
    let knee = |phase: f64| 6.0 + 52.0 * (-phase.sin()).max(0.0).powf(1.5);
    let bent = |degrees: f64| DQuat::from_rotation_x((-degrees).to_radians());
    let turned = |rotation: DQuat| rotation.to_array().to_vec();
    let keys = |of: &dyn Fn(f64) -> Vec<f64>| times.iter().map(|&time| (time, of(time))).collect::<Vec<_>>();
    let reach = |time: f64| {
        let leg = |right| {
            let phase = phase(time, right);
            let (hip, shin) = (hip(phase).to_radians(), (hip(phase) - knee(phase)).to_radians());
            0.42 * hip.cos() + 0.41 * shin.cos() + 0.09
        };
        leg(false).max(leg(true)) + 0.033
    };
    d.animate(
        "walk",
        Moved::Translation(joints[0]),
        &keys(&|time| {
            let ahead = heading * dvec3(0.0, 0.0, PACE * time);
            (DVec3::from(start) + ahead + dvec3(0.0, reach(time), 0.0)).to_array().to_vec()
        }),
    );
    d.animate(
        "walk",
        Moved::Rotation(joints[0]),
        &keys(&|time| {
            turned(heading * DQuat::from_rotation_y(5.0_f64.to_radians() * phase(time, true).cos()))
        }),
    );
    d.animate(
        "walk",
        Moved::Rotation(joints[2]),
        &keys(&|time| turned(DQuat::from_rotation_y(10.0_f64.to_radians() * phase(time, false).cos()))),
    );
    for (first, right) in [(4, false), (7, true)] {
        d.animate("walk", Moved::Rotation(joints[first]), &keys(&|t| turned(bent(hip(phase(t, right))))));
        d.animate(
            "walk",
            Moved::Rotation(joints[first + 1]),
            &keys(&|t| turned(bent(-knee(phase(t, right))))),
        );
        let level = |t: f64| turned(bent(knee(phase(t, right)) - hip(phase(t, right))));
        d.animate("walk", Moved::Rotation(joints[first + 2]), &keys(&level));
    }
    for (first, right) in [(10, true), (13, false)] {
        d.animate(
            "walk",
            Moved::Rotation(joints[first]),
            &keys(&|t| turned(bent(18.0 * phase(t, right).cos()))),
        );
        let elbow = |t: f64| turned(bent(18.0 + 8.0 * phase(t, right).cos()));
        d.animate("walk", Moved::Rotation(joints[first + 1]), &keys(&elbow));
    }
}
