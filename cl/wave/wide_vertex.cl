#pragma OPENCL FP_CONTRACT OFF
// Eight vertices of paths at once, for CPUs: in each lane what wave/vertex.cl does, operation by operation, which
// tests/image/test_wide_shading.py holds to the bit. Lanes that need what few scenes have are left to it. Materials
// whose text serves eight are asked together (dispatch/material8.cl), others and lights but triangles one by one.
#include "base/warp8.cl"
#include "base/wide.cl"
#include "base/wide_sampler.cl"
#include "accel/geometry.cl"
#include "accel/wide_surface.cl"
#include "dispatch/material8.cl"
#include "dispatch/light.cl"
#include "wave/path.cl"
#include "wave/shading.cl"
#include "wave/vertex.cl"

#if WIDE_SHADING
#define LIGHT_ROWS ((uint)(sizeof(Light) / sizeof(float4)))

typedef struct {
    Surface8 surface;
    Frame8 frame;
    Vector8 wo;
    Vector8 normal;
    uint8 material;
    uint8 kind;
    uint8 flags;
    Vector8 state;
    uint lanes;  // those at work, a bit each
} Vertices8;

typedef struct {
    Vector8 to;
    Vector8 radiance;
    float8 pdf;  // probability of being picked included
    uint8 delta;
    uint8 infinite;
} LightSamples8;

#if HAS_REGULARISED
#define WORDS_ARGUMENT , const uint8 words
#define WORDS_OF(path) , as_uint8((path).y)
#else
#define WORDS_ARGUMENT
#define WORDS_OF(path)
#endif

static void set_bits(uint8 *v, const uint k, const uint value) { ((uint *)v)[k] = value; }

// vertex_of: lanes of materials that light passes keep the front side; those of `lanes` that shine are left out.
static Vertices8 vertices_of(const Geometry g, global const Object *objects, global const Material *materials,
                             const uint8 prim, const Rows8 hit, const Vector8 direction, const Vector8 state,
                             const uint lanes WORDS_ARGUMENT)
{
    Vertices8 v;
    v.state = state;
    v.surface = surfaces_of(g, prim, hit.y, hit.z);
    const Rows8 object = rows_at((global const float4 *)objects, v.surface.object);
    v.material = RECORD_MET(as_uint8(object.x), words);
#if HAS_EMITTER
    v.lanes = lanes & movemask8(as_uint8(object.y) == NONE);
#else
    v.lanes = lanes;
#endif
    const Rows8 head = rows_at((global const float4 *)materials, v.material * MATERIAL_ROWS);
    v.kind = as_uint8(head.x);
    v.flags = as_uint8(head.y);
    const Vector8 wo = negate8(renormalize8(direction));
    const float8 cos_o = dot8(wo, v.surface.ng);
    const int8 back = cos_o < 0.0f;
    v.normal = choose8(back, negate8(v.surface.ng), v.surface.ng);
#if HAS_TRANSMISSION
    const int8 turn = back & ((v.flags & MATERIAL_TRANSMITS) == 0u);
#else
    const int8 turn = back;
#endif
    const Vector8 upright = choose8(turn, negate8(v.surface.n), v.surface.n);
    const float8 facing = dot8(upright, wo) * (turn | ~back ? (float8)(1.0f) : (float8)(-1.0f));
    const Vector8 instead = choose8(turn, v.normal, v.surface.ng);
    v.frame = frame_of8(choose8(facing > 0.0f, upright, instead));
    v.wo = to_local8(v.frame, wo);
#if HAS_ONE_SIDED
    v.kind = back & ((v.flags & MATERIAL_ONE_SIDED) != 0u) ? (uint8)(MATERIAL_EMISSIVE) : v.kind;  // black
#endif
    return v;
}

static Vector8 reflectances(global const Material *materials, const uint8 material)
{
    return xyz8(rows_at((global const float4 *)&materials->p0, material * MATERIAL_ROWS));
}

