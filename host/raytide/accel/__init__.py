"""Which tree builder runs, and the packing into 8-wide nodes and leaf blocks."""

from raytide.accel.build import build_tree, tree_sources
from raytide.accel.compact import compact_source, compact_tree
from raytide.accel.forest import Forest
from raytide.accel.refit import refit_tree, update_tree
from raytide.accel.tree import FlatGeometry, Tree, TreeStats

__all__ = [
    "FlatGeometry", "Forest", "Tree", "TreeStats", "build_tree", "compact_source", "compact_tree", "refit_tree",
    "tree_sources", "update_tree",
]  # fmt: skip
