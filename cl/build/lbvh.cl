#pragma OPENCL FP_CONTRACT OFF
// The kernels of the builder that orders primitives by Morton codes.
#include "build/morton.cl"
#include "build/radix.cl"
