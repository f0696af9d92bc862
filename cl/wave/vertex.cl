#pragma OPENCL FP_CONTRACT OFF
// What happens at one vertex of a path: emission met, light sampled, next direction. Included by wave/shade.cl.
#include "base/portable.cl"
#include "base/special.cl"
#include "base/vector.cl"
#include "base/frame.cl"
#include "base/light_pair.cl"
#include "base/mis.cl"
#include "base/sampler.cl"
#include "accel/geometry.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
#include "accel/relief.cl"
#include "accel/textured.cl"
#include "accel/blended.cl"
#include "accel/tangent.cl"
#include "dispatch/material.cl"
#include "dispatch/light.cl"
#include "wave/path.cl"
#include "wave/caustic.cl"
#include "wave/roulette.cl"
#include "wave/walk.cl"

typedef struct {
    Surface surface;
    Frame frame;    // shading frame on the viewer's side; of materials that light passes, on the front side
    float3 wo;      // towards the viewer, in the shading frame
    float3 normal;  // geometric, on the viewer's side
#if HAS_RELIEF
    float3 level;      // shading normal without relief
    float roughening;  // of the relief's shadow
#endif
    float cos_o;    // of the viewer's direction to the geometric front side
#if HAS_COPIED
    Material material;  // its parameters at this point
#else
    global const Material *material;
#endif
#if HAS_MEASURED
    global const Material *tables;  // behind the records
#endif
    uint number;    // of the material, as the scene has it
    uint medium;    // absorbing material that the path came through: its number + 1; 0: none
#if HAS_NESTED
    uint front;     // of a ranked boundary: body on its front side, as `medium`; behind is its own
    int ranked;     // bodies are ranked, and the path is inside of one or at its boundary
#endif
    float4 state;   // throughput here; w = pdf of the direction that led here
} PathVertex;

static MATERIAL_SPACE const Material *material_of(const PathVertex *v)
{
#if HAS_COPIED
    return &v->material;
#else
    return v->material;
#endif
}

typedef struct {
    Ray ray;
    float3 light;  // what arrives if nothing is in the way, times the path's throughput
    int valid;
} ShadowRay;

typedef struct {
    Ray ray;
    float4 state;  // throughput; w = pdf of the direction
    uint medium;
    int delta;
    int valid;
#if HAS_NESTED
    int to_front;  // of the surface
#endif
#if HAS_CAUSTICS
    float per_cosine;  // density of its direction over the cosine
#endif
#if HAS_REGULARISED
    int scattered;     // by a lobe of many directions, whatever `delta` says of light sampling
#endif
} NextRay;

// Absorption (Beer 1852) over a distance in the medium of that number.
static float3 absorbed(global const Material *materials, const uint medium, const float distance)
{
#if HAS_ABSORPTION
    const float3 depth = medium ? xyz(materials[medium - 1u].absorption) * distance : (float3)(0.0f);
    return (float3)(exp_of(-depth.x), exp_of(-depth.y), exp_of(-depth.z));
#else
    return (float3)(1.0f);
#endif
}

// Medium of a ray that leaves: only surfaces of absorbing materials change it, by the side (wi_z > 0: front).
static uint medium_ahead(const PathVertex *v, const float wi_z)
{
#if HAS_NESTED
    if (v->material.flags >> MATERIAL_RANK_SHIFT) {
        return wi_z < 0.0f ? v->number + 1u : v->front;
    }
#endif
#if HAS_ABSORPTION
    return (material_of(v)->flags & MATERIAL_ABSORBS) ? (wi_z < 0.0f ? v->number + 1u : 0u) : v->medium;
#else
    return 0u;
#endif
}

