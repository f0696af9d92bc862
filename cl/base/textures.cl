#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
// Textures in memory: records, the words that their texels are made of, and filtering along one axis.

#if HAS_TEXTURES
typedef struct {
    global const Texture *table;
    global const TextureSlot *slots;
    global const uint *texels;
    global const float2 *uvs;     // of vertices
    global const float4 *colors;  // of vertices, then of triangles; xyz
    uint face_colors;             // place of the first triangle's colour
} Textures;

// Parameters of every kernel that shades, after `materials`; its geometry is GEOMETRY_AND_TEXTURES.
#define TEXTURE_ARGUMENTS                                                                                             \
    , global const Texture *texture_table, global const TextureSlot *texture_slots, global const uint *texels,        \
        global const float2 *uvs, global const float4 *colors, const uint face_colors

// A point of a surface as textures see it.
typedef struct {
    float2 uv;           // texture coordinates
    float2 barycentric;  // triangles: weights of the second and third vertex
    uint triangle;       // where its corners stand; NONE on shapes
} TexturePoint;

// Two neighbouring texels of a row or column, and the weight of the second.
typedef struct {
    uint low;
    uint high;
    float weight;
    uint cell;  // gaps between texel centres, counted from the edge at 0
} TexelPair;

// Coordinate brought into [0, 1], and what rounding took from it; what is not finite goes to 0.
static float wrapped(const float coordinate, const uint wrap, float *rest)
{
    const float period = wrap == WRAP_MIRROR ? 2.0f : 1.0f;
    const float whole = period * floor_of(coordinate / period);
    const float part = coordinate - whole;
    const float lost = coordinate - (part + whole);  // exact
    const int folds = part > 1.0f;
    const float turned = folds ? 2.0f - part : part;
    const float inside = wrap == WRAP_CLAMP ? clamp_of(coordinate, 0.0f, 1.0f) : turned;
    const int usable = inside >= 0.0f && inside <= 1.0f;
    *rest = usable && wrap != WRAP_CLAMP ? (folds ? -lost : lost) : 0.0f;
    return usable ? inside : 0.0f;
}

// Texel centres lie at (i + 1/2) / size. The product u size is taken in two parts, so that the weight keeps its digits
// in the widest picture.
static TexelPair texel_pair(const float coordinate, const uint size, const uint wrap)
{
    float rest;
    const float u = wrapped(coordinate, wrap, &rest);
    const float n = (float)size;
    const float at = u * n;
    const float tail = fma_of(u, n, -at) + rest * n;
    const float shifted = at - 0.5f;
    const float floored = floor_of(shifted);
    const float beyond = (shifted - floored) + tail;
    const float step = beyond < 0.0f ? -1.0f : (beyond >= 1.0f ? 1.0f : 0.0f);
    const float below = clamp_of(floored + step, -1.0f, n - 1.0f);
    const int low = (int)below;
    const int last = (int)size - 1;
    const int repeats = wrap == WRAP_REPEAT;
    TexelPair out;
    out.weight = clamp_of(beyond - step, 0.0f, 1.0f);
    out.low = (uint)(low < 0 ? (repeats ? last : 0) : low);
    out.high = (uint)(low + 1 > last ? (repeats ? 0 : last) : low + 1);
    out.cell = (uint)(low + 1);
    return out;
}

// The texel that holds the coordinate.
static uint texel_nearest(const float coordinate, const uint size, const uint wrap)
{
    float rest;
    const uint place = (uint)(wrapped(coordinate, wrap, &rest) * (float)size);
    return place < size ? place : (wrap == WRAP_REPEAT ? 0u : size - 1u);
}

// Bytes are looked up in a table of 256 numbers, which knows what they mean; numbers stand for themselves.
static float3 texel_at(const Textures all, global const Texture *t, const uint x, const uint y)
{
    const uint place = y * t->width + x;
    if (t->words == 1u) {
        const uint packed = all.texels[t->first + place];
        global const uint *table = all.texels + t->bytes;
        return (float3)(float_of(table[packed & 255u]), float_of(table[(packed >> 8) & 255u]),
                        float_of(table[(packed >> 16) & 255u]));
    }
    global const uint *rgb = all.texels + t->first + 3u * place;
    return (float3)(float_of(rgb[0]), float_of(rgb[1]), float_of(rgb[2]));
}

// Luminance, Rec. 709; equal channels give exactly their value.
static float grey_of(const float3 c) { return c.y + 0.2126f * (c.x - c.y) + 0.0722f * (c.z - c.y); }

// Exact at both ends and between equal numbers.
static float3 mix3(const float3 a, const float3 b, const float weight) { return a + weight * (b - a); }

static float3 texels_between(const Textures all, global const Texture *t, const TexelPair x, const TexelPair y)
{
    const float3 upper = mix3(texel_at(all, t, x.low, y.low), texel_at(all, t, x.high, y.low), x.weight);
    const float3 lower = mix3(texel_at(all, t, x.low, y.high), texel_at(all, t, x.high, y.high), x.weight);
    return mix3(upper, lower, y.weight);
}

// The texture's own coordinates.
static float2 texture_place(global const Texture *t, const float2 uv)
{
    return (float2)(fma_of(t->row_u.x, uv.x, fma_of(t->row_u.y, uv.y, t->row_u.z)),
                    fma_of(t->row_v.x, uv.x, fma_of(t->row_v.y, uv.y, t->row_v.z)));
}
#else
#define TEXTURE_ARGUMENTS
#endif
