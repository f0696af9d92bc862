#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"

// Four numbers of eight things, number by number.
typedef struct {
    float8 x;
    float8 y;
    float8 z;
    float8 w;
} Rows8;

// Lanes 0 to 3 of `low` columns and 4 to 7 of `high` ones: columns to rows, which is its own inverse.
static Rows8 transposed8(const float8 a, const float8 b, const float8 c, const float8 d)
{
    const float8 ab_low = (float8)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5);
    const float8 ab_high = (float8)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7);
    const float8 cd_low = (float8)(c.s0, d.s0, c.s1, d.s1, c.s4, d.s4, c.s5, d.s5);
    const float8 cd_high = (float8)(c.s2, d.s2, c.s3, d.s3, c.s6, d.s6, c.s7, d.s7);
    Rows8 out;
    out.x = (float8)(ab_low.s01, cd_low.s01, ab_low.s45, cd_low.s45);
    out.y = (float8)(ab_low.s23, cd_low.s23, ab_low.s67, cd_low.s67);
    out.z = (float8)(ab_high.s01, cd_high.s01, ab_high.s45, cd_high.s45);
    out.w = (float8)(ab_high.s23, cd_high.s23, ab_high.s67, cd_high.s67);
    return out;
}

// The rows of four numbers at `index`.
static Rows8 rows_at(global const float4 *rows, const uint8 index)
{
    return transposed8((float8)(rows[index.s0], rows[index.s4]), (float8)(rows[index.s1], rows[index.s5]),
                       (float8)(rows[index.s2], rows[index.s6]), (float8)(rows[index.s3], rows[index.s7]));
}