static PathVertex vertex_of(const Geometry g, global const Object *objects, global const Material *materials,
                            global const Settings *settings, const Ray ray, const Hit hit, const uint4 path,
                            const float4 state)
{
    PathVertex v;
    v.medium = 0u;
    v.state = state;
#if HAS_ABSORPTION
    v.medium = (path.y >> PATH_MEDIUM_SHIFT) & MOST_MEDIA;
#if WALKS
    const uint absorbing = scattering_medium(materials, path.y) ? 0u : v.medium;  // else weighed by the flight here
#else
    const uint absorbing = v.medium;
#endif
    v.state = make4(xyz(state) * absorbed(materials, absorbing, hit.t * length3(xyz(ray.direction))), state.w);
#endif
    v.surface = surface_of(g, ray, hit);
    v.number = objects[v.surface.object].material;
#if HAS_BLEND
    const Sampler sampler = sampler_for(settings, path.z, path.w);
    float end, share = sample_2d(sampler, SET_BLEND(path.y & PATH_EDGES)).x;
    v.number = blended(g, materials, v.number, &v.surface, xyz(ray.direction), share, &end);
#endif
    global const Material *material = materials + RECORD_MET(v.number, path.y);
#if HAS_COPIED
    v.material = textured_material(g, material, &v.surface);
#else
    v.material = material;
#endif
#if HAS_MEASURED
    v.tables = materials;
#endif
    const float3 wo = -renormalize3(xyz(ray.direction));
    v.cos_o = dot3(wo, v.surface.ng);
    const int back = v.cos_o < 0.0f;
    v.normal = back ? -v.surface.ng : v.surface.ng;
#if HAS_RELIEF
    v.level = v.surface.n;
    v.surface.n = towards_viewer(relief_normal(g, material, &v.surface), v.level, wo);
    v.roughening = relief_roughening(v.surface.n, v.level);
#endif
    float3 n = v.surface.n;
#if HAS_TRANSMISSION
    const int turn = back && !(material->flags & MATERIAL_TRANSMITS);
#else
    const int turn = back;
#endif
    n = turn ? -n : n;
    // A shading normal turned away from the viewer has no meaning there: fall back to the geometric one.
    const int hidden = !(dot3(n, wo) * (turn || !back ? 1.0f : -1.0f) > 0.0f);
    n = hidden ? (turn ? v.normal : v.surface.ng) : n;
#if HAS_TANGENTS
    const int stretched = (material->flags & MATERIAL_STRETCHED) != 0u;
    v.frame = stretched ? frame_along(n, tangent_of(g, v.surface)) : frame_of(n);
#else
    v.frame = frame_of(n);
#endif
    v.wo = to_local(v.frame, wo);
    return v;
}

// Whether the surface shines.
static int is_light(global const Object *objects, const PathVertex *v)
{
#if HAS_EMITTER
    return objects[v->surface.object].light != NONE;
#else
    return 0;
#endif
}

// Whether the side that the viewer sees scatters nothing.
static int is_black(const PathVertex *v)
{
#if HAS_ONE_SIDED
    if (v->cos_o < 0.0f && (material_of(v)->flags & MATERIAL_ONE_SIDED)) {
        return 1;
    }
#endif
    return material_of(v)->kind == MATERIAL_EMISSIVE;
}

// Whether light straight from its source is left to shadow rays: where an object stops these but not rays that scatter,
// or the reverse, the two techniques would not see the same light, and no weights could join them.
static int shadows_alone(global const Settings *settings)
{
#if HAS_LOCAL
    return 1;
#elif HAS_VISIBILITY
    return settings->shadows_alone != 0u;
#else
    return 0;
#endif
}

// Whether light sampling could have found what was met by chance.
static int competes(global const Settings *settings, const uint path_edges)
{
    return !(path_edges & PATH_DELTA) && !shadows_alone(settings);
}

// Weight of light met by chance: full where no light sampling competes.
static float chance_weight(global const Settings *settings, const uint path_edges, const float pdf,
                           const float light_pdf)
{
    if (path_edges & PATH_DELTA) {
        return 1.0f;
    }
    return shadows_alone(settings) ? 0.0f : power_heuristic(pdf, light_pdf);
}

