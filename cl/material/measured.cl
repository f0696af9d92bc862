#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/ggx.cl"
#include "base/math.cl"
#include "base/node_grid.cl"
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"

// A measured surface, as render/measured.py lays out what files hold. Values come in one of two forms:
//   half angles (MEASURED_HALF): f over the angles of half and difference vector (Rusinkiewicz 1998; Matusik et al.
//     2003). Exchanging both directions turns the difference vector by half a turn, and the table has half a turn only.
//   adaptive (else): f cos i = colour(u) D(h) / (4 sigma(o)), where u are the numbers that the density of visible facets
//     turns into h (Dupuy and Jakob 2018).
// Both are sampled by facets of the tabulated density (adaptive: u itself has a density, too), mixed with a cosine.
// Facets h have the coordinates (root of the angle to the normal over a quarter turn, turns about it + 1/2).

#define COSINE_SHARE 0.1f  // bounds weights where a table has a density of 0

// Numbers at the start of a table
#define TABLE_VIEWS 0u      // angles to the normal, turns about it, places of both lists
#define TABLE_FACETS 4u     // NodeGrid
#define TABLE_NUMBERS 9u    // NodeGrid
#define TABLE_COLOURS 14u   // columns, rows, place; three grids one after the other
#define TABLE_DENSITY 17u   // columns, rows, place: D, one slice
#define TABLE_SIGMA 20u     // columns, rows, place: sigma, one slice
#define TABLE_HALF 23u      // number of angles of h, of differences, of turns of these; place
#define TABLE_TURNED 27u    // 1: facets turn with the viewer (isotropic)
#define TABLE_PARTS 28u     // equal parts that the full turn was measured as: 1, 2 or 4
#define TABLE_DIVIDED 29u   // 1: colours are freed of D / (4 sigma)

// A direction's coordinates as a facet.
static float2 measured_place(const float3 w)
{
    const float across = sqrt_of(w.x * w.x + w.y * w.y);
    return (float2)(sqrt_of(max_of(4.0f * atan2_turns(across, w.z), 0.0f)), atan2_turns(w.y, w.x) + 0.5f);
}

// Last of `count` rising numbers that is not above `x`, at most the last but one, and the place on the way to the next.
static uint measured_interval(global const float *numbers, const uint count, const float x, float *within)
{
    *within = 0.0f;
    if (count < 2u) {
        return 0u;
    }
    uint low = 0u;
    uint high = count - 1u;
    while (high - low > 1u) {
        const uint middle = (low + high) >> 1;
        const int below = numbers[middle] <= x;
        low = below ? middle : low;
        high = below ? high : middle;
    }
    *within = clamp_of((x - numbers[low]) / (numbers[low + 1u] - numbers[low]), 0.0f, 1.0f);
    return low;
}

static Views measured_views(global const float *t, const float3 wo)
{
    const uint angles = (uint)t[TABLE_VIEWS];
    const uint turns = (uint)t[TABLE_VIEWS + 1u];
    const float2 at = (float2)(atan2_turns(sqrt_of(wo.x * wo.x + wo.y * wo.y), wo.z), atan2_turns(wo.y, wo.x));
    float a, b;
    const uint angle = measured_interval(t + (uint)t[TABLE_VIEWS + 2u], angles, at.x, &a);
    const uint turn = measured_interval(t + (uint)t[TABLE_VIEWS + 3u], turns, at.y, &b);
    const uint first = turn * angles + angle;
    const uint further = angle + 1u < angles ? 1u : 0u;
    const uint round = turn + 1u < turns ? angles : 0u;
    Views out;
    out.slice = (uint4)(first, first + further, first + round, first + round + further);
    out.share = (float4)((1.0f - a) * (1.0f - b), a * (1.0f - b), (1.0f - a) * b, a * b);
    return out;
}

static Views measured_one_view(void)
{
    Views out;
    out.slice = (uint4)(0u);
    out.share = (float4)(1.0f, 0.0f, 0.0f, 0.0f);
    return out;
}

