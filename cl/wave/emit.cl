#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/light_pair.cl"
#include "base/vector.cl"
#include "base/frame.cl"
#include "base/math.cl"
#include "base/sampler.cl"
#include "base/warp.cl"
#include "accel/geometry.cl"
#include "dispatch/light.cl"
#include "wave/caustic.cl"
#include "wave/path.cl"
#include "wave/tile.cl"

#if HAS_CAUSTICS
#define AIMS_ARGUMENT , global const float4 *aims
#else
#define AIMS_ARGUMENT
#endif

#if HAS_CAUSTICS
// The same light, sent towards the sphere `aim` out of those that are picked by `caps` in all.
static LightEmission towards(global const Light *l, const Geometry g, global const float4 *aims,
                             const LightEmission leaving, const float4 aim, const float caps, const float2 u)
{
    LightEmission out = leaving;
    const float down = u.x * cap_of(aim, leaving.origin);
    const float sine = sqrt_of(max_of(down * (2.0f - down), 0.0f));
    float s, c;
    sin_cos_turns(u.y, &s, &c);
    const Frame frame = frame_of(normalize3(xyz(aim) - leaving.origin));
    out.direction = to_world(frame, (float3)(sine * c, sine * s, 1.0f - down));
    const float share = caps / max_of(caps_around(aims, leaving.origin, out.direction), 1.0f);
    if (l->kind != LIGHT_EMITTER) {
        const float3 intensity = light_sample(l, g, leaving.origin + out.direction, u).radiance;  // at distance 1
        out.power = intensity * (6.28318531f * share);
        return out;
    }
    const int both = l->extra.x != 0.0f;
    const float cosine = dot3(leaving.normal, out.direction);
    out.origin = cosine < 0.0f ? leaving.origin - leaving.normal * (2.0f * leaving.error) : leaving.origin;
    out.power = leaving.power * (cosine > 0.0f || both ? (both ? 1.0f : 2.0f) * share * abs_of(cosine) : 0.0f);
    return out;
}

// The same light from infinity, before the disk of the sphere `aim`.
static LightEmission before(global const float4 *aims, const LightEmission leaving, const float4 around,
                            const float4 aim, const float2 u)
{
    LightEmission out = leaving;
    const float2 disk = square_to_disk(u) * aim.w;
    const float3 p = xyz(aim) + to_world(frame_of(leaving.direction), (float3)(disk.x, disk.y, 0.0f));
    const float deep = dot3(p - xyz(around), leaving.direction) + around.w;
    out.origin = p - leaving.direction * deep;
    const float count = max_of(disks_around(aims, p, leaving.direction), 1.0f);
    out.power = leaving.power * (aims[0].y / (aims[0].z * count));
    return out;
}

static int is_afar(global const Light *l) { return l->kind == LIGHT_SUN || l->kind == LIGHT_DIRECTIONAL; }

// Light on its way to what reflects or refracts it to single directions; u.x picks a sphere around such things.
static LightEmission aimed(global const Light *l, const Geometry g, global const float4 *aims,
                           const LightEmission leaving, const float4 around, const float4 u)
{
    const int afar = is_afar(l);
    const float caps = afar ? aims[0].y : caps_seen(aims, leaving.origin);
    if (!(afar ? disks_used(aims) : caps_used(caps))) {
        return leaving;
    }
    uint place = 0u;
    for (float left = u.x * caps; left >= 0.0f && place < (uint)aims[0].x;) {
        place++;
        left -= afar ? aims[place].w * aims[place].w : cap_of(aims[place], leaving.origin);
    }
    return afar ? before(aims, leaving, around, aims[place], u.yz)
                : towards(l, g, aims, leaving, aims[place], caps, u.yz);
}
#endif