static float3 emission_seen(const Lights lights, const LightPlace from, global const Settings *settings,
                            const Geometry g, global const Object *objects, const PathVertex v, const Ray ray,
                            const Hit hit, const uint path_edges, const CausticEnd end)
{
#if HAS_EMITTER
    global const Object *object = objects + v.surface.object;
    if (object->light == NONE) {
        return (float3)(0.0f);
    }
    const uint index = object->light + (hit.prim - object->first);
    const float3 emitted = xyz(v.state) * emitter_seen(lights.table + index, g, &v.surface, v.cos_o);
    if (is_caustic(path_edges)) {
        return emitted * caustic_weight(lights.table + index, end, v.surface.p, v.cos_o,
                                        -renormalize3(xyz(ray.direction)));
    }
    if (!competes(settings, path_edges)) {  // no need to ask how likely a shadow ray would have been
        return emitted * chance_weight(settings, path_edges, v.state.w, 0.0f);
    }
    const float3 wi = renormalize3(xyz(ray.direction));
    const float pdf = pick_probability(lights, index, from) * light_pdf(lights.table + index, g, from.p, v.surface, wi);
    return emitted * chance_weight(settings, path_edges, v.state.w, pdf);
#else
    return (float3)(0.0f);
#endif
}

// What stands for a direction that is no number: a ray without a way, which carries NaN, so that it is counted and its
// sample left out (wave/fault.cl). Simply ending the path would be black.
static Ray no_way(void)
{
    Ray out;
    out.origin = (float4)(0.0f);
    out.direction = (float4)(float_of(0x7fc00000u));
    return out;
}

// Where the vertex asks for light: the side that it must come from, too, unless light passes the surface. Kept for the
// light that the path meets next, which asks how likely it was to be picked from here.
static LightPlace light_place_of(const PathVertex *v, const uint slot LEFT_NORMALS_ARGUMENT)
{
#if HAS_LIGHT_TREE
    const int both_sides = (material_of(v)->flags & MATERIAL_TRANSMITS) != 0u;
    left_normals[slot] = packed_normal(both_sides ? (float3)(0.0f) : v->frame.n);
#endif
    return LIGHT_PLACE_AT(v->surface.p, slot);
}

// Above 0 where wi, whose cosine in the shading frame is wi_z, is on the one side that both normals call lit.
static float side_of(const PathVertex *v, const float3 wi, const float wi_z)
{
    return dot3(wi, v->normal) * (v->wo.z < 0.0f ? -wi_z : wi_z);
}

// Ray that leaves the vertex along unit wi: without an end, or to the point `to` from it, which is exact in the ray:
// origin plus direction.
static Ray ray_from(const PathVertex *v, const float3 wi, const float3 to, const int infinite)
{
    const float3 origin = spawn_origin(&v->surface, wi);
    Ray out;
    out.origin = make4(origin, float_of(v->surface.prim));
    out.direction = infinite ? make4(wi, T_MAX_FREE) : make4(to - (origin - v->surface.p), 1.0f);
    return out;
}

