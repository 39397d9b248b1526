#!/usr/bin/env python3
"""Fills closed triangle meshes (OBJ) with tetrahedra by TetGen and by Gmsh: a remesh that real volume meshers take is watertight and does not
cross itself.

    python3 benches/tetrahedra.py MESH.obj ...

Needs the PyPI packages numpy, meshio, tetgen and gmsh. Exits with 1 if one of them makes no tetrahedra.
"""
import os
import sys
import tempfile

import gmsh
import meshio
import numpy as np
import tetgen


def read_obj(path):
    """Points and triangles."""
    points, triangles = [], []
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                triangles.append([int(x.split("/")[0]) - 1 for x in words[1:4]])
    return np.array(points), np.array(triangles, np.int32)


def by_tetgen(points, triangles):
    """Number of tetrahedra of TetGen (quality 1.8, 10 degrees)."""
    made = tetgen.TetGen(points, triangles).tetrahedralize(order=1, mindihedral=10, minratio=1.8)
    return len(made[1])


def by_gmsh(points, triangles):
    """Number of tetrahedra of Gmsh with its default algorithm, their smallest and mean gamma."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "surface.stl")
        meshio.write(path, meshio.Mesh(points, [("triangle", triangles)]), binary=True)
        gmsh.initialize()
        try:
            gmsh.option.setNumber("General.Verbosity", 1)
            gmsh.merge(path)
            loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
            gmsh.model.geo.addVolume([loop])
            gmsh.model.geo.synchronize()
            gmsh.model.mesh.generate(3)
            tags = gmsh.model.mesh.getElementsByType(4)[0]
            gamma = gmsh.model.mesh.getElementQualities(tags, "gamma")
            return len(tags), min(gamma), float(np.mean(gamma))
        finally:
            gmsh.finalize()


def main():
    print("| mesh | triangles | TetGen: tetrahedra | Gmsh: tetrahedra | gamma min | mean |\n|---|---|---|---|---|---|")
    for path in sys.argv[1:]:
        points, triangles = read_obj(path)
        of_gmsh, least, mean = by_gmsh(points, triangles)
        print(f"| {os.path.basename(path)} | {len(triangles)} | {by_tetgen(points, triangles)} | {of_gmsh} | {least:.3f} | {mean:.3f} |", flush=True)


if __name__ == "__main__":
    main()
