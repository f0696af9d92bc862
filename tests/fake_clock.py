"""A clock that goes on only where a render launches waves: how long anything takes is what a test says it does."""

from __future__ import annotations

from typing import Any

import pytest

from raytide.device import Device
from raytide.render import frame, loop


class WaveClock:
    """Seconds by the renderer's clock: one passes in every wave, none in anything else, however busy the machine is."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, device: Device) -> None:
        self.now = 1000.0
        launch = device.launch

        def launched(program: Any, kernel: str, *arguments: Any, **options: Any) -> None:
            self.now += kernel == "shade"  # of which every wave has one
            launch(program, kernel, *arguments, **options)

        monkeypatch.setattr(device, "launch", launched)
        for module in (frame, loop):
            monkeypatch.setattr(module, "time", self)

    def perf_counter(self) -> float:
        return self.now
