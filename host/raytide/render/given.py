"""What scripts hand over to a renderer, checked before any work. Raises UsageError."""

from __future__ import annotations

from typing import Any

from raytide.device import Device, DeviceInfo
from raytide.errors import UsageError
from raytide.render.checkpoint import Checkpoints
from raytide.scene.describe import value_words
from raytide.scene.given import bytes_given, count_given
from raytide.scene.scene import Scene


def checked(scene: Any, device: Any, memory: Any, threads: Any) -> tuple[Scene, int | None, int | None]:
    """The scene, the bytes of memory and the threads, in the form that Renderer works with; and of the device whether
    it is one at all."""
    if not isinstance(scene, Scene):
        example = scene if isinstance(scene, str) and scene else "scene.toml"
        raise UsageError(f"scene: came {value_words(scene)}; wanted a Scene, such as rt.load({example!r})")
    if not isinstance(device, (str, DeviceInfo, Device, type(None))):
        wanted = 'an id or part of one, such as "cpu", one of rt.list_devices(), or an open Device'
        raise UsageError(f"device: came {value_words(device)}; wanted {wanted}")
    return scene, bytes_given(memory, "memory"), count_given(threads, "threads")


def check_checkpoints(given: Any) -> Checkpoints:
    """What a render is to be kept with."""
    if isinstance(given, Checkpoints):
        return given
    example = given if isinstance(given, str) and given else "render.ck"
    raise UsageError(f"checkpoints: came {value_words(given)}; wanted rt.Checkpoints({example!r})")
