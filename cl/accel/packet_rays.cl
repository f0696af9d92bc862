#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/leaf.cl"
#include "accel/traverse.cl"
// 64 neighbouring rays, eight groups of eight, set up eight at a time. Every number of a ray here is that of
// prepare_ray, slab_ray and shear_of, lane by lane, so that both variants of the traversal give the same bits.

#define PACKET_GROUPS 8u
#define PACKET_RAYS (8u * PACKET_GROUPS)
#define DONE -1.0f  // t of rays that are no rays, and of those that asked for any hit and have it: they meet no box
#define LARGEST 3.4028235e38f
#define FEWEST_TOGETHER 9u  // rays; fewer are traced one by one

// All rays of a packet advance along one axis, the main one, in the same sense. u is the distance along it from where
// a ray starts, and along the two other axes a ray's place is within its origin's bounds plus u times a slope's bounds.
typedef struct {
    uint near, far;          // bytes: rows of the main axis that rays come to first and last
    float sign;              // of the main axis
    float start_low;         // bounds of the origins along it, times the sign
    float start_high;
    float step_high;         // the largest u for a unit of t
    float inverse_high;      // its reciprocal, rounded down
    uint side[2];            // bytes: low rows of the two other axes
    float low[2], high[2];   // bounds of the origins along them
    float low_rising[2], low_falling[2];    // the lowest slope, split by its sign
    float high_rising[2], high_falling[2];  // the highest
} Beam;

typedef struct {
    float8 inverse[3][PACKET_GROUPS];  // 1/d
    float8 shift[3][PACKET_GROUPS];    // -o/d
    float8 d[3][PACKET_GROUPS];
    float8 t[PACKET_GROUPS];       // of the best hit so far, or t_max, or DONE
    float8 t_unit[PACKET_GROUPS];  // times a scaled t gives the ray's own t
    float8 t_given[PACKET_GROUPS];
    float8 u[PACKET_GROUPS], v[PACKET_GROUPS];
#if HAS_TRIANGLES
    float8 shear_x[PACKET_GROUPS], shear_y[PACKET_GROUPS], scale[PACKET_GROUPS], scale_z[PACKET_GROUPS];
    float8 length_z[PACKET_GROUPS], shift_x[PACKET_GROUPS], shift_y[PACKET_GROUPS], shift_z[PACKET_GROUPS];
    int8 axis[PACKET_GROUPS];
    uint axes[PACKET_GROUPS];  // bits 0 to 2: directions of rays of the group are longest along that axis
#endif
    int8 skip[PACKET_GROUPS], prim[PACKET_GROUPS];
    uint groups[PACKET_GROUPS];  // those with rays that may still meet something
    uint group_count;
    uint flip[3];    // 8 where a direction is negative along an axis: floats from a node's near row to its far one
    int mixed;       // whether other directions are positive there
    Beam beam;
    ulong usable;    // rays that may meet something
    ulong together;  // those of them that are traced together; the others stand still along an axis
    float extent;    // of the geometry
    global const Ray *rays;
    global const uint *slots;
#if HAS_ANALYTIC || HAS_PLANE || HAS_INSTANCES
    Query queries[PACKET_RAYS];
    ulong prepared;  // queries that are there
#endif
} Packet;

// Over the rays that are traced together, eight at a time.
typedef struct {
    float8 d_low[3], d_high[3], o_low[3], o_high[3], extent;
} Bounds8;

static float lane_of8(private const float8 *values, const uint i) { return ((private const float *)values)[i]; }
static void set_lane8(private float8 *values, const uint i, const float x) { ((private float *)values)[i] = x; }
static uint lane_of_int8(private const int8 *values, const uint i) { return ((private const uint *)values)[i]; }
static void set_lane_int8(private int8 *values, const uint i, const uint x) { ((private uint *)values)[i] = x; }

