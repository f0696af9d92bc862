#pragma OPENCL FP_CONTRACT OFF
// Every kernel that builds a tree, as one program: PoCL compiles a kernel to machine code at its first launch, so the
// kernels of the other builder cost next to nothing.
#define MAX_BINARY_DEPTH 48u  // of the SAH tree before its collapse
#include "build/bounds.cl"
#include "build/morton.cl"
#include "build/radix.cl"
#include "build/sah_top.cl"
#include "build/sah_subtree.cl"
#include "build/join.cl"
#include "build/collapse.cl"
#include "build/pack.cl"
#include "build/refit.cl"
#include "build/reinsert_order.cl"
