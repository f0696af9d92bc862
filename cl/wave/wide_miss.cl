#pragma OPENCL FP_CONTRACT OFF
// Eight paths at once that met nothing. Included by wave/wide_shade.cl.
#include "base/wide.cl"
#include "wave/arrive.cl"
#include "wave/fault.cl"
#include "wave/path.cl"
#include "wave/shading.cl"
#include "wave/wide_light.cl"

// The same from everywhere, and nothing that competes with meeting it
#define PLAIN_SKY (HAS_ENVIRONMENT && HAS_CHANCE_SKY && !HAS_ENVIRONMENT_MAP && !HAS_SUN && !HAS_HIDDEN_SKY)

#if WIDE_SHADING
// Adds light that paths meet after `edge` to the samples `place` of `lanes`.
static void arrive_seen(const Shading *s, const uint8 place, const uint8 edge, const Vector8 light, const uint lanes)
{
    const uint8 words = arriving_words8(place, edge - 1u);
    const Rows8 t = transposed8(light.x, light.y, light.z, (float8)(0.0f));
    const float8 columns[4] = {t.x, t.y, t.z, t.w};
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        arrive(s->samples, lane_bits(&words, k), k < 4u ? columns[k].lo : columns[k - 4u].hi BOUNDS_OF(s));
    }
}

// shade_miss for `lanes`, whose directions are `way`; gives those that are done. The others are unsound, or see what is
// asked for one by one.
static uint shade_misses(const Shading *s, const uint8 slot, const Vector8 way, const Rows8 path, const Rows8 state,
                         const uint lanes)
{
    const uint8 edge = as_uint8(path.y) & PATH_EDGES;
    const uint first = lanes & movemask8(edge == 1u);
    uint done = lanes;
    if (first != 0u) {
        const Rows8 origin = rows_at((global const float4 *)s->rays, slot * 2u);
        done = (lanes & ~first) | sound_lanes(xyz8(state), xyz8(origin), way, first);
    }
#if PLAIN_SKY
    if (s->settings->environment == NONE) {
        return 0u;
    }
    const float4 sky = s->lights.table[s->settings->environment].radiance;
    const float8 zero = (float8)(0.0f);  // what suns add: -0 becomes 0
    const Vector8 light = vector8(zero + state.x * sky.x, zero + state.y * sky.y, zero + state.z * sky.z);
    const float8 least = min8(light.x, min8(light.y, light.z));
    done &= movemask8((least >= 0.0f) & (light.x + light.y + light.z <= LARGEST_FLOAT));
    arrive_seen(s, as_uint8(path.x), edge, light, done);
    return done;
#elif HAS_SKY
    return 0u;
#else
    return done;
#endif
}
#endif
