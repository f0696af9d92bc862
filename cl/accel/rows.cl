#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
// Nodes and blocks are rows of eight floats. Plain loads: they are aligned, and vload8 is a call on PoCL's wheel.

#define ROW 32u  // bytes

static float8 row_at(global const char *record, const uint offset) { return *(global const float8 *)(record + offset); }
