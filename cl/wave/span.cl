#pragma OPENCL FP_CONTRACT OFF
// Which samples of which tile a chunk holds where tiles have numbers of samples of their own (HAS_ADAPTIVE), as groups of
// 64 items: a sample more for each pixel of a tile. The even and the odd pixels of a tile, coloured like a chessboard,
// each have their own range of samples, and a group is the next of each; one that only one colour wants is half empty.
#if HAS_ADAPTIVE
// spans, a tile of the chunk: samples of the pass that its pixels have taken before, first group, groups. ranges, a tile
// of the picture: first sample of even and odd pixels in the pass, then their ends. group_tiles: the chunk's tile of each
// group.
#define SPAN_ARGUMENTS                                                                                                \
    , global const uint4 *spans, global const uint4 *ranges, global const uint *group_tiles
#define SPANS , spans, ranges, group_tiles

// The samples that pixel (x, y) of a tile takes: first and end.
static uint2 range_of(const uint4 range, const uint x, const uint y)
{
    return ((x + y) & 1u) ? (uint2)(range.y, range.w) : (uint2)(range.x, range.z);
}
#else
#define SPAN_ARGUMENTS
#define SPANS
#endif
