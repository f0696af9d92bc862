#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"

// How much of the tree a group of 64 neighbouring rays touches against what each of them touches: coherent rays share
// most of it. Build with HAS_COUNTERS. Groups are queue[first + 64 k ...]; results[k] = (node visits of all its rays,
// leaf visits, different nodes, different leaves). Leaves are blocks, then shapes.
//
// Race rule: item w of `workers` owns the groups w, w + workers, ... and the words of `bitmaps` from
// w * (node_words + leaf_words) on, which are zero before and after.

#define GROUP_RAYS 64u

static uint count_and_clear(global uint *words, const uint count)
{
    uint set = 0u;
    for (uint i = 0u; i < count; i++) {
        const uint word = words[i];
        if (word != 0u) {
            set += popcount_of(word);
            words[i] = 0u;
        }
    }
    return set;
}

VEC_LEN_HINT __attribute__((reqd_work_group_size(1, 1, 1)))
kernel void coherence(GEOMETRY_ARGUMENTS, global const uint *queue, const uint first, const uint count,
                      global const Ray *rays, const uint any, const uint workers, global uint *bitmaps,
                      const uint node_words, const uint leaf_words, global uint4 *results)
{
    const uint worker = (uint)get_global_id(0);
    if (worker >= workers) {
        return;
    }
    Geometry g = GEOMETRY_OF_ARGUMENTS;
    Visits visits;
    visits.node_bits = bitmaps + (ulong)worker * (node_words + leaf_words);
    visits.leaf_bits = visits.node_bits + node_words;
    g.visits = &visits;
    const uint groups = (count + GROUP_RAYS - 1u) / GROUP_RAYS;
    for (uint group = worker; group < groups; group += workers) {
        const uint begin = group * GROUP_RAYS;
        const uint end = begin + GROUP_RAYS < count ? begin + GROUP_RAYS : count;
        visits.nodes = 0u;
        visits.leaves = 0u;
        for (uint i = begin; i < end; i++) {
            const Ray ray = rays[queue[first + i]];
            if (any) {
                trace_any(g, ray);
            } else {
                trace_closest(g, ray);
            }
        }
        const uint nodes_met = count_and_clear(visits.node_bits, node_words);
        const uint leaves_met = count_and_clear(visits.leaf_bits, leaf_words);
        results[group] = (uint4)(visits.nodes, visits.leaves, nodes_met, leaves_met);
    }
}
