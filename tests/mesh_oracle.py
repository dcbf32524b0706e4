"""The rules of a legal mesh by brute force, on integer coordinates: all pairs of cells, every node and every edge."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import combinations

import numpy as np


def turn(a, b, c):
    return int((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def parts_of(n, cells):
    """Return a number for each node that cells which share nodes have in common."""
    part = list(range(n))
    for _ in range(n):
        before = list(part)
        for cell in cells:
            least = min(part[v] for v in cell)
            for v in cell:
                part[v] = least
        if part == before:
            break
    return part


def interiors_meet(one, two):
    """Tell whether two counter-clockwise triangles overlap: no edge of either has the other on its outer side."""
    for p, q in ((one, two), (two, one)):
        for k in range(3):
            if all(turn(p[k], p[(k + 1) % 3], x) <= 0 for x in q):
                return False
    return True


def broken_rules(points, cells):
    """Return the names of all rules that a mesh breaks, and whether it breaks one between different parts only."""
    points = np.asarray(points).astype(int).tolist()
    cells = [list(map(int, cell)) for cell in cells]
    rules = set()
    positive = []
    for cell in cells:
        if len(set(cell)) < 3:
            rules.add("repeated node")
            continue
        area = turn(*(points[v] for v in cell))
        if area == 0:
            rules.add("zero area")
            continue
        positive.append(cell if area > 0 else [cell[0], cell[2], cell[1]])
    if set(range(len(points))) - {v for cell in cells for v in cell}:
        rules.add("node in no cell")
    if max(Counter(frozenset(cell) for cell in positive).values(), default=0) > 1:
        rules.add("duplicate cell")
    sides = defaultdict(list)
    for k, cell in enumerate(positive):
        for j in range(3):
            sides[frozenset((cell[j], cell[(j + 1) % 3]))].append((k, cell[j], cell[(j + 1) % 3]))
    if any(len(around) > 2 for around in sides.values()):
        rules.add("edge with three cells")
    part = parts_of(len(points), positive)
    for one, two in combinations(positive, 2):
        if interiors_meet([points[v] for v in one], [points[v] for v in two]):
            rules.add("overlap" if part[one[0]] == part[two[0]] else "overlap of parts")
    boundary = [around[0] for around in sides.values() if len(around) == 1]
    faces = {(tuple(points[a]), tuple(points[b])) for _, a, b in boundary}
    doubled = Counter(k for k, a, b in boundary if (tuple(points[b]), tuple(points[a])) in faces)
    if 3 in doubled.values():
        rules.add("coincident nodes")
    # the sides of a slit are no boundary of what is covered
    outer = [(a, b) for _, a, b in boundary if (tuple(points[b]), tuple(points[a])) not in faces]
    for a, b in outer:
        for node in {v for edge in outer for v in edge}:
            p, q, x = points[a], points[b], points[node]
            between = min(p, q) < x < max(p, q) and turn(p, q, x) == 0
            if between:
                rules.add("hanging node" if part[node] == part[a] else "touch of parts")
    return rules


ALLOWED = {
    "repeated node": {"repeated node"},
    "zero area": {"zero area"},
    "node in no cell": {"node in no cell"},
    "duplicate cell": {"duplicate cell"},
    "edge with three cells": {"edge with three cells"},
    "hanging node": {"hanging node"},
    "coincident nodes": {"coincident nodes", "overlap", "overlap of parts"},
    "overlapping or inverted cells": {"overlap", "overlap of parts"},
}
"""For each rule that an error names, what brute force must have found."""
