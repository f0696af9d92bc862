#pragma OPENCL FP_CONTRACT OFF
// One pass of a stable radix sort of (64-bit key, value) pairs by 8 bits from `shift` on. One item a chunk of pairs.

#define DIGITS 256u

// Starts of digits are found row by row: histogram[digit * chunks + c] counts the digit in chunk c.
kernel void radix_count(const uint chunks, const uint count, const uint chunk, const uint shift,
                        global const ulong *keys, global uint *histogram)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunks) {
        return;
    }
    uint found[DIGITS];
    for (uint digit = 0; digit < DIGITS; ++digit) {
        found[digit] = 0u;
    }
    const uint first = c * chunk;
    const uint last = count - first < chunk ? count : first + chunk;
    for (uint i = first; i < last; ++i) {
        ++found[(uint)(keys[i] >> shift) & (DIGITS - 1u)];
    }
    for (uint digit = 0; digit < DIGITS; ++digit) {
        histogram[digit * chunks + c] = found[digit];
    }
}

// Turns each row into the places of its chunks within the digit, and keeps the row's total. One item a digit.
kernel void radix_rows(const uint digits, const uint chunks, global uint *histogram, global uint *totals)
{
    const uint digit = (uint)get_global_id(0);
    if (digit >= digits) {
        return;
    }
    uint sum = 0u;
    for (uint c = 0; c < chunks; ++c) {
        const uint here = histogram[digit * chunks + c];
        histogram[digit * chunks + c] = sum;
        sum += here;
    }
    totals[digit] = sum;
}

// Moves each pair to its place; the places of chunks are disjoint.
kernel void radix_move(const uint chunks, const uint count, const uint chunk, const uint shift,
                       global const ulong *keys, global const uint *values, global const uint *histogram,
                       global const uint *totals, global ulong *moved_keys, global uint *moved_values)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunks) {
        return;
    }
    uint places[DIGITS];
    uint start = 0u;
    for (uint digit = 0; digit < DIGITS; ++digit) {
        places[digit] = start + histogram[digit * chunks + c];
        start += totals[digit];
    }
    const uint first = c * chunk;
    const uint last = count - first < chunk ? count : first + chunk;
    for (uint i = first; i < last; ++i) {
        const ulong key = keys[i];
        const uint place = places[(uint)(key >> shift) & (DIGITS - 1u)]++;
        moved_keys[place] = key;
        moved_values[place] = values[i];
    }
}
