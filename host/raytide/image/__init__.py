"""Pictures: EXR and PNG files, tone, error metrics. The only package that imports OpenEXR; it does so on first use."""

from raytide.image.atomic import replacing, write_all, write_file
from raytide.image.exr import ExrImage, ExrWritten, capture_date, read_exr, write_exr
from raytide.image.metrics import ErrorFigure, mse, relmse, smape, tile_means
from raytide.image.png import png_bytes, write_png
from raytide.image.tone import luminance, srgb_bytes, srgb_encode

__all__ = [
    "ErrorFigure",
    "ExrImage",
    "ExrWritten",
    "capture_date",
    "luminance",
    "mse",
    "png_bytes",
    "read_exr",
    "relmse",
    "replacing",
    "smape",
    "srgb_bytes",
    "srgb_encode",
    "tile_means",
    "write_all",
    "write_exr",
    "write_file",
    "write_png",
]
