#pragma OPENCL FP_CONTRACT OFF

// Pixel of the window that item `lane` of a tile's 64 works at: tiles, and pixels inside of them, go row by row. Tiles at
// the border reach beyond it.
static uint2 tile_pixel(global const Settings *settings, const uint tile, const uint lane)
{
    return (uint2)((tile % settings->tiles_x) * TILE_SIDE + lane % TILE_SIDE,
                   (tile / settings->tiles_x) * TILE_SIDE + lane / TILE_SIDE);
}

// Where item `place` of a tile's 64 x `samples` stands among them when they are traced: all samples of a pixel follow each
// other, and pixels go along a Z-order curve (Morton 1966), so that rays in a row leave through as few pixels as can be.
static uint traced_at(const uint place, const uint samples)
{
    const uint z = place / samples;
    const uint x = (z & 1u) | ((z >> 1) & 2u) | ((z >> 2) & 4u);
    const uint y = ((z >> 1) & 1u) | ((z >> 2) & 2u) | ((z >> 3) & 4u);
    return (place % samples) * TILE + y * TILE_SIDE + x;
}