#if HAS_CAUSTICS && HAS_PLANE
// Whether light from afar that starts at `origin` would have had to cross an infinite plane on its way there.
static int crossed_plane(const Geometry g, const float3 origin, const float3 direction)
{
    for (uint i = 0u; i < g.plane_count; i++) {
        const float3 normal = xyz(g.shapes[i].w);
        const float height = dot3(normal, origin - xyz(g.shapes[i].center));
        const float away = dot3(normal, direction);
        if (!is_hidden(g, g.shapes[i].object) && (height > 0.0f ? away > 0.0f : height < 0.0f && away < 0.0f)) {
            return 1;
        }
    }
    return 0;
}
#endif

// Fills `count` free slots with light that leaves the lights (integrator photon), one path for each pixel and sample of
// the chunk, cut as `primary` does: its numbers are those of that pixel and sample, but where it goes has nothing to do
// with them. throughput.xyz: what it carries [W] over its density; paths.x: its way so far (bits; `weakened` of
// wave/connect.cl). Race rule: every item owns its slot.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void emit(GEOMETRY_ARGUMENTS, global const Light *light_table TEXTURE_ARGUMENTS, global const Settings *settings,
                 global const float4 *around, global const uint *queue, const uint queue_first, const uint first_item,
                 const uint count, const uint first_tile, const uint first_sample, const uint samples_in_chunk,
                 global Ray *rays, global float4 *throughput, global uint4 *paths SCATTERINGS_ARGUMENT AIMS_ARGUMENT)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint slot = queue[queue_first + i];
    const uint item = first_item + i;
    const uint lane = item % TILE;
    const uint group = item / TILE;
    const uint sample = first_sample + group % samples_in_chunk;
    const uint tile = first_tile + group / samples_in_chunk;
    const uint2 at = tile_pixel(settings, tile, lane);
    const uint pixel = pixel_name(settings, settings->first_x + at.x, settings->first_y + at.y);
    Ray ray;
    ray.origin = (float4)(0.0f);
    ray.direction = (float4)(0.0f, 0.0f, 1.0f, MISS_AT_ONCE);
    float4 state = (float4)(0.0f);
#if HAS_LIGHTS && HAS_PHOTON
    if (settings->light_count != 0u && at.x < settings->width && at.y < settings->height) {
        const Sampler sampler = sampler_for(settings, pixel, sample);
        const Lights lights = LIGHTS_OF_ARGUMENTS(light_table, settings->light_count);
        const LightPlace anywhere = light_place(xyz(*around), 0u);
        float picked;
        const uint about = pick_light(lights, anywhere, sample_2d(sampler, SET_EMIT_LIGHT), &picked);
        float4 u = sample_4d(sampler, SET_EMIT);
        float2 within = u.xy;
        const uint index = light_of_pair(lights, about, &within);
        u.xy = within;
        LightEmission leaving = light_emit(light_table + index, g, *around, u);
#if HAS_CAUSTICS
        leaving = aimed(light_table + index, g, aims, leaving, *around, sample_4d(sampler, SET_EMIT_AIM));
#endif
#if HAS_CAUSTICS && HAS_PLANE
        if (is_afar(light_table + index) && crossed_plane(g, leaving.origin, leaving.direction)) {
            leaving.power = (float3)(0.0f);
        }
#endif
        const float3 power = picked > 0.0f ? leaving.power * (1.0f / picked) : (float3)(0.0f);
        ray.origin = make4(leaving.origin, float_of(leaving.prim));
        ray.direction = make4(leaving.direction, largest3(power) > 0.0f ? T_MAX_FREE : MISS_AT_ONCE);
#if HAS_CAUSTICS
        state = make4(power, lamp_density(light_table + index, aims, leaving.origin,
                                          dot3(leaving.normal, leaving.direction), leaving.direction));
#else
        state = make4(power, 0.0f);
#endif
    }
#endif
    rays[slot] = ray;
    throughput[slot] = state;
    paths[slot] = (uint4)(0u, 1u | PATH_DELTA, pixel, sample);
#if HAS_OPACITY
    scatterings[slot] = make4(xyz(ray.origin), float_of(0u));
#endif
}
