#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
// What can be hit: the tree, its leaf blocks, and the arrays behind primitive ids. Triangle i has id i, shape j has
// id triangle_count + j. Infinite planes are the first plane_count shapes and are not in the tree.

#define NO_HIT -1.0f

// Child words of a node
#define CHILD_LEAF 0x80000000u
#define CHILD_ANALYTIC 0x40000000u
#define CHILD_SHAPE_MASK 0x07ffffffu
#define CHILD_BLOCK_MASK 0x3fffffffu  // of leaves that are triangle blocks: block << 3 | count - 1

// Inner nodes from root to leaf at most; builders keep to it. Each visit leaves at most 7 children for later, so the
// stack can never overflow.
#define MAX_DEPTH 40
#define STACK_SIZE (7 * MAX_DEPTH + 2)

#define UNIT_ROUNDOFF 5.9604645e-8f  // 2^-24

#if HAS_COUNTERS
// What one ray, or a group of rays, touched. The bitmaps may be null.
typedef struct {
    uint nodes;
    uint leaves;
    global uint *node_bits;
    global uint *leaf_bits;
} Visits;
#endif

typedef struct {
    global const Node *nodes;
    global const Block *blocks;
    global const Triangle *triangles;
    global const Vertex *vertices;
    global const Normal *normals;
    global const Shape *shapes;
    uint block_count;
    uint triangle_count;
    uint shape_count;
    uint plane_count;
#if HAS_COUNTERS
    Visits *visits;
#endif
} Geometry;

// Parameters, in this order, of every kernel that knows the geometry; such a kernel starts with
// `const Geometry g = GEOMETRY_OF_ARGUMENTS;`
#define GEOMETRY_ARGUMENTS                                                                                            \
    global const Node *nodes, global const Block *blocks, global const Triangle *triangles,                           \
        global const Vertex *vertices, global const Normal *normals, global const Shape *shapes,                      \
        const uint block_count, const uint triangle_count, const uint shape_count, const uint plane_count

#define GEOMETRY_OF_ARGUMENTS                                                                                         \
    geometry_of(nodes, blocks, triangles, vertices, normals, shapes, block_count, triangle_count, shape_count,        \
                plane_count)

static Geometry geometry_of(GEOMETRY_ARGUMENTS)
{
    Geometry g;
    g.nodes = nodes;
    g.blocks = blocks;
    g.triangles = triangles;
    g.vertices = vertices;
    g.normals = normals;
    g.shapes = shapes;
    g.block_count = block_count;
    g.triangle_count = triangle_count;
    g.shape_count = shape_count;
    g.plane_count = plane_count;
#if HAS_COUNTERS
    g.visits = 0;
#endif
    return g;
}

// A point on a surface.
typedef struct {
    float3 p;
    float3 ng;    // unit geometric normal, front side
    float3 n;     // unit shading normal
    float2 uv;    // triangles: barycentric; shapes: local
    float error;  // the true surface is within this distance of p along ng
    uint object;
    uint prim;
} Surface;

#if HAS_COUNTERS
// Counts a visit of a node, or of a leaf, and marks it in the bitmap that its group of rays shares.
static void count_visit(Visits *visits, const uint index, const int leaf)
{
    if (!visits) {
        return;
    }
    global uint *bits = leaf ? visits->leaf_bits : visits->node_bits;
    visits->nodes += leaf ? 0u : 1u;
    visits->leaves += leaf ? 1u : 0u;
    if (bits) {
        bits[index >> 5] |= 1u << (index & 31u);
    }
}
#endif
