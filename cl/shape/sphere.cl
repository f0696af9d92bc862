#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "base/frame.cl"
#include "base/math.cl"
#include "accel/area.cl"
#include "accel/geometry.cl"
// Sphere around center with radius center.w; u, v, w are its half axes.

#define ONE_OVER_TWO_PI 0.15915494309f
#define SPHERE_NEAR 1e-6f  // from closer than this (squared distance above the surface, per r^2) the cone has no digits

// |v|^2 - r^2 without cancellation.
static float sphere_excess(const float3 v, const float r) { return dot4_exact(make4(v, r), make4(v, -r)); }

// Ray Tracing Gems ch. 7 (Haines et al.): the discriminant from the point of closest approach; roots by q, so that
// neither cancels; the constant term in twice the precision. All in units near the larger of r and the distance.
static float sphere_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max)
{
    const float3 from_center = o - xyz(s->center);
    const float extent = max_of(largest3(abs3(from_center)), s->center.w);
    const float unit = scale_to_one(extent);
    const float3 f = from_center * unit;
    const float r = s->center.w * unit;
    const float a = dot3(d, d);
    const float b = -dot3_exact(f, d);
    const float b_over_a = b / a;
    const float3 closest = (float3)(fma_of(b_over_a, d.x, f.x), fma_of(b_over_a, d.y, f.y), fma_of(b_over_a, d.z, f.z));
    const float discriminant = -sphere_excess(closest, r);
    if (!(discriminant >= 0.0f)) {
        return NO_HIT;
    }
    const float c = sphere_excess(f, r);
    const float root = sqrt_of(a * discriminant);
    const float q = b < 0.0f ? b - root : b + root;
    const float inverse = 1.0f / q;
    const float quotient = c * inverse;
    const float refined = fma_of(fma_of(-q, quotient, c), inverse, quotient);  // right where division is ulps off
    const float t0 = q == 0.0f ? 0.0f : refined;
    const float t1 = q / a;
    const float near = min_of(t0, t1);
    const float far = max_of(t0, t1);
    const float t = (near >= 0.0f ? near : far) * power_below(extent);
    return t >= 0.0f && t <= t_max ? abs_of(t) : NO_HIT;
}

// Rounding of center and of the normal times r; the origin of a spawned ray is rounded once more, as is its distance.
static float sphere_error(const float3 center, const float r, const float3 n)
{
    return UNIT_ROUNDOFF * (8.0f * r + 4.0f * dot3(abs3(n), abs3(center)));
}

static float3 sphere_point(const float3 center, const float r, const float3 n)
{
    return (float3)(fma_of(r, n.x, center.x), fma_of(r, n.y, center.y), fma_of(r, n.z, center.z));
}

static void sphere_surface(global const Shape *s, const float3 o, const float3 d, const float t, Surface *out)
{
    const float3 center = xyz(s->center);
    const float r = s->center.w;
    const float3 f = o - center;
    const float3 along = (float3)(fma_of(t, d.x, f.x), fma_of(t, d.y, f.y), fma_of(t, d.z, f.z));
    const float3 n = renormalize3(normalize3(along));  // quotients and roots may be ulps off: a step makes up for it
    out->p = sphere_point(center, r, n);
    out->ng = n;
    out->n = n;
    out->uv = (float2)(dot3(xyz(s->inverse_u), n) * r, dot3(xyz(s->inverse_v), n) * r);
    out->error = sphere_error(center, r, n);
}

// sin^2 of the half angle under which the sphere is seen along `to` (to its center); 0 from inside or too near.
static float sphere_sin2(const float3 to, const float r)
{
    const float unit = scale_to_one(max_of(largest3(abs3(to)), r));
    const float3 v = to * unit;
    const float radius = r * unit;
    const float excess = sphere_excess(v, radius);
    return excess > SPHERE_NEAR * radius * radius ? radius * radius / dot3(v, v) : 0.0f;
}

// 1 - cos of an angle from its sin^2, without cancellation.
static float versine(const float sin2) { return sin2 / (1.0f + sqrt_of(max_of(1.0f - sin2, 0.0f))); }

static float sphere_area(const float r) { return 12.566370614f * r * r; }

