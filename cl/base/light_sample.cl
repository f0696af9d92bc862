#pragma OPENCL FP_CONTRACT OFF

// All lights, and what one of them is picked by: the tree where there is one.
typedef struct {
    global const Light *table;
    uint count;
#if HAS_LIGHT_TREE
    global const LightNode *nodes;
#endif
} Lights;

#if HAS_LIGHT_TREE
#define LEFT_NORMALS_ARGUMENT , global uint *left_normals
#define LIGHT_TREE_ARGUMENTS , global const LightNode *light_nodes LEFT_NORMALS_ARGUMENT
#define LEFT_NORMALS , left_normals
#define LIGHT_PLACE_AT(p, slot) light_place(p, left_normals[slot])
#else
#define LEFT_NORMALS_ARGUMENT
#define LIGHT_TREE_ARGUMENTS
#define LEFT_NORMALS
#define LIGHT_PLACE_AT(p, slot) light_place(p, 0u)
#endif
#define LIGHT_PLACE_BEFORE(ray, slot) LIGHT_PLACE_AT(xyz((ray).origin), slot)

// Where light is wanted: the point, and the normal of its surface where only that side can receive.
typedef struct {
    float3 p;
#if HAS_LIGHT_TREE
    float3 n;
    int has_n;
#endif
} LightPlace;

#if HAS_LIGHT_TREE
#define LIGHTS_OF_ARGUMENTS(table, count) lights_of(table, count, light_nodes)
static Lights lights_of(global const Light *table, const uint count, global const LightNode *nodes)
{
    Lights out;
    out.table = table;
    out.count = count;
    out.nodes = nodes;
    return out;
}
#else
#define LIGHTS_OF_ARGUMENTS(table, count) lights_of(table, count)
static Lights lights_of(global const Light *table, const uint count)
{
    Lights out;
    out.table = table;
    out.count = count;
    return out;
}
#endif

// A light seen from one point.
typedef struct {
    float3 to;        // lights at a distance: their point minus `from` [m]; else unit direction towards the light
    float3 radiance;  // what arrives without obstacles, distance included; emitters: radiance leaving towards `from`
    float pdf;        // per steradian; 1 for single directions, 0: nothing sampled
    uint delta;       // a single direction, which no material sample can hit
    uint infinite;    // no end: shadow rays run to infinity
} LightSample;

static LightSample no_light_sample(void)
{
    LightSample out;
    out.to = (float3)(0.0f, 0.0f, 1.0f);
    out.radiance = (float3)(0.0f);
    out.pdf = 0.0f;
    out.delta = 1u;
    out.infinite = 0u;
    return out;
}
