#pragma OPENCL FP_CONTRACT OFF
// What one step along a queue shades at once. Included by wave/shade.cl.
#include "base/mis.cl"
#include "base/portable.cl"
#include "base/wide.cl"
#include "base/wide_sampler.cl"
#include "wave/arrive.cl"
#include "wave/numbers.cl"
#include "wave/path.cl"
#include "wave/shading.cl"
#include "wave/vertex.cl"
#include "wave/wide_vertex.cl"
#include "wave/wide_light.cl"
#include "wave/wide_miss.cl"
#include "wave/wide_order.cl"

#if DEVICE_GPU
#define GROUP_SLOTS 1u
#else
#define GROUP_SLOTS 8u
#endif

#define MANY_TRIANGLES 4096u  // more than near caches hold

// Slot of what is shaded as number `i`, or of the last one where there are not so many.
static uint slot_ahead(const Shading *s, const uint i, const uint end)
{
#if SORTED
    const uint last = end - 1u;
#else
    const uint last = s->count - 1u;
#endif
    return s->queue[place_of(s, i < last ? i : last)];
}

// Asks for the state of the slots that come a group later; and where triangles are many, for their corners, for the
// triangles of those two groups later and the hits of those three groups later.
static void prefetch_group(const Shading *s, const uint i, const uint end)
{
    const int many = s->g.triangle_count > MANY_TRIANGLES;
    for (uint k = i + GROUP_SLOTS; k < i + 2u * GROUP_SLOTS; k++) {
        const uint later = slot_ahead(s, k, end);
        PREFETCH(s->rays + later);
        PREFETCH(s->paths + later);
        PREFETCH(s->throughput + later);
        if (!many) {
            PREFETCH(s->hits + later);
            continue;
        }
        const uint prim = s->hits[later].prim;
        const uint4 corners = s->g.triangles[prim < s->g.triangle_count ? prim : 0u].v;
        PREFETCH(s->g.vertices + corners.x);
        PREFETCH(s->g.vertices + corners.y);
        PREFETCH(s->g.vertices + corners.z);
        const uint next = s->hits[slot_ahead(s, k + GROUP_SLOTS, end)].prim;
        PREFETCH(s->g.triangles + (next < s->g.triangle_count ? next : 0u));
        PREFETCH(s->hits + slot_ahead(s, k + 2u * GROUP_SLOTS, end));
    }
}

#if WIDE_SHADING
// note_density, one by one, for `lanes` that the camera sees.
static void note_densities(const Shading *s, const Vertices8 *v, const BsdfSample8 bsdf, const uint lanes,
                           const uint8 slot CAUSTICS_ARGUMENT)
{
#if HAS_CAUSTICS
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        const uint own = lane_bits(&slot, k);
        const float3 away = lane3_of(&v->surface.p, k) - xyz(s->rays[own].origin);
        const float onward = per_cosine(lane_of(&bsdf.pdf, k), lane_of(&bsdf.wi.z, k));
        densities[own] = camera_density(s->settings, lane_of(&v->wo.z, k), onward, dot3(away, away));
    }
#endif
}

// sample_onward: stores the next rays; gives the lanes that go on. Those where anything is unsound leave v->lanes.
static uint onward_of(const Shading *s, Vertices8 *v, const uint8 slot, const uint8 prim, const Rows8 path,
                      const Rows8 u CAUSTICS_ARGUMENT)
{
    const uint8 edge = as_uint8(path.y) & PATH_EDGES;
    const BsdfSample8 bsdf = samples_of(s->materials, v, u);
    const Vector8 wi = to_world8(v->frame, bsdf.wi);
    const float8 side = dot8(wi, v->normal);
    const int8 passes = (bsdf.flags & BSDF_TRANSMIT) != 0u ? side < 0.0f : side > 0.0f;
    const Vector8 before = multiply8(v->state, bsdf.weight);
    const float8 strongest = max8(before.x, max8(before.y, before.z));
    const uint start = s->settings->roulette_start;
    const int8 gambles = start != 0u ? edge >= start : (int8)(0);
    const float8 survival = max8(min8(strongest, (float8)(1.0f)), (float8)(LEAST_SURVIVAL));
    const Vector8 after = choose8(gambles, scale8(before, 1.0f / survival), before);
    const uint alive = v->lanes & movemask8((bsdf.pdf > 0.0f) & passes & (~gambles | (u.w < survival)) &
                                            ((strongest > 0.0f) | (strongest != strongest)));
    const Vector8 origin = spawn_origin8(&v->surface, wi);
    const uint sound = sound_lanes(after, origin, wi, alive);
    v->lanes &= movemask8((bsdf.pdf == bsdf.pdf) & (side == side)) & ~(alive & ~sound);
    note_densities(s, v, bsdf, v->lanes & movemask8(edge == 1u), slot CAUSTICS);
    global float4 *rays = (global float4 *)s->rays;
    put_rows(rays, slot * 2u, rows8(origin, as_float8(prim)), v->lanes);
    put_rows(rays, slot * 2u + 1u, rows8(wi, (float8)(T_MAX_FREE)), v->lanes);
    put_rows(s->throughput, slot, rows8(after, bsdf.pdf), v->lanes);
    const int8 delta = (bsdf.flags & BSDF_DELTA) != 0u;
    const uint8 words = (edge + 1u) | (delta ? (uint8)(PATH_DELTA) : (uint8)(0u));
    Rows8 following = path;
#if HAS_CAUSTICS
    const int8 marked = edge == 1u ? ~delta : delta & ((as_uint8(path.y) & PATH_CAUSTIC) != 0u);
    following.y = as_float8(words | (marked ? (uint8)(PATH_CAUSTIC) : (uint8)(0u)));
#elif HAS_REGULARISED
    const uint8 long_ago = as_uint8(path.y) & PATH_SCATTERED;
    following.y = as_float8(words | (delta ? long_ago : (uint8)(PATH_SCATTERED)));
#else
    following.y = as_float8(words);
#endif
    put_rows((global float4 *)s->paths, slot, following, v->lanes);
    return alive;
}

