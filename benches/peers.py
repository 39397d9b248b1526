#!/usr/bin/env python3
"""Runs `remesh` and its peers on the same files at equal size in one run, has an independent judge measure all results, and prints a
Markdown table: quality of ours beside the best peer of each column, user CPU of ours over that of the fastest peer.

    python3 benches/peers.py --judge ../shared/judge --data ../shared/data [--peer mmgs-loose --peer cgal-resample ...] [MODEL ...]

Needs the release build; a python (`--python`) with what judge.py and the named peers of peers.py need (mmgpy, gmsh, pymeshlab, an installed
CGAL ...). Times: of ours the whole program with one thread, from start to written file; of a peer its remeshing call alone.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

from figures import MODELS, program, timed

EIGHT = ["bunny.obj", "pelvisSMOOTH.stl", "pelvis-hemi.msh", "aorta2.stl", "bypass.stl", "fandisk.obj", "rocker-arm.obj", "t13_data.stl"]
PEERS = ["mmgs", "mmgs-loose", "cgal-protect", "cgal-resample"]
# Column, key of the judge, whether more is better, format.
COLUMNS = [
    ("kappa min", "kappa_min", True, ".3f"), ("kappa mean", "kappa_mean", True, ".4f"), ("tau", "tau", True, ".1f"),
    ("skew max", "skew_max", False, ".3f"), ("Hausdorff", "hausdorff_max_rel", False, ".2e"), ("RMS", "hausdorff_rms_rel", False, ".2e"),
    ("features", "feature_kept", True, ".3f"), ("crossings", "self_intersections", False, "d"),
]


def find(tree, key):
    """The value of a key in nested dictionaries."""
    if isinstance(tree, dict):
        if key in tree:
            return tree[key]
        for value in tree.values():
            found = find(value, key)
            if found is not None:
                return found
    return None


def peers(arguments, path, size, folder):
    """What each peer made: its name, the judge's figures, its user seconds."""
    results = []
    for peer in arguments.peer or PEERS:
        command = [arguments.python, os.path.join(arguments.judge, "peers.py"), "run", "--size", str(size), "--out", folder, "--peer", peer, path]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        try:
            result = json.loads(run.stdout)[0]
        except (ValueError, IndexError):
            print(f"{os.path.basename(path)} {peer}: no answer: {run.stderr.strip()[-200:]}", file=sys.stderr)
            continue
        if find(result, "kappa_min") is not None and find(result, "topology_kept"):
            results.append((peer, result, find(result, "user_s")))
    return results


def row(arguments, judge, model, folder):
    import numpy as np
    path, triangles = os.path.join(arguments.data, model), MODELS[model]
    source = judge.read(path, "always")
    area = judge.norm(judge.triangle_area_vectors(source.V, source.triangulated())).sum()
    size = float(np.sqrt(area / triangles * 4 / 3 ** 0.5))
    output = os.path.join(folder, "ours.obj")
    command = [program(), "run", path, "-o", output, "--triangles", str(triangles), "--threads", "1", "-q"]
    user = min(timed(command)[0] for _ in range(arguments.repeat))
    ours = judge.judge(source, judge.read(output, "auto"), size)
    others = peers(arguments, path, size, folder)
    cells = [model, str(ours["n_triangles"])]
    for _, key, more, form in COLUMNS:
        mine = ours[key]
        theirs = [(find(r, key), name) for name, r, _ in others if find(r, key) is not None]
        if mine is None or not theirs:
            cells.append("")
            continue
        best = max(theirs) if more else min(theirs)
        lead = mine >= best[0] if more else mine <= best[0]
        cells.append(f"{'**' if lead else ''}{mine:{form}}{'**' if lead else ''} / {best[0]:{form}} {best[1]}")
    fastest = min(((t, name) for name, _, t in others if t is not None), default=(float("nan"), "none"))
    cells.append(f"{user:.2f} / {fastest[0]:.2f} {fastest[1]} = {user / fastest[0]:.2f}")
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--judge", required=True, help="folder of judge.py and peers.py")
    parser.add_argument("--data", required=True, help="folder of the real meshes")
    parser.add_argument("--python", default=sys.executable, help="python that has the peers")
    parser.add_argument("--peer", action="append", help="a peer of peers.py; repeated")
    parser.add_argument("--repeat", type=int, default=3, help="runs of ours, of which the fastest counts")
    parser.add_argument("models", nargs="*", default=EIGHT)
    arguments = parser.parse_args()
    sys.path.insert(0, arguments.judge)
    import judge
    print("| model | triangles | " + " | ".join(f"{c[0]}: ours / best peer" for c in COLUMNS) + " | user s: ours / fastest peer |")
    print("|---" * (len(COLUMNS) + 3) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for model in arguments.models:
            row(arguments, judge, model, folder)


if __name__ == "__main__":
    main()
