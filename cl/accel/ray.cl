#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
// A ray as the traversal wants it: direction scaled by a power of two so that its largest component is in [1, 2),
// t in lengths of that direction. Scaling by powers of two is exact: it changes no decision at any scale.

typedef struct {
    float3 o;
    float3 d;
    float t_max;
    float t_unit;  // times a scaled t gives the ray's own t
    uint skip;     // planar primitive that the ray left, or NONE
    float extent;  // largest magnitude of any coordinate that takes part
} TraceRay;

static int within(const float3 v, const float limit)
{
    const uint bits = bits_of(limit);
    return bits_of(abs_of(v.x)) <= bits && bits_of(abs_of(v.y)) <= bits && bits_of(abs_of(v.z)) <= bits;
}

#if HAS_TREE
static int has_nodes(const Geometry g) { return g.block_count > 0u || g.shape_count > g.plane_count; }
#endif

static float largest8(const float8 v)
{
    const float4 four = v.lo > v.hi ? v.lo : v.hi;
    const float2 two = four.lo > four.hi ? four.lo : four.hi;
    return max_of(two.x, two.y);
}

// Largest coordinate magnitude of the geometry; its order of magnitude is enough. Builders may leave it in the root's
// spare words; else it is read from the root's boxes or, without a tree, from the first block.
static float geometry_extent(const Geometry g)
{
    float8 largest = (float8)(0.0f);
#if HAS_TREE
    if (!has_nodes(g)) {
        return 0.0f;
    }
    const float known = float_of(g.nodes[0].spare.s0);
    if (known > 0.0f) {
        return known;
    }
    global const float8 *rows = &g.nodes[0].lox;
    for (uint axis = 0u; axis < 3u; axis++) {
        const float8 low = rows[2u * axis];
        const float8 high = rows[2u * axis + 1u];
        const float8 reach = max8(-low, high);
        largest = max8(largest, low <= high ? reach : (float8)(0.0f));  // empty lanes are inside out
    }
#else
    for (uint row = 0u; row < 9u && g.block_count > 0u; row++) {
        const float8 value = (&g.blocks[0].v0x)[row];
        largest = max8(largest, max8(-value, value));
    }
#endif
    return largest8(largest);
}

// 0 for rays that miss at once: anything not finite, no direction, or an interval that is empty.
static int prepare_ray(const Geometry g, const Ray ray, TraceRay *out)
{
    const float3 o = xyz(ray.origin);
    const float3 d = xyz(ray.direction);
    const float longest = largest3(abs3(d));
    const int usable = within(o, COORDINATE_LIMIT) && within(d, 1.7e38f) && longest >= 1.1754944e-38f &&
                       is_finite(ray.direction.w) && ray.direction.w >= 0.0f;
    if (!usable) {
        return 0;
    }
    const float scale = scale_to_one(longest);
    out->o = o;
    out->d = d * scale;
    out->t_unit = scale;
    out->t_max = min_of(ray.direction.w * power_below(longest), 3.4028235e38f);
    out->skip = bits_of(ray.origin.w);
    out->extent = max_of(geometry_extent(g), max_of(largest3(abs3(o)), 1.1754944e-38f));
    return 1;
}
