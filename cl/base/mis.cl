#pragma OPENCL FP_CONTRACT OFF

// Weight of a sample drawn with `own` density where another technique has density `other` (power heuristic, exponent
// 2; Veach 1997, 9.2.2). As a ratio, so that squares neither overflow nor vanish; finite for all pairs in [0, inf].
static float power_heuristic(const float own, const float other)
{
    const float ratio = own == other ? 1.0f : other / own;
    return 1.0f / (1.0f + ratio * ratio);
}
