#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/math.cl"
#include "base/warp.cl"
#include "base/filter.cl"

// Point of the film, in pixels, for pixel (x, y). Filter importance sampling: samples are spread as the filter
// weighs them, so that every sample counts the same (Ernst, Stamminger and Greiner 2006) but for the sign.
static float2 film_point(const uint x, const uint y, const float radius, const float2 u)
{
    const float2 center = (float2)((float)x + 0.5f, (float)y + 0.5f);
#if HAS_CENTER
    return center;
#elif HAS_GAUSSIAN
    // Gaussian of sigma = radius / 4, cut at `radius` (4 sigma): Box-Muller with the radius's distribution cut.
    const float cut = 0.99966453737f;  // 1 - exp(-8)
    const float r = 0.25f * radius * sqrt_of(-2.0f * log_of(1.0f - cut * u.x));
    float s, c;
    sin_cos(6.2831853071795864f * u.y, &s, &c);
    return center + (float2)(r * c, r * s);
#elif SIGNED_FILTER
    float weight;  // the film's matter
    return center + radius * filter_offset(u, &weight);
#elif HAS_TENT
    const float2 t = 2.0f * u - (float2)(1.0f);
    const float across = 1.0f - sqrt_of(1.0f - abs_of(t.x));
    const float down = 1.0f - sqrt_of(1.0f - abs_of(t.y));
    return center + radius * (float2)(t.x < 0.0f ? -across : across, t.y < 0.0f ? -down : down);
#else
    return center + radius * (2.0f * u - (float2)(1.0f));
#endif
}

// Ray through film point `at`; `lens` in [0,1)^2 picks the point on the aperture. Unit direction.
// Plane coordinates are counted from the axis: what lies near it keeps its digits at every angle and size.
static Ray camera_ray(global const Camera *camera, const float2 at, const float2 lens)
{
    const float x = (at.x - camera->raster.x) * camera->raster.z;
    const float y = (at.y - camera->raster.y) * camera->raster.w;
    const float3 right = xyz(camera->right);
    const float3 up = xyz(camera->up);
    const float3 forward = xyz(camera->forward);
    float3 origin = xyz(camera->origin);
#if HAS_ORTHOGRAPHIC
    origin += right * x + up * y;
    const float3 direction = forward;
#else
    float3 direction = right * x + up * y + forward;
#if HAS_LENS
    const float2 disk = square_to_disk(lens) * camera->origin.w;
    const float3 shift = right * disk.x + up * disk.y;
    direction = direction - shift * camera->right.w;  // w = 1 / focus distance; 0 focuses at infinity
    origin += shift;
#endif
#endif
    Ray ray;
    ray.origin = make4(origin, float_of(NONE));
    ray.direction = make4(normalize3(direction), 0.0f);
    return ray;
}
