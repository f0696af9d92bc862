#pragma OPENCL FP_CONTRACT OFF
// Lanes of Node records, and boxes of the build (build/box.cl) to and from them.

#define LEAF_BIT 0x80000000u
#define ANALYTIC_BIT 0x40000000u

// The next float below x, by bits: no arithmetic that a device could flush.
static float next_below(const float x)
{
    const uint bits = as_uint(x);
    const uint magnitude = bits & 0x7fffffffu;
    return as_float(magnitude == 0u ? 0x80000001u : bits == magnitude ? bits - 1u : bits + 1u);
}

// Every side one step outward.
static float8 rounded_outward(const float8 box)
{
    return (float8)(next_below(box.s0), next_below(box.s1), next_below(box.s2), 0.0f, next_below(box.s4),
                    next_below(box.s5), next_below(box.s6), 0.0f);
}

static void write_box(global Node *node, const uint lane, const float8 box)
{
    global float *rows = (global float *)node;
    rows[lane] = box.s0;
    rows[8u + lane] = -box.s4;
    rows[16u + lane] = box.s1;
    rows[24u + lane] = -box.s5;
    rows[32u + lane] = box.s2;
    rows[40u + lane] = -box.s6;
}

static float8 read_box(global const Node *node, const uint lane)
{
    global const float *rows = (global const float *)node;
    return (float8)(rows[lane], rows[16u + lane], rows[32u + lane], 0.0f, -rows[8u + lane], -rows[24u + lane],
                    -rows[40u + lane], 0.0f);
}

static uint read_child(global const Node *node, const uint lane)
{
    return ((global const uint *)node)[48u + lane];
}

static void write_child(global Node *node, const uint lane, const uint child)
{
    ((global uint *)node)[48u + lane] = child;
    ((global uint *)node)[56u + lane] = 0u;
}
