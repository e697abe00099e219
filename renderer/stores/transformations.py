"""Turn the coordinate transformations of OME-NGFF into matrices.

A matrix is float64 [n + 1, n + 1] for n axes, in homogeneous coordinates, in the order of the axes in the metadata.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from renderer.stores.fields import list_of, mappings_of, numbers_of, text_of
from renderer.volume import Float64

# The deepest nesting of sequences.
_MAX_DEPTH = 8


def matrix_of(transformation: Mapping[str, Any], count: int, depth: int = 0) -> Float64 | None:
    """Return the matrix of a transformation of `count` axes; None if it has no matrix here.

    Identity, scale, translation, rotation and affine transformations have one, and sequences of them. Others have
    none: displacements, coordinates, transformations by dimension, and numbers in a file of their own.
    """
    kind, matrix = text_of(transformation.get("type")), np.eye(count + 1)
    if kind == "identity":
        return matrix
    if kind in ("scale", "translation"):
        numbers = numbers_of(transformation.get(kind), count)
        if numbers is None:
            return None
        if kind == "scale":
            matrix[range(count), range(count)] = numbers
        else:
            matrix[:count, count] = numbers
        return matrix
    if kind in ("rotation", "affine"):
        width = count + (kind == "affine")
        rows = [numbers_of(row, width) for row in list_of(transformation.get(kind))]
        found = [row for row in rows if row is not None]
        if len(found) != count or len(rows) != count:
            return None
        matrix[:count, :width] = found
        return matrix
    if kind == "sequence" and depth < _MAX_DEPTH:
        return matrix_of_all(mappings_of(transformation.get("transformations")), count, depth + 1)
    return None


def matrix_of_all(transformations: Sequence[Mapping[str, Any]], count: int, depth: int = 0) -> Float64 | None:
    """Return the matrix of transformations that are applied one after the other; None if one of them has no matrix."""
    whole = np.eye(count + 1)
    for each in transformations:
        matrix = matrix_of(each, count, depth)
        if matrix is None:
            return None
        whole = matrix @ whole
    return whole
