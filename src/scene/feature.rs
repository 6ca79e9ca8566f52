use super::SceneProfile;

/// Something that costs time where it is modelled, also for a scene that has none of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Feature {
    /// Textures of base colour.
    Textures,
    /// Textures of roughness and metalness.
    MetallicRoughnessTextures,
    /// Normal maps.
    NormalMaps,
    /// Textures of the dielectric reflection's strength or colour.
    SpecularTextures,
    /// Textures of transmission.
    TransmissionTextures,
    /// Textures of emission.
    EmissionTextures,
    /// Clear coats, and evaluating all lobes by angle.
    Clearcoat,
    /// Clear coats as smooth as a mirror: rays that follow them.
    SmoothCoats,
    /// Textures of the clear coat's strength or roughness.
    ClearcoatTextures,
    /// Textures of 16 bits a channel.
    DeepTextures,
    /// A second set of texture coordinates.
    Uv1,
    /// Vertex colours.
    VertexColors,
    /// Shading normals.
    SmoothNormals,
    /// Facets that stand for curved surfaces.
    Curved,
    /// Meshes with more than one instance.
    Instanced,
    /// Mirrors: rays that follow them.
    Mirrors,
    /// Glass: rays that follow it.
    Glass,
    /// Panes that shadow rays pass.
    Panes,
    /// Solid glass.
    Volumes,
    /// Alpha masks.
    AlphaMask,
    /// Alpha as partial coverage.
    AlphaBlend,
    /// Emissive triangles as lights.
    Emission,
    /// Unlit materials, which paths find at their ends.
    Unlit,
    /// Specular lobes rougher than a mirror: VPLs light them in a pass of its own.
    RoughLobes,
    /// Spot lights.
    SpotLights,
    /// Directional lights.
    DirectionalLights,
    /// Light from infinitely far around.
    Environment,
    /// Room for the deepest structure that rays can be traced in.
    DeepStructure,
}

impl Feature {
    /// All of them.
    pub const ALL: &'static [Self] = &[
        Self::Textures,
        Self::MetallicRoughnessTextures,
        Self::NormalMaps,
        Self::SpecularTextures,
        Self::TransmissionTextures,
        Self::EmissionTextures,
        Self::Clearcoat,
        Self::SmoothCoats,
        Self::ClearcoatTextures,
        Self::DeepTextures,
        Self::Uv1,
        Self::VertexColors,
        Self::SmoothNormals,
        Self::Curved,
        Self::Instanced,
        Self::Mirrors,
        Self::Glass,
        Self::Panes,
        Self::Volumes,
        Self::AlphaMask,
        Self::AlphaBlend,
        Self::Emission,
        Self::Unlit,
        Self::RoughLobes,
        Self::SpotLights,
        Self::DirectionalLights,
        Self::Environment,
        Self::DeepStructure,
    ];

    /// Its name in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Textures => "textures of base colour",
            Self::MetallicRoughnessTextures => "textures of roughness and metalness",
            Self::NormalMaps => "normal maps",
            Self::SpecularTextures => "textures of specular reflection",
            Self::TransmissionTextures => "textures of transmission",
            Self::EmissionTextures => "textures of emission",
            Self::Clearcoat => "clear coats",
            Self::SmoothCoats => "clear coats that mirror",
            Self::ClearcoatTextures => "textures of clear coats",
            Self::DeepTextures => "textures of 16 bits a channel",
            Self::Uv1 => "second texture coordinates",
            Self::VertexColors => "vertex colours",
            Self::SmoothNormals => "shading normals",
            Self::Curved => "curved surfaces",
            Self::Instanced => "instances",
            Self::Mirrors => "mirrors",
            Self::Glass => "glass",
            Self::Panes => "panes",
            Self::Volumes => "solid glass",
            Self::AlphaMask => "alpha masks",
            Self::AlphaBlend => "blended alpha",
            Self::Emission => "emission",
            Self::Unlit => "unlit materials",
            Self::RoughLobes => "specular lobes but mirrors",
            Self::SpotLights => "spot lights",
            Self::DirectionalLights => "directional lights",
            Self::Environment => "environment",
            Self::DeepStructure => "deeper structures",
        }
    }
}

impl SceneProfile {
    /// As if the scene had a feature, too.
    #[must_use]
    pub fn with(mut self, feature: Feature) -> Self {
        let flag = match feature {
            Feature::Textures => &mut self.textures,
            Feature::MetallicRoughnessTextures => &mut self.metallic_roughness_textures,
            Feature::NormalMaps => &mut self.normal_maps,
            Feature::SpecularTextures => &mut self.specular_textures,
            Feature::TransmissionTextures => &mut self.transmission_textures,
            Feature::EmissionTextures => &mut self.emission_textures,
            Feature::Clearcoat => &mut self.clearcoat,
            Feature::SmoothCoats => &mut self.smooth_coats,
            Feature::ClearcoatTextures => &mut self.clearcoat_textures,
            Feature::DeepTextures => &mut self.deep_textures,
            Feature::Uv1 => &mut self.uv1,
            Feature::VertexColors => &mut self.vertex_colors,
            Feature::SmoothNormals => &mut self.smooth_normals,
            Feature::Curved => &mut self.curved,
            Feature::Instanced => &mut self.instanced,
            Feature::Mirrors => &mut self.mirrors,
            Feature::Glass => &mut self.glass,
            Feature::Panes => {
                self.beyond_panes = true;
                &mut self.panes
            }
            Feature::Volumes => &mut self.volumes,
            Feature::AlphaMask => &mut self.alpha_mask,
            Feature::AlphaBlend => &mut self.alpha_blend,
            Feature::Emission => &mut self.emission,
            Feature::Unlit => &mut self.unlit,
            Feature::RoughLobes => &mut self.rough_lobes,
            Feature::Environment => &mut self.environment,
            Feature::SpotLights => {
                self.spot_lights = self.spot_lights.max(1);
                return self;
            }
            Feature::DirectionalLights => {
                self.directional_lights = self.directional_lights.max(1);
                return self;
            }
            // Not the scene's, but its structure's.
            Feature::DeepStructure => return self,
        };
        *flag = true;
        self
    }
}
