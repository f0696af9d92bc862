"""Which tree builder runs, and the packing into 8-wide nodes and leaf blocks."""

from raytide.accel.build import build_tree, tree_sources
from raytide.accel.refit import refit_tree, update_tree
from raytide.accel.tree import FlatGeometry, Tree, TreeStats

__all__ = ["FlatGeometry", "Tree", "TreeStats", "build_tree", "refit_tree", "tree_sources", "update_tree"]
