#pragma OPENCL FP_CONTRACT OFF
// The one file with vendor words: arithmetic that every device has, under one name each.
//
// PoCL's wheel turns every OpenCL built-in into a call that spills all vector registers and stops the vectoriser, so
// hot code uses these forms only. Clang's own built-ins become one instruction each on CPUs; elsewhere OpenCL's serve.

#ifndef __has_builtin
#define __has_builtin(name) 0
#endif

#if DEVICE_CPU && __has_builtin(__builtin_sqrtf) && __has_builtin(__builtin_ctz)
#define CLANG_BUILTINS 1
#else
#define CLANG_BUILTINS 0
#endif

// A kernel that is 8 wide by itself loses 6 times its speed if Intel's runtime vectorises it across work-items too. And
// that vectoriser (2026.22) gives wrong components for structs of float3 that a switch returns: shading is hinted too,
// which also made it a quarter faster.
#ifdef cl_intel_vec_len_hint
#define VEC_LEN_HINT __attribute__((intel_vec_len_hint(1)))
#else
#define VEC_LEN_HINT
#endif

// Rays that a work-item traces one after the other, and items of a group: a CPU finds what its rays share once and keeps
// one stack in its nearest cache. The host's trace_launch agrees.
#if DEVICE_GPU
#define ITEM_RAYS 1u
#define ITEM_GROUP RAY_GROUP
#else
#define ITEM_RAYS TILE
#define ITEM_GROUP TILE_GROUP
#endif

// Where a call would spill vector registers in the innermost loop.
#define ALWAYS_INLINE __attribute__((always_inline))

// The long part of a kernel. PoCL inlines a kernel into both of its launchers and makes machine code of all three, but
// of a function that it calls once only. Structs of the scene come by pointer and are copied, to be kept in registers.
#if DEVICE_POCL
#define COMPILED_ONCE __attribute__((noinline))
#else
#define COMPILED_ONCE
#endif

static uint bits_of(const float x) { return as_uint(x); }
static float float_of(const uint bits) { return as_float(bits); }

// By bits: few compilers that assume finite numbers remove it (Intel's does); no render is built so.
static int is_finite(const float x) { return (as_uint(x) & 0x7f800000u) != 0x7f800000u; }

static float abs_of(const float x) { return as_float(as_uint(x) & 0x7fffffffu); }

// Smaller and larger of two numbers; where one is NaN the second argument comes back.
static float min_of(const float a, const float b) { return a < b ? a : b; }
static float max_of(const float a, const float b) { return a > b ? a : b; }
static float4 min4(const float4 a, const float4 b) { return a < b ? a : b; }
static float4 max4(const float4 a, const float4 b) { return a > b ? a : b; }
static float4 abs4(const float4 x) { return as_float4(as_uint4(x) & 0x7fffffffu); }
static float8 min8(const float8 a, const float8 b) { return a < b ? a : b; }
static float8 max8(const float8 a, const float8 b) { return a > b ? a : b; }

// NaN stays NaN.
static float clamp_of(const float x, const float low, const float high)
{
    const float above = x < low ? low : x;
    return above > high ? high : above;
}

static float sqrt_of(const float x)
{
#if CLANG_BUILTINS
    return __builtin_sqrtf(x);
#else
    return sqrt(x);
#endif
}

static float floor_of(const float x)
{
#if CLANG_BUILTINS
    return __builtin_floorf(x);
#else
    return floor(x);
#endif
}

// Towards zero, of numbers that an int holds.
static int int_of(const float x) { return (int)x; }

// a b + c rounded once. Where the hardware cannot, a plain sum of products: the forms that use it then keep their
// exact antisymmetry and lose only digits. The start-up probe reports which of the two a device does.
static float fma_of(const float a, const float b, const float c)
{
#if DEVICE_GPU
    return fma(a, b, c);
#else
#pragma OPENCL FP_CONTRACT ON
    return a * b + c;
#endif
}

static float4 fma4(const float4 a, const float4 b, const float4 c)
{
#if DEVICE_GPU
    return fma(a, b, c);
#else
#pragma OPENCL FP_CONTRACT ON
    return a * b + c;
#endif
}

