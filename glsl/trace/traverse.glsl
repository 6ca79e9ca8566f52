// Which primitive a ray meets first, or with `any_hit` any that it meets, and the placement that it is in; NONE if none.
// `t_max` becomes where.
//
// Included once for each kind of primitive, after its test, with RAY defined: what the test knows of a ray; and with
// LEVELS where placements may have a level of their own.
//
// bool meets(RAY ray, uint index, uvec2 best, float t_min, float t_max, out float t);
//
// It is true where the ray meets a primitive before `t_max`, namely at `t`, or at `t_max` one that precedes `best`.
uvec2 traverse(BvhNodes nodes, NodeRay node, RAY ray, float t_min, inout float t_max, const bool any_hit)
{
    uint best = NONE;
    uint within = 0u; // the placement of the best
    uint placement = NONE; // that is traversed; NONE above them
    uint top = 0u;
    uint bottom = 0u; // of the stack, as far as it belongs to the level
    uvec2 group = root(0u);
    bool going = true;
    do {
        uvec2 found;
#ifdef LEVELS
        // From the stack also come placements, a group without nodes.
        if (TWO_LEVELS && group.y <= 0x00ffffffu) {
            found = group;
            group.y = 0u;
        } else
#endif
            found = visit(nodes, node, t_min, t_max, group, top);
#ifdef LEVELS
        if (TWO_LEVELS && placement == NONE && found.y != 0u) {
            if (group.y > 0x00ffffffu) trace_stack[top++] = group;
            uint at = uint(findMSB(found.y));
            found.y &= ~(1u << at);
            if (found.y != 0u) trace_stack[top++] = found;
            placement = found.x + at;
            bottom = top;
            uint first;
            node = placed_ray(placement, ray, first);
            set_placement(placement, ray);
            nodes = BvhNodes(scene.bvh_nodes);
            group = root(first);
            found.y = 0u;
        }
#endif
        while (found.y != 0u) {
            uint at = uint(findMSB(found.y));
            found.y &= ~(1u << at);
            at += found.x;
            float t;
            if (!meets(ray, at, uvec2(best, within), t_min, t_max, t)) continue;
            best = at;
            within = placement;
            // A return from here is lost on some lanes by Mesa 22.3's lavapipe; in the loop's condition the test is 1 % slower.
            if (any_hit) break;
            t_max = t;
        }
        if (any_hit && best != NONE) break;
        going = proceed(group, top, bottom);
#ifdef LEVELS
        if (TWO_LEVELS && !going && placement != NONE) {
            placement = NONE;
            bottom = 0u;
            node = node_ray(ray.origin, ray.direction);
            nodes = BvhNodes(scene.bvh_top);
            going = proceed(group, top, bottom);
        }
#endif
    } while (going);
    return uvec2(best, within);
}
