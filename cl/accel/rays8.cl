#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/rows8.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
// Eight rays set up at once, one a lane. Every number is that of prepare_ray, slab_ray and shear_of, lane by lane, so
// that no bit tells how a ray was set up. Rays that stand still along an axis are left to those.

#define LARGEST 3.4028235e38f

typedef struct {
    float8 o[3], d[3];
    float8 inverse[3];  // 1/d
    float8 shift[3];    // -o/d
    float8 t_max, t_unit, extent;
    float8 t_given;  // the record's t_max
    int8 skip, axis;
#if HAS_TRIANGLES
    float8 shear_x, shear_y, scale, scale_z, length_z, shift_x, shift_y, shift_z;
#endif
    int8 usable;  // rays that may meet something
    int8 moving;  // those of them that stand still along no axis: the numbers above are of them only
} Rays8;

static float lane_of8(private const float8 *values, const uint i) { return ((private const float *)values)[i]; }
static uint lane_of_int8(private const int8 *values, const uint i) { return ((private const uint *)values)[i]; }

// Records Ray of eight rays, one a vector, as components.
ALWAYS_INLINE static void columns_of8(const float8 *r, Rows8 *origin, Rows8 *direction)
{
    *origin = transposed8((float8)(r[0].lo, r[4].lo), (float8)(r[1].lo, r[5].lo), (float8)(r[2].lo, r[6].lo),
                          (float8)(r[3].lo, r[7].lo));
    *direction = transposed8((float8)(r[0].hi, r[4].hi), (float8)(r[1].hi, r[5].hi), (float8)(r[2].hi, r[6].hi),
                             (float8)(r[3].hi, r[7].hi));
}

static int8 larger_int8(const int8 a, const int8 b) { return a > b ? a : b; }

#if HAS_TRIANGLES
static float8 slope_of8(const float8 a, const float8 b, const float8 inverse)
{
    const float8 slope = a * inverse;
    return fma8(fma8(-slope, b, a), inverse, slope);
}

// shear_of, with the same names.
ALWAYS_INLINE static void shear_rays8(Rays8 *r)
{
    const int8 x_main = r->axis == 0;
    const int8 y_main = r->axis == 1;
    const float8 d_z = x_main ? r->d[0] : (y_main ? r->d[1] : r->d[2]);
    const float8 inverse_z = x_main ? r->inverse[0] : (y_main ? r->inverse[1] : r->inverse[2]);
    const float8 length = abs8(d_z);
    const float8 towards = abs8(inverse_z);
    const float8 scale = scale_of8(r->extent);
    const float8 scale_z = as_float8(as_int8(scale * TO_DEPTH) | (as_int8(d_z) & (int8)(0x80000000)));
    r->scale = scale;
    r->scale_z = scale_z;
    r->shear_x = slope_of8(x_main ? r->d[1] : (y_main ? r->d[2] : r->d[0]), length, towards) * -FROM_DEPTH;
    r->shear_y = slope_of8(x_main ? r->d[2] : (y_main ? r->d[0] : r->d[1]), length, towards) * -FROM_DEPTH;
    r->length_z = length * (scale * TO_DEPTH);
    r->shift_x = -(x_main ? r->o[1] : (y_main ? r->o[2] : r->o[0])) * scale;
    r->shift_y = -(x_main ? r->o[2] : (y_main ? r->o[0] : r->o[1])) * scale;
    r->shift_z = -(x_main ? r->o[0] : (y_main ? r->o[1] : r->o[2])) * scale_z;
}
#endif

// Lanes that move along an axis; what slab_ray finds along it.
ALWAYS_INLINE static int8 slab_axis8(Rays8 *r, const uint axis, const float8 smallest)
{
    r->inverse[axis] = (float8)(1.0f) / r->d[axis];
    r->shift[axis] = -r->o[axis] * r->inverse[axis] + 0.0f;
    return abs8(r->d[axis]) >= smallest;
}

// prepare_ray and slab_ray for eight rays, given as rows of their records. `extent` is the geometry's.
ALWAYS_INLINE static void set_up_rays8(const float extent, const float8 *rows, Rays8 *r)
{
    Rows8 origin, direction;
    columns_of8(rows, &origin, &direction);
    const int8 size_x = as_int8(direction.x) & 0x7fffffff;
    const int8 size_y = as_int8(direction.y) & 0x7fffffff;
    const int8 size_z = as_int8(direction.z) & 0x7fffffff;
    const int8 longest = larger_int8(larger_int8(size_x, size_y), size_z);
    const int8 remotest = larger_int8(larger_int8(as_int8(abs8(origin.x)), as_int8(abs8(origin.y))),
                                      as_int8(abs8(origin.z)));
    const int8 t_max = as_int8(direction.w + 0.0f);
    const int8 usable = (longest >= (int)SMALLEST_NORMAL) & (longest < (int)HUGE_BITS) &
                        (remotest <= (int)LIMIT_BITS) & (t_max >= 0) & (t_max < (int)INFINITY_BITS);
    const float8 unit = as_float8(0x7f000000 - (longest & 0x7f800000));
    r->extent = max8(max8((float8)(extent), usable ? as_float8(remotest) : (float8)(0.0f)),
                     (float8)(float_of(SMALLEST_NORMAL)));
    r->o[0] = usable ? origin.x : (float8)(0.0f);
    r->o[1] = usable ? origin.y : (float8)(0.0f);
    r->o[2] = usable ? origin.z : (float8)(0.0f);
    r->d[0] = usable ? direction.x * unit : (float8)(1.0f);
    r->d[1] = usable ? direction.y * unit : (float8)(1.0f);
    r->d[2] = usable ? direction.z * unit : (float8)(1.0f);
    const float8 smallest = max8(r->extent, (float8)(1.0f)) * SLOWEST;
    r->usable = usable;
    r->moving = usable & slab_axis8(r, 0u, smallest) & slab_axis8(r, 1u, smallest) & slab_axis8(r, 2u, smallest);
    r->t_max = min8(as_float8(t_max) * as_float8(longest & 0x7f800000), (float8)(LARGEST));
    r->t_unit = unit;
    r->t_given = direction.w;
    r->skip = as_int8(origin.w);
    r->axis = size_x == longest ? (int8)(0) : (size_y == longest ? (int8)(1) : (int8)(2));
#if HAS_TRIANGLES
    shear_rays8(r);
#endif
}
