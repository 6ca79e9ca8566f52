//! Layers beside beauty.

/// Declares the layers; each is one entry: its word, the names of its channels, and what its texels keep before them.
macro_rules! aovs {
    ($($(#[$doc:meta])* $aov:ident = $name:literal, $channels:expr, $first:literal;)*) => {
        /// A layer beside beauty.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Aov {
            $($(#[$doc])* $aov,)*
        }

        impl Aov {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$aov),*];

            /// Its word on the command line and in files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$aov => $name,)*
                }
            }

            /// Names of its channels in files, as many as it has.
            #[must_use]
            pub const fn channel_names(self) -> &'static [&'static str] {
                match self {
                    $(Self::$aov => $channels,)*
                }
            }

            /// Which number of a texel is its first channel.
            pub(crate) const fn first_channel(self) -> usize {
                match self {
                    $(Self::$aov => $first,)*
                }
            }
        }
    };
}

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];

aovs! {
    /// Diffuse albedo that irradiance is multiplied with, 3 channels.
    Albedo = "albedo", RGB, 0;
    /// Unit shading normal in the world, turned to the camera, 3 channels.
    N = "N", XYZ, 0;
    /// Position in the world (m), 3 channels.
    P = "P", XYZ, 0;
    /// Radiance by emission and direct light, 3 channels.
    Direct = "direct", RGB, 0;
    /// Radiance through mirrors and glass, 3 channels.
    Specular = "specular", RGB, 0;
    /// Radiance by indirect light in the diffuse part, 3 channels.
    Indirect = "indirect", RGB, 0;
    /// Radiance by indirect light in glossy lobes, 3 channels.
    Glossy = "glossy", RGB, 0;
    /// Indirect irradiance (W/m²), 3 channels.
    Irradiance = "irradiance", RGB, 0;
    /// Distance along the viewing direction (m), 1 channel.
    Depth = "depth", &["Z"], 3;
    /// Variance of beauty's mean, estimated by its halves (one degree of freedom), 3 channels.
    Variance = "variance", RGB, 0;
    /// Radiance by samples 0, 2, 4, … alone, 3 channels.
    HalfA = "half_a", RGB, 0;
    /// Radiance by samples 1, 3, 5, … alone, 3 channels.
    HalfB = "half_b", RGB, 0;
    /// Of adaptive sampling, 3 channels: samples a pixel takes for each that pixels take on average, the variance that
    /// rates so far have led to, 1 where it is that of equal rates, and samples it took before the rates last changed.
    Rate = "rate", &["now", "variance", "taken"], 0;
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
