//! Means that outlive their graphs and grow by samples, until there are enough. Which samples come in which graph never
//! shows.

use super::error::Error;
use super::request::Resume;
use crate::graph::{Graph, Image, Res};
use crate::layer::Layer;
use crate::methods::Aov;
use crate::techniques::path_trace::Means;
use crate::techniques::path_trace::adaptive::{Rates, relative_variance};
use crate::vk::{self, Format};
use std::sync::Arc;

/// Relative error of a picture by two independent halves of its samples, `a` of one more or as many as `b`: the root of
/// the relative mean squared error ([`crate::metrics::rel_mse`]) to be expected of `mean`.
#[must_use]
pub fn noise(mean: &[f32], a: &[f32], b: &[f32], samples: u32) -> f64 {
    let (n, count) = (f64::from(samples), mean.len().max(1) as f64);
    let share = f64::from(samples.div_ceil(2)) / n * (f64::from(samples / 2) / n);
    let terms = relative_variance(mean, a, b, share);
    (terms.sum::<f64>() / count).sqrt()
}

/// The means that drawing `aovs` takes.
pub(super) fn means_of(
    adaptive: bool,
    aovs: &[Aov],
    mut image: impl FnMut(&'static str) -> Res<Image>,
) -> Means {
    let halves = adaptive || aovs.iter().any(|aov| aov.takes_halves());
    Means {
        all: image("mean"),
        halves: halves.then(|| [image("half_a"), image("half_b")]),
        rates: adaptive.then(|| image("rates")),
    }
}

/// Images that outlive the graphs, and what they hold.
#[derive(Debug)]
pub(super) struct Growing {
    all: Arc<vk::Image>,
    halves: Option<[Arc<vk::Image>; 2]>,
    rates: Option<(Arc<vk::Image>, Rates)>,
    /// Whether the means hold anything; black or `contents` is what they begin with.
    begun: bool,
    /// Whether the rates are on the device.
    rated: bool,
    /// Samples a pixel, contents and rates to begin with.
    first: u32,
    contents: Option<Vec<Vec<u8>>>,
    first_rates: Option<Rates>,
}

impl Growing {
    pub(super) fn new(
        device: &vk::Device,
        extent: [u32; 2],
        halves: bool,
        adaptive: bool,
        resume: Option<&Resume>,
    ) -> Result<Self, Error> {
        let image = |name| device.image(name, extent, Format::Rgba32Float).map(Arc::new);
        let all = image("mean")?;
        let halves = if halves { Some([image("half_a")?, image("half_b")?]) } else { None };
        let first_rates = match resume {
            _ if !adaptive => None,
            None => Some(Rates::new(extent)),
            Some(resume) => Some(rates(resume, extent)?),
        };
        let contents = resume
            .map(|resume| contents(resume, extent, halves.is_some(), first_rates.as_ref()))
            .transpose()?;
        let rates = first_rates.clone().map(|rates| Ok::<_, Error>((image("rates")?, rates))).transpose()?;
        let first = resume.map_or(0, |resume| resume.samples);
        Ok(Self { all, halves, rates, begun: false, rated: false, first, contents, first_rates })
    }

    /// Samples a pixel to begin with.
    pub(super) fn first(&self) -> u32 {
        self.first
    }

    /// Begins anew.
    pub(super) fn restart(&mut self) {
        (self.begun, self.rated) = (false, false);
        if let (Some((_, rates)), Some(first)) = (&mut self.rates, &self.first_rates) {
            *rates = first.clone();
        }
    }

    /// Begins anew from nothing.
    pub(super) fn forget(&mut self) {
        (self.first, self.contents) = (0, None);
        self.first_rates = self.first_rates.take().map(|_| Rates::new(self.all.extent()));
        self.restart();
    }

    /// Decides the rates of the round that begins, by mean and halves.
    pub(super) fn next_round(&mut self, images: &[Vec<f32>], samples: u32) {
        if let (Some((_, rates)), [mean, a, b]) = (&mut self.rates, images) {
            *rates = rates.next(mean, a, b, samples);
            self.rated = false;
        }
    }

    /// The images in a graph, with a first content where they have none.
    pub(super) fn import(&self, g: &mut Graph) -> Means {
        let all = g.import_image("mean", &self.all);
        let halves =
            self.halves.as_ref().map(|[a, b]| [g.import_image("half_a", a), g.import_image("half_b", b)]);
        if !self.begun {
            let images = std::iter::once(all).chain(halves.into_iter().flatten());
            for (index, image) in images.enumerate() {
                match &self.contents {
                    Some(contents) => g.upload_image("resume", image, contents[index].clone()),
                    None => g.clear_image("begin", image),
                }
            }
        }
        let rates = self.rates.as_ref().map(|(image, rates)| {
            let image = g.import_image("rates", image);
            if !self.rated {
                g.upload_image("rates", image, bytemuck::cast_slice(&rates.texels()).to_vec());
            }
            image
        });
        Means { all, halves, rates }
    }

    /// A graph with the images was handed to the device.
    pub(super) fn submitted(&mut self) {
        (self.begun, self.rated) = (true, true);
    }
}

/// Checks a layer's shape.
fn fits(layer: &Layer, extent: [u32; 2], channels: usize) -> Result<(), Error> {
    if [layer.width, layer.height] == extent && layer.channels == channels {
        return Ok(());
    }
    let (given, [width, height]) = ((layer.width, layer.height), extent);
    Err(Error::Resume(format!("{}x{} pixels in place of {width}x{height}", given.0, given.1)))
}

/// The rates it goes on at.
fn rates(resume: &Resume, extent: [u32; 2]) -> Result<Rates, Error> {
    let layer = resume
        .rates
        .as_ref()
        .ok_or_else(|| Error::Resume("there is no layer rate, which adaptive sampling needs".into()))?;
    fits(layer, extent, 3)?;
    Rates::read(extent, &layer.data)
        .ok_or_else(|| Error::Resume("the layer rate holds what no render leaves there".into()))
}

/// Texels of the means, what the samples behind each colour weigh in w.
fn contents(
    resume: &Resume,
    extent: [u32; 2],
    halves: bool,
    rates: Option<&Rates>,
) -> Result<Vec<Vec<u8>>, Error> {
    let n = resume.samples;
    let mut layers = vec![&resume.mean];
    if halves {
        let Some(halves) = &resume.halves else {
            return Err(Error::Resume(
                "there are no layers half_a and half_b, which noise, variance and adaptive sampling need"
                    .into(),
            ));
        };
        layers.extend(halves);
    }
    let weight = |pixel: usize, layer: usize| match rates {
        Some(rates) => rates.weights(pixel, n)[layer],
        None => [n, n.div_ceil(2), n / 2][layer] as f32,
    };
    let texels = |(index, layer): (usize, &Layer)| {
        fits(layer, extent, 3)?;
        let colours = layer.data.chunks_exact(3).enumerate();
        let texels = colours.map(|(pixel, c)| [c[0], c[1], c[2], weight(pixel, index)]);
        Ok(bytemuck::cast_slice(&texels.collect::<Vec<[f32; 4]>>()).to_vec())
    };
    layers.into_iter().enumerate().map(texels).collect()
}

/// Red, green and blue of each texel.
pub(super) fn colours(texels: &[[f32; 4]]) -> Vec<f32> {
    texels.iter().flat_map(|texel| [texel[0], texel[1], texel[2]]).collect()
}
