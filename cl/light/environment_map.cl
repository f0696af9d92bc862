#pragma OPENCL FP_CONTRACT OFF
#include "accel/daylight.cl"
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/math.cl"
#include "base/textures.cl"
#include "base/vector.cl"
// Radiance from a picture of all directions: longitude along its rows, latitude down its columns, the top at +y of the
// frame whose rows are position, direction and extra (xyz), bilinear between texel centres; radiance.xyz scales it.
// direction.w: share of the picture's height that lies beyond the poles: 0 where they are its edges, 1 / height where
// they are the middles of its first and last row. Of daylight the picture is only sampled by: its radiance is that of the
// model (accel/daylight.cl), and radiance.w != 0.
//
// The sky is cut into patches between four texel centres: height + 1 rows (the first and the last are half as high)
// of `width` patches. A patch is picked by inverting first the distribution of rows, then that of patches in the row,
// and a point in it by the density that is bilinear between its corners' luminances, so that the density follows the
// radiance but for sin(theta) within a patch. Distributions are whole numbers of 2^-24: they sum exactly, no patch
// with light has zero probability, and the density is that of what is sampled. Words of the texels: from `patches`,
// the ends of the rows' shares, then for each row the ends of its patches' shares.

#define WHOLE 16777216.0f        // 2^24
#define PATCH_UNIT 3.5527137e-15f  // 2^-48
#define LEAST_SINE 1.0e-10f      // at the poles the density has no bound
#define PI_SQUARED 9.86960440f

