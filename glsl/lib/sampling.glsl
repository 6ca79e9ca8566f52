// Low-discrepancy numbers, hashes and warps. Twin: src/sampling (integers equal bit for bit).
#ifndef LIB_SAMPLING_GLSL
#define LIB_SAMPLING_GLSL

const float PI = 3.14159265358979;

const uint PRIMES[69] = uint[69](
    2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101, 103, 107,
    109, 113, 127, 131, 137, 139, 149, 151, 157, 163, 167, 173, 179, 181, 191, 193, 197, 199, 211, 223, 227, 229,
    233, 239, 241, 251, 257, 263, 269, 271, 277, 281, 283, 293, 307, 311, 313, 317, 331, 337, 347);

// PCG as a hash (Jarzynski & Olano 2020).
uint hash(uint v) {
    uint state = v * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash(uint a, uint b) { return hash(a ^ hash(b)); }
uint hash(uint a, uint b, uint c) { return hash(a ^ hash(b, c)); }

float unit_float(uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }

// The radical inverse of `index` in the base of `dimension` as digits: numerator and denominator.
// Seed 0 leaves the digits as they are; any other maps each by an affine permutation modulo the (prime) base.
uvec2 halton_digits(uint dimension, uint index, uint seed) {
    uint base = PRIMES[dimension];
    uint numerator = 0u, denominator = 1u;
    // As many digits as fit 32 bits: scrambled zeros count too.
    uint last = 0xffffffffu / base;
    for (uint level = 0u; denominator <= last; ++level) {
        uint digit = index % base;
        index /= base;
        if (seed != 0u) {
            uint h = hash(seed, dimension, level);
            digit = (digit * (1u + (h & 0xffffu) % (base - 1u)) + (h >> 16) % base) % base;
        }
        numerator = numerator * base + digit;
        denominator *= base;
    }
    return uvec2(numerator, denominator);
}

float halton(uint dimension, uint index, uint seed) {
    uvec2 digits = halton_digits(dimension, index, seed);
    return min(float(digits.x) / float(digits.y), 0.99999994);
}

// Owen scrambling of binary digits, the least significant first: each is flipped by a hash of those below (Burley,
// "Practical Hash-based Owen Scrambling", 2020; constants of Vegdahl, "Building a Better LK Hash", 2021).
uint owen_scramble(uint digits, uint seed) {
    digits ^= digits * 0x3d20adeau;
    digits += seed;
    digits *= (seed >> 16) | 1u;
    digits ^= digits * 0x05526c56u;
    digits ^= digits * 0x53a22864u;
    return digits;
}

// Element `index` of an Owen-scrambled and shuffled (0, 2)-sequence (Sobol' 1967), digits after the binary point from the
// top bit down. Every seed is another, independent one.
uvec2 sobol_bits(uint index, uint seed) {
    uint i = bitfieldReverse(owen_scramble(bitfieldReverse(index), hash(seed, 0u)));
    uint j = i; // times Pascal's triangle modulo 2
    j ^= (j >> 16) & 0x0000ffffu;
    j ^= (j >> 8) & 0x00ff00ffu;
    j ^= (j >> 4) & 0x0f0f0f0fu;
    j ^= (j >> 2) & 0x33333333u;
    j ^= (j >> 1) & 0x55555555u;
    return bitfieldReverse(uvec2(owen_scramble(i, hash(seed, 1u)), owen_scramble(j, hash(seed, 2u))));
}

vec2 sobol(uint index, uint seed) {
    uvec2 bits = sobol_bits(index, seed);
    return vec2(unit_float(bits.x), unit_float(bits.y));
}

// Orthonormal basis around a unit vector (Duff et al. 2017).
mat3 basis_around(vec3 n) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

// Density 1/4π.
vec3 sample_sphere(vec2 u) {
    float z = 1.0 - 2.0 * u.x;
    float r = sqrt(max(0.0, 1.0 - z * z));
    return vec3(r * cos(2.0 * PI * u.y), r * sin(2.0 * PI * u.y), z);
}

// Density 1/(2π(1 − cos_max)) around +Z.
vec3 sample_cone(vec2 u, float cos_max) {
    float z = 1.0 - u.x * (1.0 - cos_max);
    float r = sqrt(max(0.0, 1.0 - z * z));
    return vec3(r * cos(2.0 * PI * u.y), r * sin(2.0 * PI * u.y), z);
}

// Density 1/π on the unit disc.
vec2 sample_disc(vec2 u) {
    return sqrt(u.x) * vec2(cos(2.0 * PI * u.y), sin(2.0 * PI * u.y));
}

// Density cosθ/π around +Z.
vec3 sample_cosine_hemisphere(vec2 u) {
    vec2 d = sample_disc(u);
    return vec3(d, sqrt(max(0.0, 1.0 - u.x)));
}

#endif
