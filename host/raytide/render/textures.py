"""Textures as device records: one buffer of words for all texels, tables and distributions, one of records, one of the
material parameters that they stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from raytide.importers.srgb import linear_of_bytes
from raytide.kernels.constants import SLOT_HEIGHTS, SLOT_NORMALS, SLOT_OPACITY, WRAPS
from raytide.kernels.features import Features, kind_number
from raytide.kernels.records import RECORDS
from raytide.render.sky import sky_shares
from raytide.scene.flatten import FlatScene
from raytide.scene.layered import layers_of
from raytide.scene.lights import EnvironmentLight, Light, SunSkyLight
from raytide.scene.material_parts import Material
from raytide.scene.painted import FlatTextures
from raytide.scene.texture_check import range_of
from raytide.scene.textures import Bitmap, Checkerboard, Constant, MeshAttribute, Texture

_CURVED, _PLAIN, _TABLES = 0, 256, 512  # words: linear values of sRGB bytes, of plain bytes, and where texels start


@dataclass(frozen=True)
class PackedTextures:
    """Arrays ready for upload: `table` (Texture), `slots` (TextureSlot), texels (words,) uint32, uvs (V, 2) and colors
    (V + T, 4) float32. `sky` is the sky's place in the table; `means` the mean colour (3,) of each
    texture; `first_slots` (materials,) where the slots of each material start."""

    table: np.ndarray
    slots: np.ndarray
    texels: np.ndarray
    uvs: np.ndarray
    colors: np.ndarray
    face_colors: int
    sky: int
    means: dict[str, np.ndarray]
    first_slots: np.ndarray

    @property
    def nbytes(self) -> int:
        return sum(array.nbytes for array in (self.table, self.slots, self.texels, self.uvs, self.colors))


def texture_kinds(flat: FlatScene) -> set[str]:
    """Kinds of texture that materials of objects read."""
    return {model.type for model in flat.textures.models.values()}


def has_relief(flat: FlatScene) -> bool:
    """Whether a material of an object has a normal or bump map."""
    models = dict(zip(flat.material_names, flat.materials, strict=True))
    used = {name for thing in flat.objects for name in layers_of(models, flat.material_names[thing.material])}
    return any(name in models[one].RELIEF for one in used for name in models[one].textures())


def pack_textures(flat: FlatScene, features: Features, materials: np.ndarray) -> PackedTextures:
    """Records of all textures in use; links the rows of `materials` to their slots."""
    textures = flat.textures
    words = [_tables()] if textures.texels or textures.sky is not None else []
    names = list(textures.models)
    table = np.zeros(len(names) + (textures.sky is not None), RECORDS["Texture"].dtype)
    for row, name in zip(table, names, strict=False):
        _fill(row, textures.models[name])
        if name in textures.texels:
            raw = getattr(textures.models[name], "raw", False)
            _add_texels(row, textures.texels[name], words, raw)
    if textures.sky is not None:
        skies = [light for light in flat.lights if light.kernel == "environment_map"]
        beyond = beyond_poles(skies[0], textures.sky) if skies else 0.0
        _add_sky(table[-1], textures.sky, words, beyond)
        words += [light.model().view(np.uint32) for light in skies if isinstance(light, SunSkyLight)]
    used = {flat.material_names.index(name) for thing in flat.objects for name in _layers(flat, thing.material)}
    used |= {i + 1 for i in used} if features.regularised else set()
    slots = _slots([flat.materials[i] if i in used else None for i in range(len(flat.materials))], names, materials)
    read = features.textures
    reads_uv = features.tangents or {"bitmap", "checkerboard"} & set(read)
    return PackedTextures(
        table=table,
        slots=slots,
        texels=np.concatenate(words) if words else np.zeros(0, np.uint32),
        uvs=_rows(textures.uv, flat.stored_vertices if reads_uv else 0, 2),
        colors=_colors(textures, flat, "mesh_attribute" in read),
        face_colors=flat.stored_vertices,
        sky=len(names),
        means={name: _mean(model, textures.texels.get(name)) for name, model in textures.models.items()},
        first_slots=materials["first_slot"],
    )


def _layers(flat: FlatScene, material: int) -> tuple[str, ...]:
    return layers_of(dict(zip(flat.material_names, flat.materials, strict=True)), flat.material_names[material])


def _tables() -> np.ndarray:
    tables = np.concatenate([linear_of_bytes(), np.arange(256) / 255.0])
    return tables.astype(np.float32).view(np.uint32)


def _rows(values: np.ndarray | None, count: int, width: int) -> np.ndarray:
    """(count, width) float32, zero beyond what `values` hold."""
    out = np.zeros((count, width), np.float32)
    if values is not None and count:
        out[:, : values.shape[1]] = values
    return out


def _colors(textures: FlatTextures, flat: FlatScene, read: bool) -> np.ndarray:
    if not read:
        return np.zeros((0, 4), np.float32)
    of_faces = textures.face_colors is not None
    faces = flat.stored_triangles if of_faces else 0
    return np.concatenate([_rows(textures.colors, flat.stored_vertices, 4), _rows(textures.face_colors, faces, 4)])


def _fill(row: np.ndarray, model: Texture) -> None:
    row["kind"] = kind_number("texture", model.type)
    if isinstance(model, (Bitmap, Checkerboard)):
        row["row_u"][:3], row["row_v"][:3] = model.matrix()[:2]
    if isinstance(model, Bitmap):
        row["wrap"], row["nearest"] = WRAPS.index(model.wrap), model.filter == "nearest"
    elif isinstance(model, Checkerboard):
        row["color0"][:3], row["color1"][:3] = model.color0, model.color1
    elif isinstance(model, Constant):
        row["color0"][:3] = model.value
    elif isinstance(model, MeshAttribute):
        row["nearest"] = model.attribute == "face_color"


def _add_texels(row: np.ndarray, texels: np.ndarray, words: list[np.ndarray], raw: bool) -> None:
    row["height"], row["width"] = texels.shape[:2]
    row["first"] = sum(len(part) for part in words)
    row["bytes"] = _PLAIN if raw else _CURVED
    if texels.dtype == np.uint8:
        row["words"] = 1
        shifted = texels.astype(np.uint32)
        words.append((shifted[..., 0] | shifted[..., 1] << 8 | shifted[..., 2] << 16).ravel())
    else:
        row["words"] = 3
        words.append(np.ascontiguousarray(texels, np.float32).view(np.uint32).ravel())


def _add_sky(row: np.ndarray, texels: np.ndarray, words: list[np.ndarray], beyond: float) -> None:
    """Texels and the distribution of patches. Negative values become 0."""
    linear = sky_radiance(texels)
    _add_texels(row, linear, words, raw=False)
    row["patches"] = sum(len(part) for part in words)
    words.append(sky_shares(linear, beyond))


def beyond_poles(light: Light, texels: np.ndarray) -> float:
    """Share of the sky's picture (h, w, 3) that lies beyond its poles; a picture of one row has none beyond."""
    rows = isinstance(light, EnvironmentLight) and light.poles == "rows" and len(texels) > 1
    return 1.0 / len(texels) if rows else 0.0


