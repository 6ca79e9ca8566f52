// The paper's bound on the geometry term (Marques & Santos 2010, eq. 1).
#ifndef INDIRECT_BOUNDING_GLSL
#define INDIRECT_BOUNDING_GLSL

// The paper's cubic f(a, b, d).
float smooth_step(float a, float b, float d) {
    if (d >= b) return 1.0;
    if (d <= a) return 0.0;
    float s = (d - a) / (b - a);
    return s * s * (3.0 - 2.0 * s);
}

// What bounding leaves of the light of a VPL so far away (m).
float bounded(float d, float min_distance) { return smooth_step(0.8 * min_distance, 1.2 * min_distance, d); }

#endif
