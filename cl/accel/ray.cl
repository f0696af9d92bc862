#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/compact_grid.cl"
// A ray as the traversal wants it: direction scaled by a power of two so that its largest component is in [1, 2),
// t in lengths of that direction. Scaling by powers of two is exact: it changes no decision at any scale.

#define SMALLEST_NORMAL 0x00800000u  // 2^-126
#define HUGE_BITS 0x7f000000u        // 2^127
#define INFINITY_BITS 0x7f800000u
#define LIMIT_BITS 0x5e000000u       // 2^61: the host drops what lies beyond 1.8e18

typedef struct {
    float4 o;      // w = 0
    float4 d;      // w = 0
    float t_max;
    float t_unit;  // times a scaled t gives the ray's own t
    float extent;  // largest magnitude of any coordinate that takes part
    uint skip;     // planar primitive that the ray left, or NONE
    uint axis;     // along which the direction is longest
} TraceRay;

// Largest magnitude of three components, as bits: these order like the numbers, with Inf and NaN above all.
static uint largest_bits(const uint4 magnitudes)
{
    const uint xy = magnitudes.x > magnitudes.y ? magnitudes.x : magnitudes.y;
    return xy > magnitudes.z ? xy : magnitudes.z;
}

#if HAS_TREE
static int has_nodes(const Geometry g) { return g.block_count > 0u || g.shape_count > g.plane_count; }
#endif

#if HAS_COMPACT
// Largest coordinate magnitude of the geometry; its order of magnitude is enough. From the root's grid.
static float geometry_extent(const Geometry g)
{
    return has_nodes(g) ? grid_reach(g.nodes[world_root(g)].grid) : 0.0f;
}
#else
static float largest8(const float8 v)
{
    const float4 four = v.lo > v.hi ? v.lo : v.hi;
    const float2 two = four.lo > four.hi ? four.lo : four.hi;
    return max_of(two.x, two.y);
}

// Largest coordinate magnitude of the geometry; its order of magnitude is enough. Read from the root's boxes or,
// without a tree, from all blocks.
static float geometry_extent(const Geometry g)
{
    float8 largest = (float8)(0.0f);
#if HAS_TREE
    if (!has_nodes(g)) {
        return 0.0f;
    }
    global const float8 *rows = &g.nodes[world_root(g)].lox;
    for (uint axis = 0u; axis < 3u; axis++) {  // empty lanes are inside out: neither end of theirs is above 0
        largest = max8(largest, max8(-rows[2u * axis], rows[2u * axis + 1u]));
    }
#else
    for (uint i = 0u; i < g.block_count; i++) {
        for (uint row = 0u; row < 9u; row++) {
            const float8 value = (&g.blocks[world_block(g) + i].v0x)[row];
            largest = max8(largest, max8(-value, value));
        }
    }
#endif
    return largest8(largest);
}
#endif

// 0 for rays that miss at once: anything not finite, no direction, or an interval that is empty. No branch but one:
// this is a third of what a ray costs that meets little.
// `extent` is that of the geometry.
static int prepare_ray(const float extent, const Ray ray, TraceRay *out)
{
    const uint4 sizes = as_uint4(ray.direction) & 0x7fffffffu;
    const uint longest = largest_bits(sizes);
    const uint remotest = largest_bits(as_uint4(ray.origin) & 0x7fffffffu);
    const uint t_max = bits_of(ray.direction.w + 0.0f);
    const int usable = (longest >= SMALLEST_NORMAL) & (longest < HUGE_BITS) & (remotest <= LIMIT_BITS) &
                       (t_max < INFINITY_BITS);
    if (!usable) {
        return 0;
    }
    const float scale = scale_to_one(float_of(longest));
    out->o = make4(xyz(ray.origin), 0.0f);
    out->d = make4(xyz(ray.direction) * scale, 0.0f);
    out->t_unit = scale;
    out->t_max = min_of(float_of(t_max) * power_below(float_of(longest)), 3.4028235e38f);
    out->skip = bits_of(ray.origin.w);
    out->extent = max_of(max_of(extent, float_of(remotest)), float_of(SMALLEST_NORMAL));
    out->axis = sizes.x == longest ? 0u : (sizes.y == longest ? 1u : 2u);
    return 1;
}