// Something was hit; what camera rays of `lanes` saw.
static void note_hits(const Shading *s, const uint lanes, const uint8 sample)
{
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        s->samples[lane_bits(&sample, ctz_of(rest))] += (float4)(0.0f, 0.0f, 0.0f, 1.0f);
    }
}

// Shades those from number `i` on, of which those before `end` count; gives the lanes that are left to be shaded alone:
// those that met a shape or a light, saw a sky that is not the same everywhere, or are unsound.
static uint shade_group(const Shading *s, const uint i, const uint end LEFT_NORMALS_ARGUMENT CAUSTICS_ARGUMENT)
{
    prefetch_group(s, i, end);
    if (end - i < LANES) {
        return (1u << (end - i)) - 1u;
    }
    const uint8 place = places_of(s, i);
    const uint8 slot = slots_of(s, place);
    const Rows8 hit = rows_at((global const float4 *)s->hits, slot);
    const Rows8 direction = rows_at((global const float4 *)s->rays, slot * 2u + 1u);
    const uint8 found = as_uint8(hit.w);
    const uint held = movemask8(direction.w > 0.0f);
    const uint lanes = held & movemask8(found < s->g.triangle_count);
    const uint missing = held & movemask8(found == NONE);
    put_status(s, place, (uint8)(0u));
    if ((lanes | missing) == 0u) {
        return held;
    }
    const Rows8 path = rows_at((global const float4 *)s->paths, slot);
    const Rows8 state = rows_at(s->throughput, slot);
    const uint missed = missing == 0u ? 0u : shade_misses(s, slot, xyz8(direction), path, state, missing);
    if (lanes == 0u) {
        return held & ~missed;
    }
    const uint8 prim = found < s->g.triangle_count ? found : (uint8)(0u);
    const uint8 edge = as_uint8(path.y) & PATH_EDGES;
    Vertices8 v = vertices_of(s->g, s->objects, s->materials, prim, hit, xyz8(direction), xyz8(state),
                              lanes WORDS_OF(path));
    const uint alone = held & ~v.lanes & ~missed;
    const uint first = v.lanes & movemask8(edge == 1u);
    const uint8 sample = as_uint8(path.x);
    const uint scattering = v.lanes & movemask8((v.kind != MATERIAL_EMISSIVE) & (edge < s->settings->max_depth));
    if (scattering == 0u) {
        note_hits(s, first, sample);
        return alone;
    }
    v.lanes = scattering;
    const Sampler8 sampler = samplers_for(s->settings, as_uint8(path.z), as_uint8(path.w));
    const uint joins = s->settings->joins;
    uint asking = 0u;
#if HAS_LIGHTS
    asking = direct_of(s->lights, s->g, s->materials, &v, light_numbers8(sampler, joins, edge, s->lights.count > 1u),
                       slot, prim, arriving_words8(sample, edge), s->shadow_rays, s->shadow_light LEFT_NORMALS);
#endif
    const int lobes = s->settings->roulette_start != 0u || other_lanes(v.kind, v.lanes) != 0u;
    const uint living = onward_of(s, &v, slot, prim, path, onward_numbers8(sampler, joins, edge, lobes) CAUSTICS);
    const uint8 bit = (uint8)(1u, 2u, 4u, 8u, 16u, 32u, 64u, 128u);
    const uint8 next = ((living & bit) != 0u ? (uint8)(STATUS_ALIVE) : (uint8)(0u)) |
                       ((asking & bit) != 0u ? (uint8)(STATUS_SHADOW) : (uint8)(0u)) | edge << STATUS_EDGES_SHIFT;
    put_status(s, place, (v.lanes & bit) != 0u ? next : (uint8)(0u));
    const uint unsound = scattering & ~v.lanes;
    note_hits(s, first & ~unsound, sample);
    return alone | unsound;
}
#else
static uint shade_group(const Shading *s, const uint i, const uint end LEFT_NORMALS_ARGUMENT CAUSTICS_ARGUMENT)
{
    prefetch_group(s, i, end);
    return end - i < GROUP_SLOTS ? (1u << (end - i)) - 1u : (1u << GROUP_SLOTS) - 1u;
}
#endif