def sky_radiance(texels: np.ndarray) -> np.ndarray:
    """(h, w, 3) float32, linear, not negative."""
    if texels.dtype == np.uint8:
        return linear_of_bytes().astype(np.float32)[texels]
    return np.maximum(texels, np.float32(0.0))


def _slots(used: Sequence[Material | None], names: list[str], materials: np.ndarray) -> np.ndarray:
    """One row a textured parameter, in the order of materials and their parameters."""
    rows: list[tuple[float, ...]] = []
    for record, material in zip(materials, used, strict=True):
        textures = material.textures() if material is not None else {}
        record["first_slot"], record["slot_count"] = len(rows), len(textures)
        place = 0
        for name, width in material.PARAMETERS if material is not None else ():
            if name in textures:
                assert material is not None
                rows.append((names.index(textures[name]), place, width, *range_of(material, name)))
            place += width
        if "opacity" in textures:
            assert material is not None
            rows.append((names.index(textures["opacity"]), 0, SLOT_OPACITY, *range_of(material, "opacity")))
        if "normal_map" in textures:
            assert material is not None
            rows.append((names.index(textures["normal_map"]), 0, SLOT_NORMALS, material.normal_green == "across", 0.0))
        if "bump_map" in textures:
            assert material is not None
            rows.append((names.index(textures["bump_map"]), 0, SLOT_HEIGHTS, material.bump_scale, 0.0))
    slots = np.zeros(len(rows), RECORDS["TextureSlot"].dtype)
    for i, member in enumerate(("texture", "place", "width", "low", "high")):
        slots[member] = [row[i] for row in rows]
    return slots


def _mean(model: Texture, texels: np.ndarray | None) -> np.ndarray:
    """(3,) float64: about what the texture gives on average; light is shared out by it, no picture depends on it."""
    if texels is not None:
        if texels.dtype != np.uint8:
            return np.maximum(texels, 0.0).mean(axis=(0, 1), dtype=np.float64)
        table = np.arange(256) / 255.0 if getattr(model, "raw", False) else linear_of_bytes()
        return np.array([table @ np.bincount(texels[..., c].ravel(), minlength=256) for c in range(3)]) / (
            texels.shape[0] * texels.shape[1]
        )
    if isinstance(model, Checkerboard):
        return (np.array(model.color0) + np.array(model.color1)) / 2
    return np.array(model.value) if isinstance(model, Constant) else np.full(3, 0.5)
