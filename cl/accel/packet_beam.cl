#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/rows.cl"
#include "accel/box.cl"
#include "accel/packet_rays.cl"
// What the tree is asked for 64 rays at once: eight boxes against bounds of them all, and one box against eight rays.

#define SMALLEST_STEP 0.125f  // of every direction along the main axis, their longest components being in [1, 2)
// Of the slopes' bounds: wider bundles share too little. Single rays that ask for any hit are done sooner.
#define WIDEST_BEAM 0.5f
#define WIDEST_BEAM_ANY 0.0625f
// Of the largest coordinate and of the slopes: 256 roundings, for those of a beam and those that a ray's own test lets
// pass (box.cl: FAR_PAD comes to 64 at most, of twice the coordinate).
#define BEAM_SLACK 1.5258789e-5f
#define BEAM_ROUNDING 4.7683716e-7f  // 8 roundings

// The lowest and highest slope along axis `side` over the main one, of all rays.
static void find_slopes(const Packet *p, const uint side, const uint main, const float sign, float *low, float *high)
{
    float8 lowest = (float8)(LARGEST);
    float8 highest = (float8)(-LARGEST);
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        const int8 counts = p->t[group] >= 0.0f;
        const float8 slope = p->d[side][group] * p->inverse[main][group];
        lowest = min8(lowest, counts ? slope : (float8)(LARGEST));
        highest = max8(highest, counts ? slope : (float8)(-LARGEST));
    }
    *low = sign > 0.0f ? smallest8(lowest) : -largest8(highest);
    *high = sign > 0.0f ? largest8(highest) : -smallest8(lowest);
}

// The axis along which all of some directions advance in one sense, and most; 3 if there is none. `low` and `high` are
// their bounds; their largest components are in [1, 2).
static uint main_axis(const float8 *low, const float8 *high)
{
    uint main = 3u;
    float least = SMALLEST_STEP;
    for (uint axis = 0u; axis < 3u; axis++) {
        const float step = max_of(smallest8(low[axis]), -largest8(high[axis]));
        main = step >= least ? axis : main;
        least = max_of(step, least);
    }
    return main;
}

// Whether eight rays that ask for any hit agree: most bundles that are no packets end here, before any work for all their rays.
static int look_alike(const Packet *p, const uint count)
{
    float8 rows[8];
    for (uint lane = 0u; lane < 8u; lane++) {
        rows[lane] = *(global const float8 *)(p->rays + p->slots[9u * lane < count ? 9u * lane : 0u]);
    }
    Rows8 origin, direction;
    columns_of8(rows, &origin, &direction);
    const float8 longest = max8(max8(abs8(direction.x), abs8(direction.y)), abs8(direction.z));
    const float8 d[3] = {direction.x / longest, direction.y / longest, direction.z / longest};
    const uint main = main_axis(d, d);
    if (main == 3u) {
        return 0;
    }
    for (uint k = 1u; k < 3u; k++) {
        const float8 slope = d[(main + k) % 3u] / d[main];
        if (!(largest8(slope) - smallest8(slope) <= WIDEST_BEAM_ANY)) {
            return 0;
        }
    }
    return 1;
}

// 0 if the rays do not agree well enough to be traced together.
static int set_beam(Packet *p, const Bounds8 *all, const float widest)
{
    Beam *b = &p->beam;
    const uint main = main_axis(all->d_low, all->d_high);
    if (main == 3u) {
        return 0;
    }
    const float d_low = smallest8(all->d_low[main]);
    const float sign = d_low > 0.0f ? 1.0f : -1.0f;
    const float extent = largest8(all->extent);
    float steepest = 0.0f;
    for (uint k = 0u; k < 2u; k++) {
        const uint side = (main + 1u + k) % 3u;
        float low, high;
        find_slopes(p, side, main, sign, &low, &high);
        if (!(high - low <= widest)) {
            return 0;
        }
        b->side[k] = 2u * ROW * side;
        b->low_rising[k] = max_of(low, 0.0f);
        b->low_falling[k] = min_of(low, 0.0f);
        b->high_rising[k] = max_of(high, 0.0f);
        b->high_falling[k] = min_of(high, 0.0f);
        steepest = max_of(steepest, max_of(high, -low));
    }
    const float slack = extent * (1.0f + steepest) * BEAM_SLACK;
    for (uint k = 0u; k < 2u; k++) {
        const uint side = (main + 1u + k) % 3u;
        b->low[k] = smallest8(all->o_low[side]) - slack;
        b->high[k] = largest8(all->o_high[side]) + slack;
    }
    const float o_low = smallest8(all->o_low[main]);
    const float o_high = largest8(all->o_high[main]);
    b->sign = sign;
    b->start_low = (sign > 0.0f ? o_low : -o_high) - slack;
    b->start_high = (sign > 0.0f ? o_high : -o_low) + slack;
    b->near = (2u * main + (sign > 0.0f ? 0u : 1u)) * ROW;
    b->far = (2u * main + (sign > 0.0f ? 1u : 0u)) * ROW;
    b->step_high = (sign > 0.0f ? largest8(all->d_high[main]) : -d_low) * (1.0f + BEAM_ROUNDING);
    b->inverse_high = (1.0f - 2.0f * BEAM_ROUNDING) / b->step_high;
    p->mixed = 0;
    for (uint axis = 0u; axis < 3u; axis++) {
        const float low = smallest8(all->d_low[axis]);
        p->flip[axis] = low < 0.0f ? 8u : 0u;
        p->mixed |= low < 0.0f && largest8(all->d_high[axis]) > 0.0f;
    }
    return 1;
}

