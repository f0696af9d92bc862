#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"
// Where the camera sees a point, and how strongly: the other way round than camera_ray. Included by wave/connect.cl.

typedef struct {
    float3 to;      // from the point to where its ray meets the camera [m]
    float2 at;      // film point [pixels]
    float measure;  // what a radiance over the cosine at the surface counts: 1 / (area of a pixel as seen there) [1/m^2]
    int seen;       // it lies before the camera
} LensPoint;

// `u` in [0,1)^2 picks the point on the aperture. A pixel's value is the mean radiance over its area on the plane at
// distance 1 before the camera, of which a surface at distance d, seen at an angle t to the axis, covers
// cosine dA / (d^2 cos^3 t) (Veach 1997, ch. 8.3).
static LensPoint lens_point(global const Camera *camera, const float3 p, const float2 u)
{
    const float3 right = xyz(camera->right);
    const float3 up = xyz(camera->up);
    const float3 forward = xyz(camera->forward);
    LensPoint out;
    float3 from = xyz(camera->origin);
    float2 shift = (float2)(0.0f);
#if HAS_LENS
    shift = square_to_disk(u) * camera->origin.w;
    from += right * shift.x + up * shift.y;
#endif
    const float3 away = p - from;
    const float depth = dot3(away, forward);
    const float2 across = (float2)(dot3(away, right), dot3(away, up));
    const float pixel = 1.0f / abs_of(camera->raster.z * camera->raster.w);
    out.seen = depth > 0.0f;
#if HAS_ORTHOGRAPHIC
    const float2 plane = across;
    out.to = forward * -depth;
    out.measure = pixel;
#else
    const float2 plane = across * (1.0f / (out.seen ? depth : 1.0f)) + shift * camera->right.w;
    out.to = -away;
    const float distance = length3(away);
    out.measure = pixel * (distance / depth) * (1.0f / depth) * (1.0f / depth);  // d^3 / (depth^3 d^2)
#endif
    out.at = (float2)(camera->raster.x + plane.x / camera->raster.z, camera->raster.y + plane.y / camera->raster.w);
    return out;
}

// Number of the pixel in the window that holds a film point; NONE outside.
static uint pixel_at(global const Settings *settings, const float2 at)
{
    const float x = at.x - (float)settings->first_x;
    const float y = at.y - (float)settings->first_y;
    if (!(x >= 0.0f && y >= 0.0f && x < (float)settings->width && y < (float)settings->height)) {
        return NONE;
    }
    return (uint)y * settings->width + (uint)x;
}
