#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/sampler.cl"
#include "accel/geometry.cl"
#include "dispatch/light.cl"
#include "wave/caustic.cl"
#include "wave/path.cl"
#include "wave/tile.cl"

// Fills `count` free slots with light that leaves the lights (integrator photon), one path for each pixel and sample of
// the chunk, cut as `primary` does: its numbers are those of that pixel and sample, but where it goes has nothing to do
// with them. throughput.xyz: what it carries [W] over its density. Race rule: every item owns its slot.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void emit(GEOMETRY_ARGUMENTS, global const Light *light_table TEXTURE_ARGUMENTS, global const Settings *settings,
                 global const float4 *around, global const uint *queue, const uint queue_first, const uint first_item,
                 const uint count, const uint first_tile, const uint first_sample, const uint samples_in_chunk,
                 global Ray *rays, global float4 *throughput, global uint4 *paths SCATTERINGS_ARGUMENT)
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
        const uint index = pick_light(lights, anywhere, sample_2d(sampler, SET_EMIT_LIGHT), &picked);
        const LightEmission leaving = light_emit(light_table + index, g, *around, sample_4d(sampler, SET_EMIT));
        const float3 power = picked > 0.0f ? leaving.power * (1.0f / picked) : (float3)(0.0f);
        ray.origin = make4(leaving.origin, float_of(leaving.prim));
        ray.direction = make4(leaving.direction, largest3(power) > 0.0f ? T_MAX_FREE : MISS_AT_ONCE);
#if HAS_CAUSTICS
        state = make4(power, lamp_density(light_table + index));
#else
        state = make4(power, 0.0f);
#endif
    }
#endif
    rays[slot] = ray;
    throughput[slot] = state;
    paths[slot] = (uint4)(item, 1u | PATH_DELTA, pixel, sample);
#if HAS_OPACITY
    scatterings[slot] = make4(xyz(ray.origin), float_of(0u));
#endif
}
