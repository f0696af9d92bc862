"""What goes into a tree builder and what comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from raytide.kernels.records import NONE, RECORDS

if TYPE_CHECKING:
    from raytide.device import Buffer, Device

LEAF_BIT = np.uint32(0x80000000)
ANALYTIC_BIT = np.uint32(0x40000000)
EMPTY_LOW, EMPTY_HIGH = np.float32(1e30), np.float32(-1e30)

LOW_ROWS = ("lox", "loy", "loz")
HIGH_ROWS = ("hix", "hiy", "hiz")


@dataclass(frozen=True)
class FlatGeometry:
    """All that can be hit, in metres relative to the geometry's origin.

    vertices (V, 4) float32, xyz and 0; triangles (T, 4) uint32, three vertices and the object; shapes (S,) of the
    record Shape, the `plane_count` infinite planes first and the `instance_count` instances of meshes last. Triangle i
    has primitive id i, shape j has T + j.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    shapes: np.ndarray = field(default_factory=lambda: np.zeros(0, RECORDS["Shape"].dtype))
    plane_count: int = 0
    instance_count: int = 0

    @property
    def primitive_count(self) -> int:
        """Primitives that belong in the tree: triangles, and shapes other than planes."""
        return len(self.triangles) + len(self.shapes) - self.plane_count


@dataclass(frozen=True)
class TreeStats:
    """What was built, by which means, and at what price.

    sah_cost = (sum of the surfaces of all inner nodes and of all leaves) / surface of the root, where a leaf is one
    block of up to 8 triangles or one shape: the visits that a random line through the root's box pays for, nodes and
    leaves at 1 each (MacDonald and Booth 1990; Goldsmith and Salmon 1987). Where the root has no surface each counts 1.
    """

    builder: str  # what ran: "sah" where another tree was too deep, or "sah-hq" on the host
    place: str  # "device" or "host"
    layout: str  # "wide": records Node and Block; "compact": CompactNode and CompactTriangle
    nodes: int
    leaves: int
    depth: int  # inner nodes from root to leaf, at most
    sah_cost: float
    leaf_fill: float  # triangles per block, mean
    bytes: int
    bytes_per_triangle: float
    build_s: float  # wall time of the build without that of compiling kernels
    kernel_build_s: float  # 0 where no kernel was needed
    built_cost: float  # sah_cost when it was built
    refits: int = 0  # how often its boxes followed motion since
    refit_s: float = 0.0  # wall time of the last one


@dataclass(frozen=True)
class Packed:
    """Nodes (n,) of the record Node, and the blocks: on the host, or on a device until someone asks for them."""

    nodes: np.ndarray
    block_count: int
    read_blocks: Callable[[], np.ndarray]
    level_starts: tuple[int, ...]  # first node of each level from the root down; nodes lie breadth first
    buffers: tuple[Buffer, Buffer] | None = None  # nodes, blocks
    device: Device | None = None


class Tree:
    """The 8-wide tree: `nodes` and `blocks` are arrays of the records Node and Block; node 0 is the root.

    Builder "none" gives no nodes, and blocks in order of triangle id.
    """

    def __init__(self, packed: Packed, stats: TreeStats) -> None:
        self._packed = packed
        self.stats = stats

    @property
    def nodes(self) -> np.ndarray:
        return self._packed.nodes

    @property
    def level_starts(self) -> tuple[int, ...]:
        """First node of each level from the root down; nodes lie breadth first."""
        return self._packed.level_starts

    @property
    def block_count(self) -> int:
        return self._packed.block_count

    @cached_property
    def blocks(self) -> np.ndarray:
        """Blocks on the host; copied from the device when first asked for."""
        return self._packed.read_blocks()

    def buffers(self, device: Device) -> tuple[Buffer, Buffer]:
        """Nodes and blocks on `device`: those of the build where it ran there, else a copy."""
        if self._packed.buffers is not None and self._packed.device is device:
            return self._packed.buffers
        return device.upload(self.nodes), device.upload(self.blocks)


def empty_nodes(count: int) -> np.ndarray:
    """`count` nodes with nothing but empty lanes."""
    nodes = np.zeros(count, RECORDS["Node"].dtype)
    nodes["child"] = NONE
    for low, high in zip(LOW_ROWS, HIGH_ROWS, strict=True):
        nodes[low], nodes[high] = EMPTY_LOW, EMPTY_HIGH
    return nodes


def node_boxes(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corners of all lanes, each (nodes, 8, 3) float32; empty lanes have low > high."""
    return (
        np.stack([nodes[row] for row in LOW_ROWS], axis=-1),
        np.stack([nodes[row] for row in HIGH_ROWS], axis=-1),
    )


def sah_cost(nodes: np.ndarray) -> float:
    """The cost of TreeStats.sah_cost from packed nodes; 0 for an empty tree."""
    filled = nodes["lox"] <= nodes["hix"]
    if not filled.any():
        return 0.0
    low, high = node_boxes(nodes[:1])
    span = high[0][filled[0]].max(axis=0).astype(np.float64) - low[0][filled[0]].min(axis=0)
    root = span[0] * span[1] + span[1] * span[2] + span[2] * span[0]
    if not root > 0:
        return float(1.0 + filled.sum())
    unit = np.float32(min(1.0 / span.max(), 1e38))  # keeps products of float32 edges in range; each errs by 1e-7
    rows = zip(LOW_ROWS, HIGH_ROWS, strict=True)
    x, y, z = (np.where(filled, nodes[high] - nodes[low], np.float32(0)) * unit for low, high in rows)
    surface = (x * y + y * z + z * x).sum(dtype=np.float64)
    return float(1.0 + surface * span.max() ** 2 / root)
