#pragma OPENCL FP_CONTRACT OFF
#include "build/reinsert_search.cl"
// Moves of one round that do not disturb each other. A move writes six rows: it takes place only if none of them is
// wanted by a move of greater gain (equal gains: lower row). Two moves on disjoint rows could still close a circle, one
// subtree going into the other and that one into the first; therefore a move gives way to a greater one of any node
// between its new place and the node above both places. (In a circle of moves each would go below the next; then each
// would have to be greater than the next.)
//
// Race rule: claims are maxima and minima, which do not depend on the order of items; every other launch writes rows
// that one item alone holds, or numbers that are the same whoever writes them.

static void rows_of_move(const uint row, const uint beside, global const uint *children, global const uint *parents,
                         uint *rows)
{
    const uint parent = parents[row];
    rows[0] = row;
    rows[1] = parent;
    rows[2] = sibling_of(row, parent, children);
    rows[3] = parents[parent];
    rows[4] = beside;
    rows[5] = parents[beside];
}

// claims: bits of the greatest gain that wants a row; they start as 0.
kernel void reinsert_claim(const uint count, const uint first, const uint stride, global const uint *children,
                           global const uint *parents, global const float *gains, global const uint2 *places,
                           volatile global uint *claims)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || places[i].x == NONE) {
        return;
    }
    uint rows[6];
    rows_of_move(first + i * stride, places[i].x, children, parents, rows);
    for (uint k = 0; k < 6u; ++k) {
        atomic_max(claims + rows[k], as_uint(gains[i]));
    }
}

// owners: of the moves of that gain, the one of the lowest row; they start as NONE.
kernel void reinsert_settle(const uint count, const uint first, const uint stride, global const uint *children,
                            global const uint *parents, global const float *gains, global const uint2 *places,
                            global const uint *claims, volatile global uint *owners)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || places[i].x == NONE) {
        return;
    }
    uint rows[6];
    rows_of_move(first + i * stride, places[i].x, children, parents, rows);
    for (uint k = 0; k < 6u; ++k) {
        if (claims[rows[k]] == as_uint(gains[i])) {
            atomic_min(owners + rows[k], rows[0]);
        }
    }
}

static int owns_all(const uint row, const uint beside, global const uint *children, global const uint *parents,
                    global const uint *owners)
{
    uint rows[6];
    rows_of_move(row, beside, children, parents, rows);
    int all = 1;
    for (uint k = 0; k < 6u; ++k) {
        all = all && owners[rows[k]] == row;
    }
    return all;
}

// moves: whether each candidate moves.
kernel void reinsert_choose(const uint count, const uint first, const uint stride, global const uint *children,
                            global const uint *parents, global const float *gains, global const uint2 *places,
                            global const uint *owners, global uint *moves)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint2 place = places[i];
    const uint row = first + i * stride;
    uint moved = place.x != NONE && owns_all(row, place.x, children, parents, owners);
    for (uint y = place.x; moved && y != place.y; y = parents[y]) {
        const uint other = (y - first) / stride;
        if (y < first || (y - first) % stride != 0u || places[other].x == NONE) {
            continue;
        }
        const int greater = gains[other] > gains[i] || (gains[other] == gains[i] && y < row);
        moved = !(greater && owns_all(y, places[other].x, children, parents, owners));
    }
    moves[i] = moved;
}

static void replace_child(const uint parent, const uint old, const uint row, global uint *children,
                          global uint *parents)
{
    children[2u * parent + (children[2u * parent] == old ? 0u : 1u)] = row;
    parents[row] = parent;
}

// places[i].y becomes the node whose child went.
kernel void reinsert_apply(const uint count, const uint first, const uint stride, global const uint *moves,
                           global uint *children, global uint *parents, global uint2 *places)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || !moves[i]) {
        return;
    }
    const uint row = first + i * stride;
    const uint beside = places[i].x;
    const uint parent = parents[row];
    const uint above = parents[parent];
    replace_child(above, parent, sibling_of(row, parent, children), children, parents);
    replace_child(parents[beside], beside, parent, children, parents);
    children[2u * parent] = row;
    children[2u * parent + 1u] = beside;
    parents[beside] = parent;
    places[i].y = above;
}

#define MOST_DEPTH 65000u  // the host keeps levels in 16 bits; splits of n primitives by area never come near it

static uint depth_of(const uint row, global const uint *parents)
{
    uint depth = 0u;
    for (uint y = parents[row]; y != NONE && depth < MOST_DEPTH; y = parents[y]) {
        ++depth;
    }
    return depth;
}

// Notes 1 + depth of a node and of all above it; where somebody has been, he goes on.
static void mark_path(const uint row, global const uint *parents, volatile global uint *marks)
{
    uint mark = depth_of(row, parents) + 1u;
    for (uint y = row; y != NONE && atomic_max(marks + y, mark) == 0u; y = parents[y]) {
        --mark;
    }
}

// marks: 1 + depth of every inner node whose box may have changed; they start as 0.
kernel void reinsert_mark(const uint count, const uint first, const uint stride, global const uint *moves,
                          global const uint2 *places, global const uint *parents, volatile global uint *marks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || !moves[i]) {
        return;
    }
    mark_path(places[i].y, parents, marks);
    mark_path(parents[first + i * stride], parents, marks);
}
