#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/camera.cl"
#include "accel/traverse.cl"
#include "accel/relief.cl"
#include "accel/textured.cl"
#include "accel/blended.cl"
#include "accel/opacity.cl"
#include "dispatch/material.cl"
#include "wave/path.cl"

// Of all parts of a blend, by their shares.
static float3 albedo_at(const Geometry g, global const Material *materials, const uint number, const Surface *s,
                        const float3 way)
{
    float3 albedo = (float3)(0.0f);
    for (float u = 0.0f, end; u < 1.0f; u = end) {
        global const Material *material = materials + blended(g, materials, number, s, way, u, &end);
#if HAS_COPIED
        const Material here = textured_material(g, material, s);
        albedo += (end - u) * material_albedo(&here);
#else
        albedo += (end - u) * material_albedo(material);
#endif
    }
    return albedo;
}

// Row `i` of a pixel's layers.
static COMPILED_ONCE void aov_pixel(const Geometry *geometry, global const Object *objects,
                                    global const Material *materials, global const Camera *camera,
                                    global const Settings *settings, const uint first_pixel, const uint i,
                                    global float4 *albedo_depth, global float4 *normal, global float4 *position_object)
{
    const Geometry g = *geometry;
    const uint pixel = first_pixel + i;
    const uint2 place = (uint2)(settings->first_x + pixel % settings->width, settings->first_y + pixel / settings->width);
    const float2 center = (float2)((float)place.x + 0.5f, (float)place.y + 0.5f);
    Ray ray = camera_ray(camera, center, (float2)(0.5f));
    ray.direction.w = T_MAX_FREE;
    Hit hit = trace_closest(g, ray);
#if HAS_OPACITY
    float before = 0.0f;
    for (; hit.prim != NONE; hit = trace_closest(g, ray)) {
        const Surface seen = surface_of(g, ray, hit);
        if (opacity_at(g, objects, materials, &seen) >= 0.5f) {
            break;
        }
        ray = ray_beyond(ray, &seen);
        before += hit.t;
    }
    hit.t += before;
#endif
    if (hit.prim == NONE) {
        albedo_depth[i] = (float4)(0.0f, 0.0f, 0.0f, INFINITY);
        normal[i] = (float4)(0.0f);
        position_object[i] = (float4)(0.0f, 0.0f, 0.0f, float_of(NONE));
        return;
    }
    Surface s = surface_of(g, ray, hit);
    const float3 wo = -normalize3(xyz(ray.direction));
    float end;
    const uint number = objects[s.object].material;
    global const Material *material = materials + blended(g, materials, number, &s, -wo, 0.5f, &end);
#if HAS_RELIEF
    s.n = relief_normal(g, material, &s);
#endif
    const float3 n = dot3(wo, s.ng) < 0.0f ? -s.n : s.n;
    const float3 albedo = albedo_at(g, materials, number, &s, -wo);
    albedo_depth[i] = make4(albedo, hit.t);
    normal[i] = make4(n, 0.0f);
    position_object[i] = make4(s.p, float_of(s.object));
}

// What lies under each pixel's centre: albedo and depth, normal, position and object. One ray a pixel, free of noise.
// Race rule: every item owns its pixel. On a miss the object is NONE and the depth infinite.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void aov(GEOMETRY_ARGUMENTS, global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS,
                global const Camera *camera, global const Settings *settings, const uint first_pixel,
                const uint pixels, global float4 *albedo_depth, global float4 *normal, global float4 *position_object)
{
    const uint i = (uint)get_global_id(0);
    if (i >= pixels) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    aov_pixel(&g, objects, materials, camera, settings, first_pixel, i, albedo_depth, normal, position_object);
}
