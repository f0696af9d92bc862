#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/textures.cl"
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
#if HAS_COMPACT
#define STACK_SIZE (MAX_DEPTH + 2)  // one entry holds all the children of a node that are left
typedef CompactNode TreeNode;
typedef CompactTriangle TreeLeaf;
#else
#define STACK_SIZE (7 * MAX_DEPTH + 2)
typedef Node TreeNode;
typedef Block TreeLeaf;
#endif

#define STACK_END 0xffffffffu  // child word of the entry below all others; no leaf has it

#define UNIT_ROUNDOFF 5.9604645e-8f  // 2^-24

// Stack entries are entry distance << 32 | child; distances are not negative, so they order as their bits do.
static ulong stack_entry(const float enter, const uint child) { return ((ulong)bits_of(enter) << 32) | child; }

#if HAS_COUNTERS
// What one ray, or a group of rays, touched. The bitmaps may be null.
typedef struct {
    uint nodes;
    uint leaves;
    global uint *node_bits;
    global uint *leaf_bits;
} Visits;
#define NO_VISITS {0u, 0u, 0, 0}  // of a ray whose visits are counted, not told apart
#endif

// Kernels fill it in this order.
typedef struct {
    global const TreeNode *nodes;
    global const TreeLeaf *blocks;
    global const Triangle *triangles;
    global const Vertex *vertices;
    global const Normal *normals;
    global const Shape *shapes;
    uint block_count;
    uint triangle_count;
    uint shape_count;
    uint plane_count;
#if HAS_INSTANCES
    global const Mesh *meshes;  // nodes and blocks of their trees come before the world's
    uint mesh_count;
    uint instance_first;        // shapes from here on are instances
    uint root;                  // node
    uint first_block;           // of the world's block_count
#endif
#if HAS_VISIBILITY
    uint ray_kind;  // HIDDEN_FROM_*: what the rays are traced for
#endif
#if HAS_TEXTURES
    Textures textures;  // only of kernels that shade
#endif
#if HAS_COUNTERS
    Visits *visits;
#endif
} Geometry;

#if HAS_INSTANCES
#define INSTANCE_ARGUMENTS                                                                                            \
    , global const Mesh *meshes, const uint mesh_count, const uint instance_first, const uint root,                   \
        const uint first_block
#define OF_INSTANCE_ARGUMENTS , meshes, mesh_count, instance_first, root, first_block
#else
#define INSTANCE_ARGUMENTS
#define OF_INSTANCE_ARGUMENTS
#endif

#if HAS_VISIBILITY
#define KIND_ARGUMENT , const uint ray_kind
#define OF_KIND_ARGUMENT , ray_kind
#define OBJECT_OF(word) ((word) & OBJECT_MASK)
#else
#define KIND_ARGUMENT
#define OF_KIND_ARGUMENT
#define OBJECT_OF(word) (word)
#endif

// Parameters, in this order, of every kernel that knows the geometry; such a kernel starts with
// `const Geometry g = GEOMETRY_OF_ARGUMENTS;`
#define GEOMETRY_ARGUMENTS                                                                                            \
    global const TreeNode *nodes, global const TreeLeaf *blocks, global const Triangle *triangles,                    \
        global const Vertex *vertices, global const Normal *normals, global const Shape *shapes,                      \
        const uint block_count, const uint triangle_count, const uint shape_count, const uint plane_count             \
        INSTANCE_ARGUMENTS KIND_ARGUMENT

#define GEOMETRY_MEMBERS                                                                                              \
    nodes, blocks, triangles, vertices, normals, shapes, block_count, triangle_count, shape_count,                    \
        plane_count OF_INSTANCE_ARGUMENTS OF_KIND_ARGUMENT
#define GEOMETRY_OF_ARGUMENTS {GEOMETRY_MEMBERS}
#if HAS_TEXTURES
#define GEOMETRY_AND_TEXTURES                                                                                         \
    {GEOMETRY_MEMBERS, {texture_table, texture_slots, texels, uvs, colors, face_colors}}
#else
#define GEOMETRY_AND_TEXTURES GEOMETRY_OF_ARGUMENTS
#endif

// Where the world begins in the arrays of nodes and blocks.
static uint world_root(const Geometry g)
{
#if HAS_INSTANCES
    return g.root;
#else
    return 0u;
#endif
}

static uint world_block(const Geometry g)
{
#if HAS_INSTANCES
    return g.first_block;
#else
    return 0u;
#endif
}

// One past the last shape that is no instance.
static uint shape_end(const Geometry g)
{
#if HAS_INSTANCES
    return g.instance_first;
#else
    return g.shape_count;
#endif
}

// Whether the object of a triangle or shape, with its HIDDEN_FROM_* bits, is not there for these rays.
static int is_hidden(const Geometry g, const uint object)
{
#if HAS_VISIBILITY
    return (object & g.ray_kind) != 0u;
#else
    return 0;
#endif
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
