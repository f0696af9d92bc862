#pragma OPENCL FP_CONTRACT OFF
#include "base/sampler.cl"
#include "base/wide_sampler.cl"
#include "wave/path.cl"
// Which dimensions of which sets a vertex takes. Included by wave/shade.cl.
//
// What varies together shares a set, whose four dimensions are a net together at powers of four samples: the place on
// the film with the point of a light that the first vertex asks (unless a lens takes that half), and the directions
// after an odd edge and after the even one that follows it, which are most of what varies in light that comes by way of
// surfaces. Points of lights beyond the first vertex need no company: the vertex itself is elsewhere in every sample.
//
//   set            dimensions 0, 1                     dimensions 2, 3
//   SET_CAMERA     place on the film                   lens; without one: point of a light after edge 1
//   SET_LIGHT(e)   point of a light                    which light
//   SET_BSDF(e)    e odd: direction after e            direction after e + 1
//                  e even: lobe, roulette after e - 1  lobe, roulette after e

#define POINT_BESIDE_FILM(edge) ((edge) == 1u && !HAS_LENS)
#define SET_POINT(edge) (POINT_BESIDE_FILM(edge) ? SET_CAMERA : SET_LIGHT(edge))
#define SET_DIRECTION(edge) SET_BSDF((edge) - 1u + ((edge) & 1u))
#define SET_LOBE(edge) SET_BSDF((edge) + ((edge) & 1u))

// After `edge`: s01 point of a light, s23 which light, s45 direction, s6 lobe, s7 roulette.
static float8 vertex_numbers(const Sampler s, const uint edge)
{
    const uint4 sets = (uint4)(SET_POINT(edge), SET_LIGHT(edge), SET_DIRECTION(edge), SET_LOBE(edge));
    const int even = (edge & 1u) ? 0 : -1;
    return sample_halves(s, sets, (int4)(POINT_BESIDE_FILM(edge) ? -1 : 0, -1, even, even));
}

// The same without lights.
static float4 onward_numbers(const Sampler s, const uint edge)
{
    const int even = (edge & 1u) ? 0 : -1;
    return (float4)(sample_half(s, SET_DIRECTION(edge), even), sample_half(s, SET_LOBE(edge), even));
}

#if DEVICE_CPU
// Points of lights (x, y), and which lights (z, w): lanes of vertex_numbers.
static Rows8 light_numbers8(const Sampler8 s, const uint8 edge)
{
    Rows8 out = sample_4d_of8(s, SET_LIGHT(edge));
#if !HAS_LENS
    const int8 first = edge == 1u;
    if (movemask8(first) != 0u) {
        const Half8 beside = sample_half_of8(s, (uint8)(SET_CAMERA), (int8)(-1));
        out.x = first ? beside.x : out.x;
        out.y = first ? beside.y : out.y;
    }
#endif
    return out;
}

// Directions (x, y); lobes and roulette (z, w) only where they are `wanted`.
static Rows8 onward_numbers8(const Sampler8 s, const uint8 edge, const int wanted)
{
    const uint8 odd = edge & 1u;
    const int8 even = odd == 0u;
    const Half8 direction = sample_half_of8(s, SET_BSDF(edge - 1u + odd), even);
    const Half8 lobe = wanted ? sample_half_of8(s, SET_BSDF(edge + odd), even) : direction;
    Rows8 out;
    out.x = direction.x;
    out.y = direction.y;
    out.z = lobe.x;
    out.w = lobe.y;
    return out;
}
#endif
