#pragma OPENCL FP_CONTRACT OFF
// State of a path between waves, one slot each: throughput (xyz) with the pdf of its last direction (w), and path words:
// x = index in `samples`, y = edges so far | medium << PATH_MEDIUM_SHIFT | PATH_DELTA | PATH_CAUSTIC or PATH_SCATTERED,
// z = pixel_name, w = sample number.

#define PATH_DELTA 0x80000000u  // the last direction came from a single-direction lobe: no light sampling competes
#if HAS_CAUSTICS
#define PATH_CAUSTIC 0x8000u  // scattered to many directions where the camera looks, and to single ones ever since
#define PATH_EDGES 0x7fffu
#elif HAS_REGULARISED
#define PATH_CAUSTIC 0u
#define PATH_SCATTERED 0x8000u  // scattered to many directions, be it long ago
#define PATH_EDGES 0x7fffu
#else
#define PATH_CAUSTIC 0u
#define PATH_EDGES 0xffffu
#endif
#define PATH_MEDIUM_SHIFT 16  // index + 1 of the absorbing material that the path is inside of; 0: none

// The record of material `number` that a path of `words` meets. Behind every record stands that of the same surface with
// wider lobes, which paths meet once they scattered (render/regularise.py).
#if HAS_REGULARISED
#define RECORD_MET(number, words) ((number) + (((words) & PATH_SCATTERED) / PATH_SCATTERED))
#else
#define RECORD_MET(number, words) number
#endif

// Where a path last scattered (xyz), and how many surfaces it passed as if they were not there (w, bits).
#if HAS_OPACITY
#define SCATTERINGS_ARGUMENT , global float4 *scatterings
#define SCATTERINGS , scatterings
#else
#define SCATTERINGS_ARGUMENT
#define SCATTERINGS
#endif

// The clear bodies that a path is inside of (wave/nested.cl), where they may overlap.
#if HAS_NESTED
#define MEDIA_ARGUMENT , global uint4 *all_media
#define MEDIA , all_media
#else
#define MEDIA_ARGUMENT
#define MEDIA
#endif

#define MEDIA_OVERFLOW -1.0f  // w of a sample whose path was inside too many bodies

// Status of a slot after `shade`, read by `partition`
#define STATUS_ALIVE 1u   // trace its next ray
#define STATUS_SHADOW 2u  // trace its shadow ray
#define STATUS_EDGES_SHIFT 8

// Sets of sample dimensions: one for the camera, then two an edge; what takes which of them: wave/numbers.cl
#define SET_CAMERA 0u
#define SET_LIGHT(edge) (2u * (edge) - 1u)
#define SET_BSDF(edge) (2u * (edge))
#define SET_PASS(passed) (0x1000000u + (passed))  // beyond all edges: surfaces that the path passed
#define SET_BLEND(edge) (0x2000000u + (edge))
#define SET_EMIT 0x3000000u  // where light leaves a light, and which light
#define SET_EMIT_LIGHT 0x3000001u
#define SET_EMIT_AIM 0x3000002u  // and towards what

// How likely the vertex that the camera sees was to send the path the way it went, and where lamps send their light to
// (wave/caustic.cl).
#if HAS_CAUSTICS
#define CAUSTICS_ARGUMENT , global float *densities, global const float4 *aims
#define CAUSTICS , densities, aims
#define CAUSTIC_END(slot) caustic_end(densities[slot], aims)
#else
#define CAUSTICS_ARGUMENT
#define CAUSTICS
#define CAUSTIC_END(slot) caustic_end(0.0f, 0)
#endif

// Whether light that is traced from the lamps could have found what the path meets now.
static int is_caustic(const uint words)
{
    return (words & PATH_CAUSTIC) != 0u && (words & PATH_DELTA) != 0u;
}

// The words of a path that goes on from its vertex, behind `words`, along a single direction or not.
static uint words_onward(const uint words, const int delta, const uint medium)
{
    const uint edges = (words & PATH_EDGES) + 1u;
#if HAS_REGULARISED
    const uint mark = words & PATH_SCATTERED;
#else
    const uint mark = edges == 2u ? (delta ? 0u : PATH_CAUSTIC) : (delta ? words & PATH_CAUSTIC : 0u);
#endif
    return edges | mark | (delta ? PATH_DELTA : 0u) | (medium << PATH_MEDIUM_SHIFT);
}

#define LOOK_AHEAD 8u  // items of a queue between the one at work and the one whose slot is asked for

// Whether paths scatter inside bodies; in the integrators local and photon these only weaken light
#define WALKS (HAS_SUBSURFACE && !HAS_LOCAL && !HAS_PHOTON)

#define T_MAX_FREE 3.0e38f  // rays without an end; finite, so that every comparison stays ordered
#define MISS_AT_ONCE -1.0f  // t_max of slots that hold no ray