// Rays come in rows of eight pixels; a group has four pixels of two rows, which are closer together. The place of a ray
// in the packet, and the ray at a place: bits 2 and 3 change places.
static uint swapped(const uint i) { return (i & ~12u) | ((i & 4u) << 1) | ((i & 8u) >> 1); }

static float smallest8(const float8 v) { return -largest8(-v); }

// Records Ray of eight rays, one a vector, become their components.
ALWAYS_INLINE static void transpose8(float8 *r)
{
    float8 s[8];
    float8 q[8];
    for (uint i = 0u; i < 8u; i += 2u) {
        const float8 a = r[i];
        const float8 b = r[i + 1u];
        s[i] = (float8)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5);
        s[i + 1u] = (float8)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7);
    }
    for (uint i = 0u; i < 8u; i += 4u) {
        for (uint k = 0u; k < 2u; k++) {
            const float8 a = s[i + k];
            const float8 b = s[i + k + 2u];
            q[i + 2u * k] = (float8)(a.s01, b.s01, a.s45, b.s45);
            q[i + 2u * k + 1u] = (float8)(a.s23, b.s23, a.s67, b.s67);
        }
    }
    for (uint i = 0u; i < 4u; i++) {
        r[i] = (float8)(q[i].lo, q[i + 4u].lo);
        r[i + 4u] = (float8)(q[i].hi, q[i + 4u].hi);
    }
}

static int8 larger_int8(const int8 a, const int8 b) { return a > b ? a : b; }

#if HAS_TRIANGLES
// shear_of, with the same names.
ALWAYS_INLINE static void set_shears(Packet *p, const uint group, const float8 *o, const float8 *d,
                                     const float8 *inverse, const float8 extent, const int8 axis)
{
    const int8 x_main = axis == 0;
    const int8 y_main = axis == 1;
    const float8 d_z = x_main ? d[0] : (y_main ? d[1] : d[2]);
    const float8 towards = -abs8(x_main ? inverse[0] : (y_main ? inverse[1] : inverse[2])) * FROM_DEPTH;
    const float8 to_one = as_float8(0x7f000000 - (as_int8(extent) & 0x7f800000));
    const float8 scale = to_one < SCALE_MOST / SCALED_EXTENT ? to_one * SCALED_EXTENT : (float8)(SCALE_MOST);
    const float8 scale_z = as_float8(as_int8(scale * TO_DEPTH) | (as_int8(d_z) & (int8)(0x80000000)));
    p->scale[group] = scale;
    p->scale_z[group] = scale_z;
    p->shear_x[group] = (x_main ? d[1] : (y_main ? d[2] : d[0])) * towards;
    p->shear_y[group] = (x_main ? d[2] : (y_main ? d[0] : d[1])) * towards;
    p->length_z[group] = abs8(d_z) * (scale * TO_DEPTH);
    p->shift_x[group] = -(x_main ? o[1] : (y_main ? o[2] : o[0])) * scale;
    p->shift_y[group] = -(x_main ? o[2] : (y_main ? o[0] : o[1])) * scale;
    p->shift_z[group] = -(x_main ? o[0] : (y_main ? o[1] : o[2])) * scale_z;
}
#endif

