"""Inline meshes: lists or numpy arrays that people give, as checked read-only arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from raytide.scene.values import LARGEST

MOST_ROWS = 2**31 - 1


def as_vertices(value: Any) -> np.ndarray:
    """(V, 3) float64, finite, of size at most LARGEST. Raises ValueError."""
    array = _table(value, "iuf")
    wrong = np.flatnonzero(~(np.abs(array.astype(float)) <= LARGEST).all(axis=1))
    if len(wrong):
        row = int(wrong[0])
        raise ValueError(f"finite numbers of size at most {LARGEST:g} (vertices[{row}] is {array[row].tolist()})")
    return _frozen(array, np.float64)


def as_uv(value: Any) -> np.ndarray:
    """(V, 2) float64, finite, of size at most LARGEST. Raises ValueError."""
    array = _table(value, "iuf", 2)
    wrong = np.flatnonzero(~(np.abs(array.astype(float)) <= LARGEST).all(axis=1))
    if len(wrong):
        row = int(wrong[0])
        raise ValueError(f"finite numbers of size at most {LARGEST:g} (uv[{row}] is {array[row].tolist()})")
    return _frozen(array, np.float64)


def as_faces(value: Any) -> np.ndarray:
    """(T, 3) uint32 of whole numbers from 0. Raises ValueError."""
    array = _table(value, "iu")
    wrong = np.flatnonzero((array < 0).any(axis=1) | (array > MOST_ROWS).any(axis=1))
    if len(wrong):
        row = int(wrong[0])
        raise ValueError(f"indices of vertices from 0 (faces[{row}] is {array[row].tolist()})")
    return _frozen(array, np.uint32)


def _table(value: Any, kinds: str, width: int = 3) -> np.ndarray:
    if not isinstance(value, (list, tuple, np.ndarray)):
        raise ValueError("")
    if not isinstance(value, np.ndarray):
        for row, items in enumerate(value):
            if not isinstance(items, (list, tuple, np.ndarray)) or len(items) != width:
                raise ValueError(f"{width} numbers in each row (row {row} is not)")
            if any(isinstance(item, (bool, str)) for item in items):
                raise ValueError(f"{width} numbers in each row (row {row} holds something else)")
    try:
        array = np.asarray(value) if len(value) else np.zeros((0, width), int)
    except (ValueError, OverflowError):
        raise ValueError("") from None
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"{width} numbers in each row (the shape is {array.shape})")
    if array.dtype.kind not in kinds:
        raise ValueError("whole numbers in each row" if kinds == "iu" else f"{width} numbers in each row")
    return array


def _frozen(array: np.ndarray, dtype: Any) -> np.ndarray:
    result = np.array(array, dtype)  # a copy: later edits of the caller's array must not pass unchecked
    result.setflags(write=False)
    return result
