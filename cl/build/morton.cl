#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"

// Every third bit from bit 0 on: the low 21 bits of x spread over 63.
static ulong spread_bits(const uint x)
{
    ulong v = x & 0x1fffffu;
    v = (v | v << 32) & 0x1f00000000ffffUL;
    v = (v | v << 16) & 0x1f0000ff0000ffUL;
    v = (v | v << 8) & 0x100f00f00f00f00fUL;
    v = (v | v << 4) & 0x10c30c30c30c30c3UL;
    return (v | v << 2) & 0x1249249249249249UL;
}

static uint cell_of(const float center, const float low, const float scale)
{
    const uint cell = (uint)((center - low) * scale);
    return cell < 0x1fffffu ? cell : 0x1fffffu;
}

// 63-bit Morton codes of doubled centres in a grid of cubes of edge 1/scale that starts at (low_x, low_y, low_z).
kernel void morton_codes(const uint count, const float low_x, const float low_y, const float low_z, const float scale,
                         global const float8 *primitives, global ulong *codes, global uint *order)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const float4 center = doubled_center(primitives[i]);
    order[i] = i;
    codes[i] = spread_bits(cell_of(center.x, low_x, scale)) << 2 | spread_bits(cell_of(center.y, low_y, scale)) << 1
               | spread_bits(cell_of(center.z, low_z, scale));
}

// Primitives in the order of sorted codes, and for the gap after each one how many leading bits its neighbours share:
// of the codes, or where those are equal, 64 + those of the places. long_run is raised where more primitives than a
// leaf holds have one code; it starts as 0, and all who raise it write the same.
kernel void morton_order(const uint count, global const uint *order, global const ulong *codes,
                         global const float8 *primitives, global float8 *sorted, global ushort *levels,
                         volatile global uint *long_run)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    sorted[i] = primitives[order[i]];
    if (i + 1u < count) {
        const ulong differing = codes[i] ^ codes[i + 1u];
        levels[i] = (ushort)(differing != 0 ? clz(differing) : 64u + clz(i ^ (i + 1u)));
    }
    if (i + 8u < count && codes[i] == codes[i + 8u]) {
        atomic_or(long_run, 1u);
    }
}
