#pragma OPENCL FP_CONTRACT OFF
// Arithmetic of words behind the sample numbers (base/sampler.cl). The host derives base/words8.cl from this text: the
// same functions of eight words, with an 8 at the end of their names. So only what works word by word stands here.

// A bijection of 32 bits without visible structure (Wellons 2018, "lowbias32").
static uint mix_bits(const uint key)
{
    uint x = key;
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

static uint reverse_bits(const uint key)
{
    uint x = key;
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x >> 8) & 0x00ff00ffu);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
    x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
    return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

// Nested uniform scramble of a reversed number: every bit changes by a hash of the bits below it (Laine and Karras
// 2011, with Vegdahl's constants of 2021). The seed must be well mixed.
static uint scramble(const uint key, const uint seed)
{
    uint x = key;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Multiplication by w, or by w^2 = w + 1, of the 16 elements of GF(4) in a word (w^2 + w + 1 = 0).
static uint times_w(const uint x)
{
    return ((x >> 1) & 0x55555555u) | ((x ^ (x << 1)) & 0xaaaaaaaau);
}

static uint times_w_squared(const uint x)
{
    return ((x ^ (x >> 1)) & 0x55555555u) | ((x << 1) & 0xaaaaaaaau);
}

// Pascal's triangle mod 2 within pairs of bits, and between the 16 pairs: together Sobol's second dimension.
static uint pascal_pairs(const uint x)
{
    return x ^ ((x >> 1) & 0x55555555u);
}

static uint dimension_one(const uint index)
{
    uint x = pascal_pairs(index);
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 8) & 0x00ff00ffu;
    return x ^ (x >> 16);
}

// Pascal's triangle times powers of w: factors w^(2^level) by Lucas' theorem.
static uint dimension_two(const uint index)
{
    uint x = index;
    x ^= times_w(x >> 2) & 0x33333333u;
    x ^= times_w_squared(x >> 4) & 0x0f0f0f0fu;
    x ^= times_w(x >> 8) & 0x00ff00ffu;
    return x ^ times_w_squared(x >> 16);
}

static uint dimension_three(const uint index)
{
    uint x = index;
    x ^= times_w_squared(x >> 2) & 0x33333333u;
    x ^= times_w(x >> 4) & 0x0f0f0f0fu;
    x ^= times_w_squared(x >> 8) & 0x00ff00ffu;
    return pascal_pairs(x ^ times_w(x >> 16));
}
