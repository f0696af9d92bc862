#pragma OPENCL FP_CONTRACT OFF

// What work costs before it does anything: launches and atomics. All increments are counted.

kernel void launch_nothing(global uint *counter, const uint add)
{
    if (get_global_id(0) == 0) {
        counter[0] += add;
    }
}

// All items add to one word: the worst case.
kernel void atomic_one(volatile global uint *counters, const uint rounds)
{
    for (uint k = 0u; k < rounds; k++) {
        atomic_inc(&counters[0]);
    }
}

// Items add to 4096 words, neighbours to neighbouring ones.
kernel void atomic_many(volatile global uint *counters, const uint rounds)
{
    const uint item = (uint)get_global_id(0);
    for (uint k = 0u; k < rounds; k++) {
        atomic_inc(&counters[(item + k * 64u) & 4095u]);
    }
}

// 64 items add to one word of local memory.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void atomic_local(volatile global uint *counters, const uint rounds)
{
    local uint count;
    if (get_local_id(0) == 0) {
        count = 0u;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint k = 0u; k < rounds; k++) {
        atomic_inc(&count);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) {
        atomic_add(&counters[0], count);
    }
}
