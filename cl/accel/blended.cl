#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/textured.cl"
// Which part of a blend a number from 0 to 1 stands for. Parts may be blends; the host sees that none holds itself.

// The material of that number, and where numbers of the same part end. Seen from behind by a ray in
// direction `way`, blends by sides are their second part.
static uint blended(const Geometry g, global const Material *materials, const uint number, const Surface *s,
                    const float3 way, const float u, float *end)
{
    uint part = number;
    *end = 1.0f;
#if HAS_BLEND
    float begin = 0.0f;
    while (materials[part].kind == MATERIAL_BLEND) {
        global const Material *m = materials + part;
#if HAS_TEXTURED
        const float share = textured_material(g, m, s).p0.s0;
#else
        const float share = m->p0.s0;
#endif
        const float weight = m->p0.s3 != 0.0f ? (dot3(way, s->ng) > 0.0f ? 1.0f : 0.0f) : share;
        const float split = *end - (*end - begin) * weight;
        const int second = u >= split;
        part = (uint)(second ? m->p0.s2 : m->p0.s1);
        begin = second ? split : begin;
        *end = second ? *end : split;
    }
#endif
    return part;
}
