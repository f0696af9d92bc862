#pragma OPENCL FP_CONTRACT OFF
#include "accel/area.cl"
#include "accel/geometry.cl"
#include "accel/triangle.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"
#include "dispatch/shape.cl"
#include "accel/textured.cl"

// One primitive of an emissive object: radiance.xyz leaves its front; extra.x != 0: its back, too. extra.y = area;
// extra.z != 0: only camera and shadow rays can meet it. Triangles: direction.xyz = unit normal. Where textures are: bits
// of radiance.w = the slot of the radiance, or NONE.

#if HAS_TRIANGLES
static float3 emitter_corner(const Geometry g, const uint vertex)
{
    return xyz(g.vertices[vertex].p);
}
#endif

// Point of the primitive with normal, density seen from `from` [1/sr] and error bound.
static float3 emitter_point(global const Light *l, const Geometry g, const float3 from, const float2 u, float3 *ng,
                            float *pdf, float *error)
{
#if HAS_TRIANGLES
    if (l->prim < g.triangle_count) {
        const uint4 v = g.triangles[l->prim].v;
        *ng = xyz(l->direction);
        return triangle_sample(emitter_corner(g, v.x), emitter_corner(g, v.y), emitter_corner(g, v.z), *ng, l->extra.y,
                               from, u, pdf, error);
    }
#endif
#if HAS_ANALYTIC
    return shape_sample(g.shapes + (l->prim - g.triangle_count), from, u, ng, pdf, error);
#else
    *ng = (float3)(0.0f, 0.0f, 1.0f);
    *error = 0.0f;
    *pdf = 0.0f;
    return from;
#endif
}

#if HAS_TEXTURED
// What the texture makes of the radiance at the point p that `u` sampled.
static float3 emitter_texture(global const Light *l, const Geometry g, const float3 p, const float3 ng, const float2 u)
{
    const uint slot = bits_of(l->radiance.w);
    if (slot == NONE) {
        return (float3)(1.0f);
    }
    return slot_value(g, g.textures.slots + slot, texture_point(g, l->prim, square_to_triangle(u), p, ng));
}
#endif

// Radiance that leaves the point `s` of this light at an angle of cosine cos_o to its front.
static float3 emitter_seen(global const Light *l, const Geometry g, const Surface *s, const float cos_o)
{
    if (!(cos_o > 0.0f || (l->extra.x != 0.0f && cos_o < 0.0f))) {
        return (float3)(0.0f);
    }
    float3 out = xyz(l->radiance);
#if HAS_TEXTURED
    const uint slot = bits_of(l->radiance.w);
    if (slot != NONE) {
        out = out * slot_value(g, g.textures.slots + slot, texture_point(g, s->prim, s->uv, s->p, s->ng));
    }
#endif
    return out;
}

// The target is moved off the primitive by its error bound and by the rounding of t along the way to it, so that a
// shadow ray up to t = 1 ends before the primitive.
static LightSample emitter_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    float3 ng;
    float pdf, error;
    const float3 p = emitter_point(l, g, from, u, &ng, &pdf, &error);
    const float3 to = p - from;
    const float front = -dot3(ng, to);
    const int shines = front > 0.0f || (l->extra.x != 0.0f && front < 0.0f);
    LightSample out;
    const float lift = error + 4.0f * UNIT_ROUNDOFF * dot3(abs3(ng), abs3(to));
    out.to = to + ng * (front > 0.0f ? lift : -lift);
    out.radiance = xyz(l->radiance);
#if HAS_TEXTURED
    out.radiance = out.radiance * emitter_texture(l, g, p, ng, u);
#endif
    out.pdf = shines ? pdf : 0.0f;
#if HAS_VISIBILITY
    out.delta = l->extra.z != 0.0f;  // rays that scatter never meet it: no other technique competes
#else
    out.delta = 0u;
#endif
    out.infinite = 0u;
    return out;
}

// Density [1/sr] of sampling the point `seen` of this light from `from`, in direction wi.
static float emitter_pdf(global const Light *l, const Geometry g, const float3 from, const Surface seen,
                         const float3 wi)
{
#if HAS_TRIANGLES
    if (l->prim < g.triangle_count) {
        return density_by_area(from, seen.p, seen.ng, l->extra.y);
    }
#endif
#if HAS_ANALYTIC
    return shape_pdf(g.shapes + (l->prim - g.triangle_count), from, seen.p, seen.ng, wi);
#else
    return 0.0f;
#endif
}

#if HAS_PHOTON
// Uniform by area, which shapes are when seen from their own centre; then by the cosine. u.z also picks the side.
static LightEmission emitter_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    float3 ng;
    float pdf, error;
    float3 from = (float3)(0.0f);
#if HAS_ANALYTIC
    if (l->prim >= g.triangle_count) {
        from = xyz(g.shapes[l->prim - g.triangle_count].center);
    }
#endif
    const float3 p = emitter_point(l, g, from, u.xy, &ng, &pdf, &error);
    const int both = l->extra.x != 0.0f;
    const float twice = 2.0f * u.z;
    const float side = both && twice >= 1.0f ? -1.0f : 1.0f;
    const float2 within = (float2)(both ? (twice >= 1.0f ? twice - 1.0f : twice) : u.z, u.w);
    LightEmission out;
    out.origin = p + ng * (side * error);
    out.direction = to_world(frame_of(ng * side), cosine_hemisphere(within));
    out.power = xyz(l->radiance) * (3.14159265f * l->extra.y * (both ? 2.0f : 1.0f));
#if HAS_TEXTURED
    out.power = out.power * emitter_texture(l, g, p, ng, u.xy);
#endif
    out.prim = l->prim;
    out.normal = ng * side;
    out.error = error;
    return out;
}
#endif
