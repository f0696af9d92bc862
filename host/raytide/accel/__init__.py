"""Which tree builder runs, and the packing into 8-wide nodes and leaf blocks."""

from raytide.accel.build import build_tree, tree_sources
from raytide.accel.forest import Forest
from raytide.accel.refit import refit_tree
from raytide.accel.tree import FlatGeometry, Tree, TreeStats

__all__ = ["FlatGeometry", "Forest", "Tree", "TreeStats", "build_tree", "refit_tree", "tree_sources"]
