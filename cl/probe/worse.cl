// Results with the errors that OpenCL allows (full profile, single precision: quotients 2.5 ulp, roots 3, sines 4,
// exponentials and logarithms 3): what `raytide verify` makes of every `/` and square root, and of raytide's own sines,
// exponentials and logarithms, to show on an exact processor what others will do. The
// error follows the digits alone, so that it is the same at every scale. Not for renders.
#pragma OPENCL FP_CONTRACT OFF

// x wrong by up to `most` halves of 2^-23 of itself.
static float wrong_by(const float x, const float most)
{
    const uint digits = as_uint(x) & 0x007fffffu;
    const uint mixed = (digits * 0x9e3779b1u) ^ (digits >> 11);
    const float step = 0.5f * (float)((int)((mixed >> 16) % 5u) - 2);
    const float wrong = x + x * (step * most * 5.9604645e-8f);
    return (as_uint(x) & 0x7f800000u) == 0x7f800000u ? x : wrong;
}

static float worse_root(const float x) { return wrong_by(x, 2.5f); }
static float worse_sine(const float x) { return wrong_by(x, 4.0f); }
static float worse_power(const float x) { return wrong_by(x, 3.0f); }

__attribute__((overloadable)) static float worse(const float x) { return wrong_by(x, 2.0f); }
__attribute__((overloadable)) static float2 worse(const float2 x) { return (float2)(worse(x.x), worse(x.y)); }
__attribute__((overloadable)) static float3 worse(const float3 x)
{
    return (float3)(worse(x.x), worse(x.y), worse(x.z));
}
__attribute__((overloadable)) static float4 worse(const float4 x) { return (float4)(worse(x.lo), worse(x.hi)); }
__attribute__((overloadable)) static float8 worse(const float8 x) { return (float8)(worse(x.lo), worse(x.hi)); }
__attribute__((overloadable)) static int worse(const int x) { return x; }
__attribute__((overloadable)) static uint worse(const uint x) { return x; }
__attribute__((overloadable)) static long worse(const long x) { return x; }
__attribute__((overloadable)) static ulong worse(const ulong x) { return x; }