static float luminance_of(const float3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

// First of `count` ends that exceeds `key`, with where its share starts; the last end exceeds every key.
static uint share_of(global const uint *ends, const uint count, const uint key, uint *start, uint *size)
{
    uint low = 0u;
    uint high = count - 1u;
    while (low < high) {  // halves each time
        const uint middle = (low + high) >> 1;
        const int beyond = ends[middle] > key;
        high = beyond ? middle : high;
        low = beyond ? low : middle + 1u;
    }
    *start = low > 0u ? ends[low - 1u] : 0u;
    *size = ends[low] - *start;
    return low;
}

// Number in [0, 1] of density proportional to the line from a at 0 to b at 1.
static float sample_line(const float u, const float a, const float b)
{
    const float larger = max_of(a, b);
    if (!(larger > 0.0f)) {
        return u;
    }
    const float x = a / larger;
    const float y = b / larger;
    return min_of(u * (x + y) / (x + sqrt_of(x * x + u * (y * y - x * x))), 1.0f);
}

// Density [1/sr] in a patch: rows and columns of texels around it, its shares, luminance at the point, sine of the
// polar angle. Solid angle is 2 pi^2 sin(theta) du dv.
static float patch_pdf(const Geometry g, global const Texture *t, const uint4 texels, const uint row,
                       const float shares, const float luminance, const float sine)
{
    const float corners = luminance_of(texel_at(g.textures, t, texels.x, texels.z)) +
                          luminance_of(texel_at(g.textures, t, texels.y, texels.z)) +
                          luminance_of(texel_at(g.textures, t, texels.x, texels.w)) +
                          luminance_of(texel_at(g.textures, t, texels.y, texels.w));
    const float patches = (float)t->width * (float)t->height * (row == 0u || row == t->height ? 2.0f : 1.0f);
    const float density = corners > 0.0f ? shares * (4.0f * luminance / corners) : 0.0f;
    return density * (patches / (2.0f * PI_SQUARED)) / max_of(sine, LEAST_SINE);
}

typedef struct {
    float3 radiance;
    float pdf;
} SkySeen;

// Radiance along unit d in the picture's axes, where the picture shows `color`.
static float3 sky_color(global const Light *l, const Geometry g, global const Texture *t, const float3 d,
                        const float3 color)
{
#if HAS_DAYLIGHT
    if (l->radiance.w != 0.0f) {
        return daylight(g.textures.texels + t->patches + (t->height + 1u) * (t->width + 1u), d) * xyz(l->radiance);
    }
#endif
    return color * xyz(l->radiance);
}

static SkySeen environment_map_seen(global const Light *l, const Geometry g, const float3 wi)
{
    global const Texture *t = g.textures.table + l->prim;
    global const uint *ends = g.textures.texels + t->patches;
    const float3 d = (float3)(dot3(xyz(l->position), wi), dot3(xyz(l->direction), wi), dot3(xyz(l->extra), wi));
    const float sine = sqrt_of(d.x * d.x + d.z * d.z);
    const TexelPair x = texel_pair(atan2_turns(d.x, -d.z), t->width, WRAP_REPEAT);
    const float beyond = l->direction.w;
    const float down = 2.0f * atan2_turns(sine, d.y);
    const TexelPair y = texel_pair(fma_of(down, 1.0f - beyond, 0.5f * beyond), t->height, WRAP_CLAMP);
    global const uint *row = ends + (t->height + 1u) + y.cell * t->width;
    const uint rows = ends[y.cell] - (y.cell > 0u ? ends[y.cell - 1u] : 0u);
    const uint columns = row[x.low] - (x.low > 0u ? row[x.low - 1u] : 0u);
    const float3 color = texels_between(g.textures, t, x, y);
    SkySeen out;
    out.radiance = sky_color(l, g, t, d, color);
    out.pdf = (1.0f - beyond) * patch_pdf(g, t, (uint4)(x.low, x.high, y.low, y.high), y.cell,
                                          (float)rows * (float)columns * PATCH_UNIT, luminance_of(color), sine);
    return out;
}

static LightSample environment_map_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    global const Texture *t = g.textures.table + l->prim;
    global const uint *ends = g.textures.texels + t->patches;
    uint start, rows, columns;
    const uint key_y = (uint)(u.y * WHOLE);
    const uint row = share_of(ends, t->height + 1u, key_y, &start, &rows);
    const float rest_y = ((float)(key_y - start) + 0.5f) / (float)rows;
    const uint key_x = (uint)(u.x * WHOLE);
    const uint column = share_of(ends + (t->height + 1u) + row * t->width, t->width, key_x, &start, &columns);
    const float rest_x = ((float)(key_x - start) + 0.5f) / (float)columns;
    TexelPair x, y;
    x.low = column;
    x.high = column + 1u < t->width ? column + 1u : 0u;
    y.low = row > 0u ? row - 1u : 0u;
    y.high = row < t->height ? row : t->height - 1u;
    const float a = luminance_of(texel_at(g.textures, t, x.low, y.low));
    const float b = luminance_of(texel_at(g.textures, t, x.high, y.low));
    const float c = luminance_of(texel_at(g.textures, t, x.low, y.high));
    const float d = luminance_of(texel_at(g.textures, t, x.high, y.high));
    y.weight = sample_line(rest_y, a + b, c + d);
    x.weight = sample_line(rest_x, a + y.weight * (c - a), b + y.weight * (d - b));
    const float half_row = row == 0u || row == t->height ? 0.5f : 1.0f;
    const float top = row == 0u ? 0.0f : (float)row - 0.5f;
    float sine, cosine, sine_phi, cosine_phi;
    const float beyond = l->direction.w;
    const float down = ((top + half_row * y.weight) / (float)t->height - 0.5f * beyond) / (1.0f - beyond);
    sin_cos_turns(0.5f * down, &sine, &cosine);
    sine = max_of(sine, 0.0f);  // rounding may take it below at the lower pole
    sin_cos_turns(((float)column + 0.5f + x.weight) / (float)t->width, &sine_phi, &cosine_phi);
    const float3 color = texels_between(g.textures, t, x, y);
    LightSample out;
    const float3 way = (float3)(sine * sine_phi, cosine, -(sine * cosine_phi));
    out.to = xyz(l->position) * way.x + xyz(l->direction) * way.y + xyz(l->extra) * way.z;
    out.radiance = sky_color(l, g, t, way, color);
    out.pdf = (1.0f - beyond) * patch_pdf(g, t, (uint4)(x.low, x.high, y.low, y.high), row,
                                          (float)rows * (float)columns * PATCH_UNIT, luminance_of(color), sine);
    out.delta = 0u;
    out.infinite = 1u;
    return out;
}

static float environment_map_pdf(global const Light *l, const Geometry g, const float3 from, const Surface seen,
                                 const float3 wi)
{
    return environment_map_seen(l, g, wi).pdf;
}

#if HAS_PHOTON
static LightEmission environment_map_emit(global const Light *l, const Geometry g, const float4 around,
                                          const float4 u)
{
    const LightSample from = environment_map_sample(l, g, xyz(around), u.zw);
    const float3 irradiance = from.radiance * (from.pdf > 0.0f ? 1.0f / from.pdf : 0.0f);
    return emission_from_afar(normalize3(from.to), irradiance, around, u.xy);
}
#endif
