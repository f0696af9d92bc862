#pragma OPENCL FP_CONTRACT OFF
// What a device really does with the arithmetic that the other kernels rely on. The host compares with exact results.

#include "base/portable.cl"

// a b - c d in plain operations: antisymmetric unless the compiler fuses against the pragma.
static float plain_difference(const float a, const float b, const float c, const float d)
{
    return a * b - c * d;
}

// One flag for each input: 1 where swapping the products does not just change the sign.
kernel void probe_contraction(global const float4 *inputs, global uint *broken)
{
    const uint i = get_global_id(0);
    const float4 x = inputs[i];
    const float sum = plain_difference(x.x, x.y, x.z, x.w) + plain_difference(x.z, x.w, x.x, x.y);
    broken[i] = sum == 0.0f ? 0u : 1u;
}

// xyzw of each input pair: product, what fma_of leaves of it, quotient, square root of |x|.
kernel void probe_precision(global const float4 *inputs, global float4 *results)
{
    const uint i = get_global_id(0);
    const float x = inputs[i].x;
    const float y = inputs[i].y;
    const float product = x * y;
    results[i] = (float4)(product, fma_of(x, y, -product), x / y, sqrt_of(abs_of(x)));
}

// inputs: NaN, 1, 1e-20, smallest denormal, infinity. Run by one item.
kernel void probe_special(global const float *inputs, global uint *results)
{
    const float nan_value = inputs[0];
    const float one = inputs[1];
    const float tiny = inputs[2];
    results[0] = (bits_of(nan_value) & 0x7fffffffu) > 0x7f800000u ? 1u : 0u;
    results[1] = is_finite(nan_value) || is_finite(inputs[4]) || !is_finite(one) ? 0u : 1u;
    results[2] = nan_value != nan_value ? 1u : 0u;
    results[3] = isnan(nan_value) ? 1u : 0u;
    results[4] = fmin(nan_value, one) == one ? 1u : 0u;
    results[5] = bits_of(tiny * tiny);          // 1e-40 where denormals are made
    results[6] = bits_of(inputs[3] + inputs[3]);  // twice the smallest where denormals are read
    results[7] = nan_value >= one || nan_value < one ? 0u : 1u;
}
