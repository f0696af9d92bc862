#pragma OPENCL FP_CONTRACT OFF

// Pixel of the window that item `lane` of a tile's 64 works at: tiles, and pixels inside of them, go row by row. Tiles at
// the border reach beyond it.
static uint2 tile_pixel(global const Settings *settings, const uint tile, const uint lane)
{
    return (uint2)((tile % settings->tiles_x) * TILE_SIDE + lane % TILE_SIDE,
                   (tile / settings->tiles_x) * TILE_SIDE + lane / TILE_SIDE);
}
