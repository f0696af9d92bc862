"""Pictures that Mitsuba made of its own scenes, where the development data is at hand; the long form of this is
`tools/compare_mitsuba.py`."""

from __future__ import annotations

from pathlib import Path

import pytest

from raytide.device import Device

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
TOOLS = Path(__file__).resolve().parents[2] / "tools"
FOLDERS = {"mitsuba/tests/scenes": 32000, "references-mitsuba391": 1024}  # samples a pixel of the pictures there
SAMPLES = 2e5  # in all over a picture, a tenth of what Mitsuba's own test takes
# twelve materials under a sky, maps of normals under three lights, a cast picture, a Cornell box: little noise
SCENES = ("test_constant", "test_normalmap", "test_spot", "cbox")


@pytest.mark.skipif(not DATA.is_dir(), reason="the development data is not beside the checkout")
@pytest.mark.parametrize("name", SCENES)
def test_pictures_agree_with_those_of_mitsuba(device: Device, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(TOOLS))
    import compare_mitsuba

    found = [(one, samples) for folder, samples in FOLDERS.items()
             for one in compare_mitsuba.references(DATA / folder) if one.name == name]
    (reference, samples), = found
    verdict = compare_mitsuba.compare(reference, SAMPLES, samples, device)
    assert verdict.passes, (verdict.share, verdict.means)
