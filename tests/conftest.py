"""Fixtures of all tests: every OpenCL device found, private caches, and the development data where it is present."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


# Every run draws the same examples, and none is judged by how long it takes: the machine may be busy.
settings.register_profile("raytide", deadline=None, derandomize=True, database=None,
                          suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
settings.load_profile("raytide")


def pytest_configure(config: pytest.Config) -> None:
    """Caches of the tests live in one folder apart from the user's, set before any OpenCL platform starts.

    RAYTIDE_TEST_CACHE keeps that folder between runs, which saves the kernel builds.
    """
    config.addinivalue_line("markers", "one_driver: a law of what every driver is given, held on one of them")
    kept = os.environ.get("RAYTIDE_TEST_CACHE")
    cache = getattr(config, "cache", None)  # absent with -p no:cacheprovider
    base = Path(kept) if kept else Path(cache.mkdir("raytide") if cache else tempfile.mkdtemp(prefix="raytide-"))
    base.mkdir(parents=True, exist_ok=True)
    os.environ["RAYTIDE_CACHE_DIR"] = str(base)
    os.environ["PYOPENCL_NO_CACHE"] = "1"
    for name in [name for name in os.environ if name.startswith("RAYTIDE_") and "CACHE" not in name]:
        if name != "RAYTIDE_TEST_DEVICES":
            del os.environ[name]  # a developer's settings must not decide a test


def found_devices(one: bool = False) -> list[str]:
    """Ids of the devices to test on: those that a word of RAYTIDE_TEST_DEVICES (commas) is part of; without it all, or
    the `one` that a render would take."""
    from raytide.device import list_devices, pick

    ids = [info.id for info in list_devices()]
    words = [word for word in os.environ.get("RAYTIDE_TEST_DEVICES", "").split(",") if word]
    if one and ids and not words:
        return [pick().id]
    return [name for name in ids if not words or any(word in name for word in words)]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        pictures = "image" in Path(str(metafunc.module.__file__)).parts  # which take minutes
        one = pictures or metafunc.definition.get_closest_marker("one_driver") is not None
        metafunc.parametrize("device", found_devices(one), indirect=True, scope="session")


@pytest.fixture(autouse=True)
def logging_untouched() -> None:
    """Commands that run inside a test, or a fixture of a module, set up logging for the whole process: undo it."""
    logger = logging.getLogger("raytide")
    logger.handlers[:], logger.propagate, logger.disabled = [], True, False
    logger.setLevel(logging.NOTSET)


@pytest.fixture(scope="session")
def device(request: pytest.FixtureRequest) -> Iterator[object]:
    """An open raytide.device.Device; tests that ask for it run on every device found."""
    from raytide.device import open_device

    opened = open_device(request.param)
    yield opened
    opened.close()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of scenes, meshes and references of the development set; absent in a user's clone."""
    if not SHARED_DATA.is_dir():
        pytest.skip("development data is not beside this checkout")
    return SHARED_DATA
