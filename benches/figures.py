#!/usr/bin/env python3
"""Remeshes real files with the built `remesh`, has an independent judge measure the results, and prints a Markdown table.

    python3 benches/figures.py --judge ../shared/judge --data ../shared/data [--threads 1] [MODEL ...]

Needs the release build, and what the judge needs (numpy, scipy, meshio, libigl). Times are of the whole program: start, read,
remesh, write.
"""
import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

MODELS = {
    "bunny.obj": 25000, "pelvisSMOOTH.stl": 8400, "pelvis-hemi.msh": 21000, "aorta2.stl": 10000, "bypass.stl": 20000,
    "carotid.stl": 10000, "skull.stl": 10000, "rocker-arm.obj": 20000, "3holes.off": 10000, "lilium.obj": 10000,
    "fandisk.obj": 10000, "t13_data.stl": 20000,
}
SAMPLES = {"artery": 20000, "pelvis": 20000, "brake": 40000, "cad-part": 12000, "tube": 8000}


def program():
    target = os.environ.get("CARGO_TARGET_DIR", os.path.join(os.path.dirname(__file__), "..", "target"))
    return os.path.join(target, "release", "remesh")


def timed(command):
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.time()
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime, time.time() - begin


def row(judge, name, path, triangles, threads, folder):
    import numpy as np
    output = os.path.join(folder, "out.obj")
    user, wall = timed([program(), "run", path, "-o", output, "--triangles", str(triangles), "--threads", str(threads), "-q"])
    source = judge.read(path, "always")
    area = judge.norm(judge.triangle_area_vectors(source.V, source.triangulated())).sum()
    size = float(np.sqrt(area / triangles * 4 / 3 ** 0.5))
    r = judge.judge(source, judge.read(output, "auto"), size)
    boundary, feature = r["boundary_dev_rel"], r["feature_kept"]
    cells = [
        name, r["n_triangles"], f"{r['kappa_min']:.3f}", f"{r['kappa_mean']:.4f}", f"{r['tau']:.1f}",
        f"{100 * r['hausdorff_max_rel']:.3f}", "" if boundary is None else f"{boundary * r['diagonal'] / size:.3f}",
        "" if feature is None else f"{feature:.3f}", r["self_intersections"],
        "kept" if r["topology_kept"] and r["topology_output"]["components"] == r["topology_input"]["components"] else "LOST",
        f"{user:.2f}", f"{wall:.2f}",
    ]
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--judge", required=True, help="folder of judge.py")
    parser.add_argument("--data", required=True, help="folder of the real meshes")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("models", nargs="*")
    a = parser.parse_args()
    sys.path.insert(0, os.path.abspath(a.judge))
    import judge
    print("| model | triangles | kappa min | kappa mean | tau | Hausdorff max, % of diagonal | boundary / size | sharp edges kept | "
          "self-intersections | topology | user s | wall s |\n|" + "---|" * 12)
    with tempfile.TemporaryDirectory() as folder:
        for name, triangles in MODELS.items():
            if not a.models or name in a.models:
                row(judge, name, os.path.join(a.data, name), triangles, a.threads, folder)
        for name, triangles in SAMPLES.items():
            if not a.models or name in a.models:
                path = os.path.join(folder, name + ".stl")
                subprocess.run([program(), "sample", name, "-o", path, "--encoding", "binary", "--triangles", "20000", "-q"], check=True,
                               stderr=subprocess.DEVNULL)
                row(judge, "sample " + name, path, triangles, a.threads, folder)


if __name__ == "__main__":
    main()
