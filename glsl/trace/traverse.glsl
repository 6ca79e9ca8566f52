// Which primitive a ray meets first, or with `any_hit` any that it meets; NONE if none. `t_max` becomes where.
//
// Included once for each kind of primitive, after its test, with RAY defined: what the test knows of a ray.
//
// bool meets(RAY ray, uint index, uint best, float t_min, float t_max, out float t);
//
// It is true where the ray meets a primitive before `t_max`, namely at `t`, or at `t_max` one that precedes `best`.
uint traverse(BvhNodes nodes, NodeRay node_ray, RAY ray, float t_min, inout float t_max, const bool any_hit)
{
    uint best = NONE;
    uint top = 0u;
    uvec2 group = ROOT;
    do {
        uvec2 found = visit(nodes, node_ray, t_min, t_max, group, top);
        while (found.y != 0u) {
            uint at = uint(findMSB(found.y));
            found.y &= ~(1u << at);
            at += found.x;
            float t;
            if (!meets(ray, at, best, t_min, t_max, t)) continue;
            best = at;
            // A return from here is lost on some lanes by Mesa 22.3's lavapipe; in the loop's condition the test is 1 % slower.
            if (any_hit) break;
            t_max = t;
        }
        if (any_hit && best != NONE) break;
    } while (proceed(group, top));
    return best;
}
