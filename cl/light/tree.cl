#pragma OPENCL FP_CONTRACT OFF
#include "base/light_sample.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Picks a light by going down a tree of bounds: each node weighs its two children by what light they could at most
// send to the point (Conty Estevez and Kulla 2018, HPG: intensity, cone of directions, square of the distance, cosine
// at the surface). The host builds it (render/light_tree.py).
//
// Probabilities are whole numbers of 2^-39, split at each node without a remainder, as arithmetic coding does: those of
// all lights add up to 1 exactly, and the walk that finds a light and the one that only asks for its probability agree
// to the last bit. A bound of zero is a proof that nothing arrives but for rounding at the rim; a child whose share of
// its node is below 2^-24 is left out, too.

#define TREE_WHOLE_BITS 39u
#define TREE_LEAF 0x80000000u
#define TREE_TWO_SIDED 0x40000000u
#define TREE_INDEX 0x3fffffffu
#define NO_NORMAL 0xffffffffu

static float8 sine8(const float8 cosine) { return sqrt8(max8(1.0f - cosine * cosine, (float8)(0.0f))); }

// Upper bound, up to a factor for all nodes, of the irradiance that each child could give at the place.
static float8 node_importance8(global const LightNode *node, const LightPlace at)
{
    const float8 one = (float8)(1.0f);
    const float8 tiny = (float8)(1.0e-30f);
    const float8 x = node->x - at.p.x;
    const float8 y = node->y - at.p.y;
    const float8 z = node->z - at.p.z;
    const float8 squared = max8(x * x + y * y + z * z, tiny);
    const float8 radius2 = node->radius * node->radius;
    const int8 around = squared <= radius2;  // the place may be among the lights
    const float8 inverse = 1.0f / sqrt8(squared);
    const float8 sin_u2 = around ? one : radius2 * inverse * inverse;
    const float8 sin_u = sqrt8(sin_u2);
    const float8 cos_u = sqrt8(max8(one - sin_u2, (float8)(0.0f)));
    const float8 straight = -(x * node->axis_x + y * node->axis_y + z * node->axis_z) * inverse;
    const int8 both = (node->child & TREE_TWO_SIDED) != 0u;
    const float8 cos_w = both && straight < 0.0f ? -straight : straight;
    const float8 sin_w = sine8(cos_w);
    const float8 cos_o = node->cos_o;
    const float8 sin_o = sine8(cos_o);
    const int8 in_cone = cos_w >= cos_o;
    const float8 cos_v = in_cone ? one : cos_w * cos_o + sin_w * sin_o;  // of the angle beyond the cone
    const float8 sin_v = in_cone ? (float8)(0.0f) : max8(sin_w * cos_o - cos_w * sin_o, (float8)(0.0f));
    const float8 leaving = around || cos_v >= cos_u ? one : cos_v * cos_u + sin_v * sin_u;
    const float8 cos_i = (x * at.n.x + y * at.n.y + z * at.n.z) * inverse;
    const float8 tilted = around || cos_i >= cos_u ? one : cos_i * cos_u + sine8(cos_i) * sin_u;
    const float8 arriving = at.has_n ? max8(tilted, (float8)(0.0f)) : one;
    const float8 bound = node->intensity * leaving * arriving / max8(squared, max8(radius2, tiny));
    return leaving > node->cos_e ? bound : (float8)(0.0f);
}

// Where the shares of the children end, in steps of 2^-24.
static void child_ends(global const LightNode *node, const LightPlace at, uint *ends)
{
    float8 weight = node->share;
    if (weight.s0 < 0.0f) {
        weight = node_importance8(node, at);
        const float4 sums = weight.lo + weight.hi;
        const int lit = (sums.x + sums.y) + (sums.z + sums.w) > 0.0f;
        weight = lit ? weight : node->intensity;  // nothing arrives, and what is picked will show it
    }
    float sums[8];
    sums[0] = weight.s0;
    sums[1] = sums[0] + weight.s1;
    sums[2] = sums[1] + weight.s2;
    sums[3] = sums[2] + weight.s3;
    sums[4] = sums[3] + weight.s4;
    sums[5] = sums[4] + weight.s5;
    sums[6] = sums[5] + weight.s6;
    sums[7] = sums[6] + weight.s7;
    const float scale = 16777216.0f / sums[7];
    for (int k = 0; k < 8; k++) {
        const float end = min_of(sums[k] * scale, 16777216.0f);
        ends[k] = sums[k] >= sums[7] ? 16777216u : (uint)end;
    }
}

