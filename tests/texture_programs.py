"""Programs that look textures and skies up, shared by their tests. Not a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.kernels.constants import WRAPS
from raytide.kernels.features import Features, kind_number, kinds
from raytide.kernels.records import NONE, RECORDS
from raytide.render.sky import sky_shares
from shading_programs import F4, LOCAL, program, rows4

_LOOK_UP = """
#include "dispatch/texture.cl"
kernel void probe_texture(GEOMETRY_ARGUMENTS TEXTURE_ARGUMENTS, const uint count, global const float4 *uv,
                          global float4 *values)
{
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    TexturePoint at;
    at.uv = uv[i].xy;
    at.barycentric = uv[i].xy;
    at.triangle = 0u;
    values[i] = make4(texture_value(texture_table, g, at), 0.0f);
}
"""

_SKY = """
#include "dispatch/light.cl"
kernel void probe_sky(GEOMETRY_ARGUMENTS TEXTURE_ARGUMENTS, const uint count, global const Light *light,
                      global const float4 *u, global float4 *sampled, global float4 *radiance, global float4 *again)
{
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const LightSample s = light_sample(light, g, (float3)(0.0f), u[i].xy);
    const SkySeen seen = environment_map_seen(light, g, s.to);
    sampled[i] = make4(s.to, s.pdf);
    radiance[i] = make4(s.radiance, 0.0f);
    again[i] = make4(seen.radiance, seen.pdf);
}

kernel void probe_seen(GEOMETRY_ARGUMENTS TEXTURE_ARGUMENTS, const uint count, global const Light *light,
                       global const float4 *directions, global float4 *seen)
{
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const SkySeen s = environment_map_seen(light, g, directions[i].xyz);
    seen[i] = make4(s.radiance, s.pdf);
}
"""


def texture_features() -> Features:
    """Every texture and the sky, without materials."""
    return Features(textures=kinds("texture"), lights=("environment_map",), shapes=kinds("shape"))


def bitmap_record(height: int, width: int, wrap: str = "repeat", nearest: bool = False, words: int = 3) -> np.ndarray:
    """A record whose texels start at word 0 (numbers) or 256 (bytes, behind their table)."""
    row = np.zeros(1, RECORDS["Texture"].dtype)
    row["kind"], row["width"], row["height"] = kind_number("texture", "bitmap"), width, height
    row["wrap"], row["nearest"], row["words"] = WRAPS.index(wrap), nearest, words
    row["first"] = 256 if words == 1 else 0
    row["row_u"][0, 0] = row["row_v"][0, 1] = 1.0
    return row


def _arguments(device: Any, table: np.ndarray, texels: np.ndarray, count: int) -> list[Any]:
    empty = device.empty(256)
    geometry = [empty] * 6 + [np.uint32(x) for x in (0, 0, 0, 0)]
    textures = [device.upload(table), empty, device.upload(texels), empty, empty, np.uint32(0)]
    return [*geometry, *textures, np.uint32(count)]


def look_up(device: Any, table: np.ndarray, texels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(n, 3) float32 colours of the first texture at uv (n, 2) float32; `texels` are uint32 words."""
    built, n = program(device, "probe_texture", _LOOK_UP, texture_features()), len(uv)
    out = device.empty(16 * n)
    arguments = [*_arguments(device, table, texels, n), device.upload(rows4(uv, n)), out]
    device.launch(built, "probe_texture", n, LOCAL, *arguments)
    return device.read(out, F4, 4 * n).reshape(n, 4)[:, :3]


@dataclass(frozen=True)
class SkySamples:
    """What sampling gave, and what looking the sampled directions up gave."""

    to: np.ndarray
    pdf: np.ndarray
    radiance: np.ndarray
    radiance_again: np.ndarray
    pdf_again: np.ndarray


class Sky:
    """A picture of the sky (h, w, 3) float32 on a device."""

    def __init__(self, device: Any, texels: np.ndarray, turn: Any = None, beyond: float = 0.0) -> None:
        self.device = device
        words = np.ascontiguousarray(texels, np.float32).view(np.uint32).ravel()
        self.table = bitmap_record(*texels.shape[:2])
        self.table["patches"] = len(words)
        self.words = np.concatenate([words, sky_shares(texels, beyond)])
        self.light = np.zeros(1, RECORDS["Light"].dtype)
        self.light["kind"], self.light["alias"] = kind_number("light", "environment_map"), NONE
        self.light["radiance"][0, :3] = 1.0
        self.light["direction"][0, 3] = beyond
        for member, axis in zip(("position", "direction", "extra"), np.eye(3) if turn is None else turn, strict=True):
            self.light[member][0, :3] = axis

    def _inputs(self, values: np.ndarray) -> list[Any]:
        upload = self.device.upload
        arguments = _arguments(self.device, self.table, self.words, len(values))
        return [*arguments, upload(self.light), upload(rows4(values, len(values)))]

    def sample(self, u: np.ndarray) -> SkySamples:
        """One direction for each u (n, 2)."""
        built, n = program(self.device, "probe_sky", _SKY, texture_features()), len(u)
        out = [self.device.empty(16 * n) for _ in range(3)]
        self.device.launch(built, "probe_sky", n, LOCAL, *self._inputs(u), *out)
        a, b, c = (self.device.read(x, F4, 4 * n).reshape(n, 4).astype(float) for x in out)
        return SkySamples(a[:, :3], a[:, 3], b[:, :3], c[:, :3], c[:, 3])

    def seen(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (n, 3) and pdf (n,) of directions (n, 3)."""
        built, n = program(self.device, "probe_sky", _SKY, texture_features()), len(directions)
        out = self.device.empty(16 * n)
        self.device.launch(built, "probe_seen", n, LOCAL, *self._inputs(directions), out)
        got = self.device.read(out, F4, 4 * n).reshape(n, 4).astype(float)
        return got[:, :3], got[:, 3]
