"""The closed set of switches that a scene turns on. They follow kinds and keys that a scene declares, never values.

The same set decides which source is pasted, which buffers exist and which waves run; the ledger lists what is off.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache

from raytide.kernels.paths import kernel_dir

SKIES = ("environment", "environment_map", "sun")  # lights that rays without a hit see
WHOLE_SKIES = ("environment", "environment_map")  # those that fill all directions
Parameters = tuple[tuple[str, int], ...]


@cache
def kinds(group: str) -> tuple[str, ...]:
    """All kinds of a group ("material", "shape", ...): the files of that folder. A kind's number is its place."""
    helpers = {"pick", "tree"}
    return tuple(sorted(p.stem for p in (kernel_dir() / group).glob("*.cl") if p.stem not in helpers))


def kind_number(group: str, kind: str) -> int:
    """The number that stands for `kind` in records; ValueError where no such kernel file exists."""
    return kinds(group).index(kind)


@dataclass(frozen=True)
class Features:
    """What one scene needs of the kernels.

    `materials` pairs each kind with its device parameters (name, number of floats) in the order of packing.
    """

    materials: tuple[tuple[str, Parameters], ...] = ()
    shapes: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()
    textures: tuple[str, ...] = ()  # kinds that materials read
    triangles: bool = True  # any triangle mesh
    smooth: bool = False  # vertex normals
    tree: bool = True  # off: brute force
    lens: bool = False  # thin lens
    orthographic: bool = False
    gaussian: bool = False  # pixel filter, else box or centre
    tent: bool = False
    mitchell: bool = False
    catmull_rom: bool = False
    lanczos: bool = False
    center: bool = False  # every ray through the exact pixel centre
    local: bool = False  # integrator local, else path
    photon: bool = False  # integrator photon: light is traced from the lights to the camera
    caustics: bool = False  # integrator path: light that mirrors and clear glass gather is traced so
    clamp: bool = False  # what one vertex adds to a sample is bounded, and what that cuts away is counted
    regularised: bool = False  # lobes are wider at vertices of paths that scattered before
    sobol: bool = True  # else plain random numbers
    chance_sky: bool = False  # the sky is found by rays that scatter alone, never by shadow rays
    daylight: bool = False  # the sky follows a formula
    hidden_sky: bool = False  # the camera does not see the sky
    light_tree: bool = False  # lights are picked by a tree of bounds, else by an alias table
    blue_noise: bool = False  # neighbouring pixels share a sequence
    adaptive: bool = False  # tiles have numbers of samples of their own
    transmission: bool = False  # any material that light passes through
    beckmann: bool = False  # any material that names the law of its facets
    one_sided: bool = False  # any material that names whether its back is like its front
    opacity: bool = False  # any material that light may pass as if nothing were there
    nested: bool = False  # any clear material that names its priority where bodies overlap
    absorption: bool = False  # any material whose inside absorbs
    subsurface: bool = False  # any material whose inside scatters
    compensation: bool = False  # any rough metal that gives back what further facets reflect
    tangents: bool = False  # any material that differs along the surface's two directions
    instances: bool = False  # meshes that several objects share
    visibility: bool = False  # objects that some kinds of ray do not meet
    compact: bool = False  # trees in the compact layout, else the wide one
    relief: bool = False  # normal or bump maps
    counters: bool = False  # instrumented build
    leaky: bool = False  # only in the benchmark of rays: a triangle test that leaks, to compare with

    @property
    def material_kinds(self) -> tuple[str, ...]:
        return tuple(kind for kind, _ in self.materials)

    @property
    def picked_lights(self) -> tuple[str, ...]:
        """Kinds that shadow rays go to."""
        return tuple(kind for kind in self.lights if not (self.chance_sky and kind in WHOLE_SKIES))

    @property
    def emits(self) -> bool:
        """Whether light is traced from the lights."""
        return self.photon or self.caustics

    def switches(self) -> dict[str, bool]:
        """Every switch by name, HAS_ left away; programs define those that they mention as 0 or 1."""
        on = {field.name: bool(getattr(self, field.name)) for field in fields(self) if field.type == "bool"}
        present_of = {"material": self.material_kinds, "shape": self.shapes, "light": self.lights}
        present_of["texture"] = self.textures
        for group, present in present_of.items():
            on |= {kind: kind in present for kind in kinds(group)}
        on["analytic"] = any(shape != "plane" for shape in self.shapes)
        on["lights"] = bool(self.picked_lights)
        on["several_materials"] = len(set(self.material_kinds) - {"emissive"}) > 1
        on["sky"] = any(light in SKIES for light in self.lights)
        on["textured"] = bool(self.textures) or self.relief  # materials
        on["textures"] = on["textured"] or "environment_map" in self.lights or self.tangents  # buffers of texels and uv
        on["copied"] = on["textured"] or self.nested  # kernels work on a material's own copy at a point
        on["absorption"] |= self.nested
        on["triangles"] |= self.instances  # which are made of them
        on["compact"] = self.compact and self.tree
        return dict(sorted(on.items()))

    def left_out(self) -> list[str]:
        """Names of the switches that are off."""
        return [name for name, on in self.switches().items() if not on]

    def with_counters(self) -> Features:
        return replace(self, counters=True)
