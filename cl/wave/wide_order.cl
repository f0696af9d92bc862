#pragma OPENCL FP_CONTRACT OFF
// The order in which a work-item shades its part of the queue: by the kind of the material that was met, so that eight
// vertices at once are of one kind where they can be. Included by wave/wide_shade.cl. No vertex knows its neighbours, so
// the order changes no bit.
#include "base/portable.cl"
#include "wave/path.cl"
#include "wave/shading.cl"

#if SORTED
// The kind that `slot` met; the last bin holds those that are shaded alone.
static uint kind_met(const Shading *s, const uint slot)
{
    const uint prim = s->hits[slot].prim;
    if (prim >= s->g.triangle_count) {
        return MATERIAL_KINDS;
    }
    global const Object *object = s->objects + s->g.triangles[prim].v.w;
    return object->light == NONE ? s->materials[RECORD_MET(object->material, s->paths[slot].y)].kind : MATERIAL_KINDS;
}

// Places of the queue from `begin` to below `end`, SHADE_RAYS or fewer, by counting; those of one kind keep their order.
static void order_by_kind(const Shading *s, const uint begin, const uint end, uint *order)
{
    uint next[MATERIAL_KINDS + 1u];
    for (uint k = 0u; k <= MATERIAL_KINDS; k++) {
        next[k] = 0u;
    }
    uchar kinds[SHADE_RAYS];
    for (uint i = begin; i < end; i++) {
        const uint soon = s->hits[s->queue[i + LOOK_AHEAD < end ? i + LOOK_AHEAD : i]].prim;
        PREFETCH(s->g.triangles + (soon < s->g.triangle_count ? soon : 0u));
        PREFETCH(s->hits + s->queue[i + 3u * LOOK_AHEAD < end ? i + 3u * LOOK_AHEAD : i]);
        const uint kind = kind_met(s, s->queue[i]);
        kinds[i - begin] = (uchar)kind;
        next[kind]++;
    }
    uint before = 0u;
    for (uint k = 0u; k <= MATERIAL_KINDS; k++) {
        const uint here = next[k];
        next[k] = before;
        before += here;
    }
    for (uint i = begin; i < end; i++) {
        const uint kind = kinds[i - begin];
        order[next[kind]] = i;
        next[kind]++;
    }
}
#endif

// Place in the queue of what is shaded as number `i`.
static uint place_of(const Shading *s, const uint i)
{
#if SORTED
    return s->order[i - s->begin];
#else
    return i;
#endif
}

#if WIDE_SHADING
// Places of the eight from `i` on, which is a whole number of eights behind the item's first.
static uint8 places_of(const Shading *s, const uint i)
{
#if SORTED
    return *(const uint8 *)(s->order + (i - s->begin));
#else
    return i + (uint8)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u);
#endif
}

static uint8 slots_of(const Shading *s, const uint8 place)
{
#if SORTED
    global const uint *q = s->queue;
    return (uint8)(q[place.s0], q[place.s1], q[place.s2], q[place.s3], q[place.s4], q[place.s5], q[place.s6],
                   q[place.s7]);
#else
    return *(global const uint8 *)(s->queue + place.s0);
#endif
}

static void put_status(const Shading *s, const uint8 place, const uint8 words)
{
#if SORTED
    global uint *status = s->status;
    status[place.s0] = words.s0;
    status[place.s1] = words.s1;
    status[place.s2] = words.s2;
    status[place.s3] = words.s3;
    status[place.s4] = words.s4;
    status[place.s5] = words.s5;
    status[place.s6] = words.s6;
    status[place.s7] = words.s7;
#else
    *(global uint8 *)(s->status + place.s0) = words;
#endif
}
#endif
