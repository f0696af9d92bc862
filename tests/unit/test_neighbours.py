"""Second differences show the variance of independent noise, and never less of it than there is."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.render.neighbours import seen_sums

SIZE = (128, 96, 3)
KINDS = ("across", "down", "both")


def means(picture: np.ndarray) -> dict[str, float]:
    found = seen(picture)
    return {kind: float(one.mean()) for kind, one in zip(KINDS, found, strict=True)}


def seen(picture: np.ndarray) -> list[np.ndarray]:
    """Means over the rows of a whole picture."""
    rows = picture.reshape(len(picture), -1).astype(np.float32)
    return [one / len(picture) for one in seen_sums(rows, np.ones_like(rows), 0, 0)]


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
    found = seen(np.ones((*size, 3)))
    assert len(found) == kinds and all(one.shape == (3 * size[1],) and not one.any() for one in found)


def test_rows_of_a_picture_in_parts_show_what_the_whole_does() -> None:
    """The oracle says it again, square by square in float64, borders having their neighbours'."""
    rng = np.random.default_rng(6)
    picture, weight = rng.normal(size=(20, 9, 3)), rng.uniform(1, 2, (20, 9, 3))
    padded = {"across": (0, 1), "down": (1, 0), "both": (1, 1)}
    flat = lambda image: image.reshape(len(image), -1).astype(np.float32)  # noqa: E731
    for first, end in ((0, 8), (8, 16), (16, 20)):
        above, below = first > 0, end < 20
        rows = slice(first - above, end + below)
        found = seen_sums(flat(picture[rows]), flat(weight[rows]), int(above), int(below))
        for sums, (down, across) in zip(found, padded.values(), strict=True):
            bent = np.diff(picture, 2, axis=0) if down else picture
            bent = np.diff(bent, 2, axis=1) if across else bent
            inner = weight[down : 20 - down, across : 9 - across]
            squares = np.pad(bent**2 * inner, ((down, down), (across, across), (0, 0)), mode="edge")
            wanted = squares[first:end].sum(axis=0).ravel() / (36 if down and across else 6)
            np.testing.assert_allclose(sums, wanted, rtol=1e-4)
