#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/leaf.cl"
#include "accel/traverse.cl"
#include "accel/rays8.cl"
// 64 neighbouring rays, eight groups of eight, set up eight at a time. Every number of a ray here is that of
// prepare_ray, slab_ray and shear_of, lane by lane, so that both variants of the traversal give the same bits.

#define PACKET_GROUPS 8u
#define PACKET_RAYS (8u * PACKET_GROUPS)
#define DONE -1.0f  // t of rays that are no rays, and of those that asked for any hit and have it: they meet no box
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
    float8 u[PACKET_GROUPS], v[PACKET_GROUPS], sum[PACKET_GROUPS];  // weights of the hit: u and v over the sum
#if HAS_TRIANGLES
    float8 shear_x[PACKET_GROUPS], shear_y[PACKET_GROUPS], scale[PACKET_GROUPS], scale_z[PACKET_GROUPS];
    float8 length_z[PACKET_GROUPS], shift_x[PACKET_GROUPS], shift_y[PACKET_GROUPS], shift_z[PACKET_GROUPS];
    int8 axis[PACKET_GROUPS];
    uint axes[PACKET_GROUPS];  // bits 0 to 2: directions of rays of the group are longest along that axis
#endif
    int8 skip[PACKET_GROUPS], prim[PACKET_GROUPS];
    int8 place[PACKET_GROUPS];  // of a triangle: as Closest has it
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

static void set_lane8(private float8 *values, const uint i, const float x) { ((private float *)values)[i] = x; }
static void set_lane_int8(private int8 *values, const uint i, const uint x) { ((private uint *)values)[i] = x; }

// Rays come in rows of eight pixels; a group has four pixels of two rows, which are closer together. The place of a ray
// in the packet, and the ray at a place: bits 2 and 3 change places.
static uint swapped(const uint i) { return (i & ~12u) | ((i & 4u) << 1) | ((i & 8u) >> 1); }

static float smallest8(const float8 v) { return -largest8(-v); }

// The rays of a group, given as rows of their records.
ALWAYS_INLINE static void set_group(Packet *p, const uint group, const float8 *rows, Bounds8 *all)
{
    Rays8 r;
    set_up_rays8(p->extent, rows, &r);
    const int8 together = r.moving;
    for (uint k = 0u; k < 3u; k++) {
        all->d_low[k] = min8(all->d_low[k], together ? r.d[k] : (float8)(LARGEST));
        all->d_high[k] = max8(all->d_high[k], together ? r.d[k] : (float8)(-LARGEST));
        all->o_low[k] = min8(all->o_low[k], together ? r.o[k] : (float8)(LARGEST));
        all->o_high[k] = max8(all->o_high[k], together ? r.o[k] : (float8)(-LARGEST));
        p->d[k][group] = r.d[k];
        p->inverse[k][group] = r.inverse[k];
        p->shift[k][group] = r.shift[k];
    }
    all->extent = max8(all->extent, r.extent);
    p->t[group] = together ? r.t_max : (float8)(DONE);
    p->t_unit[group] = r.t_unit;
    p->t_given[group] = r.t_given;
    p->skip[group] = r.skip;
    p->prim[group] = (int8)((int)NONE);
    p->sum[group] = (float8)(1.0f);
    p->usable |= (ulong)movemask8(r.usable) << (8u * group);
    p->together |= (ulong)movemask8(together) << (8u * group);
#if HAS_TRIANGLES
    p->axis[group] = r.axis;
    p->axes[group] = (movemask8((r.axis == 0) & together) != 0u ? 1u : 0u) |
                     (movemask8((r.axis == 1) & together) != 0u ? 2u : 0u) |
                     (movemask8((r.axis == 2) & together) != 0u ? 4u : 0u);
    p->shear_x[group] = r.shear_x;
    p->shear_y[group] = r.shear_y;
    p->scale[group] = r.scale;
    p->scale_z[group] = r.scale_z;
    p->length_z[group] = r.length_z;
    p->shift_x[group] = r.shift_x;
    p->shift_y[group] = r.shift_y;
    p->shift_z[group] = r.shift_z;
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
