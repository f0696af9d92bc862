"""The builders of cl/build/ driven on a device."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.boxes import centers_of, edge_scale, shape_boxes
from raytide.accel.limits import kernel_constant
from raytide.accel.morton import grid_scale, refined_order
from raytide.accel.reinsertion import reinserted
from raytide.accel.tree import FlatGeometry, Packed
from raytide.accel.wide import GROUP_NAME, Cut, by_depth
from raytide.kernels import RECORDS, Features, Source, assemble

if TYPE_CHECKING:
    from raytide.device import Buffer, Device, Program

# Primitives per work-item in passes over all of them, and per subtree that one work-item builds alone: large enough
# to hide the launch on a CPU, small enough to occupy a GPU. The tree does not depend on either.
_CHUNK = {"gpu": 512}
_SUBTREE = {"gpu": 128}
_CHUNK_OTHERWISE = 8192
_SUBTREE_OTHERWISE = 4096
_LOCAL = 64
_DIGITS = 256  # build/radix.cl
_IS_GROUP = 1 << 24  # build/hierarchy.cl

NO_PROGRAMS: Mapping[str, Program] = MappingProxyType({})


# Programs by the start of their kernels' names; all other kernels are in "bvh".
_PROGRAMS = {"top": "bvh_sah", "subtrees": "bvh_sah", "morton": "bvh_lbvh", "radix": "bvh_lbvh",
             "reinsert": "bvh_reinsert", "refit": "bvh_refit"}  # fmt: skip
_ENTRIES = {"bvh": "bvh", "bvh_sah": "sah", "bvh_lbvh": "lbvh", "bvh_reinsert": "reinsert_order", "bvh_refit": "refit"}
_OF_BUILDER = {"sah": ("bvh", "bvh_sah"), "sah-hq": ("bvh", "bvh_sah", "bvh_reinsert"), "lbvh": ("bvh", "bvh_lbvh")}


def program_of(kernel: str) -> str:
    """The name of the program that a kernel of cl/build/ is in."""
    return _PROGRAMS.get(kernel.partition("_")[0], "bvh")


def build_source(program: str) -> Source:
    """One of the programs of cl/build/; the same for every scene."""
    return assemble(f"build/{_ENTRIES[program]}.cl", Features())


def build_sources(builder: str, refit: bool = False) -> dict[str, Source]:
    """The programs that a builder runs, by name; with `refit` that of new positions in its trees, too."""
    return {name: build_source(name) for name in (*_OF_BUILDER[builder], *(("bvh_refit",) if refit else ()))}


class BuildPrograms:
    """The programs of cl/build/ on a device: those `given`, and others once a kernel of theirs is launched."""

    def __init__(self, device: Device, given: Mapping[str, Program]) -> None:
        self._device, self._programs = device, {name: given[name] for name in _ENTRIES if name in given}
        self._before = {name: _compiled_s(program) for name, program in self._programs.items()}

    def of(self, kernel: str) -> Program:
        name = program_of(kernel)
        if name not in self._programs:
            self._programs |= self._device.build({name: build_source(name)})
        return self._programs[name]

    @property
    def build_s(self) -> float:
        """Seconds that compiling took since the start: of programs, and of kernels at their first launch."""
        return sum(_compiled_s(program) - self._before.get(name, 0.0) for name, program in self._programs.items())


def _compiled_s(program: Program) -> float:
    return program.build_s + program.first_launch_s


class DeviceBuilder:
    """Binary trees by kernels. Every launch is in order; nothing is read back but what the host needs to go on."""

    def __init__(
        self, geometry: FlatGeometry, device: Device, programs: Mapping[str, Program] = NO_PROGRAMS
    ) -> None:
        self.geometry, self.device = geometry, device
        self._programs = BuildPrograms(device, programs)
        self.count = geometry.primitive_count
        self.chunk = _CHUNK.get(device.kind, _CHUNK_OTHERWISE)
        self.vertices, self.triangles = device.upload(geometry.vertices), device.upload(geometry.triangles)
        self._boxes = self._primitive_boxes()
        self._read_bounds()
        self._sah_tree: tuple[Buffer, Buffer] | None = None

    @property
    def kernel_build_s(self) -> float:
        """Seconds that compiling took since the start."""
        return self._programs.build_s

    def launch(self, kernel: str, items: int, *arguments: Buffer | np.generic, local: int = _LOCAL) -> None:
        """`items` work-items; kernels take their number as first argument."""
        self.device.launch(self._programs.of(kernel), kernel, items, local, np.uint32(items), *arguments, label="build")

    def _primitive_boxes(self) -> Buffer:
        boxes = self.device.empty(self.count * 32)
        triangles = len(self.geometry.triangles)
        if triangles:
            self.launch("triangle_boxes", triangles, self.vertices, self.triangles, boxes)
        if self.count > triangles:
            self.device.write(boxes, shape_boxes(self.geometry), offset=32 * triangles)
        return boxes

    def _read_bounds(self) -> None:
        """Low and high doubled centres of all primitives, and the scale of the whole scene."""
        chunks = -(-self.count // self.chunk)
        buffer = self.device.empty(chunks * 64)
        self.launch("scene_boxes", chunks, np.uint32(self.count), np.uint32(self.chunk), self._boxes, buffer, local=1)
        rows = self.device.read(buffer, np.float32, chunks * 16).reshape(chunks, 2, 8).min(axis=0)
        self.scale = np.float32(edge_scale(rows[:1])[0])
        self._low, self._high = rows[1, :3], -rows[1, 4:7]

    def tree(self, builder: str) -> DeviceTree:
        """The binary tree by "sah", "sah-hq" or "lbvh"; once the first two used up the builder's boxes, only "sah"."""
        if builder == "lbvh":
            levels = self.device.empty(max(self.count - 1, 1) * 2)
            return DeviceTree(self, self._lbvh(levels), levels)
        if self._sah_tree is None:
            levels = self.device.empty(max(self.count - 1, 1) * 2)
            self._sah_tree = self._sah(levels), levels
        best = DeviceTree(self, *self._sah_tree)
        if builder == "sah-hq" and self.count > 2:
            for ordered, levels in reinserted(best):
                tree = DeviceTree(self, ordered, levels)
                best = tree if tree.cost < best.cost else best
        return best

    def _lbvh(self, levels: Buffer) -> Buffer:
        device, count = self.device, self.count
        codes, order, ordered = device.empty(count * 8), device.empty(count * 4), device.empty(count * 32)
        scale = np.float32(grid_scale(self._low, self._high))
        self.launch("morton_codes", count, *self._low, scale, self._boxes, codes, order)
        self._sort(codes, order)
        long_run = device.empty(4)
        device.fill(long_run, 0, 4)
        self.launch("morton_order", count, order, codes, self._boxes, ordered, levels, long_run)
        if device.read(long_run, np.uint32, 1)[0]:
            self._refine(codes, order, ordered, levels)
        return ordered

    def _sort(self, keys: Buffer, values: Buffer) -> None:
        """Stable sort by 63-bit keys, in place: 8 passes of 8 bits end where they began."""
        device, chunk = self.device, np.uint32(4 * self.chunk)
        chunks = -(-self.count // int(chunk))
        other_keys, other_values = device.empty(self.count * 8), device.empty(self.count * 4)
        histogram, totals = device.empty(chunks * _DIGITS * 4), device.empty(_DIGITS * 4)
        for shift in range(0, 64, 8):
            pass_over: tuple[Buffer | np.uint32, ...] = (np.uint32(self.count), chunk, np.uint32(shift), keys)
            self.launch("radix_count", chunks, *pass_over, histogram, local=1)
            self.launch("radix_rows", _DIGITS, np.uint32(chunks), histogram, totals)
            self.launch("radix_move", chunks, *pass_over, values, histogram, totals, other_keys, other_values, local=1)
            keys, values, other_keys, other_values = other_keys, other_values, keys, values

    def _refine(self, codes: Buffer, order: Buffer, ordered: Buffer, levels: Buffer) -> None:
        """Orders runs of equal codes again, on the host: rare."""
        device, count = self.device, self.count
        boxes = device.read(self._boxes, np.float32, count * 8).reshape(count, 8)
        centers = centers_of(boxes)
        new_order, new_levels = refined_order(
            device.read(order, np.uint32, count), device.read(codes, np.uint64, count), lambda i: centers[i]
        )
        device.write(ordered, boxes[new_order])
        device.write(levels, new_levels)

    def _sah(self, levels: Buffer) -> Buffer:
        device, count = self.device, self.count
        even, odd = self._boxes, device.empty(count * 32)  # the boxes in id order end here
        limit = max(_SUBTREE.get(device.kind, _SUBTREE_OTHERWISE), kernel_constant("build/sah_subtree.cl", "SWEEP"))
        tasks, active = [], np.array([[0, count]], np.int64)
        for depth in range(count):
            source, target = (even, odd) if depth % 2 == 0 else (odd, even)
            done = active[:, 1] <= limit
            small = np.empty((done.sum(), 4), np.uint32)
            small[:, :2], small[:, 2], small[:, 3] = active[done], depth, depth % 2
            tasks.append(small)
            active = active[~done]
            if not len(active):
                break
            active = self._split_level(active, depth, source, target, levels)
        todo = np.concatenate(tasks)
        todo = todo[np.argsort(-todo[:, 1].astype(np.int64), kind="stable")]  # long ones first: threads end together
        self.launch("subtrees", len(todo), device.upload(todo), even, odd, levels, local=1)
        return even

    def _split_level(
        self, active: np.ndarray, depth: int, source: Buffer, target: Buffer, levels: Buffer
    ) -> np.ndarray:
        """Splits all nodes (first, count) of one depth of the SAH tree; gives their children."""
        device = self.device
        per_node = -(-active[:, 1] // self.chunk)
        first_chunk = np.concatenate([[0], np.cumsum(per_node)])
        nodes = np.zeros((len(active) + 1, 4), np.uint32)
        nodes[:-1, :2], nodes[:, 2], nodes[:, 3] = active, depth, first_chunk
        chunks = np.empty((first_chunk[-1], 4), np.uint32)
        chunks[:, 0] = np.repeat(np.arange(len(active)), per_node)
        place = (np.arange(len(chunks)) - first_chunk[chunks[:, 0]]) * self.chunk
        chunks[:, 1], chunks[:, 3] = active[chunks[:, 0], 0] + place, place
        chunks[:, 2] = np.minimum(self.chunk, active[chunks[:, 0], 1] - place)
        bins = 3 * kernel_constant("build/bins.cl", "BINS")
        node_buffer, chunk_buffer = device.upload(nodes), device.upload(chunks)
        chunk_boxes, frames = device.empty(len(chunks) * 32), device.empty(len(active) * 32)
        chunk_bins, chunk_counts = device.empty(len(chunks) * bins * 32), device.empty(len(chunks) * bins * 4)
        splits, before = device.empty(len(active) * 16), device.empty(len(chunks) * 4)
        self.launch("top_centers", len(chunks), chunk_buffer, source, chunk_boxes, local=1)
        self.launch("top_frames", len(active), node_buffer, chunk_boxes, frames, local=1)
        self.launch("top_bins", len(chunks), chunk_buffer, source, frames, chunk_bins, chunk_counts, local=1)
        self.launch(
            "top_splits", len(active), node_buffer, chunk_buffer, chunk_bins, chunk_counts, splits, before, levels,
            local=1,
        )  # fmt: skip
        self.launch(
            "top_partition", len(chunks), node_buffer, chunk_buffer, splits, before, source, target, local=1
        )
        left = device.read(splits, np.uint32, len(active) * 4).reshape(-1, 4)[:, 2].astype(np.int64)
        children = np.stack([active[:, 0], left, active[:, 0] + left, active[:, 1] - left], axis=1)
        return children.reshape(-1, 2)


class DeviceTree:
    """Binary tree on the device, as raytide.accel.wide.BinaryTree; at least two primitives."""

    def __init__(self, builder: DeviceBuilder, ordered: Buffer, levels: Buffer) -> None:
        device, count = builder.device, builder.count
        self.builder, self.ordered = builder, ordered
        self._triangles = np.uint32(len(builder.geometry.triangles))
        gaps = count - 1
        self.boxes, self.links, costs = device.empty(gaps * 32), device.empty(gaps * 16), device.empty(gaps * 32)
        rest = device.empty(gaps * 2)
        chunks, sizes = -(-count // builder.chunk), (np.uint32(count), np.uint32(builder.chunk))
        arrays = (self.boxes, self.links, costs)
        builder.launch(
            "join_chunks", chunks, *sizes, self._triangles, builder.scale, levels, ordered, *arrays, rest, local=1
        )
        lists = by_depth(device.read(rest, np.uint16, gaps))
        if lists:
            gap_buffer = device.upload(np.concatenate(lists).astype(np.uint32))
            builder.launch("link_rest", sum(map(len, lists)), np.uint32(gaps), gap_buffer, levels, self.links)
            first = sum(map(len, lists))
            for part in reversed(lists):
                first -= len(part)
                builder.launch(
                    "join_rest", len(part), np.uint32(first), self._triangles, builder.scale, gap_buffer, ordered,
                    *arrays,
                )  # fmt: skip
        self.root = int(lists[0][0] if lists else device.read(levels, np.uint16, gaps).argmin())
        self.cost = float(device.read(costs, np.float32, 1, offset=32 * self.root)[0])  # times the scale
        if device.read(self.boxes, np.uint32, 1, offset=32 * self.root + 12)[0] & _IS_GROUP:
            self.root |= GROUP_NAME

    def expand(self, roots: np.ndarray, by_levels: bool) -> np.ndarray:
        """Names (m, 8) of the wide children of binary nodes (m,)."""
        device = self.builder.device
        wide = device.empty(len(roots) * 32)
        self.builder.launch(
            "expand", len(roots), self._triangles, np.uint32(by_levels), device.upload(roots), self.ordered, self.boxes,
            self.links, wide,
        )  # fmt: skip
        return device.read(wide, np.uint32, len(roots) * 8).reshape(-1, 8)

    def pack(self, found: Cut) -> Packed:
        """Records of a cut; blocks stay on the device until they are asked for."""
        device, node, block = self.builder.device, RECORDS["Node"], RECORDS["Block"]
        node_count, block_count = len(found.names), len(found.blocks)
        nodes, blocks = device.empty(node_count * node.size), device.empty(block_count * block.size)
        self.builder.launch(
            "pack_nodes", node_count, self._triangles, device.upload(found.names), device.upload(found.numbers),
            self.ordered, self.boxes, self.links, nodes,
        )  # fmt: skip
        self.builder.launch(
            "pack_blocks", block_count, device.upload(found.blocks), self.ordered, self.links,
            self.builder.vertices, self.builder.triangles, blocks,
        )  # fmt: skip
        return Packed(
            device.read(nodes, node.dtype, node_count),
            block_count,
            lambda: device.read(blocks, block.dtype, block_count),
            found.level_starts,
            (nodes, blocks),
            device,
        )
