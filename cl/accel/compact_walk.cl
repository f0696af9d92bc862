#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/box.cl"
#include "accel/compact_grid.cl"
#if HAS_COMPACT
// From leaf to leaf through compact nodes, for devices that run one ray a work-item on narrow lanes: children four at a
// time, and a short stack with at most one entry a level. An entry is a node and those of its children that are still
// to be visited, nearest first; no distances are kept, a child is tested again when its turn comes.
//
// No hit is lost: a plane is first made a number, by the arithmetic with which the packer saw to it that the box
// contains the wide node's, and then tested as box.cl tests it. Every step keeps order, so a box is entered no later
// and left no earlier than any box inside it, the candidate's own (leaf.cl) included: where that one is met up to some
// limit, no box around it can have been passed over. Boxes larger than the wide tree's cost visits, never a hit.

// Stack entries: children still to visit << 32 | node. The children are 3 bits each, the next one lowest, below a 1.
#define CHILDREN_UNKNOWN 0u  // the node has not been tested; an entry made by stack_entry(0.0f, node)
#define CHILDREN_DONE 1u

// Planes of four lanes, a byte each.
static float4 grid_planes4(const uint bytes, const float low, const float step)
{
    const uint4 q = ((uint4)(bytes) >> (uint4)(0u, 8u, 16u, 24u)) & 255u;
    return fma4(float4_of(as_int4(q)), (float4)(step), (float4)(low));
}

// Narrows four intervals of t, first to last, to the slabs between near and far planes of one axis; on an axis without
// motion, to nothing where the origin is not between them.
static void clip4(const float4 near, const float4 far, const float inverse, const float shift, const uint still,
                  const float o, float4 *first, float4 *last)
{
    if (still != 0u) {
        const int4 inside = (near <= (float4)(o)) & (far >= (float4)(o));
        *last = inside ? *last : (float4)(-1.0f);
        return;
    }
    *first = max4(fma4(near, (float4)(inverse), (float4)(shift)), *first);
    *last = min4(fma4(far, (float4)(inverse), (float4)(shift)), *last);
}

// Sorting keys of four lanes, from `lane` on: where the ray enters the box, but for 3 bits, which are the lane; NONE
// where it meets nothing up to `limit`. near_bytes, far_bytes: planes of x, y, z.
static uint4 child_keys4(const float4 grid, const uint4 near_bytes, const uint4 far_bytes, const uint lane,
                         const SlabRay s, const float limit)
{
    const uint bits = bits_of(grid.w);
    const uint4 lanes = (uint4)(0u, 1u, 2u, 3u) + lane;
    const float4 step = grid_steps(bits);
    float4 first = (float4)(0.0f);
    float4 last = (float4)(limit);
    clip4(grid_planes4(near_bytes.x, grid.x, step.x), grid_planes4(far_bytes.x, grid.x, step.x), s.inverse.x,
          s.shift.x, s.still & 1u, s.o.x, &first, &last);
    clip4(grid_planes4(near_bytes.y, grid.y, step.y), grid_planes4(far_bytes.y, grid.y, step.y), s.inverse.y,
          s.shift.y, s.still & 2u, s.o.y, &first, &last);
    clip4(grid_planes4(near_bytes.z, grid.z, step.z), grid_planes4(far_bytes.z, grid.z, step.z), s.inverse.z,
          s.shift.z, s.still & 4u, s.o.z, &first, &last);
    const int4 filled = (((uint4)(bits >> 24) >> lanes) & 1u) != 0u;
    const int4 met = as_int4(last) + (int)(FAR_PAD + 1u) > as_int4(first);  // as box.cl decides
    return (met & filled) ? (as_uint4(first) & ~7u) | lanes : (uint4)(NONE);
}

static void order_two(private uint *keys, const uint a, const uint b)
{
    const uint low = keys[a] < keys[b] ? keys[a] : keys[b];
    const uint high = keys[a] < keys[b] ? keys[b] : keys[a];
    keys[a] = low;
    keys[b] = high;
}

