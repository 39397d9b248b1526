#!/usr/bin/env python3
"""libigl's lscm and harmonic of one disc patch: cold times (user CPU and wall, median of five) and the charts, to compare ours with.

Usage: python3 benches/libigl.py PATCH.off|PATCH.obj [--out PREFIX] [--systems PREFIX]
                                [--ours CHART.obj --method lscm|harmonic]
       python3 benches/libigl.py SURFACE.off --halves PREFIX      (cuts a surface into two connected parts, writes PREFIX-0.off, -1.off)

Needs the PyPI packages numpy, scipy and libigl. Pins: the two boundary vertices farthest apart, at (0, 0) and (1, 0). Boundary of the
harmonic map: igl.map_vertices_to_circle, from the first vertex of igl.boundary_loop. With --out the charts are written as
PREFIX-lscm.obj and PREFIX-harmonic.obj (v and vt lines in vertex order) and the pins are printed. --ours reads such a file (vt in the
order of v) and prints the largest deviation after a similarity, over the size of the chart. --systems writes the matrices of both maps.
"""
import os

os.environ["OMP_NUM_THREADS"] = "1"
import argparse
import resource
import time

import igl
import numpy as np


def read(path):
    """Vertices and triangles of an OFF or OBJ file (faces of an OBJ with or without slashes)."""
    if path.endswith(".off"):
        words = open(path).read().split()
        nv, nf = int(words[1]), int(words[2])
        positions = np.array(words[4:4 + 3 * nv], float).reshape(nv, 3)
        faces = np.array(words[4 + 3 * nv:4 + 3 * nv + 4 * nf], np.int64).reshape(nf, 4)[:, 1:]
        return positions, faces
    positions, faces = [], []
    for line in open(path):
        word = line.split()
        if word[:1] == ["v"]:
            positions.append([float(x) for x in word[1:4]])
        elif word[:1] == ["f"]:
            faces.append([int(x.split("/")[0]) - 1 for x in word[1:4]])
    return np.array(positions), np.array(faces, np.int64)


def write_off(path, positions, faces):
    with open(path, "w") as out:
        print("OFF", len(positions), len(faces), 0, file=out)
        np.savetxt(out, positions, fmt="%.17g")
        np.savetxt(out, np.column_stack([np.full(len(faces), 3), faces]), fmt="%d")


def compact(positions, faces):
    used, index = np.unique(faces, return_inverse=True)
    return positions[used], index.reshape(faces.shape)


