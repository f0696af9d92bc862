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
#include "wave/wide_primary.cl"

// Fills the first slot of `queue` with the camera ray of item `place`.
static void fill_one(global const Camera *camera, global const Settings *settings, global const uint *queue,
                     const uint place, const uint first_tile, const uint first_sample, const uint samples_in_chunk,
                     global Ray *rays, global float4 *throughput, global uint4 *paths,
                     global float4 *samples SCATTERINGS_ARGUMENT MEDIA_ARGUMENT SPAN_ARGUMENTS)
{
    const uint slot = *queue;
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

// Fills the slots from place `begin` of `queue` to below `end`, of which the first of all is item `first_item`.
static COMPILED_ONCE void fill_span(global const Camera *camera, global const Settings *settings,
                                    global const uint *queue, const uint first_item, const uint first_tile,
                                    const uint first_sample, const uint samples_in_chunk, global Ray *rays,
                                    global float4 *throughput, global uint4 *paths,
                                    global float4 *samples SCATTERINGS_ARGUMENT MEDIA_ARGUMENT SPAN_ARGUMENTS,
                                    const uint begin, const uint end)
{
    uint i = begin;
#if WIDE_PRIMARY
    for (; i + LANES <= end; i += LANES) {
        fill_eight(camera, settings, queue + i, first_item + i, first_tile, first_sample, samples_in_chunk, rays,
                   throughput, paths, samples);
    }
#endif
    for (; i < end; i++) {
        fill_one(camera, settings, queue + i, first_item + i, first_tile, first_sample, samples_in_chunk, rays,
                 throughput, paths, samples SCATTERINGS MEDIA SPANS);
    }
}

// Fills `count` free slots with camera rays, tile by tile, and in a tile pixel by pixel: rays next to each other in the
// queue stay next to each other on the image. An item's number is that of its place among the chunk's results, where 64
// are a tile at one sample; chunks and launches are whole tiles of them. A work-item fills ITEM_RAYS slots.
// Race rule: every item owns its slot and its sample.
VEC_LEN_HINT __attribute__((reqd_work_group_size(ITEM_GROUP, 1, 1)))
kernel void primary(global const Camera *camera, global const Settings *settings, global const uint *queue,
                    const uint queue_first, const uint first_item, const uint count, const uint first_tile,
                    const uint first_sample, const uint samples_in_chunk, global Ray *rays,
                    global float4 *throughput, global uint4 *paths, global float4 *samples SCATTERINGS_ARGUMENT MEDIA_ARGUMENT
                    SPAN_ARGUMENTS)
{
    const uint begin = (uint)get_global_id(0) * ITEM_RAYS;
    if (begin >= count) {
        return;
    }
    const uint end = count - begin < ITEM_RAYS ? count : begin + ITEM_RAYS;
    fill_span(camera, settings, queue + queue_first, first_item, first_tile, first_sample, samples_in_chunk, rays,
              throughput, paths, samples SCATTERINGS MEDIA SPANS, begin, end);
}
