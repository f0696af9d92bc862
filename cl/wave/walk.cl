#pragma OPENCL FP_CONTRACT OFF
// Walks through bodies that scatter inside: free flights between surfaces. Included by wave/vertex.cl.
#include "base/math.cl"
#include "base/portable.cl"
#include "base/sampler.cl"
#include "base/special.cl"
#include "base/vector.cl"
#include "base/frame.cl"
#include "wave/path.cl"
#include "wave/roulette.cl"

// Set of sample dimensions of each scattering between two surfaces; beyond all others.
#define SET_WALK(edge, scattered) (0x40000000u + ((edge) << 12) + (scattered))
#define MOST_SCATTERINGS 4095u  // between two surfaces

#if HAS_SUBSURFACE
// What happened on the way to the next surface.
typedef struct {
    float4 state;  // as in PathVertex; after a scattering w = -(scatterings since the last surface)
    Ray ray;       // after a scattering: the next ray
    int scattered;
    int ended;     // by Russian roulette or MOST_SCATTERINGS
} Flight;

// Scattering medium of a path: its number + 1; 0: none, or one that only absorbs.
static uint scattering_medium(global const Material *materials, const uint path_edges)
{
    const uint medium = (path_edges >> PATH_MEDIUM_SHIFT) & MOST_MEDIA;
    return medium && (materials[medium - 1u].flags & MATERIAL_SCATTERS) ? medium : 0u;
}

static float3 transmitted(const float3 extinction, const float distance)
{
    const float3 depth = extinction * distance;
    return (float3)(exp_of(-depth.x), exp_of(-depth.y), exp_of(-depth.z));
}

// Cosine between the directions before and after a scattering (Henyey and Greenstein 1941); a form that stays exact
// from g = 0 to 1, u in [0, 1).
static float phase_cosine(const float g, const float u)
{
    const float s = 2.0f * u - 1.0f;
    const float below = 1.0f + g * s;
    const float above = s + 0.5f * g * (s * s + 3.0f) + g * g * s + 0.5f * g * g * g * (s - 1.0f) * (s + 1.0f);
    return clamp_of(above / (below * below), -1.0f, 1.0f);
}

static float3 phase_direction(const float g, const float3 way, const float2 u)
{
    const float cosine = phase_cosine(g, u.x);
    const float sine = sqrt_of(max_of((1.0f - cosine) * (1.0f + cosine), 0.0f));
    float s, c;
    sin_cos_turns(u.y, &s, &c);
    return renormalize3(to_world(frame_of(way), (float3)(sine * c, sine * s, cosine)));
}

// A flight along `ray` to a surface at `distance`. The channel that decides how far is picked by what the path carries;
// each weighs by the density of all (balance heuristic), so that the sum of the channels never grows.
static Flight flight_of(global const Material *m, global const Settings *settings, const Ray ray, const float distance,
                        const uint4 path, const float4 state)
{
    Flight out;
    const uint edge = path.y & PATH_EDGES;
    const uint before = state.w < 0.0f ? (uint)(-state.w) : 0u;
    const float4 u = sample_4d(sampler_for(settings, path.z, path.w), SET_WALK(edge, before));
    const float3 carried = xyz(state);
    const float3 extinction = xyz(m->absorption);
    const float3 share = carried * (1.0f / max_of(carried.x + carried.y + carried.z, 1.0e-37f));
    const int first = u.y < share.x;
    const int second = !first && u.y < share.x + share.y;
    const float chosen = first ? extinction.x : (second ? extinction.y : extinction.z);
    const float length = -log_of(1.0f - u.x) / max_of(chosen, 1.0e-20f);
    out.scattered = length < distance;
    // Off the surface by more than its place is rounded.
    const float flown = out.scattered ? min_of(length, 0.9999f * distance) : distance;
    const float3 left = transmitted(extinction, out.scattered ? length : distance);
    const float3 density = out.scattered ? extinction * left : left;
    const float3 gained = out.scattered ? xyz(m->p7) * density : density;
    const float all = dot3(share, density);
    float3 onward = carried * gained * (1.0f / max_of(all, 1.0e-37f));
    const float strongest = largest3(onward);
    out.ended = out.scattered && (before >= MOST_SCATTERINGS || !(strongest > 0.0f));
    out.state = make4(onward, state.w);
    out.ray = ray;
    if (!out.scattered || out.ended) {
        return out;
    }
    if (settings->roulette_start != 0u) {
        // What is left of the number that picked the channel decides. Weak walks only: the rest end by leaving.
        const float low = first ? 0.0f : (second ? share.x : share.x + share.y);
        const float width = first ? share.x : (second ? share.y : share.z);
        const float rest = (u.y - low) / max_of(width, 1.0e-7f);
        out.ended = !survives(4.0f * strongest, rest, &onward);
    }
    const float3 way = renormalize3(xyz(ray.direction));
    out.state = make4(onward, -(float)(before + 1u));
    out.ray.origin = make4(xyz(ray.origin) + way * flown, float_of(NONE));
    out.ray.direction = make4(phase_direction(m->p7.w, way, u.zw), T_MAX_FREE);
    return out;
}
#endif
