#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/triangle.cl"
// From the id of a triangle in an instance to the instance, and its surface in the world.

#if HAS_INSTANCES
static int is_instanced(const Geometry g, const uint prim) { return prim >= g.triangle_count + g.shape_count; }

// The instance (a shape) that owns the id, and the triangle of its mesh. A mesh's instances stand together.
static uint instance_of(const Geometry g, const uint prim, uint *triangle)
{
    uint first = 0u;
    uint last = g.mesh_count - 1u;
    while (first < last) {
        const uint middle = (first + last + 1u) / 2u;
        if (g.meshes[middle].first_id <= prim) {
            first = middle;
        } else {
            last = middle - 1u;
        }
    }
    global const Mesh *mesh = g.meshes + first;
    const uint place = prim - mesh->first_id;
    const uint instance = place / mesh->triangle_count;
    *triangle = place - instance * mesh->triangle_count;
    return mesh->first_instance + instance;
}

// Where a triangle's corners stand in g.triangles: instances read those of their mesh.
static uint stored_instance_triangle(const Geometry g, const uint prim)
{
    uint triangle;
    global const Shape *s = g.shapes + instance_of(g, prim, &triangle);
    return g.meshes[s->mesh].first_triangle + triangle;
}

// A normal of the mesh in the world, by the inverse transpose, which keeps fronts in front even where it mirrors; its
// length is how much a step along it in the world is in the mesh's space.
static float3 outward_normal(global const Shape *s, const float3 n)
{
    return n.x * xyz(s->inverse_u) + n.y * xyz(s->inverse_v) + n.z * xyz(s->inverse_w);
}

#if HAS_SMOOTH
static float3 outward_vertex_normal(const Geometry g, global const Shape *s, const uint vertex)
{
    return normalize3(outward_normal(s, xyz(g.normals[vertex].n)));
}
#endif

// Bound on how far the world's point p may lie from the surface along ng, and on how far what leaves it may come out
// short once it is moved into the mesh again: `error` within the mesh and one rounding of the moved origin, both there;
// in the world the roundings of p, of its product with the matrix and of the matrix itself, and of the origin.
static float instance_error(global const Shape *s, const Surface *inner, const float3 n, const float3 p, const float3 ng)
{
    const float3 at = abs3(inner->p);
    const float3 size = at.x * abs3(xyz(s->u)) + at.y * abs3(xyz(s->v)) + at.z * abs3(xyz(s->w));
    const float within = inner->error + 2.0f * UNIT_ROUNDOFF * dot3(abs3(inner->ng), at);
    const float world = UNIT_ROUNDOFF * dot3(abs3(ng), 3.0f * abs3(p) + 6.0f * size);
    return within / length3(n) * 1.00001f + world;
}

static Surface surface_of_instance(const Geometry g, const Hit hit)
{
    Surface inner;
    uint triangle;
    global const Shape *s = g.shapes + instance_of(g, hit.prim, &triangle);
    const uint4 corners = g.triangles[g.meshes[s->mesh].first_triangle + triangle].v;
    triangle_surface(xyz(g.vertices[corners.x].p), xyz(g.vertices[corners.y].p), xyz(g.vertices[corners.z].p),
                     (float2)(hit.u, hit.v), &inner);
    const float3 n = outward_normal(s, inner.ng);
    Surface out;
    out.p = xyz(s->center) + (inner.p.x * xyz(s->u) + inner.p.y * xyz(s->v) + inner.p.z * xyz(s->w));
    out.ng = normalize3(n);
    out.n = out.ng;
    out.uv = inner.uv;
    out.error = instance_error(s, &inner, n, out.p, out.ng);
    out.object = OBJECT_OF(s->object);
    out.prim = hit.prim;
#if HAS_SMOOTH
    const float3 mixed = (1.0f - hit.u - hit.v) * outward_vertex_normal(g, s, corners.x) +
                         hit.u * outward_vertex_normal(g, s, corners.y) +
                         hit.v * outward_vertex_normal(g, s, corners.z);
    const float3 unit = normalize3(mixed);
    out.n = dot3(unit, unit) > 0.5f ? unit : out.ng;  // zero rows ask for the flat normal
#endif
    return out;
}
#endif
