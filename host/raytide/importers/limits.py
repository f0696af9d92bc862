"""Sizes beyond which a file is refused before anything is allocated for it, and the range of usable coordinates."""

LARGEST = 1.8e18  # coordinates; the square is still finite in float32
SMALLEST = 1e-18  # lengths; the square is still a normal float32

MOST_BYTES = 1 << 30  # of one geometry file or buffer
MOST_TRIANGLES = 1 << 26
MOST_VERTICES = 1 << 27
MOST_HEADER = 1 << 20  # bytes of a PLY header
