#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/textures.cl"

// Colours of a mesh: of its triangles, or of its vertices and mixed between them.
static float3 mesh_attribute_value(global const Texture *t, const Geometry g, const TexturePoint at)
{
    if (at.triangle == NONE) {
        return (float3)(0.0f);
    }
    global const float4 *colors = g.textures.colors;
    if (t->nearest) {
        return xyz(colors[g.textures.face_colors + at.triangle]);
    }
    const uint4 corner = g.triangles[at.triangle].v;
    const float3 first = xyz(colors[corner.x]);
    return first + at.barycentric.x * (xyz(colors[corner.y]) - first) +
           at.barycentric.y * (xyz(colors[corner.z]) - first);
}
