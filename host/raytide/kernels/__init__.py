"""Text and numpy: record layouts, feature switches and the assembly of OpenCL C sources. Knows no device."""

from raytide.kernels.features import Features
from raytide.kernels.records import NONE, RECORDS
from raytide.kernels.source import Source, assemble

__all__ = ["NONE", "RECORDS", "Features", "Source", "assemble"]
