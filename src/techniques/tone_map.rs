//! From linear radiance to a picture for a screen: exposure, a tone mapping operator and the sRGB transfer function.

use super::setting::{BadValue, Settings, within};
use crate::graph::{Buffer, Graph, Grid, Image, Res};
use crate::shaders::{
    self,
    tone_map::{display, exposure, rows},
};
use crate::vk::Format;

/// How exposed radiance is brought into the range of a screen, 0 … 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Operator {
    /// Khronos PBR Neutral (specification of May 2024): colours up to 0.76 stay as they are but for a small offset,
    /// brighter ones are compressed and lose saturation.
    #[default]
    Neutral = shaders::OPERATOR_NEUTRAL as isize,
    /// Reinhard et al. 2002, *Photographic Tone Reproduction for Digital Images*, equation 4, on luminance: everything
    /// is compressed, and [`ToneMapConfig::white`] comes out as 1. Keeps hue and saturation; saturated lights clip.
    Reinhard = shaders::OPERATOR_REINHARD as isize,
    /// Stephen Hill's fit (BakingLab, 2016) of ACES 1.0, its reference rendering and sRGB output transforms: film's
    /// contrast, bright colours turn white. Middle grey, 0.18, comes out as 0.11.
    Aces = shaders::OPERATOR_ACES as isize,
    /// None: what is above 1 is clipped, channel by channel.
    Linear = shaders::OPERATOR_LINEAR as isize,
}

impl Operator {
    /// All operators.
    pub const ALL: &'static [Self] = &[Self::Neutral, Self::Reinhard, Self::Aces, Self::Linear];

    /// Its word on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Neutral => "neutral",
            Self::Reinhard => "reinhard",
            Self::Aces => "aces",
            Self::Linear => "linear",
        }
    }

    /// Its name in full, for pictures' texts.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Neutral => "Khronos PBR Neutral",
            Self::Reinhard => "extended Reinhard",
            Self::Aces => "ACES (Hill's fit)",
            Self::Linear => "linear, clipped",
        }
    }
}

/// How radiance becomes display values.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ToneMapConfig {
    /// Exposure in stops, −64 … 64: radiance is multiplied by 2^EV. Absent: the log-average luminance of the pixels that
    /// have any is brought to 0.18 (Reinhard et al. 2002), so the value depends on what is rendered.
    pub exposure: Option<f32>,
    /// What brings exposed radiance into a screen's range.
    pub operator: Operator,
    /// Luminance after exposure that [`Operator::Reinhard`] shows as 1, 0.01 … 10⁶. Less burns out more and has more
    /// contrast; the default, 4, is 4.5 stops above middle grey.
    pub white: f32,
}

impl Default for ToneMapConfig {
    fn default() -> Self {
        Self { exposure: None, operator: Operator::default(), white: 4.0 }
    }
}

impl Settings for ToneMapConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("tone_map.white", self.white, 0.01..=1e6)?;
        self.exposure.map_or(Ok(()), |stops| within("tone_map.exposure", stops, -64.0..=64.0))
    }
}

/// Exposure of a picture: a buffer of one float, in stops.
pub fn exposure(g: &mut Graph, config: &ToneMapConfig, radiance: Res<Image>) -> Res<Buffer> {
    g.group("tone_map", |g| {
        let stops = g.buffer("exposure", 4);
        if let Some(ev) = config.exposure {
            g.upload("fixed", stops, ev.to_ne_bytes().to_vec());
            return stops;
        }
        let [_, height] = g.desc(radiance).extent;
        let sums = g.buffer("rows", u64::from(height) * 8);
        let [threads, ..] = rows::CODE.workgroup;
        let grid = Grid::Of([threads * height, 1, 1]);
        g.pass("rows", &rows::kernel(), rows::Bind { radiance, rows: sums }, rows::Params {}, grid);
        let bind = exposure::Bind { rows: sums, exposure: stops };
        let params = exposure::Params { rows: height };
        g.pass("exposure", &exposure::kernel(), bind, params, Grid::Of([1, 1, 1]));
        stops
    })
}

/// RGBA, 8 bits each, sRGB, of radiance at an exposure.
pub fn tone_map(
    g: &mut Graph,
    config: &ToneMapConfig,
    radiance: Res<Image>,
    exposure: Res<Buffer>,
) -> Res<Image> {
    g.group("tone_map", |g| {
        let image = g.image("display", g.desc(radiance).with_format(Format::Rgba8Unorm));
        let bind = display::Bind { radiance, exposure, out_display: image };
        let kernel = display::kernel(display::Spec { operator: config.operator as u32 });
        g.pass(
            config.operator.name(),
            &kernel,
            bind,
            display::Params { white: config.white },
            Grid::Over(image),
        );
        image
    })
}
