#ifndef RADIANCE_CACHE_SHARES_GLSL
#define RADIANCE_CACHE_SHARES_GLSL

#include "lib/glossy.glsl"

struct Shares {
    uint diffuse;
    uint lobe;
};

// How rays are shared out: by what the diffuse part, where there is one, and the lobes reflect, one each at least.
Shares shares_of(GlossySurface g, uint rays, bool diffuse) {
    Shares s = Shares(diffuse ? rays : 0u, 0u);
    if (!GLOSSY || !has_glossy_lobe(g)) return s;
    float share = diffuse ? 1.0 - g.layers.p_diffuse : 1.0;
    s.lobe = clamp(uint(ceil(float(rays) * share)), 1u, diffuse ? max(rays, 2u) - 1u : rays);
    if (diffuse) s.diffuse = max(rays - s.lobe, 1u);
    return s;
}

#endif
