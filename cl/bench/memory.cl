#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"

// Bandwidths. All sums are of integers modulo 2^32, so that the host can check them exactly in any order.

static uint sum4(const uint4 x) { return x.x + x.y + x.z + x.w; }

static uint scattered(const uint x)  // integer hash: Wellons, lowbias32
{
    uint h = x;
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
}

// Neighbours read neighbouring rows.
kernel void read_coalesced(global const uint4 *rows, const uint count, global uint *out)
{
    const uint item = (uint)get_global_id(0), items = (uint)get_global_size(0);
    uint4 sum = (uint4)(0u);
    for (uint i = item; i < count; i += items) {
        sum += rows[i];
    }
    out[item] = sum4(sum);
}

// Each item reads a run of its own: what CPUs like.
kernel void read_runs(global const uint4 *rows, const uint count, global uint *out)
{
    const uint item = (uint)get_global_id(0), items = (uint)get_global_size(0);
    const uint run = (count + items - 1u) / items, first = item * run;
    const uint end = first + run < count ? first + run : count;
    uint4 sum = (uint4)(0u);
    for (uint i = first; i < end; i++) {
        sum += rows[i];
    }
    out[item] = sum4(sum);
}

// Rows of an item that writes: neighbouring items take neighbouring rows on GPUs, a run each elsewhere.
#if DEVICE_GPU
#define FOR_MY_ROWS(i, count) for (uint i = (uint)get_global_id(0); i < count; i += (uint)get_global_size(0))
#else
#define RUN(count) ((count + (uint)get_global_size(0) - 1u) / (uint)get_global_size(0))
#define FOR_MY_ROWS(i, count) \
    for (uint i = (uint)get_global_id(0) * RUN(count), end = i + RUN(count); i < end && i < count; i++)
#endif

kernel void write_rows(global uint4 *rows, const uint count, const uint seed)
{
    FOR_MY_ROWS(i, count) {
        rows[i] = (uint4)(i, i ^ seed, seed, ~i);
    }
}

kernel void copy_rows(global const uint4 *rows, global uint4 *to, const uint count)
{
    FOR_MY_ROWS(i, count) {
        to[i] = rows[i];
    }
}

// Rows of 16 bytes at places that nobody can foresee; `mask` + 1 rows, a power of two.
kernel void gather(global const uint4 *rows, const uint mask, const uint reads, global uint *out)
{
    const uint item = (uint)get_global_id(0);
    uint4 sum = (uint4)(0u);
    for (uint k = 0u; k < reads; k++) {
        sum += rows[scattered(item * reads + k) & mask];
    }
    out[item] = sum4(sum);
}

// Rows of 256 bytes, as nodes of trees are; `mask` + 1 rows, a power of two.
kernel void gather_nodes(global const uint8 *rows, const uint mask, const uint reads, global uint *out)
{
    const uint item = (uint)get_global_id(0);
    uint8 sum = (uint8)(0u);
    for (uint k = 0u; k < reads; k++) {
        global const uint8 *row = rows + 8u * (scattered(item * reads + k) & mask);
        sum += ((row[0] + row[1]) + (row[2] + row[3])) + ((row[4] + row[5]) + (row[6] + row[7]));
    }
    out[item] = sum4(sum.lo + sum.hi);
}

// 64 items share 4 KiB of local memory and read all of it, each from a place of its own on.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void local_read(global const uint4 *rows, const uint rounds, global uint *out)
{
    local uint4 shared[256];
    const uint item = (uint)get_local_id(0);
    for (uint k = 0u; k < 4u; k++) {
        shared[item + 64u * k] = rows[item + 64u * k];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint4 sum = (uint4)(0u);
    for (uint k = 0u; k < rounds; k++) {
        sum += shared[(item + k) & 255u] ^ k;
    }
    out[get_global_id(0)] = sum4(sum);
}
