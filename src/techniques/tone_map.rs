//! From linear radiance to a picture for a screen: exposure, the Khronos PBR Neutral operator (specification of
//! May 2024) and the sRGB transfer function.

use crate::graph::{Buffer, Graph, Grid, Image, Res};
use crate::shaders::tone_map::{exposure, neutral, rows};
use crate::vk::Format;

/// The operator's name in outputs.
pub const OPERATOR: &str = "Khronos PBR Neutral";

/// How radiance becomes display values.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ToneMapConfig {
    /// Exposure in stops, −64 … 64: radiance is multiplied by 2^EV. Absent: the log-average luminance of the pixels that
    /// have any is brought to 0.18 (Reinhard et al. 2002), so the value depends on what is rendered.
    pub exposure: Option<f32>,
}

/// A picture for a screen and the exposure it was given.
#[derive(Clone, Copy, Debug)]
pub struct Display {
    /// RGBA, 8 bits each, sRGB.
    pub image: Res<Image>,
    /// One float: stops.
    pub exposure: Res<Buffer>,
}

/// Exposes and tone maps.
pub fn tone_map(g: &mut Graph<'_>, config: &ToneMapConfig, radiance: Res<Image>) -> Display {
    g.group("tone_map", |g| {
        let desc = g.desc(radiance);
        let stops = g.buffer("exposure", 4);
        if let Some(ev) = config.exposure {
            g.upload("fixed", stops, ev.to_ne_bytes().to_vec());
        } else {
            let height = desc.extent[1];
            let sums = g.buffer("rows", u64::from(height) * 8);
            let [threads, ..] = rows::CODE.workgroup;
            let grid = Grid::Of([threads * height, 1, 1]);
            g.pass("rows", &rows::kernel(), rows::Bind { radiance, rows: sums }, rows::Params {}, grid);
            let bind = exposure::Bind { rows: sums, exposure: stops };
            g.pass(
                "exposure",
                &exposure::kernel(),
                bind,
                exposure::Params { rows: height },
                Grid::Of([1, 1, 1]),
            );
        }
        let image = g.image("display", desc.with_format(Format::Rgba8Unorm));
        let bind = neutral::Bind { radiance, exposure: stops, out_display: image };
        g.pass("neutral", &neutral::kernel(), bind, neutral::Params {}, Grid::Over(image));
        Display { image, exposure: stops }
    })
}
