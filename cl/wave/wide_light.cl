#pragma OPENCL FP_CONTRACT OFF
// Lights of eight vertices at once, and the rays that leave these. Included by wave/wide_shade.cl.
#include "base/light_pair.cl"
#include "base/wide.cl"
#include "accel/wide_surface.cl"
#include "dispatch/light.cl"
#include "wave/fault.cl"
#include "wave/vertex.cl"
#include "wave/wide_vertex.cl"

#if WIDE_SHADING
#if HAS_LIGHTS
#if HAS_LIGHT_TREE
// pick_light, a lane at a time.
static uint8 picked_lights(const Lights lights, const Vertices8 *v, const Rows8 *u, const uint8 slot,
                           float8 *probability LEFT_NORMALS_ARGUMENT)
{
    const Vertices8 all = *v;
    const Rows8 numbers = *u;
    uint8 out = (uint8)(0u);
    for (uint rest = v->lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        const uint place = lane_bits(&slot, k);
        const int both_sides = (lane_bits(&all.flags, k) & MATERIAL_TRANSMITS) != 0u;
        left_normals[place] = packed_normal(both_sides ? (float3)(0.0f) : lane3_of(&all.frame.n, k));
        float one;
        const uint light = pick_light(lights, LIGHT_PLACE_AT(lane3_of(&all.surface.p, k), place),
                                      (float2)(lane_of(&numbers.z, k), lane_of(&numbers.w, k)), &one);
        set_bits(&out, k, light);
        set_lane(probability, k, one);
    }
    return out;
}
#else
#if HAS_EMITTER
// light_of_pair, where the light `picked` is an emitter whose words are `words`.
static uint8 lights_of_pairs(const uint8 picked, const int8 emits, const Rows8 words, Rows8 *u)
{
    const uint8 first = as_uint8(words.x);
    const int8 paired = emits & (first != 0u);
    const float8 rest_x = 1.0f - u->x;
    const float8 rest_y = 1.0f - u->y;
    const int8 beyond = u->y > rest_x;
    const float8 x = beyond ? rest_x : u->x;
    const float8 y = beyond ? rest_y : u->y;
    const uint8 corners = as_uint8(words.z);
    const uint8 corner = beyond ? corners >> 2 : corners & 3u;
    const float8 rest = 1.0f - x - y;  // from here on numbers_of_weights
    const float8 second = corner == 0u ? x : (corner == 1u ? rest : y);
    const float8 third = corner == 0u ? y : (corner == 1u ? x : rest);
    const float8 sum = second + third;
    const int8 above = third > second;
    u->x = paired ? (above ? 2.0f * second : sum) : u->x;
    u->y = paired ? (above ? sum : 2.0f * third) : u->y;
    return paired ? (beyond ? as_uint8(words.y) : first - 1u) : picked;
}
#endif

// pick_light by the alias table, then light_of_pair, which changes the first two numbers of `u`.
static uint8 picked_lights(const Lights lights, const Vertices8 *v, Rows8 *numbers, const uint8 slot,
                           float8 *probability)
{
    const Rows8 u = *numbers;
    const ulong8 bits = ulong8_of(uint8_of(u.z * 16777216.0f)) << 16 | ulong8_of(uint8_of(u.w * 65536.0f));
    const ulong8 place = bits * lights.count;
    const uint8 row = low_bits8(place >> 40);
    const float8 share = float8_of(as_int8(low_bits8(place >> 16) & 0xffffffu)) * 5.9604644775390625e-8f;  // 2^-24
    const Rows8 head = rows_at((global const float4 *)lights.table, row * LIGHT_ROWS);
    const uint8 picked = share < head.w ? row : as_uint8(head.z);
    const Rows8 words = rows_at((global const float4 *)&lights.table->position, picked * LIGHT_ROWS);
    *probability = words.w;
#if HAS_EMITTER
    const uint8 kind = as_uint8(rows_at((global const float4 *)lights.table, picked * LIGHT_ROWS).x);
    return lights_of_pairs(picked, kind == LIGHT_EMITTER, words, numbers);
#else
    return picked;
#endif
}
#endif