typedef struct {
    float8 near, far, low_a, high_a, low_b, high_b;  // planes of the main axis, and of the two others
} BeamRows;

// Lanes whose boxes any ray might meet at t in [0, limit], and a lower bound of where.
ALWAYS_INLINE static uint beam_boxes8(const Beam *b, const BeamRows r, const float limit, float8 *enter)
{
    const float8 u_low = max8(fma8(r.near, (float8)(b->sign), (float8)(-b->start_high)), (float8)(0.0f));
    const float8 u_high = min8(fma8(r.far, (float8)(b->sign), (float8)(-b->start_low)), (float8)(limit * b->step_high));
    const float8 a_low = fma8(u_low, (float8)(b->low_rising[0]), fma8(u_high, (float8)(b->low_falling[0]), (float8)(b->low[0])));
    const float8 a_high = fma8(u_high, (float8)(b->high_rising[0]), fma8(u_low, (float8)(b->high_falling[0]), (float8)(b->high[0])));
    const float8 b_low = fma8(u_low, (float8)(b->low_rising[1]), fma8(u_high, (float8)(b->low_falling[1]), (float8)(b->low[1])));
    const float8 b_high = fma8(u_high, (float8)(b->high_rising[1]), fma8(u_low, (float8)(b->high_falling[1]), (float8)(b->high[1])));
    *enter = u_low * b->inverse_high;
    const int8 misses = as_int8(u_high - u_low) | as_int8(r.high_a - a_low) | as_int8(a_high - r.low_a) |
                        as_int8(r.high_b - b_low) | as_int8(b_high - r.low_b);  // where any is negative
    return movemask8(misses < 0) ^ ALL_LANES;
}

ALWAYS_INLINE static BeamRows node_rows(const Beam *b, global const Node *node)
{
    global const char *rows = (global const char *)node;
    BeamRows r;
    r.near = row_at(rows, b->near);
    r.far = row_at(rows, b->far);
    r.low_a = row_at(rows, b->side[0]);
    r.high_a = row_at(rows, b->side[0] + ROW);
    r.low_b = row_at(rows, b->side[1]);
    r.high_b = row_at(rows, b->side[1] + ROW);
    return r;
}

// A box, rounded outward: the corners that rays with all signs of the packet's first come to first and last.
typedef struct {
    float near_x, near_y, near_z, far_x, far_y, far_z;
} PacketBox;

// Lane `lane` of rows as of a node.
#define PACKET_BOX(p, values, lane)                                                                                   \
    {(values)[(lane) + (p)->flip[0]],  (values)[(lane) + (p)->flip[1] + 16u], (values)[(lane) + (p)->flip[2] + 32u],  \
     (values)[(lane) - (p)->flip[0] + 8u], (values)[(lane) - (p)->flip[1] + 24u],                                     \
     (values)[(lane) - (p)->flip[2] + 40u]}

// Lanes of a group whose rays meet a box no farther than their own t, and where they enter: box_met's arithmetic. Where
// `mixed`, rays come to the corners in either order.
ALWAYS_INLINE static int8 box_met_by8(const Packet *p, const uint group, const PacketBox box, const int mixed,
                                      float8 *enter)
{
    float8 near_x = fma8((float8)(box.near_x), p->inverse[0][group], p->shift[0][group]);
    float8 near_y = fma8((float8)(box.near_y), p->inverse[1][group], p->shift[1][group]);
    float8 near_z = fma8((float8)(box.near_z), p->inverse[2][group], p->shift[2][group]);
    float8 far_x = fma8((float8)(box.far_x), p->inverse[0][group], p->shift[0][group]);
    float8 far_y = fma8((float8)(box.far_y), p->inverse[1][group], p->shift[1][group]);
    float8 far_z = fma8((float8)(box.far_z), p->inverse[2][group], p->shift[2][group]);
    if (mixed) {
        const float8 x = near_x;
        const float8 y = near_y;
        const float8 z = near_z;
        near_x = min8(x, far_x);
        near_y = min8(y, far_y);
        near_z = min8(z, far_z);
        far_x = max8(x, far_x);
        far_y = max8(y, far_y);
        far_z = max8(z, far_z);
    }
    const float8 first = max8(max8(near_x, near_y), max8(near_z, (float8)(0.0f)));
    const float8 last = min8(min8(far_x, far_y), min8(far_z, p->t[group]));
    *enter = first;
    return in_order8(first, last);
}

// Lists the groups, of `count` in `groups`, of which any ray meets the box: at `met`, its value plus `mark`. Without
// branches, which nobody could foretell.
ALWAYS_INLINE static uint list_groups(const Packet *p, const uint *groups, const uint count, const PacketBox box,
                                      const uint mark, uint *met)
{
    float8 enter;
    uint found = 0u;
    if (p->mixed) {
        for (uint k = 0u; k < count; k++) {
            met[found] = groups[k] + mark;
            found += movemask8(box_met_by8(p, groups[k], box, 1, &enter)) != 0u ? 1u : 0u;
        }
    } else {
        for (uint k = 0u; k < count; k++) {
            met[found] = groups[k] + mark;
            found += movemask8(box_met_by8(p, groups[k], box, 0, &enter)) != 0u ? 1u : 0u;
        }
    }
    return found;
}

// The farthest that any ray still looks; negative when all are done.
static float packet_limit(const Packet *p)
{
    const float8 a = max8(max8(p->t[0], p->t[1]), max8(p->t[2], p->t[3]));
    const float8 b = max8(max8(p->t[4], p->t[5]), max8(p->t[6], p->t[7]));
    return largest8(max8(a, b));
}