def halves(positions, faces):
    """Two parts of about equal size: faces by their breadth-first distance from a face at one end, each made connected and a disc if
    the surface allows it (a part keeps the holes of the surface)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components, dijkstra

    tt = np.asarray(igl.triangle_triangle_adjacency(faces)[0])
    i = np.repeat(np.arange(len(faces)), 3)[tt.ravel() >= 0]
    j = tt.ravel()[tt.ravel() >= 0]
    centre = positions[faces].mean(1)
    graph = coo_matrix((np.linalg.norm(centre[i] - centre[j], axis=1), (i, j)), shape=(len(faces),) * 2).tocsr()
    keep = connected_components(graph)[1]
    keep = keep == np.bincount(keep).argmax()
    start = np.flatnonzero(keep)[centre[keep][:, 0].argmin()]
    far = dijkstra(graph, indices=start)
    label = (far > np.median(far[keep])).astype(int)
    # Islands go to the other side, until both sides are connected.
    for _ in range(10):
        for side in (0, 1):
            mine = np.flatnonzero(keep & (label == side))
            part = connected_components(graph[mine][:, mine])[1]
            label[mine[part != np.bincount(part).argmax()]] = 1 - side
    return [compact(positions, faces[keep & (label == side)]) for side in (0, 1)]


def cold(task):
    """User CPU and wall seconds of five runs (medians), and the result of the last."""
    cpu, wall = [], []
    for _ in range(5):
        c, w = resource.getrusage(resource.RUSAGE_SELF).ru_utime, time.perf_counter()
        result = task()
        cpu.append(resource.getrusage(resource.RUSAGE_SELF).ru_utime - c)
        wall.append(time.perf_counter() - w)
    return np.median(cpu), np.median(wall), result


def farthest(points):
    p, q, span = 0, 0, -1.0
    while True:
        far = np.linalg.norm(points - points[q], axis=1)
        if far.max() <= span:
            return p, q
        p, q, span = q, int(far.argmax()), far.max()


def flips(uv, faces):
    a, b, c = (uv[faces[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return int(min((area <= 0).sum(), (area >= 0).sum()))


def deviation(uv, wanted):
    """Largest distance after the similarity that fits best, over the largest distance from the mean."""
    x, y = (z[:, 0] + 1j * z[:, 1] for z in (uv, wanted))
    x, y = x - x.mean(), y - y.mean()
    return abs(np.vdot(x, y) / np.vdot(x, x) * x - y).max() / abs(y).max()


def write_systems(prefix, positions, faces, loop, pins):
    """The matrices of the two maps without the rows that are given, for benches/cholmod.c: one triangle, Matrix Market."""
    from scipy.io import mmwrite
    from scipy.sparse import block_diag, tril

    n = len(positions)
    laplace = -igl.cotmatrix(positions, faces)
    area = igl.vector_area_matrix(faces)
    conformal = block_diag([laplace, laplace]) - 2 * area
    for name, matrix, given in (("lscm", conformal, np.r_[pins, pins + n]), ("harmonic", laplace, loop)):
        free = np.setdiff1d(np.arange(matrix.shape[0]), given)
        mmwrite(f"{prefix}-{name}.mtx", tril(matrix.tocsc()[free][:, free]).tocoo(), symmetry="symmetric", precision=17)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh")
    parser.add_argument("--halves")
    parser.add_argument("--out")
    parser.add_argument("--systems")
    parser.add_argument("--ours")
    parser.add_argument("--method", choices=["lscm", "harmonic"], default="lscm")
    args = parser.parse_args()
    positions, faces = read(args.mesh)
    if args.halves:
        for side, part in enumerate(halves(positions, faces)):
            loops = len(igl.boundary_loop_all(part[1])) if hasattr(igl, "boundary_loop_all") else "?"
            print(f"{args.halves}-{side}.off: {len(part[0])} vertices, {len(part[1])} triangles, loops {loops}")
            write_off(f"{args.halves}-{side}.off", *part)
        return
    loop = np.asarray(igl.boundary_loop(faces))
    p, q = farthest(positions[loop])
    pins, targets = np.array([loop[p], loop[q]], np.int64), np.array([[0.0, 0.0], [1.0, 0.0]])
    circle = igl.map_vertices_to_circle(positions, loop)
    if args.systems:
        write_systems(args.systems, positions, faces, loop, pins)
    tasks = {
        "lscm": lambda: np.asarray(igl.lscm(positions, faces, pins, targets)[0]),
        "harmonic": lambda: igl.harmonic(positions, faces, loop, circle, 1),
    }
    print(f"{args.mesh}: {len(positions)} vertices, {len(faces)} triangles, boundary {len(loop)}, pins {pins}, circle from {loop[0]}")
    for name, task in tasks.items():
        cpu, wall, uv = cold(task)
        print(f"  igl.{name:9} cpu {cpu:.3f} s  wall {wall:.3f} s  flips {flips(uv, faces)}")
        if args.out:
            with open(f"{args.out}-{name}.obj", "w") as out:
                np.savetxt(out, positions, fmt="v %.17g %.17g %.17g")
                np.savetxt(out, uv, fmt="vt %.17g %.17g")
                np.savetxt(out, np.repeat(faces + 1, 2, axis=1), fmt="f %d/%d %d/%d %d/%d")
        if args.ours and name == args.method:
            ours = np.array([[float(x) for x in line.split()[1:3]] for line in open(args.ours) if line.startswith("vt ")])
            print(f"  deviation of {args.ours}: {deviation(ours, uv):.3e} after a similarity")


if __name__ == "__main__":
    main()
