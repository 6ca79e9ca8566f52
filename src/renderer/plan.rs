//! The plan of a frame where there is no device.

use super::drawing::{Drawing, Tickets, modelling};
use super::error::Error;
use super::growing::means_of;
use super::window::Window;
use crate::accel::Traversal;
use crate::config::RenderConfig;
use crate::graph::{Graph, ImageDesc, Plan, Requirements};
use crate::methods::Aov;
use crate::scene::{Scene, SceneProfile};
use crate::techniques::Kernels;
use crate::vk::Format;

/// The plan of one frame, made without any device.
///
/// # Errors
/// A bad configuration, or a limit that `requirements` names.
pub fn plan(
    scene: &Scene,
    config: &RenderConfig,
    aovs: &[Aov],
    requirements: &dyn Requirements,
) -> Result<Plan, Error> {
    config.validate()?;
    config.method.check_layers(config, aovs)?;
    let kernels =
        Kernels::new(&SceneProfile::of(scene, config.whitted.mirror_roughness), Traversal::default());
    let kernels = modelling(kernels, config, &[]);
    let window = Window::of(config);
    let mut info = window.frame(scene.area() as f32);
    let mut g = Graph::new();
    if let Some(progressive) = &config.method.progressive {
        let image = |name| g.declare_image(name, ImageDesc::new(window.extent, Format::Rgba32Float));
        info.means = Some(means_of((progressive.adaptive)(config), aovs, image));
        info.samples = 1;
    }
    let drawing = Drawing {
        config: config.clone(),
        kernels,
        window,
        layers: aovs.to_vec(),
        origin: scene.origin,
        free_path: None,
    };
    let recorded = drawing.record(&mut g, &info, aovs, &[], 0);
    Tickets::take(&mut g, config, recorded, true);
    Ok(g.plan(requirements)?)
}
