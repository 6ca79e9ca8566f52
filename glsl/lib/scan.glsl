// Prefix sums over a workgroup (Hillis & Steele 1986), the part that larger ones are made of: the sums of blocks, the prefix
// sums of these, and from there on those within each block. Declares the local size.
#ifndef LIB_SCAN_GLSL
#define LIB_SCAN_GLSL

const uint SCAN_THREADS = 256u;
layout(local_size_x = SCAN_THREADS) in;

shared uint scanned[SCAN_THREADS];

// The sum of the values of the threads before, and of all. Every thread calls it.
uint sum_before(uint value, out uint total) {
    uint thread = gl_LocalInvocationIndex;
    scanned[thread] = value;
    barrier();
    for (uint step = 1u; step < SCAN_THREADS; step *= 2u) {
        uint left = thread >= step ? scanned[thread - step] : 0u;
        barrier();
        scanned[thread] += left;
        barrier();
    }
    uint before = scanned[thread] - value;
    total = scanned[SCAN_THREADS - 1u];
    barrier();
    return before;
}

#endif
