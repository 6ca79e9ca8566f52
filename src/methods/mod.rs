//! Methods: ordered lists of techniques, and all that the rest of the program needs to know of them. A method is one
//! file; configuration, help, charts, the choice of settings, the stress suite and docs find it in [`REGISTRY`].

mod aov;
pub mod config;
pub mod igi;
mod layers;
mod option;
mod own;
pub mod path;
#[cfg(test)]
mod toy;
mod trial;

use crate::ErrorClass;
pub use aov::Aov;
pub use layers::{Layers, VplCounts};
pub use option::{CliOption, OptionGroup, OptionValue};
pub use own::{Group, Own};
pub use trial::Trial;

use crate::graph::Graph;
use crate::scene::{Feature, SceneProfile};
use crate::techniques::Kernels;
use crate::techniques::path_trace::Means;
use crate::techniques::setting::BadValue;
use config::RenderConfig;
use std::fmt;

/// All methods there are, the default first.
pub static REGISTRY: &[&Method] = &[
    &igi::METHOD,
    &path::METHOD,
    #[cfg(test)]
    &toy::METHOD,
];

/// The method that others are measured against.
pub static REFERENCE: &Method = &path::METHOD;

/// What a method needs to know beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct FrameInfo {
    /// Where the window rendered begins in the whole picture (pixels).
    pub origin: [u32; 2],
    /// Pixels of the window rendered.
    pub extent: [u32; 2],
    /// The scene's surface (m²).
    pub area: f32,
    /// What a progressive method has come to.
    pub means: Option<Means>,
    /// Samples a pixel that a progressive method has taken before.
    pub taken: u32,
    /// Samples a pixel that a progressive method takes in this graph.
    pub samples: u32,
}

/// A way to render.
#[derive(Clone, Copy)]
pub struct Method {
    /// Its word everywhere.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// A paragraph: how it works, what it is known to lose, how its error looks, whose it is.
    pub description: &'static str,
    /// The layers it can draw.
    pub aovs: &'static [Aov],
    /// Those of them that only some settings have.
    pub conditional: &'static [Conditional],
    /// Settings that it has for itself, under its name.
    pub own: Option<Group>,
    /// Checks what no group of settings can check by itself.
    pub check: fn(&RenderConfig) -> Result<(), BadValue>,
    /// Its words on the command line. Methods may share some; one without a word refuses it.
    pub options: &'static [CliOption],
    /// How its picture grows over many graphs; one graph draws it otherwise.
    pub progressive: Option<Progressive>,
    /// Specialises the kernels to its settings.
    pub kernels: fn(Kernels, &RenderConfig) -> Kernels,
    /// Features of scenes that cost it nothing.
    pub costless: &'static [Feature],
    /// What pixels depend on.
    pub reach: fn(&RenderConfig) -> Reach,
    /// Changes settings so that the picture, or the layer that is returned, is light that diffuse surfaces reflect of what
    /// others scattered, alone.
    pub diffuse_indirect: fn(&mut RenderConfig) -> Option<Aov>,
    /// Rays a pixel that a frame takes, roughly.
    pub cost: fn(&RenderConfig) -> f64,
    /// Makes its picture comparable with others': paths begin at pixels' centres and, where a number is given, have so
    /// many edges at most.
    pub comparable: fn(&mut RenderConfig, Option<u32>),
    /// What charts and the choice of settings try of it.
    pub sweeps: Sweeps,
    /// What it is tried with under stress.
    pub trials: &'static [Trial],
    /// Records one graph.
    pub record: fn(&mut Graph, &Kernels, &RenderConfig, &FrameInfo) -> Layers,
    /// What of a scene it does not model as configured, a sentence each.
    pub left_out: fn(&SceneProfile, &RenderConfig) -> Vec<String>,
}

/// A layer that only some settings have.
#[derive(Clone, Copy, Debug)]
pub struct Conditional {
    /// The layer.
    pub aov: Aov,
    /// The option that turns it on.
    pub option: &'static str,
    /// Whether these settings have it.
    pub there: fn(&RenderConfig) -> bool,
}

/// How a picture grows, by [`FrameInfo::samples`] samples a pixel each graph: its time in proportion to them all, its
/// squared error in inverse proportion.
#[derive(Clone, Copy, Debug)]
pub struct Progressive {
    /// The key that says how many samples a pixel there are in the end.
    pub key: &'static str,
    /// How many these settings say.
    pub samples: fn(&RenderConfig) -> u32,
    /// Sets how many.
    pub set_samples: fn(&mut RenderConfig, u32),
    /// Whether pixels take samples at different rates.
    pub adaptive: fn(&RenderConfig) -> bool,
    /// Rounds of a kernel's loop that a sample takes at most.
    pub rounds: fn(&RenderConfig) -> u32,
}

/// Settings of a method, each text tables `[[sweep]]` as in files of grids.
#[derive(Clone, Copy, Debug)]
pub struct Sweeps {
    /// From coarse to fine, in minutes on a CPU.
    pub small: &'static str,
    /// The paper's approaches.
    pub paper: &'static str,
    /// Everything there is, for a GPU.
    pub full: &'static str,
    /// What predicts all others where settings are to be picked quickly.
    pub probe: &'static str,
    /// What is tried beside where time is not short; no setting of `probe`.
    pub finer: &'static str,
}

/// What pixels depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// Pixels beyond a part of the picture that decide what is in it.
    pub pixels: u32,
    /// Width and height (pixels) of the cells that are drawn whole or not at all.
    pub cell: u32,
}

impl Method {
    /// The layers it draws with these settings.
    pub fn layers(&self, config: &RenderConfig) -> impl Iterator<Item = Aov> {
        let there = |aov: &Aov| self.conditional.iter().all(|c| c.aov != *aov || (c.there)(config));
        self.aovs.iter().copied().filter(there)
    }

    /// Checks that the method can draw these layers with these settings.
    ///
    /// # Errors
    /// Names the first that it can't.
    pub fn check_layers(&self, config: &RenderConfig, aovs: &[Aov]) -> Result<(), NoLayer> {
        match aovs.iter().find(|&&aov| self.layers(config).all(|there| there != aov)) {
            Some(aov) => {
                Err(NoLayer { method: self.name, layer: aov.name(), there: self.layers(config).collect() })
            }
            None => Ok(()),
        }
    }
}

impl fmt::Debug for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// A layer that a method does not draw.
#[derive(Clone, Debug, thiserror::Error)]
#[error("method {method} has no layer `{layer}`; there are {}", names(.there))]
pub struct NoLayer {
    /// The method.
    pub method: &'static str,
    /// The layer asked for.
    pub layer: &'static str,
    /// Those there are.
    pub there: Vec<Aov>,
}

impl NoLayer {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

fn names(aovs: &[Aov]) -> String {
    aovs.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(", ")
}

/// Makes the pictures of all methods comparable, as [`Method::comparable`] does for one.
pub fn comparable(config: &mut RenderConfig, max_depth: Option<u32>) {
    REGISTRY.iter().for_each(|method| (method.comparable)(config, max_depth));
}

/// The method called `name`, if there is one.
#[must_use]
pub fn named(name: &str) -> Option<&'static Method> {
    REGISTRY.iter().copied().find(|method| method.name == name)
}
