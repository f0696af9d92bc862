#pragma OPENCL FP_CONTRACT OFF
#include "wave/path.cl"
// Compaction in three launches: count by chunks of 1024 items, scan the chunks, scatter. One item a chunk, counted
// first and stored without branches: no atomics, so order and picture never depend on timing, and it is several
// times faster than an atomic an item on CPUs.

// counters: alive, shadow, then both by path edges

__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void partition_count(const uint count, global const uint *status, global uint *chunk_counts)
{
    const uint chunk = (uint)get_global_id(0);
    const uint first = chunk * PARTITION_CHUNK;
    if (first >= count) {
        return;
    }
    const uint end = first + PARTITION_CHUNK < count ? first + PARTITION_CHUNK : count;
    uint bins[2 * EDGE_BINS];
    for (uint b = 0; b < 2u * EDGE_BINS; b++) {
        bins[b] = 0u;
    }
    for (uint i = first; i < end; i++) {
        const uint word = status[i];
        const uint edge = word >> STATUS_EDGES_SHIFT;
        const uint bin = edge < EDGE_BINS ? edge : EDGE_BINS - 1u;
        bins[bin] += word & STATUS_ALIVE;
        bins[EDGE_BINS + bin] += (word & STATUS_SHADOW) >> 1;
    }
    for (uint b = 0; b < 2u * EDGE_BINS; b++) {
        chunk_counts[chunk * 2u * EDGE_BINS + b] = bins[b];
    }
}

// One work-item: turns the counts of each chunk into its first places (kept in the chunk's bins 0 and EDGE_BINS).
__attribute__((reqd_work_group_size(1, 1, 1)))
kernel void partition_scan(const uint count, global uint *chunk_counts, global uint *counters)
{
    uint totals[2 * EDGE_BINS];
    for (uint b = 0; b < 2u * EDGE_BINS; b++) {
        totals[b] = 0u;
    }
    uint alive = 0u;
    uint shadow = 0u;
    const uint chunks = (count + PARTITION_CHUNK - 1u) / PARTITION_CHUNK;
    for (uint c = 0; c < chunks; c++) {
        global uint *bins = chunk_counts + c * 2u * EDGE_BINS;
        const uint alive_before = alive;
        const uint shadow_before = shadow;
        for (uint b = 0; b < EDGE_BINS; b++) {
            totals[b] += bins[b];
            totals[EDGE_BINS + b] += bins[EDGE_BINS + b];
            alive += bins[b];
            shadow += bins[EDGE_BINS + b];
        }
        bins[0] = alive_before;
        bins[EDGE_BINS] = shadow_before;
    }
    counters[0] = alive;
    counters[1] = shadow;
    for (uint b = 0; b < 2u * EDGE_BINS; b++) {
        counters[COUNTER_EDGES + b] = totals[b];
    }
}

// Alive slots to the front of `next_queue` and free ones behind them, both in order; shadow slots to `shadow_queue`.
// Slots from `count` to `capacity` are free already and keep their places.
// Race rule: the scan gave every chunk places of its own.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void partition_scatter(const uint count, const uint capacity, global const uint *status,
                              global const uint *chunk_counts, global const uint *counters, global const uint *queue,
                              global uint *next_queue, global uint *shadow_queue)
{
    const uint chunk = (uint)get_global_id(0);
    const uint first = chunk * PARTITION_CHUNK;
    if (first >= capacity) {
        return;
    }
    const uint end = first + PARTITION_CHUNK < capacity ? first + PARTITION_CHUNK : capacity;
    const uint used = end < count ? end : count;
    uint i = first;
    if (first < count) {
        uint alive = chunk_counts[chunk * 2u * EDGE_BINS];
        uint shadow = chunk_counts[chunk * 2u * EDGE_BINS + EDGE_BINS];
        uint dead = counters[0] + (first - alive);
        for (; i < used; i++) {
            const uint word = status[i];
            const uint slot = queue[i];
            const uint is_alive = word & STATUS_ALIVE;
            next_queue[is_alive ? alive : dead] = slot;
            alive += is_alive;
            dead += 1u - is_alive;
            if (word & STATUS_SHADOW) {
                shadow_queue[shadow] = slot;
                shadow++;
            }
        }
    }
    for (; i < end; i++) {
        next_queue[i] = queue[i];
    }
}