// Grid of which only values are asked for.
static NodeGrid measured_values(global const float *t, const uint header)
{
    NodeGrid out;
    out.columns = (uint)t[header];
    out.rows = (uint)t[header + 1u];
    out.values = t + (uint)t[header + 2u];
    out.marginal = t;
    out.conditional = t;
    return out;
}

// Where only a part of the full turn was measured, the signs by which x and y take the viewer into it.
static float2 measured_signs(global const float *t, const float3 wo)
{
    const float parts = t[TABLE_PARTS];
    const float y = wo.y > 0.0f ? -1.0f : 1.0f;
    const float x = parts > 3.0f ? (wo.x > 0.0f ? -1.0f : 1.0f) : y;
    return parts > 1.0f ? (float2)(x, y) : (float2)(1.0f);
}

static float3 measured_turned(const float2 signs, const float3 w) { return (float3)(signs.x * w.x, signs.y * w.y, w.z); }

// A facet's coordinates in the table's own turn.
static float2 measured_facet(global const float *t, const float3 wo, const float3 h)
{
    const float2 at = measured_place(h);
    const float turn = t[TABLE_TURNED] > 0.0f ? at.y - atan2_turns(wo.y, wo.x) : at.y;
    return (float2)(at.x, turn - floor_of(turn));
}

// f in half-angle form, between the centres of eight cells; the same bits with both directions exchanged.
static float3 measured_half_value(global const float *t, const float3 wo, const float3 wi)
{
    const float3 sum = wo + wi;
    const float3 difference = wi - wo;
    const float across2 = sum.x * sum.x + sum.y * sum.y;
    const float size = sqrt_of(dot3(sum, sum));
    const int upright = !(across2 > 0.0f);
    float x = sum.z * (sum.x * difference.x + sum.y * difference.y) - difference.z * across2;
    float y = (sum.x * difference.y - sum.y * difference.x) * size;
    x = upright ? difference.x : x;
    y = upright ? difference.y : y;
    const int turned = y < 0.0f || (y == 0.0f && x < 0.0f);
    const float turn = 2.0f * atan2_turns(turned ? -y : y, turned ? -x : x);
    const uint3 count = (uint3)((uint)t[TABLE_HALF], (uint)t[TABLE_HALF + 1u], (uint)t[TABLE_HALF + 2u]);
    const float tilt = 4.0f * atan2_turns(sqrt_of(across2), sum.z);
    const float apart = 4.0f * atan2_turns(sqrt_of(dot3(difference, difference)), size);
    const float last_h = (float)(count.x - 1u);
    const float last_d = (float)(count.y - 1u);
    const float a = clamp_of(sqrt_of(max_of(tilt, 0.0f)) * (float)count.x - 0.5f, 0.0f, last_h);
    const float b = clamp_of(apart * (float)count.y - 0.5f, 0.0f, last_d);
    const float c = turn * (float)count.z + ((float)count.z - 0.5f);
    const uint h0 = (uint)a;
    const uint d0 = (uint)b;
    const uint p0 = (uint)c;
    const float3 within = (float3)(a - (float)h0, b - (float)d0, c - (float)p0);
    global const float *cells = t + (uint)t[TABLE_HALF + 3u];
    float3 out = (float3)(0.0f);
    for (uint corner = 0u; corner < 8u; corner++) {
        const uint h = h0 + ((corner & 4u) && h0 + 1u < count.x ? 1u : 0u);
        const uint d = d0 + ((corner & 2u) && d0 + 1u < count.y ? 1u : 0u);
        const uint p = (p0 + (corner & 1u)) % count.z;
        const float share = ((corner & 4u) ? within.x : 1.0f - within.x) * ((corner & 2u) ? within.y : 1.0f - within.y) *
                            ((corner & 1u) ? within.z : 1.0f - within.z);
        global const float *cell = cells + 3u * ((h * count.y + d) * count.z + p);
        out += share * (float3)(cell[0], cell[1], cell[2]);
    }
    return out;
}