// Lanes of `lanes` whose material is neither diffuse nor black.
static uint other_lanes(const uint8 kind, const uint lanes)
{
#if HAS_DIFFUSE
    return lanes & movemask8((kind != MATERIAL_DIFFUSE) & (kind != MATERIAL_EMISSIVE));
#else
    return lanes & movemask8(kind != MATERIAL_EMISSIVE);
#endif
}

// material_value for lanes of any kind, put among those that are there.
static Rows8 further_values(global const Material *materials, const uint8 material, const Vector8 wo, const Vector8 wi,
                            const Rows8 known, const uint lanes)
{
    Rows8 out = known;
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        const BsdfValue one = material_value(materials + lane_bits(&material, k) TABLES(materials), lane3_of(&wo, k),
                                             lane3_of(&wi, k));
        set_lane(&out.x, k, one.value.x);
        set_lane(&out.y, k, one.value.y);
        set_lane(&out.z, k, one.value.z);
        set_lane(&out.w, k, one.pdf);
    }
    return out;
}

// material_value: values (xyz) and densities (w).
static Rows8 values_of(global const Material *materials, const Vertices8 *v, const Vector8 wi, const uint lanes)
{
#if HAS_DIFFUSE
    const int8 diffuse = v->kind == MATERIAL_DIFFUSE;
    const float8 pdf = diffuse ? max8(wi.z, (float8)(0.0f)) * INVERSE_PI : (float8)(0.0f);
    const Rows8 known = rows8(scale8(reflectances(materials, v->material), pdf), pdf);
#else
    const Rows8 known = rows8(vector8((float8)(0.0f), (float8)(0.0f), (float8)(0.0f)), (float8)(0.0f));
#endif
    const uint others = other_lanes(v->kind, lanes);
    if (others == 0u) {
        return known;
    }
    Rows8 out = known;
    const uint rest = others & ~wide_values(materials, v->material, v->kind, v->wo, wi, others, &out);
    return rest == 0u ? out : further_values(materials, v->material, v->wo, wi, out, rest);
}

// material_sample for lanes of any kind, put among those that are there.
static BsdfSample8 further_samples(global const Material *materials, const uint8 material, const Vector8 wo,
                                    const Rows8 u, const BsdfSample8 known, const uint lanes)
{
    BsdfSample8 out = known;
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        const float4 numbers = (float4)(lane_of(&u.x, k), lane_of(&u.y, k), lane_of(&u.z, k), lane_of(&u.w, k));
        const BsdfSample one = material_sample(materials + lane_bits(&material, k) TABLES(materials),
                                               lane3_of(&wo, k), numbers);
        set_lane3(&out.wi, k, one.wi);
        set_lane3(&out.weight, k, one.weight);
        set_lane(&out.pdf, k, one.pdf);
        set_bits(&out.flags, k, one.flags);
    }
    return out;
}

// material_sample; diffuse_sample in the lanes that are diffuse.
static BsdfSample8 samples_of(global const Material *materials, const Vertices8 *v, const Rows8 u)
{
    BsdfSample8 known;
    known.flags = (uint8)(0u);
#if HAS_DIFFUSE
    known.wi = cosine_hemisphere8(pair8(u.x, u.y));
    known.weight = reflectances(materials, v->material);
    known.pdf = v->kind == MATERIAL_DIFFUSE ? known.wi.z * INVERSE_PI : (float8)(0.0f);
#else
    known.wi = known.weight = vector8((float8)(0.0f), (float8)(0.0f), (float8)(0.0f));
    known.pdf = (float8)(0.0f);
#endif
    const uint others = other_lanes(v->kind, v->lanes);
    if (others == 0u) {
        return known;
    }
    BsdfSample8 out = known;
    const uint rest = others & ~wide_samples(materials, v->material, v->kind, v->wo, u, others, &out);
    return rest == 0u ? out : further_samples(materials, v->material, v->wo, u, out, rest);
}
#endif
