#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "dispatch/texture.cl"
// Textures that lights cast: direction.xyz = axis, (extra.xy, direction.w) = the way up, as long as the cotangent of half
// the angle that the unit square fills upwards; prim = texture.

#if HAS_TEXTURED
// Texture coordinates in the direction `away` from the light, which must not be across or against the axis. The unit
// square is `aspect` times as wide as high; seen from the light, u runs to the right and v upwards.
static float2 cast_place(global const Light *l, const float3 away, const float aspect)
{
    const float3 axis = xyz(l->direction);
    const float3 up = (float3)(l->extra.x, l->extra.y, l->direction.w);
    const float ahead = dot3(axis, away);
    return (float2)(0.5f + 0.5f * dot3(cross3(axis, up), away) / (ahead * aspect), 0.5f + 0.5f * dot3(up, away) / ahead);
}

// What the texture gives there; light cannot be negative.
static float3 cast_color(global const Light *l, const Geometry g, const float2 uv)
{
    TexturePoint at;
    at.uv = uv;
    at.barycentric = (float2)(0.0f);
    at.triangle = NONE;
    const float3 value = texture_value(g.textures.table + l->prim, g, at);
    return (float3)(max_of(value.x, 0.0f), max_of(value.y, 0.0f), max_of(value.z, 0.0f));
}
#endif