static float tree_probability(const ulong range)
{
    return (float)(long)range * 1.8189894035458565e-12f;  // 2^-39
}

// u.x chooses, and u.y adds bits below it. Neither may be used again.
static uint pick_light(const Lights lights, const LightPlace at, const float2 u, float *probability)
{
    ulong value = ((ulong)(uint)(u.x * 16777216.0f) << 15) | (ulong)(uint)(u.y * 32768.0f);
    ulong range = 1ul << TREE_WHOLE_BITS;
    uint child = 0u;
    while (!(child & TREE_LEAF)) {
        global const LightNode *node = lights.nodes + (child & TREE_INDEX);
        uint ends[8];
        child_ends(node, at, ends);
        ulong start = 0ul;
        ulong end = (range * ends[0]) >> 24;
        uint lane = 0u;
        while (value >= end) {  // ends at the latest where the last share does, at `range`
            start = end;
            lane++;
            end = (range * ends[lane]) >> 24;
        }
        value -= start;
        range = end - start;
        child = ((global const uint *)&node->child)[lane];
    }
    *probability = tree_probability(range);
    return child & TREE_INDEX;
}

// Probability of that light being picked at the place.
static float pick_probability(const Lights lights, const uint index, const LightPlace at)
{
    ulong range = 1ul << TREE_WHOLE_BITS;
    uint trail = lights.table[index].alias;
    uint child = 0u;
    while (!(child & TREE_LEAF)) {
        global const LightNode *node = lights.nodes + (child & TREE_INDEX);
        uint ends[8];
        child_ends(node, at, ends);
        const uint lane = trail & 7u;
        const ulong start = lane > 0u ? (range * ends[lane - 1u]) >> 24 : 0ul;
        range = ((range * ends[lane]) >> 24) - start;
        trail >>= 3;
        child = ((global const uint *)&node->child)[lane];
    }
    return tree_probability(range);
}

// A unit normal in 32 bits (octahedron, 16 bits each: Cigolle et al. 2014); zero is NO_NORMAL.
static uint packed_normal(const float3 n)
{
    const float sum = abs_of(n.x) + abs_of(n.y) + abs_of(n.z);
    if (!(sum > 0.0f)) {
        return NO_NORMAL;
    }
    const float x = n.x / sum;
    const float y = n.y / sum;
    const int below = n.z < 0.0f;
    const float a = below ? (1.0f - abs_of(y)) * (x < 0.0f ? -1.0f : 1.0f) : x;
    const float b = below ? (1.0f - abs_of(x)) * (y < 0.0f ? -1.0f : 1.0f) : y;
    return (uint)(a * 32766.0f + 32767.5f) | ((uint)(b * 32766.0f + 32767.5f) << 16);
}

// The place as the packed normal tells it: where a light is picked and where it is hit later, the same bits are seen.
static LightPlace light_place(const float3 p, const uint packed)
{
    LightPlace out;
    out.p = p;
    out.has_n = packed != NO_NORMAL;
    const float a = ((float)(int)(packed & 0xffffu) - 32767.0f) * 3.0519441e-5f;  // 1 / 32766
    const float b = ((float)(int)(packed >> 16) - 32767.0f) * 3.0519441e-5f;
    const float z = 1.0f - abs_of(a) - abs_of(b);
    const float fold = max_of(-z, 0.0f);
    const float x = a + (a < 0.0f ? fold : -fold);
    const float y = b + (b < 0.0f ? fold : -fold);
    out.n = out.has_n ? normalize3((float3)(x, y, z)) : (float3)(0.0f);
    return out;
}
