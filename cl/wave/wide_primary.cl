#pragma OPENCL FP_CONTRACT OFF
// Eight camera rays at once, for CPUs: in each lane what wave/primary.cl does with one, operation by operation, so that no
// bit tells whether a ray was made among eight or alone.
#include "base/camera.cl"
#include "base/portable.cl"
#include "base/warp8.cl"
#include "base/wide.cl"
#include "base/wide_sampler.cl"
#include "wave/path.cl"
#include "wave/tile.cl"

#define WIDE_PRIMARY (DEVICE_CPU && !HAS_ADAPTIVE && !HAS_OPACITY && !HAS_NESTED)
#if WIDE_PRIMARY
// film_point
static Pair8 film_points(const uint8 x, const uint8 y, const float radius, const Rows8 u)
{
    Pair8 at = pair8(float8_of(as_int8(x)) + 0.5f, float8_of(as_int8(y)) + 0.5f);
#if HAS_GAUSSIAN || HAS_TENT || SIGNED_FILTER
    for (uint k = 0u; k < LANES; k++) {
        const float2 numbers = (float2)(lane_of(&u.x, k), lane_of(&u.y, k));
        const float2 one = film_point(lane_bits(&x, k), lane_bits(&y, k), radius, numbers);
        set_lane(&at.x, k, one.x);
        set_lane(&at.y, k, one.y);
    }
#elif !HAS_CENTER
    at.x += radius * (2.0f * u.x - 1.0f);
    at.y += radius * (2.0f * u.y - 1.0f);
#endif
    return at;
}

static Vector8 all8(const float4 v) { return vector8((float8)(v.x), (float8)(v.y), (float8)(v.z)); }

// camera_ray, without its t_max
static void camera_rays(global const Camera *camera, const Pair8 at, const Rows8 u, Vector8 *origin, Vector8 *direction)
{
    const float8 x = (at.x - camera->raster.x) * camera->raster.z;
    const float8 y = (at.y - camera->raster.y) * camera->raster.w;
    const Vector8 right = all8(camera->right);
    const Vector8 up = all8(camera->up);
    const Vector8 forward = all8(camera->forward);
    const Vector8 across = add8(scale8(right, x), scale8(up, y));
    *origin = all8(camera->origin);
#if HAS_ORTHOGRAPHIC
    *origin = add8(*origin, across);
    *direction = normalize8(forward);
#else
    Vector8 way = add8(across, forward);
#if HAS_LENS
    const Pair8 disk = square_to_disk8(pair8(u.z, u.w));
    const float radius = camera->origin.w;
    const Vector8 shift = add8(scale8(right, disk.x * radius), scale8(up, disk.y * radius));
    way = subtract8(way, scale8(shift, (float8)(camera->right.w)));
    *origin = add8(*origin, shift);
#endif
    *direction = normalize8(way);
#endif
}

// traced_at for eight places below TILE * `samples`. The quotient is exact: half a unit keeps it away from whole numbers
// by more than it is rounded.
static uint8 traced_at8(const uint8 place, const uint samples)
{
    const uint8 z = uint8_of((float8_of(as_int8(place)) + 0.5f) / (float)samples);
    const uint8 x = (z & 1u) | ((z >> 1) & 2u) | ((z >> 2) & 4u);
    const uint8 y = ((z >> 1) & 1u) | ((z >> 2) & 2u) | ((z >> 3) & 4u);
    return (place - z * samples) * TILE + y * TILE_SIDE + x;
}

// Fills the slots from place `i` of the queue on; `place` is their first item's.
static void fill_eight(global const Camera *camera, global const Settings *settings, global const uint *queue,
                       const uint place, const uint first_tile, const uint first_sample, const uint samples_in_chunk,
                       global Ray *rays, global float4 *throughput, global uint4 *paths, global float4 *samples)
{
    const uint8 lanes = (uint8)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u);
    const uint8 slot = (uint8)(queue[0], queue[1], queue[2], queue[3], queue[4], queue[5], queue[6], queue[7]);
    const uint within = place % (TILE * samples_in_chunk);
    const uint tile = first_tile + (place - within) / TILE / samples_in_chunk;
    const uint2 corner = tile_pixel(settings, tile, 0u);
    const uint8 traced = traced_at8(within + lanes, samples_in_chunk);
    const uint8 item = place - within + traced;
    const uint8 at_x = corner.x + traced % TILE_SIDE;
    const uint8 at_y = corner.y + traced % TILE / TILE_SIDE;
    const int8 inside = (at_x < settings->width) & (at_y < settings->height);
    const uint8 sample = first_sample + traced / TILE;
    const uint8 x = settings->first_x + at_x;
    const uint8 y = settings->first_y + at_y;
#if HAS_BLUE_NOISE
    const uint8 pixel = y << 16 | x;
#else
    const uint8 pixel = y * settings->whole_width + x;
#endif
    const Rows8 u = sample_4d_of8(samplers_for(settings, pixel, sample), (uint8)(SET_CAMERA));
    Vector8 origin, direction;
    camera_rays(camera, film_points(x, y, settings->filter_radius, u), u, &origin, &direction);
    const float8 t_max = inside ? (float8)(T_MAX_FREE) : (float8)(MISS_AT_ONCE);
    const uint8 words = (uint8)(1u | PATH_DELTA);
    put_rows((global float4 *)rays, slot * 2u, rows8(origin, as_float8((uint8)(NONE))), 0xffu);
    put_rows((global float4 *)rays, slot * 2u + 1u, rows8(direction, t_max), 0xffu);
    put_rows((global float4 *)paths, slot, four8(as_float8(item), as_float8(words), as_float8(pixel), as_float8(sample)),
             0xffu);
    for (uint k = 0u; k < LANES; k++) {
        throughput[lane_bits(&slot, k)] = (float4)(1.0f, 1.0f, 1.0f, 0.0f);
        samples[lane_bits(&item, k)] = (float4)(0.0f);
    }
}
#endif