#if HAS_EMITTER
// emitter_sample of triangles.
static LightSamples8 triangle_lights(global const Light *table, const Geometry g, const uint8 prim, const uint8 light,
                                     const Vector8 from, const Rows8 u)
{
    const uint8 row = light * LIGHT_ROWS;
    const Vector8 ng = xyz8(rows_at((global const float4 *)&table->direction, row));
    const Rows8 extra = rows_at((global const float4 *)&table->extra, row);
    const Corners8 corners = corners_of(g, triangle_rows(g, prim));
    const int8 above = u.y > u.x;
    const float8 half_low = 0.5f * (above ? u.x : u.y);
    const float8 rest = (above ? u.y : u.x) - half_low;
    const Vector8 p = triangle_point8(corners, above ? half_low : rest, above ? rest : half_low);
    const float8 error = triangle_error8(corners, ng);
    const float8 pdf = density_by_area8(from, p, ng, extra.y);
    const Vector8 to = subtract8(p, from);
    const float8 front = -dot8(ng, to);
    const int8 shines = (front > 0.0f) | ((extra.x != 0.0f) & (front < 0.0f));
    const float8 lift = error + 4.0f * UNIT_ROUNDOFF * dot8(magnitudes8(ng), magnitudes8(to));
    LightSamples8 out;
    out.to = add8(to, scale8(ng, front > 0.0f ? lift : -lift));
    out.radiance = xyz8(rows_at((global const float4 *)&table->radiance, row));
    out.pdf = shines ? pdf : (float8)(0.0f);
    out.delta = (uint8)(0u);
    out.infinite = (uint8)(0u);
    return out;
}
#endif

#if HAS_POINT || HAS_DIRECTIONAL
// point_sample and directional_sample, put among those that are there; gives the lanes whose lights are such.
static uint single_directions(global const Light *table, const uint8 light, const Vector8 from, LightSamples8 *out)
{
    const uint8 row = light * LIGHT_ROWS;
    const uint8 kind = as_uint8(rows_at((global const float4 *)table, row).x);
    const Vector8 radiance = xyz8(rows_at((global const float4 *)&table->radiance, row));
    int8 done = (int8)(0);
#if HAS_POINT
    const int8 points = kind == LIGHT_POINT;
    const Vector8 to = subtract8(xyz8(rows_at((global const float4 *)&table->position, row)), from);
    const float8 squared = dot8(to, to);
    const int8 apart = squared > 0.0f;
    out->to = choose8(points, to, out->to);
    out->radiance = choose8(points, scale8(radiance, apart ? 1.0f / squared : (float8)(0.0f)), out->radiance);
    out->pdf = points ? (apart ? (float8)(1.0f) : (float8)(0.0f)) : out->pdf;
    done |= points;
#endif
#if HAS_DIRECTIONAL
    const int8 parallel = kind == LIGHT_DIRECTIONAL;
    const Vector8 direction = xyz8(rows_at((global const float4 *)&table->direction, row));
    out->to = choose8(parallel, negate8(direction), out->to);
    out->radiance = choose8(parallel, radiance, out->radiance);
    out->pdf = parallel ? (float8)(1.0f) : out->pdf;
    out->infinite = parallel ? (uint8)(1u) : out->infinite;
    done |= parallel;
#endif
    out->delta = done ? (uint8)(1u) : out->delta;
    return movemask8(done);
}
#endif

// light_sample for lights of any kind, put among those that are there.
static LightSamples8 further_lights(global const Light *table, const Geometry g, const uint8 light, const Vector8 from,
                                    const Rows8 u, const LightSamples8 known, const uint lanes)
{
    LightSamples8 out = known;
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        const LightSample one = light_sample(table + lane_bits(&light, k), g, lane3_of(&from, k),
                                             (float2)(lane_of(&u.x, k), lane_of(&u.y, k)));
        set_lane3(&out.to, k, one.to);
        set_lane3(&out.radiance, k, one.radiance);
        set_lane(&out.pdf, k, one.pdf);
        set_bits(&out.delta, k, one.delta);
        set_bits(&out.infinite, k, one.infinite);
    }
    return out;
}

