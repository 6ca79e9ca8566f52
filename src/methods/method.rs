//! What a method is, and the settings that it works by.

use super::{Aov, CliOption, Group, Layers, Own, Trial};
use crate::ErrorClass;
use crate::graph::Graph;
use crate::scene::{Feature, SceneProfile};
use crate::techniques::Kernels;
use crate::techniques::path_trace::Means;
use crate::techniques::setting::BadValue;
use crate::techniques::{
    glare::GlareConfig, indirect::IndirectConfig, path_trace::PathTraceConfig, tone_map::ToneMapConfig,
    vpl_shoot::VplShootConfig, whitted::WhittedConfig,
};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;

/// Edges of the longest path where nothing says less: what is beyond them shows in no room.
const ALL_EDGES: u32 = 64;

/// What a method needs to know beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct FrameInfo {
    /// Where the window rendered begins in the whole picture (pixels).
    pub origin: [u32; 2],
    /// Pixels of the window rendered.
    pub extent: [u32; 2],
    /// The scene's surface (m²).
    pub area: f32,
    /// Half of the ways from what the camera sees to what that sees are shorter (m); where the method asks for it and
    /// there are any.
    pub free_path: Option<f32>,
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
    /// Perceptual roughness up to which thin walls that transmit are panes, which let light straight through.
    pub pane_roughness: fn(&RenderConfig) -> f32,
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
    /// Whether it asks for [`FrameInfo::free_path`].
    pub asks_free_path: fn(&RenderConfig) -> bool,
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

/// Its name.
impl Serialize for Method {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
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

/// How one of many lights is chosen to be asked for light; light paths always go by power.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightChoice {
    /// By a tree that bounds what each can give a point: distance, the sides that lights and the point face, intensity
    /// (Conty Estevez & Kulla 2018). Emissive triangles that look large are sampled by solid angle (Arvo 1995). A scene
    /// without any and with at most 8 lights has no tree.
    #[default]
    Tree,
    /// In proportion to power, whatever the point; triangles by area. Noisier.
    Power,
}

/// Everything that decides a picture besides scene, camera and backend.
///
/// ```
/// let mut config = parhelion::config::RenderConfig::default();
/// config.apply_override("vpl_shoot.vpls=90")?;
/// assert_eq!(config.vpl_shoot.vpls, 90);
/// let error = config.apply_override("vpl_shoot.vpl=90").unwrap_err();
/// assert_eq!(error.to_string(), "unknown key `vpl_shoot.vpl`; the nearest is `vpl_shoot.vpls`");
/// # Ok::<(), parhelion::config::ConfigError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RenderConfig {
    /// How light is computed.
    pub method: &'static Method,
    /// Width and height (pixels), each 1 … 16384. Time and memory grow with their product.
    pub size: [u32; 2],
    /// Seed of all samples. Another seed gives other noise of the same strength, and no bias. The same seed on the same
    /// device and backend gives the same bits.
    pub seed: u32,
    /// Stratified positions a pixel, 1 … 65536, averaged. One is the pixel's centre: edges are jagged and the
    /// picture differs from an area average. Time grows in proportion.
    pub pixel_samples: u32,
    /// Part of the picture to render: x0, y0, x1, y1 (pixels from the top left, the ends exclusive). Absent:
    /// all of it. Its radiance is that of the whole picture, bit for bit; automatic exposure, glare and denoising are
    /// the crop's own.
    pub crop: Option<[u32; 4]>,
    /// Whether the dielectric and the diffuse part are mixed so that they never reflect more light than they receive.
    /// Otherwise they are mixed as glTF 2.0 publishes it, which reflects too much at grazing angles (1.59 times what
    /// arrives at 85° and roughness 0.05). Method `igi` heeds it with `indirect.glossy` only: otherwise the parts never meet.
    pub energy_conserving: bool,
    /// Whether facets whose vertices' normals bend away from their own are lit as the curved surface that they stand for: by
    /// the side of the interpolated normal, not of the facet, along rays that start over it (Hanika 2021). Without it coarse
    /// meshes show black facets where the light sinks below them (the shadow terminator). Energy: light that a facet got
    /// before is the same, that from below it is added, at most what a smooth surface gets; a white one under white light
    /// stays white. Bias: rays from below pass over what stands on the facet, up to twice the height of the curve; light
    /// paths meet facets as they are and VPLs light them so. Surfaces that transmit are facets. Presets turn it off.
    pub shadow_terminator: bool,
    /// Whether light goes straight through panes: thin walls that transmit and are smooth. Otherwise they block shadow rays,
    /// rooms behind glass are dark, and to pass one is a bounce. No bias by itself, but for roughness up to
    /// `whitted.mirror_roughness`, which method `igi` takes for none. Ours: the paper does not say; its presets turn it off.
    pub panes: bool,
    /// How one of many lights is chosen to be asked for light. Both have the same mean.
    pub light_choice: LightChoice,
    /// Virtual point lights.
    pub vpl_shoot: VplShootConfig,
    /// Direct light and specular paths.
    pub whitted: WhittedConfig,
    /// Indirect light.
    pub indirect: IndirectConfig,
    /// Paths from the camera.
    pub path_trace: PathTraceConfig,
    /// Light around bright things, in pictures for screens.
    pub glare: GlareConfig,
    /// From radiance to a picture for a screen.
    pub tone_map: ToneMapConfig,
    /// Groups that methods have for themselves.
    #[serde(flatten)]
    pub own: Own,
}

impl RenderConfig {
    /// Edges of the longest path a path tracer follows.
    #[must_use]
    pub fn max_depth(&self) -> u32 {
        let of_bounces = self.vpl_shoot.bounces.map_or(ALL_EDGES, |bounces| bounces.saturating_add(2));
        self.path_trace.max_depth.unwrap_or(of_bounces)
    }

    /// The part of the picture that is rendered: x0, y0, x1, y1 (pixels, ends exclusive).
    #[must_use]
    pub fn window(&self) -> [u32; 4] {
        self.crop.unwrap_or([0, 0, self.size[0], self.size[1]])
    }
}
