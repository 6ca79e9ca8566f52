//! Layers beside beauty.

/// A layer beside beauty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Aov {
    /// Diffuse albedo that irradiance is multiplied with, 3 channels.
    Albedo,
    /// Unit shading normal in the world, turned to the camera, 3 channels.
    N,
    /// Position in the file's coordinates (m), 3 channels.
    P,
    /// Radiance by emission and direct light, 3 channels.
    Direct,
    /// Radiance through mirrors and glass, 3 channels.
    Specular,
    /// Radiance by indirect light in the diffuse part, 3 channels.
    Indirect,
    /// Radiance by indirect light in glossy lobes, 3 channels.
    Glossy,
    /// Indirect irradiance (W/m²), 3 channels.
    Irradiance,
    /// Distance along the viewing direction (m), 1 channel.
    Depth,
    /// Variance of beauty's mean, estimated by its halves (one degree of freedom), 3 channels.
    Variance,
    /// Radiance by samples 0, 2, 4, … alone, 3 channels.
    HalfA,
    /// Radiance by samples 1, 3, 5, … alone, 3 channels.
    HalfB,
    /// Of adaptive sampling, 3 channels: samples a pixel takes for each that pixels take on average, the variance that
    /// rates so far have led to, 1 where it is that of equal rates, and samples it took before the rates last changed.
    Rate,
}

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];

impl Aov {
    /// All of them.
    pub const ALL: &'static [Self] = &[
        Self::Albedo,
        Self::N,
        Self::P,
        Self::Direct,
        Self::Specular,
        Self::Indirect,
        Self::Glossy,
        Self::Irradiance,
        Self::Depth,
        Self::Variance,
        Self::HalfA,
        Self::HalfB,
        Self::Rate,
    ];

    /// Its word, the names of its channels, and which number of a texel is the first of them.
    const fn entry(self) -> (&'static str, &'static [&'static str], usize) {
        match self {
            Self::Albedo => ("albedo", RGB, 0),
            Self::N => ("N", XYZ, 0),
            Self::P => ("P", XYZ, 0),
            Self::Direct => ("direct", RGB, 0),
            Self::Specular => ("specular", RGB, 0),
            Self::Indirect => ("indirect", RGB, 0),
            Self::Glossy => ("glossy", RGB, 0),
            Self::Irradiance => ("irradiance", RGB, 0),
            Self::Depth => ("depth", &["Z"], 3),
            Self::Variance => ("variance", RGB, 0),
            Self::HalfA => ("half_a", RGB, 0),
            Self::HalfB => ("half_b", RGB, 0),
            Self::Rate => ("rate", &["now", "variance", "taken"], 0),
        }
    }

    /// Its word on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().0
    }

    /// Names of its channels in files, as many as it has.
    #[must_use]
    pub const fn channel_names(self) -> &'static [&'static str] {
        self.entry().1
    }

    /// Which number of a texel is its first channel.
    pub(crate) const fn first_channel(self) -> usize {
        self.entry().2
    }
}

impl Aov {
    /// Whether it takes independent halves of a progressive picture's samples.
    #[must_use]
    pub fn takes_halves(self) -> bool {
        matches!(self, Self::Variance | Self::HalfA | Self::HalfB)
    }

    /// Channels of the layer.
    #[must_use]
    pub const fn channels(self) -> usize {
        self.channel_names().len()
    }
}
