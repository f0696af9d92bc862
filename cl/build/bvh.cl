#pragma OPENCL FP_CONTRACT OFF
// The kernels that every builder runs. Those of one builder alone are programs of their own (accel/device_tree.py): a
// program in the cache holds machine code of all its kernels, and PoCL needs about 0.1 s for the smallest.
#include "build/bounds.cl"
#include "build/join.cl"
#include "build/collapse.cl"
#include "build/pack.cl"
