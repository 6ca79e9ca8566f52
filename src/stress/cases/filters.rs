//! What fewer samples than pixels miss.

use super::super::scenes;
use super::Case;
use super::measure::against_reference;
use crate::metrics;
use crate::stress::lab::{Part, Subject};

const WIRES: Subject = Subject { name: "wires", make: scenes::wires };
const BUMPY: Subject = Subject { name: "bumpy", make: scenes::bumpy };

pub(super) const CASES: &[Case] = &[
    Case {
        name: "wires",
        mechanism: "Of posts as wide as a pixel a sample in 4x4 pixels sees few; the others take the light of what is \
                    behind them.",
        number: "relMSE of indirect light",
        limit: 0.02,
        settings: &["vpl_shoot.vpls=1024"],
        measure: |lab, config| against_reference(lab, config, &WIRES, Part::Indirect, metrics::rel_mse),
    },
    Case {
        name: "bumpy",
        mechanism: "Facets that face every way have no neighbours of their normal to share virtual lights with: the \
                    pattern of subsets stays.",
        number: "relMSE of indirect light",
        limit: 0.06,
        settings: &["vpl_shoot.vpls=720"],
        measure: |lab, config| against_reference(lab, config, &BUMPY, Part::Indirect, metrics::rel_mse),
    },
];