// f cos i in adaptive form; directions in the measured part of the turn.
static float3 measured_adaptive_value(global const float *t, const float3 wo, const float3 wi)
{
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const Views views = measured_views(t, wo);
    const float2 facet = measured_facet(t, wo, h);
    const float2 u = node_grid_invert(node_grid_at(t, TABLE_FACETS), views, facet);
    NodeGrid colour = measured_values(t, TABLE_COLOURS);
    const uint slices = (uint)t[TABLE_VIEWS] * (uint)t[TABLE_VIEWS + 1u];
    float3 out;
    out.x = node_grid_value(colour, views, u);
    colour.values += slices * colour.columns * colour.rows;
    out.y = node_grid_value(colour, views, u);
    colour.values += slices * colour.columns * colour.rows;
    out.z = node_grid_value(colour, views, u);
    if (t[TABLE_DIVIDED] > 0.0f) {
        const Views one = measured_one_view();
        const float density = node_grid_value(measured_values(t, TABLE_DENSITY), one, facet);
        const float sigma = node_grid_value(measured_values(t, TABLE_SIGMA), one, measured_place(wo));
        out = out * (density / max_of(4.0f * sigma, 1.0e-20f));
    }
    return out;
}

static float3 measured_eval(const Measured m, const float3 wo, const float3 wi)
{
    const int lit = wo.z > 0.0f && wi.z > 0.0f;
    float3 value;
    if (m.half_angles > 0.0f) {
        value = measured_half_value(m.table, wo, wi) * wi.z;
    } else {
        const float2 signs = measured_signs(m.table, wo);
        value = measured_adaptive_value(m.table, measured_turned(signs, wo), measured_turned(signs, wi));
    }
    return lit ? value : (float3)(0.0f);
}

static float measured_pdf(const Measured m, const float3 wo, const float3 wi)
{
    const float2 signs = measured_signs(m.table, wo);
    const float3 o = measured_turned(signs, wo);
    float cosine;
    const float3 h = half_vector(o, measured_turned(signs, wi), &cosine);
    const Views views = measured_views(m.table, o);
    const float2 facet = measured_facet(m.table, o, h);
    const NodeGrid facets = node_grid_at(m.table, TABLE_FACETS);
    float density = node_grid_value(facets, views, facet);
    if (!(m.half_angles > 0.0f)) {
        const float2 u = node_grid_invert(facets, views, facet);
        density = density * node_grid_value(node_grid_at(m.table, TABLE_NUMBERS), views, u);
    }
    // Solid angle of a facet's coordinates, times that of directions about its own.
    const float across = sqrt_of(h.x * h.x + h.y * h.y);
    const float area = max_of(2.0f * PI * PI * facet.x * across * 4.0f * cosine, 1.0e-12f);
    const float pdf = (1.0f - COSINE_SHARE) * (density / area) + COSINE_SHARE * (wi.z * INVERSE_PI);
    return wo.z > 0.0f && wi.z > 0.0f ? pdf : 0.0f;
}

static BsdfSample measured_sample(const Measured m, const float3 wo, const float4 u)
{
    const float2 signs = measured_signs(m.table, wo);
    const float3 o = measured_turned(signs, wo);
    const Views views = measured_views(m.table, o);
    float2 at = u.xy;
    if (!(m.half_angles > 0.0f)) {
        at = node_grid_sample(node_grid_at(m.table, TABLE_NUMBERS), views, at);
    }
    at = node_grid_sample(node_grid_at(m.table, TABLE_FACETS), views, at);
    const float turn = at.y - 0.5f + (m.table[TABLE_TURNED] > 0.0f ? atan2_turns(o.y, o.x) : 0.0f);
    float s, c, sine, cosine;
    sin_cos_turns(turn, &s, &c);
    sin_cos_turns(0.25f * at.x * at.x, &sine, &cosine);
    const float3 facet = measured_turned(signs, (float3)(sine * c, sine * s, cosine));
    const float3 bounced = renormalize3(reflect_about(wo, facet));
    const float3 wi = u.z < COSINE_SHARE ? cosine_hemisphere(u.xy) : bounced;
    return bsdf_sample(wi, measured_eval(m, wo, wi), measured_pdf(m, wo, wi), 0u);
}

static float3 measured_albedo(const Measured m)
{
    return m.albedo;
}
