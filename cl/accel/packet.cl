#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/rows.cl"
#include "accel/leaf.cl"
#include "accel/traverse.cl"
#include "accel/packet_rays.cl"
#include "accel/packet_beam.cl"
#include "accel/packet_leaf.cl"
// 64 neighbouring rays through the tree together: the same answers as trace_closest and trace_any, bit for bit. A
// node's children are tested against a beam around all rays (after Reshetov et al. 2005, "Multi-level ray tracing
// algorithm"). For any hit, where bundles are wide, a node that comes off the stack is tested against the rays
// themselves, eight at a time, up to the first that meets it (Wald et al. 2007, "Ray tracing deformable scenes").

// Stack entries are entry distance << 32 | node << 3 | lane.
static ulong packet_entry(const float enter, const uint node, const uint lane)
{
    return ((ulong)bits_of(enter) << 32) | (node << 3) | lane;
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

// The nearest child that the beam meets (any of them where `any`), or else the top of the stack; the others go on the
// stack.
static ulong visit_packet_node(const Geometry g, const Packet *p, const uint index, const float limit, const int any,
                               ulong *stack, uint *count)
{
    float enters[8] __attribute__((aligned(32)));
    float8 enter;
    uint mask = beam_boxes8(&p->beam, node_rows(&p->beam, g.nodes + index), limit, &enter);
    if (mask == 0u) {
        return stack[--*count];
    }
    *(private float8 *)enters = enter;
    uint lane = ctz_of(mask);
    ulong nearest = packet_entry(enters[lane], index, lane);
    const uint base = *count;
    for (mask &= mask - 1u; mask != 0u; mask &= mask - 1u) {
        lane = ctz_of(mask);
        const ulong entry = packet_entry(enters[lane], index, lane);
        push_packet_entry(entry < nearest ? nearest : entry, any, base, stack, count);
        nearest = entry < nearest ? entry : nearest;
    }
    return nearest;
}

// Drops groups of which all rays are done; gives the farthest that the others look.
static float packet_progress(Packet *p)
{
    uint count = 0u;
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        p->groups[count] = group;
        count += movemask8(p->t[group] < 0.0f) != 0xffu ? 1u : 0u;
    }
    p->group_count = count;
    return packet_limit(p);
}

static int visit_packet_leaf(const Geometry g, Packet *p, const uint child, const uint *groups, const uint count,
                             const float limit, const int any)
{
#if HAS_ANALYTIC || HAS_INSTANCES
    if (child & CHILD_ANALYTIC) {
        return visit_packet_shape(g, p, child & CHILD_SHAPE_MASK, p->together, any);
    }
#endif
#if HAS_TRIANGLES
    return visit_packet_block(g, p, child, groups, count, limit, any);
#else
    return 0;
#endif
}

static void trace_packet_tree(const Geometry g, Packet *p, const int any)
{
    ulong stack[STACK_SIZE];
    uint groups[PACKET_GROUPS];
    uint met = 0u;
    float limit = packet_progress(p);
    if (!has_nodes(g) || limit < 0.0f) {
        return;
    }
    stack[0] = stack_entry(0.0f, STACK_END);
    uint count = 1u;
    ulong entry = visit_packet_node(g, p, world_root(g), limit, any, stack, &count);
    while ((uint)entry != STACK_END) {
        if ((uint)(entry >> 32) > bits_of(limit)) {
            entry = stack[--count];
            continue;
        }
        global const Node *node = g.nodes + ((uint)entry >> 3);
        const uint lane = (uint)entry & 7u;
        const uint child = ((global const uint *)&node->child)[lane];
        if (child & CHILD_LEAF || any) {
            const PacketBox box = PACKET_BOX(p, (global const float *)node, lane);
            met = list_groups(p, p->groups, p->group_count, box, 0u, groups);
        }
        if (child & CHILD_LEAF) {
            if (met != 0u && visit_packet_leaf(g, p, child, groups, met, limit, any)) {
                limit = packet_progress(p);
                if (limit < 0.0f) {
                    return;
                }
            }
            entry = stack[--count];
        } else {
            entry = !any || met != 0u ? visit_packet_node(g, p, child, limit, any, stack, &count) : stack[--count];
        }
    }
}

// One ray that does not go with the others.
static void trace_alone(const Geometry g, Packet *p, const uint i, const int any)
{
    Query q;
    if (!prepare_query(p->extent, p->rays[p->slots[swapped(i)]], &q)) {
        return;
    }
    const Closest best = trace(g, &q, any);
    if (any) {
        set_lane_int8(p->prim, i, best.prim);
    } else if (best.prim != NONE) {
        const Hit hit = hit_of(g, &q, best);
        set_lane8(p->t, i, hit.t);
        set_lane8(p->t_unit, i, 1.0f);
        set_lane8(p->u, i, hit.u);
        set_lane8(p->v, i, hit.v);
        set_lane8(p->sum, i, 1.0f);
        set_lane_int8(p->prim, i, best.prim);
    }
}

