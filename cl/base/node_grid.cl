#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"

// A function on the unit square that is known at the nodes of a grid and bilinear between them, one grid for each of
// several viewing directions; and the map of the unit square that has that function as its density: first the row, then
// the place along it (marginal and conditional distributions, both piecewise quadratic).

// Grids about a viewing direction, and their shares.
typedef struct {
    uint4 slice;
    float4 share;
} Views;

typedef struct {
    global const float *values;       // a slice: rows of columns
    global const float *marginal;     // a slice: of each row, the share below it
    global const float *conditional;  // a slice: of each node, the integral along its row up to it
    uint columns;
    uint rows;
} NodeGrid;

// Grid whose description starts at `header` of a table: columns, rows, places of values, marginal, conditional.
static NodeGrid node_grid_at(global const float *table, const uint header)
{
    NodeGrid out;
    out.columns = (uint)table[header];
    out.rows = (uint)table[header + 1u];
    out.values = table + (uint)table[header + 2u];
    out.marginal = table + (uint)table[header + 3u];
    out.conditional = table + (uint)table[header + 4u];
    return out;
}

// The number at `place` of each slice, slices `stride` apart, mixed.
static float mixed_at(global const float *numbers, const uint stride, const uint place, const Views v)
{
    const float2 one = (float2)(numbers[v.slice.x * stride + place], numbers[v.slice.y * stride + place]);
    float sum = v.share.x * one.x + v.share.y * one.y;
    if (v.share.z + v.share.w > 0.0f) {
        sum += v.share.z * numbers[v.slice.z * stride + place] + v.share.w * numbers[v.slice.w * stride + place];
    }
    return sum;
}

// Cell below the coordinate, of `nodes` in [0, 1], and the place in it.
static uint node_cell(const float coordinate, const uint nodes, float *within)
{
    const float at = clamp_of(coordinate, 0.0f, 1.0f) * (float)(nodes - 1u);
    const uint whole = (uint)at;
    const uint cell = whole > nodes - 2u ? nodes - 2u : whole;
    *within = at - (float)cell;
    return cell;
}

// Place in [0, 1] below which a line from a to b has the area `area`.
static float place_of_area(const float a, const float b, const float area)
{
    const float root = sqrt_of(max_of(a * a + 2.0f * area * (b - a), 0.0f));
    return clamp_of(2.0f * area / max_of(a + root, 1.0e-30f), 0.0f, 1.0f);
}

// The last of `count` nodes that is not above `wanted`, among marginal shares.
static uint marginal_cell(const NodeGrid g, const Views v, const float wanted)
{
    uint low = 0u;
    uint high = g.rows - 1u;
    while (high - low > 1u) {
        const uint middle = (low + high) >> 1;
        const int below = mixed_at(g.marginal, g.rows, middle, v) <= wanted;
        low = below ? middle : low;
        high = below ? high : middle;
    }
    return low;
}

// Integral up to a node along the line that is `t` of the way from row `row` to the next.
static float conditional_at(const NodeGrid g, const Views v, const uint row, const float t, const uint column)
{
    const uint size = g.rows * g.columns;
    const uint place = row * g.columns + column;
    const float below = mixed_at(g.conditional, size, place, v);
    return below + t * (mixed_at(g.conditional, size, place + g.columns, v) - below);
}

static float value_at(const NodeGrid g, const Views v, const uint row, const float t, const uint column)
{
    const uint size = g.rows * g.columns;
    const uint place = row * g.columns + column;
    const float below = mixed_at(g.values, size, place, v);
    return below + t * (mixed_at(g.values, size, place + g.columns, v) - below);
}

static float node_grid_value(const NodeGrid g, const Views v, const float2 at)
{
    float x, y;
    const uint column = node_cell(at.x, g.columns, &x);
    const uint row = node_cell(at.y, g.rows, &y);
    const float left = value_at(g, v, row, y, column);
    return left + x * (value_at(g, v, row, y, column + 1u) - left);
}

// Point with the grid's density.
static float2 node_grid_sample(const NodeGrid g, const Views v, const float2 u)
{
    const float step = 1.0f / (float)(g.rows - 1u);
    const uint row = marginal_cell(g, v, u.y);
    const uint last = g.columns - 1u;
    const float lower = conditional_at(g, v, row, 0.0f, last);
    const float upper = conditional_at(g, v, row, 1.0f, last);
    const float above = u.y - mixed_at(g.marginal, g.rows, row, v);
    const float y = place_of_area(lower, upper, above * (float)(g.rows - 1u));
    const float wanted = u.x * (lower + y * (upper - lower));
    uint low = 0u;
    uint high = last;
    while (high - low > 1u) {
        const uint middle = (low + high) >> 1;
        const int below = conditional_at(g, v, row, y, middle) <= wanted;
        low = below ? middle : low;
        high = below ? high : middle;
    }
    const float rest = (wanted - conditional_at(g, v, row, y, low)) * (float)last;
    const float left = value_at(g, v, row, y, low);
    const float x = place_of_area(left, value_at(g, v, row, y, low + 1u), rest);
    return (float2)(((float)low + x) / (float)last, ((float)row + y) * step);
}

// The numbers that node_grid_sample turns into a point.
static float2 node_grid_invert(const NodeGrid g, const Views v, const float2 at)
{
    float x, y;
    const uint column = node_cell(at.x, g.columns, &x);
    const uint row = node_cell(at.y, g.rows, &y);
    const uint last = g.columns - 1u;
    const float lower = conditional_at(g, v, row, 0.0f, last);
    const float upper = conditional_at(g, v, row, 1.0f, last);
    const float in_row = y * (lower + 0.5f * y * (upper - lower)) / (float)(g.rows - 1u);
    const float left = value_at(g, v, row, y, column);
    const float right = value_at(g, v, row, y, column + 1u);
    const float in_cell = x * (left + 0.5f * x * (right - left)) / (float)last;
    const float whole = max_of(lower + y * (upper - lower), 1.0e-30f);
    return (float2)((conditional_at(g, v, row, y, column) + in_cell) / whole,
                    mixed_at(g.marginal, g.rows, row, v) + in_row);
}