static float8 fma8(const float8 a, const float8 b, const float8 c)
{
#if DEVICE_GPU
    return fma(a, b, c);
#else
#pragma OPENCL FP_CONTRACT ON
    return a * b + c;
#endif
}

static float8 abs8(const float8 x) { return as_float8(as_uint8(x) & 0x7fffffffu); }

// Lane by lane the component of `v` that `axis` names: 0, 1 or 2.
static float8 component8(const float4 v, const int8 axis)
{
#if DEVICE_CPU && __has_builtin(__builtin_ia32_vpermilvarps256)
    return __builtin_ia32_vpermilvarps256((float8)(v, v), axis);
#else
    return axis == 0 ? (float8)(v.x) : (axis == 1 ? (float8)(v.y) : (float8)(v.z));
#endif
}

static float8 sqrt8(const float8 x)
{
#if DEVICE_CPU && __has_builtin(__builtin_ia32_sqrtps256)
    return __builtin_ia32_sqrtps256(x);
#elif CLANG_BUILTINS
    return (float8)(sqrt_of(x.s0), sqrt_of(x.s1), sqrt_of(x.s2), sqrt_of(x.s3), sqrt_of(x.s4), sqrt_of(x.s5),
                    sqrt_of(x.s6), sqrt_of(x.s7));
#else
    return sqrt(x);
#endif
}

static float8 clamp8(const float8 x, const float8 low, const float8 high)
{
    const float8 above = x < low ? low : x;
    return above > high ? high : above;
}

static float8 floor8(const float8 x)
{
    return (float8)(floor_of(x.s0), floor_of(x.s1), floor_of(x.s2), floor_of(x.s3), floor_of(x.s4), floor_of(x.s5),
                    floor_of(x.s6), floor_of(x.s7));
}

static int8 int8_of(const float8 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return __builtin_convertvector(x, int8);
#else
    return convert_int8(x);
#endif
}

// Towards zero; of numbers from 0 to below 2^31.
static uint8 uint8_of(const float8 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return as_uint8(__builtin_convertvector(x, int8));
#else
    return convert_uint8(x);
#endif
}

static ulong8 ulong8_of(const uint8 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return __builtin_convertvector(x, ulong8);
#else
    return convert_ulong8(x);
#endif
}

// The low halves.
static uint8 low_bits8(const ulong8 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return __builtin_convertvector(x, uint8);
#else
    return convert_uint8(x);
#endif
}

// Numbers below 2^24 are exact.
static float8 float8_of(const int8 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return __builtin_convertvector(x, float8);
#else
    return convert_float8(x);
#endif
}

static float4 float4_of(const int4 x)
{
#if CLANG_BUILTINS && __has_builtin(__builtin_convertvector)
    return __builtin_convertvector(x, float4);
#else
    return convert_float4(x);
#endif
}

#define ALL_LANES 0xffu

// Bit k is set where lane k of a comparison's result is true.
static uint movemask8(const int8 lanes)
{
#if DEVICE_CPU && __has_builtin(__builtin_ia32_movmskps256)
    return (uint)__builtin_ia32_movmskps256(as_float8(lanes));
#else
    const uint8 bits = as_uint8(lanes) & (uint8)(1u, 2u, 4u, 8u, 16u, 32u, 64u, 128u);
    const uint4 half_bits = bits.lo | bits.hi;
    const uint2 quarter = half_bits.lo | half_bits.hi;
    return quarter.x | quarter.y;
#endif
}

// Asks for the memory at `p`, which is wanted soon. CPUs run the items of a work-group one after the other, so that an
// item can ask for what a later one needs; devices that run them side by side need no such thing.
#if DEVICE_CPU && __has_builtin(__builtin_prefetch)
#define PREFETCH(p) __builtin_prefetch((const void *)(ulong)(p))
#else
#define PREFETCH(p) ((void)0)
#endif

// Place of the lowest set bit; x is not zero.
static uint ctz_of(const uint x)
{
#if CLANG_BUILTINS
    return (uint)__builtin_ctz(x);
#else
    return 31u - clz(x & (0u - x));
#endif
}

static uint popcount_of(const uint x)
{
#if CLANG_BUILTINS
    return (uint)__builtin_popcount(x);
#else
    return popcount(x);
#endif
}