#if PLAIN_FIRST
// The box around a triangle, rounded outward as box_met does it.
static PacketBox triangle_box(const Packet *p, const Geometry g, const uint place)
{
    float rows[48];
    global const float *values = (global const float *)(g.blocks + (place >> 3)) + (place & 7u);
    for (uint axis = 0u; axis < 3u; axis++) {
        const float a = values[8u * axis];
        const float b = values[8u * axis + 24u];
        const float c = values[8u * axis + 48u];
        const float low = min_of(a, min_of(b, c));
        const float high = max_of(a, max_of(b, c));
        rows[16u * axis] = low - abs_of(low) * UNIT_ROUNDOFF;
        rows[16u * axis + 8u] = high + abs_of(high) * UNIT_ROUNDOFF;
    }
    const PacketBox box = PACKET_BOX(p, rows, 0u);
    return box;
}

// Rays whose winner by plain t is not what exact candidates give (leaf.cl: stands), eight at a time.
static ulong unsettled(const Geometry g, const Packet *p)
{
    ulong rays = 0ul;
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        const int8 winners = as_uint8(p->prim[group]) < (uint8)(g.triangle_count);
        uint left = movemask8(winners) & (uint)(p->together >> (8u * group)) & 0xffu;
        while (left != 0u) {
            const uint place = lane_of_int8(p->place, 8u * group + ctz_of(left));
            const uint same = movemask8(p->place[group] == (int8)((int)place)) & left;
            float8 enter;
            const PacketBox box = triangle_box(p, g, place);
            const int8 met = box_met_by8(p, group, box, p->mixed, &enter);
            rays |= (ulong)(same & ~movemask8(met & (p->t[group] >= enter * NEAR_SCALE))) << (8u * group);
            left &= ~same;
        }
    }
    return rays;
}

// Traces these rays once more, exactly.
static void settle_packet(const Geometry g, Packet *p)
{
    for (ulong rays = unsettled(g, p); rays != 0ul; rays &= rays - 1ul) {
        const uint i = lowest_ray(rays);
        set_lane_int8(p->prim, i, NONE);
        trace_alone(g, p, i, 0);
    }
}
#endif

// All rays one by one, which ask for any hit.
static void trace_unlike(const Geometry g, Packet *p, const uint count)
{
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        p->prim[group] = (int8)((int)NONE);
    }
    for (uint i = 0u; i < PACKET_RAYS; i++) {
        const uint ray = swapped(i);
        if (ray < count) {
            trace_alone(g, p, i, 1);
        }
    }
}

// Traces the packet's rays that go together, planes first.
static void trace_together(const Geometry g, Packet *p, const int any)
{
#if HAS_PLANE
    for (uint i = 0u; i < g.plane_count; i++) {
        visit_packet_shape(g, p, i, p->together, any);
    }
#endif
    trace_packet_tree(g, p, any);
#if PLAIN_FIRST
    if (!any) {
        settle_packet(g, p);
    }
#endif
}

// Traces the rays of up to 64 queued slots: what they meet first, or where `any` whatever they meet, is in packet_hit
// and packet_met then. Rays apart come last: with a t of their own they would take part in their groups.
static void trace_packet(const Geometry g, Packet *p, global const uint *slots, const uint count,
                         global const Ray *rays, const int any)
{
    Bounds8 all;
    p->extent = geometry_extent(g);
    p->rays = rays;
    p->slots = slots;
    if (any && !look_alike(p, count)) {
        trace_unlike(g, p, count);
        return;
    }
    begin_packet(p, count, &all);
    if (count_rays(p->together) < FEWEST_TOGETHER || !set_beam(p, &all, any ? WIDEST_BEAM_ANY : WIDEST_BEAM)) {
        p->together = 0ul;
    }
    if (p->together != 0ul) {
        trace_together(g, p, any);
    }
    for (ulong alone = p->usable & ~p->together; alone != 0ul; alone &= alone - 1ul) {
        trace_alone(g, p, lowest_ray(alone), any);
    }
}

// Whether a ray met anything.
static int packet_met(const Packet *p, const uint ray) { return lane_of_int8(p->prim, swapped(ray)) != NONE; }

// The hit of a ray.
static Hit packet_hit(const Packet *p, const uint ray)
{
    const uint i = swapped(ray);
    const int met = packet_met(p, ray);
    Hit hit;
    hit.t = met ? lane_of8(p->t, i) * lane_of8(p->t_unit, i) : lane_of8(p->t_given, i);
    hit.u = met ? lane_of8(p->u, i) / lane_of8(p->sum, i) : 0.0f;
    hit.v = met ? lane_of8(p->v, i) / lane_of8(p->sum, i) : 0.0f;
    hit.prim = lane_of_int8(p->prim, i);
    return hit;
}
