#pragma OPENCL FP_CONTRACT OFF
// Clear bodies that overlap (Schmidt and Budge 2002, JGT 7(4)): of those that a path is inside of, the one of the highest
// rank counts. A surface inside a body of higher rank is not there; any other parts what lies on its sides.
// Included by wave/shade.cl.
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/spawn.cl"
#include "wave/path.cl"
#include "wave/shading.cl"
#include "wave/vertex.cl"

#if HAS_NESTED
#define LEAST_BEND 1.0e-3f  // of a ratio of indices from 1, as rough boundaries of other scenes must have
#define NESTED_ENTRIES 8u  // two a word: number of a material plus one; 0: free. Their order has no meaning

static uint media_entry(const uint4 media, const uint place)
{
    const uint word = place < 4u ? (place < 2u ? media.x : media.y) : (place < 6u ? media.z : media.w);
    return (word >> (16u * (place & 1u))) & 0xffffu;
}

static uint4 with_entry(const uint4 media, const uint place, const uint entry)
{
    const uint shift = 16u * (place & 1u);
    const uint keep = ~(0xffffu << shift);
    const uint set = entry << shift;
    uint4 out = media;
    out.x = place >> 1 == 0u ? (media.x & keep) | set : media.x;
    out.y = place >> 1 == 1u ? (media.y & keep) | set : media.y;
    out.z = place >> 1 == 2u ? (media.z & keep) | set : media.z;
    out.w = place >> 1 == 3u ? (media.w & keep) | set : media.w;
    return out;
}

// The media with one entry `from` turned into `to`: from 0 inserts, to 0 removes. *found: whether there was one; what is
// not there cannot be left.
static uint4 media_changed(const uint4 media, const uint from, const uint to, int *found)
{
    *found = 0;
    for (uint i = 0u; i < NESTED_ENTRIES; i++) {
        if (media_entry(media, i) == from) {
            *found = 1;
            return with_entry(media, i, to);
        }
    }
    return media;
}

static uint rank_of(global const Material *materials, const uint entry)
{
    return entry ? materials[entry - 1u].flags >> MATERIAL_RANK_SHIFT : 0u;
}

// The entry of the highest rank; 0: none.
static uint top_of(global const Material *materials, const uint4 media)
{
    uint best = 0u;
    for (uint i = 0u; i < NESTED_ENTRIES; i++) {
        const uint entry = media_entry(media, i);
        best = rank_of(materials, entry) > rank_of(materials, best) ? entry : best;
    }
    return best;
}

// The media before and behind a boundary of a ranked material, of which the path is in one.
typedef struct {
    uint4 front;
    uint4 behind;
    int fits;
} NestedSides;

static NestedSides nested_sides(const PathVertex *v, const uint4 media)
{
    const uint entry = v->number + 1u;
    int found;
    NestedSides out;
    out.fits = 1;
    if (v->cos_o > 0.0f) {
        out.front = media;
        out.behind = media_changed(media, 0u, entry, &out.fits);
    } else {
        out.behind = media;
        out.front = media_changed(media, entry, 0u, &found);
    }
    return out;
}

// Takes the index in front of a ranked boundary for that of nothing. A rough boundary that hardly bends is a smooth one:
// light goes straight on, and no facet in particular joins two such directions.
static void stand_before(Material *m, const float index)
{
    m->p0.x = m->p0.x / index;
    if (abs_of(m->p0.x - 1.0f) < LEAST_BEND) {
        m->p1.w = m->p2.x = 0.0f;  // alphas of the kinds that have them
    }
}
#endif

// Settles what a boundary parts: *v gets the medium before it and the ratio of both indices. Returns whether the path is
// done here: it goes straight on through a boundary that is not there, or is inside too many bodies to be told apart.
static int settle_nested(const Shading *s, PathVertex *v, const Ray ray, const uint4 path, const uint slot,
                         const uint item MEDIA_ARGUMENT)
{
#if HAS_NESTED
    const uint rank = v->material.flags >> MATERIAL_RANK_SHIFT;
    v->front = 0u;
    v->ranked = rank != 0u || rank_of(s->materials, v->medium) != 0u;
    if (rank == 0u) {
        return 0;
    }
    const NestedSides sides = nested_sides(v, all_media[slot]);
    if (!sides.fits) {
        s->samples[path.x] = (float4)(INFINITY, INFINITY, INFINITY, MEDIA_OVERFLOW);
        return 1;
    }
    v->front = top_of(s->materials, sides.front);
    if (rank > rank_of(s->materials, v->front)) {
        stand_before(&v->material, v->front ? s->materials[v->front - 1u].p0.x : 1.0f);
        return 0;
    }
    const uint4 beyond = v->cos_o > 0.0f ? sides.behind : sides.front;
    all_media[slot] = beyond;
    s->rays[slot].origin = make4(spawn_origin(&v->surface, xyz(ray.direction)), float_of(v->surface.prim));
    s->throughput[slot] = v->state;
    uint4 onward = path;
    onward.y = (path.y & (PATH_EDGES | PATH_DELTA)) | (top_of(s->materials, beyond) << PATH_MEDIUM_SHIFT);
#if HAS_REGULARISED
    onward.y |= path.y & PATH_SCATTERED;
#endif
    s->paths[slot] = onward;
    s->status[item] = STATUS_ALIVE | ((path.y & PATH_EDGES) << STATUS_EDGES_SHIFT);
    return 1;
#else
    return 0;
#endif
}

// Notes the bodies around a path that goes on.
static void note_media(const PathVertex *v, const NextRay *onward, const uint slot MEDIA_ARGUMENT)
{
#if HAS_NESTED
    if (v->material.flags >> MATERIAL_RANK_SHIFT) {
        const NestedSides sides = nested_sides(v, all_media[slot]);
        all_media[slot] = onward->to_front ? sides.front : sides.behind;
    }
#endif
}
