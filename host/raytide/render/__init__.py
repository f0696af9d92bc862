"""Where scene, kernels, tree and device meet: renders a scene into a film."""

from raytide.render.checkpoint import Checkpoints
from raytide.render.film import Film
from raytide.render.renderer import Renderer
from raytide.render.shard import merge

__all__ = ["Checkpoints", "Film", "Renderer", "merge"]
