"""Words that errors and reports share."""

from __future__ import annotations

import pytest

from raytide.errors import few_of


@pytest.mark.parametrize(
    ("count", "words"), [(0, ""), (1, "a"), (3, "a, b, c"), (4, "a, b, c and 1 more"), (6, "a, b, c and 3 more")]
)
def test_a_few_names_and_how_many_more(count: int, words: str) -> None:
    assert few_of("abcdef"[:count]) == words
    assert few_of(list("abcdef")[:count], shown=6) == ", ".join("abcdef"[:count])
