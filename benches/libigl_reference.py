#!/usr/bin/env python3
"""Writes src/engine/parametrize/tests/reference/data.rs: two small generated patches with the charts that libigl computes of them.

Usage: python3 benches/libigl_reference.py > src/engine/parametrize/tests/reference/data.rs
Needs the PyPI packages numpy, scipy and libigl. The surfaces are closed formulas over scattered points of the plane, so nothing but
numbers comes from outside; the charts are what igl.lscm (two pins with targets) and igl.harmonic (cotangent weights, k = 1, the boundary
by igl.map_vertices_to_circle) return.
"""
import igl
import numpy as np
from scipy.spatial import Delaunay


def scattered(count, radius, seed):
    """Points in a disc, kept apart by rejection, with a ring of irregular points on its border."""
    rng = np.random.default_rng(seed)
    rim = np.sort(rng.uniform(0, 2 * np.pi, 3 * count // 8))
    rim = np.linspace(0, 2 * np.pi, len(rim), endpoint=False) + 0.25 * (rim - np.linspace(0, 2 * np.pi, len(rim), endpoint=False))
    rim = np.unique(rim % (2 * np.pi))
    points = [radius * np.array([np.cos(t), np.sin(t)]) for t in rim]
    while len(points) < count:
        p = rng.uniform(-radius, radius, 2)
        if np.hypot(*p) < 0.93 * radius and min(np.hypot(*(p - q)) for q in points) > 0.9 * radius / np.sqrt(count):
            points.append(p)
    return np.array(points)


def dome():
    """A cap of an ellipsoid: strong curvature of one sign."""
    p = scattered(84, 0.85, 1)
    z = np.sqrt(1.0 - (p ** 2).sum(1))
    return np.column_stack([1.4 * p[:, 0], p[:, 1], 0.9 * z]), p


def waves():
    """A wavy sheet, stretched along one axis."""
    p = scattered(112, 1.0, 2)
    z = 0.35 * np.sin(3.1 * p[:, 0]) * np.cos(2.3 * p[:, 1]) + 0.15 * p[:, 0] ** 2
    return np.column_stack([1.7 * p[:, 0], p[:, 1] + 0.2 * p[:, 0] ** 2, z]), p


def patch(make):
    positions, plane = make()
    faces = Delaunay(plane).simplices
    # Counter-clockwise, and none of the slivers that the hull of points on a circle may have.
    a, b, c = (plane[faces[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    assert abs(area).min() > 1e-6
    faces = np.where((area < 0)[:, None], faces[:, [0, 2, 1]], faces).astype(np.int64)
    return positions, faces


def charts(positions, faces):
    loop = igl.boundary_loop(faces)
    span = np.linalg.norm(positions[loop][:, None] - positions[loop][None], axis=2)
    i, j = np.unravel_index(span.argmax(), span.shape)
    pins = np.array([loop[min(i, j)], loop[max(i, j)]], dtype=np.int64)
    targets = np.array([[0.0, 0.0], [1.0, 0.25]])
    conformal = np.asarray(igl.lscm(positions, faces, pins, targets)[0])
    circle = igl.map_vertices_to_circle(positions, loop)
    harmonic = igl.harmonic(positions, faces, loop, circle, 1)
    return loop, circle, pins, targets, conformal, harmonic


def rows(name, kind, array, form):
    lines = [f"pub(super) const {name}: [{kind}; {len(array)}] = ["]
    lines += ["    [" + ", ".join(form(x) for x in row) + "]," for row in array]
    return "\n".join(lines + ["];"])


def number(x):
    # Seventeen digits, as short as they can be.
    return repr(float(x))


def main():
    print("//! Made by benches/libigl_reference.py with libigl 2.6.3 (PyPI): patches and libigl's charts of them. Do not edit.")
    print("#![allow(clippy::excessive_precision, clippy::unreadable_literal)]")
    for name, make in (("DOME", dome), ("WAVES", waves)):
        positions, faces = patch(make)
        loop, circle, pins, targets, conformal, harmonic = charts(positions, faces)
        print()
        print(rows(f"{name}_POSITIONS", "[f64; 3]", positions, number))
        print(rows(f"{name}_TRIANGLES", "[u32; 3]", faces, str))
        print(f"/// The boundary in libigl's order.\npub(super) const {name}_LOOP: [u32; {len(loop)}] = {list(map(int, loop))};")
        print(rows(f"{name}_CIRCLE", "[f64; 2]", circle, number))
        print(f"pub(super) const {name}_PINS: [u32; 2] = {list(map(int, pins))};")
        print(rows(f"{name}_TARGETS", "[f64; 2]", targets, number))
        print(rows(f"{name}_LSCM", "[f64; 2]", conformal, number))
        print(rows(f"{name}_HARMONIC", "[f64; 2]", harmonic, number))


if __name__ == "__main__":
    main()