// Shadow ray to one light, picked by power or by the tree.
static ShadowRay sample_direct(const Lights lights, global const Settings *settings, const Geometry g,
                               global const Material *materials, const PathVertex *v, const float4 u,
                               const uint slot LEFT_NORMALS_ARGUMENT)
{
    ShadowRay out;
    out.valid = 0;
#if HAS_LIGHTS
    if (lights.count == 0u) {
        return out;
    }
    float pick_pdf;
    const LightPlace place = light_place_of(v, slot LEFT_NORMALS);
    float2 within = u.xy;
    const uint index = light_of_pair(lights, pick_light(lights, place, u.zw, &pick_pdf), &within);
    const LightSample light = light_sample(lights.table + index, g, v->surface.p, within);
    const float3 wi = normalize3(light.to);
    const float3 wi_local = to_local(v->frame, wi);
    const float pdf = light.pdf * pick_pdf;
    const float same_side = side_of(v, wi, wi_local.z);
    if (!(pdf > 0.0f) || !(same_side > 0.0f)) {
        out.valid = pdf != pdf || (pdf > 0.0f && same_side != same_side);
        out.ray = no_way();
        out.light = (float3)(out.ray.direction.x);
        return out;
    }
#if HAS_NESTED
    if (v->ranked && medium_ahead(v, wi_local.z)) {
        return out;  // boundaries that are not there would stop it: light inside a body is left to chance
    }
#endif
    BsdfValue bsdf = material_value(material_of(v) TABLES(v->tables), v->wo, wi_local);
#if HAS_RELIEF
    bsdf.value = bsdf.value * relief_shadow(v->roughening, dot3(v->level, wi));
#endif
    const float weight = light.delta || shadows_alone(settings) ? 1.0f : power_heuristic(pdf, bsdf.pdf);
    out.light = xyz(v->state) * bsdf.value * light.radiance * (weight / pdf);
#if HAS_ABSORPTION
    const float distance = light.infinite ? 1.0e30f : sqrt_of(dot3(light.to, light.to));
    out.light = out.light * absorbed(materials, medium_ahead(v, wi_local.z), distance);
#endif
    out.ray = ray_from(v, wi, light.to, light.infinite);
    out.valid = out.light.x + out.light.y + out.light.z != 0.0f;  // NaN goes on: the film counts it
#endif
    return out;
}

// Next direction by the material, then Russian roulette on the throughput (survivors weigh more).
static NextRay sample_onward(global const Settings *settings, const PathVertex *v, const uint edge, const float4 u)
{
    NextRay out;
    out.valid = 0;
    const BsdfSample bsdf = material_sample(material_of(v) TABLES(v->tables), v->wo, u);
    const float3 wi = to_world(v->frame, bsdf.wi);
    const float side = dot3(wi, v->normal);
#if HAS_REGULARISED
    out.scattered = (bsdf.flags & BSDF_DELTA) == 0u;
#endif
    if (!(bsdf.pdf > 0.0f) || side != side) {
        out.valid = bsdf.pdf != bsdf.pdf || (bsdf.pdf > 0.0f && side != side);
        out.ray = no_way();
        out.state = out.ray.direction;
        out.medium = 0u;
        out.delta = 0;
        return out;
    }
    const int passes = (bsdf.flags & BSDF_TRANSMIT) ? side < 0.0f : side > 0.0f;
    out.medium = medium_ahead(v, bsdf.wi.z);
    out.delta = (bsdf.flags & BSDF_DELTA) != 0u;
#if HAS_LOCAL
    const int wanted = passes && out.delta && edge <= settings->reflection_depth;
#else
    const int wanted = passes;
#endif
    if (!wanted) {
        return out;
    }
#if HAS_NESTED
    out.to_front = bsdf.wi.z > 0.0f;
    out.delta = out.delta || (v->ranked && out.medium);  // shadow rays do not look inside bodies
#endif
#if HAS_RELIEF
    const float passing = (bsdf.flags & BSDF_TRANSMIT) ? 1.0f : relief_shadow(v->roughening, dot3(v->level, wi));
    float3 onward = xyz(v->state) * bsdf.weight * passing;
#else
    float3 onward = xyz(v->state) * bsdf.weight;
#endif
    const float strongest = largest3(onward);
#if !HAS_LOCAL
    if (gambles(settings, edge) && !survives(strongest, u.w, &onward)) {
        return out;
    }
#endif
    out.state = make4(onward, bsdf.pdf);
#if HAS_CAUSTICS
    out.per_cosine = per_cosine(bsdf.pdf, bsdf.wi.z);
#endif
    out.ray = ray_from(v, wi, wi, 1);
    out.valid = strongest > 0.0f || strongest != strongest;
    return out;
}
