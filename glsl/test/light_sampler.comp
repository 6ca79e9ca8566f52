#version 460
#extension GL_GOOGLE_include_directive : require
// Chooses lights at receivers, so many times each, and lists the probability of every light there.
layout(local_size_x = 64) in;
#include "lib/light_sampler.glsl"

struct LightReceiver {
    vec3 position;
    uint through;
    vec3 normal;
};

struct ListedLight {
    uint chosen; // of the lights without size, then emissive triangles
    float probability;
    uint light; // of the node with this number
    float listed;
};

layout(set = 1, binding = 0, scalar) readonly buffer Receivers { LightReceiver data[]; } receivers;
layout(set = 1, binding = 1, scalar) writeonly buffer Answers { ListedLight data[]; } answers;
layout(push_constant) uniform Params { uint count; uint each; uint nodes; } params;

const uint NO_LIGHT = 0xffffffffu;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count * params.each) return;
    LightReceiver at = receivers.data[i / params.each];
    uint k = i % params.each;
    Receiver x = Receiver(at.position, at.normal, at.normal, at.normal, 0.0);
    bool through = at.through != 0u;
    LightSource lights = all_lights();
    ListedLight answer = ListedLight(NO_LIGHT, 0.0, NO_LIGHT, 0.0);
    ChosenLight chosen;
    if (choose_light(lights, x, through, unit_float(hash(i)), chosen)) {
        answer.chosen = chosen.delta ? chosen.light : scene.light_count + chosen.choice.primitive;
        answer.probability = chosen.choice.probability;
    }
    if (k < params.nodes) {
        LightNode node = light_node(k);
        if ((node.child & LIGHT_NODE_LEAF) != 0u) {
            bool delta = (node.child & LIGHT_NODE_DELTA) != 0u;
            answer.light = (node.child & LIGHT_NODE_INDEX) + (delta ? 0u : scene.light_count);
            answer.listed = lights.tree_probability * probability_of(lights.root, k, x, through);
        }
    }
    answers.data[i] = answer;
}