// What sample_direct asks of lights: one for each vertex, and a point of it.
static LightSamples8 sampled_lights(const Lights lights, const Geometry g, const Vertices8 *v, const Rows8 numbers,
                                    const uint8 slot LEFT_NORMALS_ARGUMENT)
{
    float8 probability;
    Rows8 u = numbers;
    const uint8 light = picked_lights(lights, v, &u, slot, &probability LEFT_NORMALS);
    LightSamples8 out;
#if HAS_EMITTER
    const Rows8 head = rows_at((global const float4 *)lights.table, light * LIGHT_ROWS);
    const uint8 prim = as_uint8(head.y);
    const int8 flat = (as_uint8(head.x) == LIGHT_EMITTER) & (prim < g.triangle_count);
    uint others = v->lanes & ~movemask8(flat);
    out = triangle_lights(lights.table, g, flat ? prim : (uint8)(0u), light, v->surface.p, u);
#else
    uint others = v->lanes;
    out.to = out.radiance = vector8((float8)(0.0f), (float8)(0.0f), (float8)(0.0f));
    out.pdf = (float8)(0.0f);
    out.delta = out.infinite = (uint8)(0u);
#endif
#if HAS_POINT || HAS_DIRECTIONAL
    if (others != 0u) {
        others &= ~single_directions(lights.table, light, v->surface.p, &out);
    }
#endif
    if (others != 0u) {
        out = further_lights(lights.table, g, light, v->surface.p, u, out, others);
    }
    out.pdf = out.pdf * probability;
    return out;
}
#endif

// Lanes of `lanes` where what is carried along a ray and the ray itself are sound, in the sense of wave/fault.cl.
static uint sound_lanes(const Vector8 carried, const Vector8 origin, const Vector8 direction, const uint lanes)
{
    const float8 sum = carried.x + carried.y + carried.z;
    const float8 least = min8(carried.x, min8(carried.y, carried.z));
    const Vector8 none = add8(scale8(origin, (float8)(0.0f)), scale8(direction, (float8)(0.0f)));
    return lanes & movemask8((least >= 0.0f) & (sum <= LARGEST_FLOAT) & (none.x + none.y + none.z == 0.0f));
}

#if HAS_LIGHTS
// sample_direct: stores rays and their light; gives the lanes that ask whether they arrive. Those where anything is
// unsound leave v->lanes. `words`: those of arriving light.
static uint direct_of(const Lights lights, const Geometry g, global const Material *materials, Vertices8 *v,
                      const Rows8 u, const uint8 slot, const uint8 prim, const uint8 words, global Ray *shadow_rays,
                      global float4 *shadow_light LEFT_NORMALS_ARGUMENT)
{
    if (lights.count == 0u) {
        return 0u;
    }
    const LightSamples8 light = sampled_lights(lights, g, v, u, slot LEFT_NORMALS);
    const Vector8 wi = normalize8(light.to);
    const Vector8 wi_local = to_local8(v->frame, wi);
    const float8 same_side = dot8(wi, v->normal) * (v->wo.z < 0.0f ? -wi_local.z : wi_local.z);
    const uint lit = v->lanes & movemask8((light.pdf > 0.0f) & (same_side > 0.0f));
    const Rows8 bsdf = values_of(materials, v, wi_local, lit);
    const float8 shared = power_heuristic8(light.pdf, bsdf.w);
    const float8 weight = light.delta != 0u ? (float8)(1.0f) : shared;
    const Vector8 arriving = scale8(multiply8(multiply8(v->state, xyz8(bsdf)), light.radiance), weight / light.pdf);
    const Vector8 origin = spawn_origin8(&v->surface, wi);
    const int8 infinite = light.infinite != 0u;
    const Vector8 target = subtract8(light.to, subtract8(origin, v->surface.p));
    const Rows8 direction = rows8(choose8(infinite, wi, target), infinite ? (float8)(T_MAX_FREE) : (float8)(1.0f));
    const uint asks = lit & movemask8(arriving.x + arriving.y + arriving.z != 0.0f);
    const uint sound = sound_lanes(arriving, origin, xyz8(direction), asks);
    v->lanes &= movemask8((light.pdf == light.pdf) & (same_side == same_side)) & ~(asks & ~sound);
    put_rows((global float4 *)&shadow_rays->origin, slot * 2u, rows8(origin, as_float8(prim)), v->lanes);
    put_rows((global float4 *)&shadow_rays->direction, slot * 2u, direction, v->lanes);
    put_rows(shadow_light, slot, rows8(arriving, as_float8(words)), v->lanes);
    return asks;
}
#endif
#endif
