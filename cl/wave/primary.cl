#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/math.cl"
#include "base/warp.cl"
#include "base/sampler.cl"
#include "base/camera.cl"
#include "wave/path.cl"
#include "wave/span.cl"
#include "wave/tile.cl"

// Fills `count` free slots with camera rays, tile by tile, and in a tile pixel by pixel: rays next to each other in the
// queue stay next to each other on the image. An item's number is that of its place among the chunk's results, where 64
// are a tile at one sample. Race rule: every item owns its slot and its sample.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void primary(global const Camera *camera, global const Settings *settings, global const uint *queue,
                    const uint queue_first, const uint first_item, const uint count, const uint first_tile,
                    const uint first_sample, const uint samples_in_chunk, global Ray *rays,
                    global float4 *throughput, global uint4 *paths, global float4 *samples SCATTERINGS_ARGUMENT MEDIA_ARGUMENT
                    SPAN_ARGUMENTS)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint slot = queue[queue_first + i];
    const uint place = first_item + i;
#if HAS_ADAPTIVE
    const uint4 span = spans[group_tiles[place / TILE]];
    const uint first = span.y * TILE;
    const uint item = first + traced_at(place - first, span.z);
    const uint tile = first_tile + group_tiles[place / TILE];
#else
    const uint within = place % (TILE * samples_in_chunk);
    const uint item = place - within + traced_at(within, samples_in_chunk);
    const uint sample = first_sample + item / TILE % samples_in_chunk;
    const uint tile = first_tile + item / TILE / samples_in_chunk;
#endif
    const uint lane = item % TILE;
    const uint2 at = tile_pixel(settings, tile, lane);
#if HAS_ADAPTIVE
    const uint2 range = range_of(ranges[tile], at.x, at.y);
    const uint sample = range.x + span.x + item / TILE - span.y;
    const int inside = sample < range.y && at.x < settings->width && at.y < settings->height;
#else
    const int inside = at.x < settings->width && at.y < settings->height;
#endif
    const uint x = settings->first_x + at.x;  // of the whole picture, so that a window changes no sample
    const uint y = settings->first_y + at.y;
    const uint pixel = pixel_name(settings, x, y);
    const Sampler sampler = sampler_for(settings, pixel, sample);
    const float4 u = sample_4d(sampler, SET_CAMERA);
    Ray ray = camera_ray(camera, film_point(x, y, settings->filter_radius, u.xy), u.zw);
    ray.direction.w = inside ? T_MAX_FREE : MISS_AT_ONCE;
    rays[slot] = ray;
#if HAS_OPACITY
    scatterings[slot] = make4(xyz(ray.origin), float_of(0u));
#endif
    throughput[slot] = (float4)(1.0f, 1.0f, 1.0f, 0.0f);
#if HAS_NESTED
    all_media[slot] = settings->media;
    paths[slot] = (uint4)(item, 1u | PATH_DELTA | (settings->first_medium << PATH_MEDIUM_SHIFT), pixel, sample);
#else
    paths[slot] = (uint4)(item, 1u | PATH_DELTA, pixel, sample);
#endif
    samples[item] = (float4)(0.0f);
}