// prepare_ray and slab_ray for the rays of a group, given as rows of their records.
ALWAYS_INLINE static void set_group(Packet *p, const uint group, float8 *rows, Bounds8 *all)
{
    transpose8(rows);
    const int8 size_x = as_int8(rows[4]) & 0x7fffffff;
    const int8 size_y = as_int8(rows[5]) & 0x7fffffff;
    const int8 size_z = as_int8(rows[6]) & 0x7fffffff;
    const int8 longest = larger_int8(larger_int8(size_x, size_y), size_z);
    const int8 remotest = larger_int8(larger_int8(as_int8(abs8(rows[0])), as_int8(abs8(rows[1]))),
                                      as_int8(abs8(rows[2])));
    const int8 t_max = as_int8(rows[7] + 0.0f);
    const int8 usable = (longest >= (int)SMALLEST_NORMAL) & (longest < (int)HUGE_BITS) &
                        (remotest <= (int)LIMIT_BITS) & (t_max >= 0) & (t_max < (int)INFINITY_BITS);
    const float8 unit = as_float8(0x7f000000 - (longest & 0x7f800000));
    const float8 extent = max8(max8((float8)(p->extent), usable ? as_float8(remotest) : (float8)(0.0f)),
                               (float8)(float_of(SMALLEST_NORMAL)));
    const float8 smallest = max8(extent, (float8)(1.0f)) * 7.5231638e-37f;  // as slab_ray
    float8 o[3], d[3], inverse[3];
    int8 together = usable;
    for (uint k = 0u; k < 3u; k++) {
        o[k] = usable ? rows[k] : (float8)(0.0f);
        d[k] = usable ? rows[4u + k] * unit : (float8)(1.0f);
        together &= abs8(d[k]) >= smallest;
        inverse[k] = (float8)(1.0f) / d[k];
        all->d_low[k] = min8(all->d_low[k], together ? d[k] : (float8)(LARGEST));
        all->d_high[k] = max8(all->d_high[k], together ? d[k] : (float8)(-LARGEST));
        all->o_low[k] = min8(all->o_low[k], together ? o[k] : (float8)(LARGEST));
        all->o_high[k] = max8(all->o_high[k], together ? o[k] : (float8)(-LARGEST));
    }
    for (uint k = 0u; k < 3u; k++) {
        p->d[k][group] = d[k];
        p->inverse[k][group] = inverse[k];
        p->shift[k][group] = -o[k] * inverse[k] + 0.0f;
    }
    all->extent = max8(all->extent, extent);
    const float8 t = min8(as_float8(t_max) * as_float8(longest & 0x7f800000), (float8)(LARGEST));
    p->t[group] = together ? t : (float8)(DONE);
    p->t_unit[group] = unit;
    p->t_given[group] = rows[7];
    p->skip[group] = as_int8(rows[3]);
    p->prim[group] = (int8)((int)NONE);
    p->usable |= (ulong)movemask8(usable) << (8u * group);
    p->together |= (ulong)movemask8(together) << (8u * group);
#if HAS_TRIANGLES
    const int8 axis = size_x == longest ? (int8)(0) : (size_y == longest ? (int8)(1) : (int8)(2));
    p->axis[group] = axis;
    p->axes[group] = (movemask8((axis == 0) & together) != 0u ? 1u : 0u) |
                     (movemask8((axis == 1) & together) != 0u ? 2u : 0u) |
                     (movemask8((axis == 2) & together) != 0u ? 4u : 0u);
    set_shears(p, group, o, d, inverse, extent, axis);
#endif
}

static uint count_rays(const ulong set) { return popcount_of((uint)set) + popcount_of((uint)(set >> 32)); }

// The lowest ray of a set that is not empty.
static uint lowest_ray(const ulong set)
{
    const uint low = (uint)set;
    return low != 0u ? ctz_of(low) : 32u + ctz_of((uint)(set >> 32));
}

// All rays of the packet's slots, and their bounds.
static void begin_packet(Packet *p, const uint count, Bounds8 *all)
{
    p->usable = p->together = 0ul;
#if HAS_ANALYTIC || HAS_PLANE || HAS_INSTANCES
    p->prepared = 0ul;
#endif
    for (uint k = 0u; k < 3u; k++) {
        all->d_low[k] = all->o_low[k] = (float8)(LARGEST);
        all->d_high[k] = all->o_high[k] = (float8)(-LARGEST);
    }
    all->extent = (float8)(0.0f);
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        float8 rows[8];
        for (uint lane = 0u; lane < 8u; lane++) {
            const uint i = swapped(8u * group + lane);
            const float8 row = *(global const float8 *)(p->rays + p->slots[i < count ? i : 0u]);
            rows[lane] = row;
            rows[lane].s7 = i < count ? row.s7 : DONE;
        }
        set_group(p, group, rows, all);
    }
}
