"""Points, the one distance formula, and exact signs.

Every distance of the package is ``sqrt(dx*dx + dy*dy)`` in this order and without fused operations, so that the Rust
core gives the same bits. Signs of determinants are exact: a float filter first, rational numbers where it can't tell.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Point = tuple[float, float]

NONE = -1
"""An index that means "none": no cell on that side, no given facet."""

# Rounded determinants differ from exact ones by less than this times the sum of the absolute products (the constants of
# Shewchuk 1997 are 3.4e-16 and 1.2e-15); the absolute term stands for products that underflow.
_ORIENT_ERROR = 4e-16
_CIRCLE_ERROR = 1.3e-15
_UNDERFLOW = 1e-290


def distance_2(a: Floats, b: Floats) -> Floats:
    """Return squared Euclidean distances of broadcast points, shape (..., d) each."""
    with np.errstate(under="ignore", over="ignore"):
        difference = a[..., 0] - b[..., 0]
        total: Floats = difference * difference
        for k in range(1, a.shape[-1]):
            difference = a[..., k] - b[..., k]
            total = total + difference * difference
    return total


def distance(a: Floats, b: Floats) -> Floats:
    """Return Euclidean distances of broadcast points, shape (..., d) each."""
    return np.sqrt(distance_2(a, b))


def orient(a: Point, b: Point, c: Point) -> int:
    """Return the exact sign of the area of the triangle a, b, c: 1 where they turn left, -1 right, 0 not at all."""
    left = (a[0] - c[0]) * (b[1] - c[1])
    right = (a[1] - c[1]) * (b[0] - c[0])
    area = left - right
    if abs(area) > _ORIENT_ERROR * (abs(left) + abs(right)) + _UNDERFLOW and abs(area) < np.inf:
        return 1 if area > 0 else -1
    (ax, ay), (bx, by), (cx, cy) = (map(Fraction, p) for p in (a, b, c))
    exact = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    return (exact > 0) - (exact < 0)


def in_circle(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return 1 where d lies inside the circle through a, b, c (which turn left), -1 outside, 0 on it; exact."""
    rows = [(p[0] - d[0], p[1] - d[1]) for p in (a, b, c)]
    total = size = 0.0
    for k in range(3):
        (px, py), (qx, qy), (rx, ry) = rows[k], rows[k - 2], rows[k - 1]
        lift = px * px + py * py
        total += lift * (qx * ry - qy * rx)
        size += lift * (abs(qx * ry) + abs(qy * rx))
    if abs(total) > _CIRCLE_ERROR * size + _UNDERFLOW and abs(total) < np.inf:
        return 1 if total > 0 else -1
    dx, dy = map(Fraction, d)
    exact_rows = [(Fraction(p[0]) - dx, Fraction(p[1]) - dy) for p in (a, b, c)]
    exact = Fraction(0)
    for k in range(3):
        (fx, fy), (gx, gy), (hx, hy) = exact_rows[k], exact_rows[k - 2], exact_rows[k - 1]
        exact += (fx * fx + fy * fy) * (gx * hy - gy * hx)
    return (exact > 0) - (exact < 0)


def signs(a: Floats, b: Floats, c: Floats) -> Ints:
    """Return `orient` of broadcast points, shape (..., 2) each, as an int64 array."""
    a, b, c = np.broadcast_arrays(a, b, c)
    with np.errstate(all="ignore"):
        left = (a[..., 0] - c[..., 0]) * (b[..., 1] - c[..., 1])
        right = (a[..., 1] - c[..., 1]) * (b[..., 0] - c[..., 0])
        area = left - right
        known = np.abs(area) > _ORIENT_ERROR * (np.abs(left) + np.abs(right)) + _UNDERFLOW
        known &= np.isfinite(area)
    result = np.sign(np.where(known, area, 0.0)).astype(np.int64)
    for at in zip(*np.nonzero(~known), strict=True):
        p, q, r = ((float(x[at][0]), float(x[at][1])) for x in (a, b, c))
        result[at] = orient(p, q, r)
    return result