// Batcher's network for 8 numbers: no branch, and constant places, so that all of them stay in registers.
static void sort8(private uint *keys)
{
    order_two(keys, 0u, 1u); order_two(keys, 2u, 3u); order_two(keys, 4u, 5u); order_two(keys, 6u, 7u);
    order_two(keys, 0u, 2u); order_two(keys, 1u, 3u); order_two(keys, 4u, 6u); order_two(keys, 5u, 7u);
    order_two(keys, 1u, 2u); order_two(keys, 5u, 6u);
    order_two(keys, 0u, 4u); order_two(keys, 1u, 5u); order_two(keys, 2u, 6u); order_two(keys, 3u, 7u);
    order_two(keys, 2u, 4u); order_two(keys, 3u, 5u);
    order_two(keys, 1u, 2u); order_two(keys, 3u, 4u); order_two(keys, 5u, 6u);
}

// The children that a ray meets up to `limit`, as a stack entry has them; unsorted where `any` of them will do.
static uint children_met(global const CompactNode *node, const SlabRay s, const float limit, const int any)
{
    uint keys[8] __attribute__((aligned(16)));
    const float4 grid = node->grid;
    const uint4 x = s.flip.x ? node->x.zwxy : node->x;  // now xy = near planes, zw = far ones
    const uint4 y = s.flip.y ? node->y.zwxy : node->y;
    const uint4 z = s.flip.z ? node->z.zwxy : node->z;
    *(private uint4 *)keys =
        child_keys4(grid, (uint4)(x.x, y.x, z.x, 0u), (uint4)(x.z, y.z, z.z, 0u), 0u, s, limit);
    *(private uint4 *)(keys + 4) =
        child_keys4(grid, (uint4)(x.y, y.y, z.y, 0u), (uint4)(x.w, y.w, z.w, 0u), 4u, s, limit);
    if (!any) {
        sort8(keys);
    }
    uint children = CHILDREN_DONE;
    for (uint i = 8u; i-- > 0u;) {
        children = keys[i] == NONE ? children : children << 3 | (keys[i] & 7u);
    }
    return children;
}

// Whether the ray meets one child up to `limit`.
static int child_met(global const CompactNode *node, const SlabRay s, const uint lane, const float limit)
{
    const float4 grid = node->grid;
    const uint bits = bits_of(grid.w);
    global const uint *words = (global const uint *)&node->x + (lane >> 2);
    const uint shift = 8u * (lane & 3u);
    const float4 step = grid_steps(bits);
    const float4 low = (float4)(grid_plane(grid.x, step.x, words[0] >> shift & 255u),
                                grid_plane(grid.y, step.y, words[4] >> shift & 255u),
                                grid_plane(grid.z, step.z, words[8] >> shift & 255u), 0.0f);
    const float4 high = (float4)(grid_plane(grid.x, step.x, words[2] >> shift & 255u),
                                 grid_plane(grid.y, step.y, words[6] >> shift & 255u),
                                 grid_plane(grid.z, step.z, words[10] >> shift & 255u), 0.0f);
    float enter;
    return box_met(s, low, high, limit, &enter);
}

static uint visit_node(const Geometry g, const uint index, const SlabRay slab, const float limit, const int any)
{
#if HAS_COUNTERS
    count_visit(g.visits, index, 0);
#endif
    return children_met(g.nodes + index, slab, limit, any);
}

// Walks, as far as `limit`, from the entry below `top` to the next leaf; STACK_END where there is none.
static uint next_leaf(const Geometry g, private const SlabRay *ray, const float limit, const int any,
                      private ulong **top)
{
    const SlabRay slab = *ray;
    for (;;) {  // ends: every turn takes a child away for good, and the tree has a bottom
        const ulong entry = *--*top;
        uint index = (uint)entry;
        uint children = (uint)(entry >> 32);
        if (index == STACK_END) {
            return STACK_END;
        }
        if (children == CHILDREN_UNKNOWN) {
            children = visit_node(g, index, slab, limit, any);
        } else if (!any) {
            while (children != CHILDREN_DONE && !child_met(g.nodes + index, slab, children & 7u, limit)) {
                children >>= 3;
            }
        }
        while (children != CHILDREN_DONE) {
            const uint child = ((global const uint *)&g.nodes[index].child)[children & 7u];
            children >>= 3;
            if (children != CHILDREN_DONE) {
                *(*top)++ = (ulong)children << 32 | index;
            }
            if (child & CHILD_LEAF) {
                return child;
            }
            index = child;
            children = visit_node(g, index, slab, limit, any);
        }
    }
}
#endif
