#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/textures.cl"

// A picture over the unit square of (u, v): its first row lies at v = 1.
static float3 bitmap_value(global const Texture *t, const Geometry g, const TexturePoint at)
{
    const float2 place = texture_place(t, at.uv);
    if (t->nearest) {
        const uint x = texel_nearest(place.x, t->width, t->wrap);
        return texel_at(g.textures, t, x, t->height - 1u - texel_nearest(place.y, t->height, t->wrap));
    }
    const TexelPair up = texel_pair(place.y, t->height, t->wrap);
    TexelPair y = up;
    y.low = t->height - 1u - up.low;
    y.high = t->height - 1u - up.high;
    return texels_between(g.textures, t, texel_pair(place.x, t->width, t->wrap), y);
}
