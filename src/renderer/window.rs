//! Crops: which pixels are drawn.

use crate::config::RenderConfig;
use crate::methods::{FrameInfo, Reach};

/// The pixels asked for, and those that are traced because the ones asked for depend on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) origin: [u32; 2],
    pub(super) extent: [u32; 2],
    pub(super) traced_origin: [u32; 2],
    pub(super) traced_extent: [u32; 2],
}

impl Window {
    pub(super) fn of(config: &RenderConfig) -> Self {
        let [x0, y0, x1, y1] = config.window();
        let Reach { pixels: reach, cell } = (config.method.reach)(config);
        // Whole cells, or the samples that stand for them would lie outside.
        let low = |at: u32| at.saturating_sub(reach) / cell * cell;
        let high = |at: u32, size: u32| (at + reach).next_multiple_of(cell).min(size);
        let traced_origin = [low(x0), low(y0)];
        let traced_end = [high(x1, config.size[0]), high(y1, config.size[1])];
        Self {
            origin: [x0, y0],
            extent: [x1 - x0, y1 - y0],
            traced_origin,
            traced_extent: [0, 1].map(|axis| traced_end[axis] - traced_origin[axis]),
        }
    }

    pub(super) fn frame(&self, area: f32) -> FrameInfo {
        let (origin, extent) = (self.traced_origin, self.traced_extent);
        FrameInfo { origin, extent, area, free_path: None, means: None, taken: 0, samples: 0 }
    }
}