static float3 sphere_sample_area(const float3 center, const float r, const float3 from, const float2 u, float3 *ng,
                                 float *pdf)
{
    float sin_phi, cos_phi;
    const float z = 1.0f - 2.0f * u.x;
    const float ring = 2.0f * sqrt_of(u.x * (1.0f - u.x));
    sin_cos_turns(u.y, &sin_phi, &cos_phi);
    *ng = (float3)(ring * cos_phi, ring * sin_phi, z);
    const float3 p = sphere_point(center, r, *ng);
    *pdf = density_by_area(from, p, *ng, sphere_area(r));
    return p;
}

// Uniform over the cone of directions to the sphere (Shirley, Wang and Zimmerman 1996); from inside or from closer
// than digits reach, uniform by area.
static float3 sphere_sample(global const Shape *s, const float3 from, const float2 u, float3 *ng, float *pdf,
                            float *error)
{
    const float3 center = xyz(s->center);
    const float r = s->center.w;
    const float3 to = center - from;
    const float sin2_max = sphere_sin2(to, r);
    if (!(sin2_max > 0.0f)) {
        const float3 p = sphere_sample_area(center, r, from, u, ng, pdf);
        *error = sphere_error(center, r, *ng);
        return p;
    }
    const float cone = versine(sin2_max);
    const float one_minus_cos = u.x * cone;
    const float cos_theta = 1.0f - one_minus_cos;
    const float sin_theta = sqrt_of(one_minus_cos * (2.0f - one_minus_cos));
    // The angle at the center between the viewer and the point: asin(sin_theta / sin_max) - theta
    const float x = min_of(sin_theta / sqrt_of(sin2_max), 1.0f);
    const float y = sqrt_of((1.0f - x) * (1.0f + x));
    const float cos_alpha = y * cos_theta + x * sin_theta;
    const float sin_alpha = x * cos_theta - y * sin_theta;
    float sin_phi, cos_phi;
    sin_cos_turns(u.y, &sin_phi, &cos_phi);
    const Frame frame = frame_of(-normalize3(to));
    *ng = normalize3(to_world(frame, (float3)(sin_alpha * cos_phi, sin_alpha * sin_phi, cos_alpha)));
    *pdf = ONE_OVER_TWO_PI / cone;
    *error = sphere_error(center, r, *ng);
    return sphere_point(center, r, *ng);
}

static float sphere_pdf(global const Shape *s, const float3 from, const float3 p, const float3 ng, const float3 wi)
{
    const float sin2_max = sphere_sin2(xyz(s->center) - from, s->center.w);
    return sin2_max > 0.0f ? ONE_OVER_TWO_PI / versine(sin2_max)
                           : density_by_area(from, p, ng, sphere_area(s->center.w));
}

#if HAS_TEXTURED
// Longitude in turns, 1/2 where the local z axis comes out, and latitude from -y to +y.
static float2 sphere_uv(global const Shape *s, const float3 p, const float3 ng)
{
    const float3 q = (float3)(dot3(xyz(s->inverse_u), ng), dot3(xyz(s->inverse_v), ng), dot3(xyz(s->inverse_w), ng));
    const float across = sqrt_of(q.x * q.x + q.z * q.z);
    return (float2)(0.5f + atan2_turns(q.x, q.z), 0.5f + 2.0f * atan2_turns(q.y, across));
}
#endif

#if HAS_RELIEF
// No tangent along u at the poles.
static void sphere_tangents(global const Shape *s, const float3 p, const float3 ng, float3 *along_u, float3 *along_v)
{
    const float r = s->center.w;
    const float3 q = r * (float3)(dot3(xyz(s->inverse_u), ng), dot3(xyz(s->inverse_v), ng), dot3(xyz(s->inverse_w), ng));
    const float across = sqrt_of(q.x * q.x + q.z * q.z);
    const float inverse = across > 0.0f ? q.y / across : 0.0f;
    *along_u = 6.28318531f * (q.z * xyz(s->u) - q.x * xyz(s->w));
    *along_v = PI * (across * xyz(s->v) - inverse * (q.x * xyz(s->u) + q.z * xyz(s->w)));
}
#endif
