"""Second differences show the variance of independent noise, and never less of it than there is."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.render.neighbours import seen_variances

SIZE = (128, 96, 3)
KINDS = ("across", "down", "both")


def means(picture: np.ndarray) -> dict[str, float]:
    found = seen_variances(picture, np.ones(SIZE))
    return {kind: float(one.mean()) for kind, one in zip(KINDS, found, strict=True)}


def noise(variance: float) -> np.ndarray:
    return np.sqrt(variance) * np.random.default_rng(4).standard_normal(SIZE)


def test_on_a_ramp_every_kind_shows_the_variance() -> None:
    y, x, c = np.indices(SIZE)
    found = means((1 + 0.3 * x - 0.2 * y + c + noise(0.04)).astype(np.float32))
    assert list(found.values()) == pytest.approx([0.04] * 3, rel=0.04)


def test_an_edge_along_an_axis_leaves_a_kind_unspoilt() -> None:
    y, x, _ = np.indices(SIZE)
    columns, rows = 5.0 * (x % 8 > 3), 5.0 * (y % 8 > 3)
    assert means(columns + noise(0.04))["down"] == pytest.approx(0.04, rel=0.04)
    assert means(rows + noise(0.04))["across"] == pytest.approx(0.04, rel=0.04)
    found = means(columns + rows + noise(0.04))
    assert found["both"] == pytest.approx(0.04, rel=0.05) and min(found["down"], found["across"]) > 1


def test_a_texture_only_adds() -> None:
    texture = np.random.default_rng(5).uniform(0, 1, SIZE)
    assert min(means(texture + noise(0.04)).values()) == pytest.approx(0.04 + 1 / 12, rel=0.1)


@pytest.mark.parametrize(("size", "kinds"), [((1, 1), 0), ((2, 5), 1), ((3, 2), 1), ((3, 3), 3)])
def test_small_pictures_show_what_they_have_neighbours_for(size: tuple[int, int], kinds: int) -> None:
    found = list(seen_variances(np.ones((*size, 3), np.float32), np.ones((*size, 3))))
    assert len(found) == kinds and all(one.shape == size and not one.any() for one in found)
