#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/rows.cl"
#include "accel/leaf.cl"
#include "accel/traverse.cl"
#include "accel/packet_rays.cl"
#include "accel/packet_leaf.cl"
// 64 neighbouring rays through the tree together: the same answers as trace_closest and trace_any, bit for bit. A
// node's children are tested once, against bounds of the whole packet; a child that comes off the stack, against the
// rays themselves, eight at a time (Wald et al. 2007, "Ray tracing deformable scenes", after Boulos et al. 2006).

// Stack entries are entry distance << 32 | node << 3 | lane; the distance's lowest bits make room for the first group
// of rays that met the node, before which no group can meet the child.
#define FIRST_GROUP 7u

static ulong packet_entry(const float enter, const uint first, const uint node, const uint lane)
{
    return ((ulong)((bits_of(enter) & ~FIRST_GROUP) | first) << 32) | (node << 3) | lane;
}

// Puts an entry on the stack; unless `any`, below all nearer ones from `base` on.
static void push_packet_entry(const ulong entry, const int any, const uint base, ulong *stack, uint *count)
{
    uint place = (*count)++;
    while (!any && place > base && stack[place - 1u] < entry) {
        stack[place] = stack[place - 1u];
        place--;
    }
    stack[place] = entry;
}

// The nearest child that the packet's bounds meet (any of them where `any`), or else the top of the stack; the others
// go on the stack.
static ulong visit_packet_node(const Geometry g, const Packet *p, const uint index, const uint first,
                               const float limit, const int any, ulong *stack, uint *count)
{
    float enters[8] __attribute__((aligned(32)));
    float8 enter;
    uint mask = packet_boxes8(g.nodes + index, &p->bounds, p->flip, limit, &enter);
    if (mask == 0u) {
        return stack[--*count];
    }
    *(private float8 *)enters = enter;
    uint lane = ctz_of(mask);
    ulong nearest = packet_entry(enters[lane], first, index, lane);
    const uint base = *count;
    for (mask &= mask - 1u; mask != 0u; mask &= mask - 1u) {
        lane = ctz_of(mask);
        const ulong entry = packet_entry(enters[lane], first, index, lane);
        push_packet_entry(entry < nearest ? nearest : entry, any, base, stack, count);
        nearest = entry < nearest ? entry : nearest;
    }
    return nearest;
}

static float4 near_corner(global const char *lane, const uint4 flip)
{
    return (float4)(*(global const float *)(lane + flip.x), *(global const float *)(lane + 2u * ROW + flip.y),
                    *(global const float *)(lane + 4u * ROW + flip.z), 0.0f);
}

static float4 far_corner(global const char *lane, const uint4 flip)
{
    return (float4)(*(global const float *)(lane + ROW - flip.x), *(global const float *)(lane + 3u * ROW - flip.y),
                    *(global const float *)(lane + 5u * ROW - flip.z), 0.0f);
}

// The first group from `group` on that meets a box; PACKET_GROUPS if none does.
static uint first_group_met(const Packet *p, const float4 near, const float4 far, uint group)
{
    float8 enter;
    while (group < PACKET_GROUPS && movemask8(box_met_by8(p, group, near, far, &enter)) == 0u) {
        group++;
    }
    return group;
}

// The rays from `group` on that meet a box.
static ulong rays_met(const Packet *p, const float4 near, const float4 far, uint group)
{
    float8 enter;
    ulong mask = 0ul;
    for (; group < PACKET_GROUPS; group++) {
        mask |= (ulong)movemask8(box_met_by8(p, group, near, far, &enter)) << (8u * group);
    }
    return mask;
}

static void trace_packet_tree(const Geometry g, Packet *p, const int any)
{
    ulong stack[STACK_SIZE];
    float limit = packet_limit(p);
    if (!has_nodes(g) || limit < 0.0f) {
        return;
    }
    stack[0] = stack_entry(0.0f, STACK_END);
    uint count = 1u;
    ulong entry = visit_packet_node(g, p, 0u, 0u, limit, any, stack, &count);
    while ((uint)entry != STACK_END) {
        const uint distance = (uint)(entry >> 32);
        if ((distance & ~FIRST_GROUP) > bits_of(limit) + FAR_PAD) {
            entry = stack[--count];
            continue;
        }
        global const Node *node = g.nodes + ((uint)entry >> 3);
        const uint lane = (uint)entry & 7u;
        global const char *box = (global const char *)node + 4u * lane;
        const float4 near = near_corner(box, p->flip);
        const float4 far = far_corner(box, p->flip);
        const uint child = ((global const uint *)&node->child)[lane];
        if (child & CHILD_LEAF) {
            const ulong mask = rays_met(p, near, far, distance & FIRST_GROUP);
            if (mask != 0ul && visit_packet_leaf(g, p, child, mask, any)) {
                limit = packet_limit(p);
                if (limit < 0.0f) {
                    return;
                }
            }
            entry = stack[--count];
        } else {
            const uint group = first_group_met(p, near, far, distance & FIRST_GROUP);
            entry = group < PACKET_GROUPS ? visit_packet_node(g, p, child, group, limit, any, stack, &count)
                                          : stack[--count];
        }
    }
}

static int is_usable(const Packet *p, const uint i) { return (int)((p->usable >> i) & 1ul); }

// The rays of up to 64 queued slots.
static void gather_packet(const Geometry g, global const uint *slots, const uint count, global const Ray *rays,
                          Packet *p)
{
    const float extent = geometry_extent(g);
    uint first = PACKET_RAYS;
    p->usable = 0ul;
    for (uint i = 0u; i < count; i++) {
        if (prepare_query(extent, rays[slots[i]], p->queries + i)) {
            p->usable |= 1ul << i;
            first = first < i ? first : i;
        }
    }
    if (first < PACKET_RAYS) {
        find_bounds(p, p->queries + first);
    }
}

// What the usable rays meet first, or where `any` whatever they meet, is in best_of then; prim stays NONE otherwise.
// Rays that do not agree in their signs are traced one by one.
static void trace_packet(const Geometry g, Packet *p, const int any)
{
    for (uint i = 0u; i < PACKET_RAYS && !p->coherent; i++) {
        if (is_usable(p, i)) {
            keep_best(p, i, trace(g, p->queries + i, any), any);
        }
    }
    if (!p->coherent) {
        return;
    }
#if HAS_PLANE
    for (uint i = 0u; i < PACKET_RAYS * g.plane_count; i++) {
        const uint ray = i % PACKET_RAYS;
        Closest best = best_of(p, ray);
        if (best.t >= 0.0f && visit_shape(g, p->queries + ray, i / PACKET_RAYS, &best)) {
            keep_best(p, ray, best, any);
        }
    }
#endif
    trace_packet_tree(g, p, any);
}

// Whether ray i met anything.
static int packet_met(const Packet *p, const uint i) { return is_usable(p, i) && lane_of_int8(p->prim, i) != NONE; }

// The hit of ray i, which came from `ray`.
static Hit packet_hit(const Geometry g, const Packet *p, const uint i, const Ray ray)
{
    return packet_met(p, i) ? hit_of(g, p->queries + i, best_of(p, i)) : miss_of(ray);
}
