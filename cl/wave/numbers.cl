#pragma OPENCL FP_CONTRACT OFF
#include "base/sampler.cl"
#include "base/wide_sampler.cl"
#include "wave/path.cl"
// Which dimensions of which sets a vertex takes. Included by wave/shade.cl.
//
// What varies together shares a set, whose four dimensions are a net together at powers of four samples. JOINS_FILM: the
// place on the film and the point of a light that the first vertex asks, unless a lens takes that half.
// JOINS_DIRECTIONS: the directions after an odd edge and after the even one that follows it, which are most of what
// varies in light that comes by way of surfaces, unless materials choose between lobes that differ in direction: there
// lobe and direction vary together more. Points of lights beyond the first vertex need no company: the vertex itself is
// elsewhere in every sample.
//
//   set            dimensions 0, 1                     dimensions 2, 3
//   SET_CAMERA     place on the film                   lens, or by JOINS_FILM: point of a light after edge 1
//   SET_LIGHT(e)   point of a light                    which light
//   SET_BSDF(e)    direction after e                   lobe, roulette after e
//   by JOINS_DIRECTIONS:
//     e odd        direction after e                   direction after e + 1
//     e even       lobe, roulette after e - 1          lobe, roulette after e

// The sets and halves (0 low, -1 high) of a vertex after `edge`: point of a light, which light, direction, lobe.
typedef struct {
    uint4 set;
    int4 high;
} Taken;

static Taken taken_after(const uint joins, const uint edge)
{
    const int film = edge == 1u && (joins & JOINS_FILM) != 0u;
    const int joined = (joins & JOINS_DIRECTIONS) != 0u;
    const uint odd = edge & 1u;
    const int high = joined && odd == 0u ? -1 : 0;
    Taken out;
    out.set = (uint4)(film ? SET_CAMERA : SET_LIGHT(edge), SET_LIGHT(edge),
                      SET_BSDF(joined ? edge - 1u + odd : edge), SET_BSDF(joined ? edge + odd : edge));
    out.high = (int4)(film ? -1 : 0, -1, high, joined ? high : -1);
    return out;
}

// s01 point of a light, s23 which light, s45 direction, s6 lobe, s7 roulette.
static float8 vertex_numbers(const Sampler s, const uint joins, const uint edge)
{
    const Taken taken = taken_after(joins, edge);
    return sample_halves(s, taken.set, taken.high);
}

// The same without lights.
static float4 onward_numbers(const Sampler s, const uint joins, const uint edge)
{
    const Taken taken = taken_after(joins, edge);
    return (float4)(sample_half(s, taken.set.z, taken.high.z), sample_half(s, taken.set.w, taken.high.w));
}

#if DEVICE_CPU
// Points of lights (x, y); which lights (z, w) only where there is a choice.
static Rows8 light_numbers8(const Sampler8 s, const uint joins, const uint8 edge, const int choice)
{
    const int8 film = (joins & JOINS_FILM) != 0u ? edge == 1u : (int8)(0);
    const Half8 within = sample_half_of8(s, film ? (uint8)(SET_CAMERA) : SET_LIGHT(edge), film);
    const Half8 which = choice ? sample_half_of8(s, SET_LIGHT(edge), (int8)(-1)) : within;
    return rows_of_halves(within, which);
}

// Directions (x, y); lobes and roulette (z, w) only where they are `wanted`.
static Rows8 onward_numbers8(const Sampler8 s, const uint joins, const uint8 edge, const int wanted)
{
    const int joined = (joins & JOINS_DIRECTIONS) != 0u;
    const uint8 odd = edge & 1u;
    const int8 high = joined ? odd == 0u : (int8)(0);
    const Half8 direction = sample_half_of8(s, SET_BSDF(joined ? edge - 1u + odd : edge), high);
    if (!wanted) {
        return rows_of_halves(direction, direction);
    }
    return rows_of_halves(direction,
                          sample_half_of8(s, SET_BSDF(joined ? edge + odd : edge), joined ? high : (int8)(-1)));
}
#endif
