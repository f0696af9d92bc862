#pragma OPENCL FP_CONTRACT OFF
// The kernels of the binned SAH builder.
#define MAX_BINARY_DEPTH 48u  // of the SAH tree before its collapse
#include "build/sah_top.cl"
#include "build/sah_subtree.cl"
