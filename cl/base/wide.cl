#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/math.cl"
#include "base/rows8.cl"
// Eight vectors side by side, one a lane, for CPUs whose compiler does not join work-items. Every function does in each
// lane what the one of base/vector.cl, frame.cl or mis.cl without the 8 in its name does, operation by operation: whether
// something was shaded alone or among eight changes no bit. tests/device/test_wide_functions.py holds them together.

#if DEVICE_CPU
#define LANES 8u

typedef struct {
    float8 x;
    float8 y;
    float8 z;
} Vector8;

static Vector8 vector8(const float8 x, const float8 y, const float8 z)
{
    Vector8 out;
    out.x = x;
    out.y = y;
    out.z = z;
    return out;
}

typedef struct {
    float8 x;
    float8 y;
} Pair8;

static Pair8 pair8(const float8 x, const float8 y)
{
    Pair8 out;
    out.x = x;
    out.y = y;
    return out;
}

static Rows8 four8(const float8 x, const float8 y, const float8 z, const float8 w)
{
    Rows8 out;
    out.x = x;
    out.y = y;
    out.z = z;
    out.w = w;
    return out;
}

static Vector8 add8(const Vector8 a, const Vector8 b) { return vector8(a.x + b.x, a.y + b.y, a.z + b.z); }
static Vector8 subtract8(const Vector8 a, const Vector8 b) { return vector8(a.x - b.x, a.y - b.y, a.z - b.z); }
static Vector8 multiply8(const Vector8 a, const Vector8 b) { return vector8(a.x * b.x, a.y * b.y, a.z * b.z); }
static Vector8 divide8(const Vector8 a, const Vector8 b) { return vector8(a.x / b.x, a.y / b.y, a.z / b.z); }
static Vector8 scale8(const Vector8 a, const float8 f) { return vector8(a.x * f, a.y * f, a.z * f); }
static Vector8 negate8(const Vector8 a) { return vector8(-a.x, -a.y, -a.z); }
static float8 dot8(const Vector8 a, const Vector8 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static Vector8 magnitudes8(const Vector8 a) { return vector8(abs8(a.x), abs8(a.y), abs8(a.z)); }
static float8 largest_of8(const Vector8 a) { return max8(a.x, max8(a.y, a.z)); }

static Vector8 choose8(const int8 which, const Vector8 yes, const Vector8 no)
{
    return vector8(which ? yes.x : no.x, which ? yes.y : no.y, which ? yes.z : no.z);
}

// One lane, taken out or put in.
static float lane_of(const float8 *v, const uint k) { return ((const float *)v)[k]; }
static float3 lane3_of(const Vector8 *v, const uint k)
{
    return (float3)(lane_of(&v->x, k), lane_of(&v->y, k), lane_of(&v->z, k));
}
static uint lane_bits(const uint8 *v, const uint k) { return ((const uint *)v)[k]; }
static void set_lane(float8 *v, const uint k, const float value) { ((float *)v)[k] = value; }
static void set_lane3(Vector8 *v, const uint k, const float3 value)
{
    set_lane(&v->x, k, value.x);
    set_lane(&v->y, k, value.y);
    set_lane(&v->z, k, value.z);
}

static float8 difference_of_products8(const float8 a, const float8 b, const float8 c, const float8 d)
{
    const float8 product = c * d;
    const float8 error = fma8(-c, d, product);
    return fma8(a, b, -product) + error;
}

static Vector8 cross8(const Vector8 a, const Vector8 b)
{
    return vector8(difference_of_products8(a.y, b.z, a.z, b.y), difference_of_products8(a.z, b.x, a.x, b.z),
                   difference_of_products8(a.x, b.y, a.y, b.x));
}

static float4 row_of(const Rows8 *v, const uint k)
{
    return (float4)(lane_of(&v->x, k), lane_of(&v->y, k), lane_of(&v->z, k), lane_of(&v->w, k));
}

// Apart, so that nothing else needs its numbers in memory.
static float8 sums_taken_exactly(const float8 plain, const uint cancelled, const Rows8 a, const Rows8 b)
{
    float8 out = plain;
    for (uint rest = cancelled; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        set_lane(&out, k, dot4_exact(row_of(&a, k), row_of(&b, k)));
    }
    return out;
}

static float8 exact_if_cancelled8(const float8 plain, const float8 limit, const Rows8 a, const Rows8 b)
{
    const uint cancelled = movemask8(abs8(plain) < limit);
    return cancelled == 0u ? plain : sums_taken_exactly(plain, cancelled, a, b);
}

static Vector8 renormalize8(const Vector8 v) { return scale8(v, 1.5f - 0.5f * dot8(v, v)); }

// Whether all squares of lengths are where neither length nor unit vector needs care.
static int are_safe8(const float8 square)
{
    return movemask8((square >= SAFE_SQUARE_MIN) & (square <= SAFE_SQUARE_MAX)) == 0xffu;
}

// The careful way, a lane at a time; apart, so that nothing else needs its vectors in memory.
static float8 careful_length8(const Vector8 v)
{
    float8 out;
    for (uint k = 0u; k < LANES; k++) {
        set_lane(&out, k, length3(lane3_of(&v, k)));
    }
    return out;
}

static Vector8 careful_normalize8(const Vector8 v)
{
    Vector8 out;
    for (uint k = 0u; k < LANES; k++) {
        set_lane3(&out, k, normalize3(lane3_of(&v, k)));
    }
    return out;
}

static float8 length8(const Vector8 v)
{
    const float8 square = dot8(v, v);
    return are_safe8(square) ? sqrt8(square) : careful_length8(v);
}

static Vector8 normalize8(const Vector8 v)
{
    const float8 square = dot8(v, v);
    if (are_safe8(square)) {
        return scale8(v, 1.0f / sqrt8(square));
    }
    return careful_normalize8(v);
}

typedef struct {
    Vector8 s;
    Vector8 t;
    Vector8 n;
} Frame8;

static Frame8 frame_of8(const Vector8 n)
{
    const float8 side = n.z < 0.0f ? (float8)(-1.0f) : (float8)(1.0f);
    const float8 a = -1.0f / (side + n.z);
    const float8 b = n.x * n.y * a;
    Frame8 frame;
    frame.s = vector8(1.0f + side * n.x * n.x * a, side * b, -side * n.x);
    frame.t = vector8(b, side + n.y * n.y * a, -n.y);
    frame.n = n;
    return frame;
}

static Vector8 to_world8(const Frame8 frame, const Vector8 v)
{
    return add8(add8(scale8(frame.s, v.x), scale8(frame.t, v.y)), scale8(frame.n, v.z));
}

static Vector8 to_local8(const Frame8 frame, const Vector8 v)
{
    return vector8(dot8(frame.s, v), dot8(frame.t, v), dot8(frame.n, v));
}

static float8 power_heuristic8(const float8 own, const float8 other)
{
    const float8 ratio = own == other ? (float8)(1.0f) : other / own;
    return 1.0f / (1.0f + ratio * ratio);
}

static Vector8 xyz8(const Rows8 r) { return vector8(r.x, r.y, r.z); }

// Writes them there where the lane's bit is set in `lanes`.
static void put_rows(global float4 *rows, const uint8 index, const Rows8 r, const uint lanes)
{
    const Rows8 t = transposed8(r.x, r.y, r.z, r.w);
    if (lanes == 0xffu) {
        rows[index.s0] = t.x.lo;
        rows[index.s1] = t.y.lo;
        rows[index.s2] = t.z.lo;
        rows[index.s3] = t.w.lo;
        rows[index.s4] = t.x.hi;
        rows[index.s5] = t.y.hi;
        rows[index.s6] = t.z.hi;
        rows[index.s7] = t.w.hi;
        return;
    }
    const float8 columns[4] = {t.x, t.y, t.z, t.w};
    for (uint rest = lanes; rest != 0u; rest &= rest - 1u) {
        const uint k = ctz_of(rest);
        rows[lane_bits(&index, k)] = k < 4u ? columns[k].lo : columns[k - 4u].hi;
    }
}

static Rows8 rows8(const Vector8 v, const float8 w) { return four8(v.x, v.y, v.z, w); }
#endif
