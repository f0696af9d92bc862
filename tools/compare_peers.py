#!/usr/bin/env python3
"""raytide beside Mitsuba 3, Cycles and LuxCore: the same scenes, samples a second and error at equal time.

    python3 tools/run.py python tools/compare_peers.py [--renderers raytide,mitsuba,...] [--scenes cornell,...]
        [--python NAME=INTERPRETER ...] [--mesh bunny.ply] [--json FILE] [--work FOLDER]

Each renderer runs in processes of its own, by the interpreter given for it, else by .peers/NAME/bin/python, else by
this one if it can import it; one that is not there is left out, and how to install it is said. Equal for all: flat
triangles, camera, box filter, maximum depth, threads; no Russian roulette, clamping, adaptive sampling or denoising.
raytide estimates its error. Errors are against a long render of Mitsuba's, raytide's own without it, or by the renderer
that --reference-by names, kept in FOLDER.
Let nothing else run meanwhile. `--tables FILE...` prints the tables of earlier JSON again, later rows in place of
earlier ones.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from compare_peers_report import Reference, figures, print_tables
from compare_peers_scenes import SCENES, PeerScene
from compare_peers_worker import RENDERERS
from raytide import __version__
from raytide.errors import RaytideError, UsageError
from raytide.importers import geometry

ROOT = Path(__file__).resolve().parents[1]
SLICES = 8  # replicates that a reference is made of
LONGEST_S = 1200.0  # of one process


@dataclass(frozen=True)
class Package:
    """Where a renderer comes from: its environment's name, what to import, what to install, what else it needs."""

    folder: str
    module: str
    install: str
    more: str = ""


MITSUBA = Package("mitsuba", "mitsuba", "mitsuba==3.9.1 numpy",
                  "it also needs libLLVM 19 (Debian, Ubuntu: apt-get install libllvm19); DRJIT_LIBLLVM_PATH names it")
PACKAGES = {
    "raytide": Package("raytide", "raytide", "."),
    "mitsuba": MITSUBA,
    "mitsuba_mj": MITSUBA,
    "cycles": Package("cycles", "bpy", "bpy==5.0.1 OpenEXR numpy", "bpy wants the Python that it was built for: 3.11"),
    "luxcore": Package("luxcore", "pyluxcore", "pyluxcore==2.11.2 numpy==1.26.4"),
}


def main() -> int:
    """Exit code 0; 2 for a wrong option or where nothing can be compared."""
    options = parse()
    try:
        if options.tables:
            print_tables(joined([json.loads(path.read_text(encoding="utf-8")) for path in options.tables]))
            return 0
        return compare(options)
    except RaytideError as error:
        print(f"compare_peers: {error}", file=sys.stderr)
        return error.exit_code


def compare(options: argparse.Namespace) -> int:
    pythons = interpreters(options)
    for name in [name for name in options.renderers if name not in pythons]:
        print(how_to_install(name), file=sys.stderr)
    if not pythons:
        raise UsageError("--renderers: none of them is installed")
    options.work.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {"about": about(options), "rows": []}
    for scene in options.scenes:
        picture = options.work / f"scene-{scene}.npz"
        made = SCENES[scene](mesh_of(options) if scene == "bunny" else None)
        made.save(picture)
        by = referee(pythons, options)
        reference = reference_of(scene, by, picture, made, pythons, options)
        for name, python in pythons.items():
            say(f"{scene}: {name}")
            row = measure(name, python, picture, reference, options)
            names = {"scene": scene, "triangles": made.triangles, "renderer": name, "reference": by}
            result["rows"].append(names | row)
            if options.json:
                options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print_tables(result)
    return 0


def about(options: argparse.Namespace) -> dict[str, Any]:
    return {
        "raytide": __version__, "machine": platform.processor() or platform.machine(), "processors": os.cpu_count(),
        "load": os.getloadavg() if hasattr(os, "getloadavg") else None, "command": " ".join(sys.argv),
        "size": options.size, "threads": options.threads, "replicates": options.replicates,
        "reference_spp": options.reference_spp, "reference_by": options.reference_by, "seconds": options.seconds,
    }  # fmt: skip


def joined(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Results of several runs as one; of a scene and renderer the last row counts. UsageError where sizes, threads,
    times or lengths of references differ."""
    equal = ("size", "threads", "seconds", "reference_spp")
    for key in equal:
        if len({json.dumps(one["about"][key]) for one in results}) > 1:
            raise UsageError(f"--tables: came files of different {key}; wanted equal ones")
    rows = {(row["scene"], row["renderer"]): row for one in results for row in one["rows"]}
    return {"about": results[0]["about"], "rows": list(rows.values())}


def mesh_of(options: argparse.Namespace) -> tuple[np.ndarray, np.ndarray]:
    """The mesh of scene bunny: the one given, else the shipped generator's blob of 70 k triangles."""
    path = options.mesh
    if path is None:
        path = options.work / "blob_70k.ply"
        if not path.exists():
            maker = [sys.executable, ROOT / "scenes/blob/generate.py", "70000", path]
            subprocess.run(maker, check=True, stdout=subprocess.DEVNULL)
    mesh = geometry.load_mesh(path)
    return mesh.vertices, mesh.triangles


def interpreters(options: argparse.Namespace) -> dict[str, str]:
    """Of the renderers asked for, those that can be run, and by which Python."""
    given = dict(pair.split("=", 1) for pair in options.python)
    found = {}
    for name in options.renderers:
        package = PACKAGES[name]
        own = ROOT / ".peers" / package.folder / "bin" / "python"
        if package.folder in given:
            found[name] = given[package.folder]
        elif name != "raytide" and own.exists():
            found[name] = str(own)
        elif importlib.util.find_spec(package.module):
            found[name] = sys.executable
    return found


def how_to_install(name: str) -> str:
    package = PACKAGES[name]
    place = f".peers/{package.folder}"
    return (f"compare_peers: {name} is left out: {package.module} is not installed. In {ROOT}:\n"
            f"    python3 -m venv {place} && {place}/bin/pip install {package.install}"
            + (f"\n    ({package.more})" if package.more else ""))  # fmt: skip


def referee(pythons: dict[str, str], options: argparse.Namespace) -> str:
    """Who renders the references."""
    there = [n for n in (options.reference_by, "mitsuba", "mitsuba_mj", *pythons) if n in pythons]
    name = "mitsuba" if there[0] == "mitsuba_mj" else there[0]
    if options.reference_by not in (None, name):
        raise UsageError(f"--reference-by: came {options.reference_by}; wanted one of {', '.join(pythons)}")
    return name


def reference_of(
    scene: str, name: str, picture: Path, made: PeerScene, pythons: dict[str, str], options: argparse.Namespace
) -> Reference:
    """Replicates of `reference_spp` samples in all, resumed from the folder where it has some of this very scene."""
    path = options.work / f"reference-{scene}-{name}-{options.size}-{options.reference_spp}.npz"
    mark = made.digest()
    pictures = np.zeros((0, options.size, options.size, 3), np.float32)
    if path.exists():
        with np.load(path) as file:
            if str(file["mark"]) == mark:
                pictures = file["pictures"]
    python = pythons.get(name) or pythons["mitsuba_mj"]
    while len(pictures) < SLICES:
        say(f"{scene}: reference by {name}, part {len(pictures) + 1} of {SLICES}")
        job = {"job": "reference", "spp": -(-options.reference_spp // SLICES), "first": len(pictures), "count": 1}
        _, more = work(name, python, picture, job, options)
        pictures = np.concatenate([pictures, more["pictures"]])
        np.savez(path, pictures=pictures, mark=np.array(mark))
    return Reference(pictures)


def measure(
    name: str, python: str, picture: Path, reference: Reference, options: argparse.Namespace
) -> dict[str, Any]:
    """One renderer on one scene: a first start with empty caches, then everything with those caches warm."""
    keys = {"seconds": options.seconds, "replicates": options.replicates, "repeats": options.repeats}
    with tempfile.TemporaryDirectory() as home:
        try:
            cold, _ = work(name, python, picture, {"job": "start"}, options, home)
            full, pictures = work(name, python, picture, {"job": "measure"} | keys, options, home)
        except UsageError as error:
            say(str(error))
            return {"failed": str(error)}
    full["cold_first_picture_s"] = cold["first_picture_s"]
    return full | figures(full, pictures, reference)


def work(
    name: str, python: str, picture: Path, job: dict[str, Any], options: argparse.Namespace, home: str | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Runs the worker; its facts and its pictures. UsageError with its last words where it fails."""
    environment = dict(os.environ, PYTHONPATH=str(ROOT / "host") if name == "raytide" else "", PYTHONSAFEPATH="")
    if home:
        environment |= {"HOME": home, "XDG_CACHE_HOME": f"{home}/cache", "RAYTIDE_CACHE_DIR": f"{home}/raytide"}
    if name == "luxcore":
        environment |= allocator(python)
    job |= {"size": options.size, "threads": options.threads}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "pictures.npz"
        words = [python, ROOT / "tools/compare_peers_worker.py", name, picture, out, json.dumps(job)]
        try:
            done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=LONGEST_S)
            facts = json.loads(done.stdout.splitlines()[-1])
        except (OSError, subprocess.TimeoutExpired, IndexError, ValueError) as error:
            last = done.stderr.strip().splitlines()[-1:] if isinstance(error, IndexError | ValueError) else [str(error)]
            raise UsageError(f"{name} failed: {' '.join(last) or 'without a word'}") from None
        if not out.exists():
            return facts, {}
        with np.load(out) as file:
            return facts, dict(file)


def allocator(python: str) -> dict[str, str]:
    """pyluxcore aborts beside other libraries' allocators unless the one that it carries is loaded first."""
    packages = Path(python).parent.parent
    found = sorted(packages.glob("lib/python*/site-packages/pyluxcore.libs/libtbbmalloc_proxy*"))
    return {"LD_PRELOAD": str(found[0])} if found else {}


def say(text: str) -> None:
    print(f"compare_peers: {text}", file=sys.stderr, flush=True)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renderers", type=names(RENDERERS), default=list(RENDERERS), help=", ".join(RENDERERS))
    parser.add_argument("--scenes", type=names(SCENES), default=list(SCENES), help=", ".join(SCENES))
    parser.add_argument("--python", action="append", default=[], metavar="NAME=INTERPRETER", type=pair,
                        help="Python that has a renderer: mitsuba, cycles or luxcore")
    parser.add_argument("--mesh", type=Path, help="of scene bunny (PLY, OBJ, STL); else a blob of 70 k triangles")
    parser.add_argument("--seconds", type=float, nargs="+", default=[1.0, 4.0], help="equal times of rendering")
    parser.add_argument("--replicates", type=whole, default=2, help="pictures of each time")
    parser.add_argument("--repeats", type=whole, default=3, help="of the rate; its median counts")
    parser.add_argument("--reference-spp", type=whole, default=2048)
    parser.add_argument("--reference-by", choices=RENDERERS, help="by default Mitsuba, else the first that is there")
    parser.add_argument("--size", type=whole, default=256, help="pixels a side")
    parser.add_argument("--threads", type=whole, default=os.cpu_count() or 1)
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "raytide-peers",
                        help="folder for scenes and references")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--tables", type=Path, nargs="+", help="only print the tables of these JSON files, joined")
    return parser.parse_args()


def names(known: Any) -> Any:
    def words(text: str) -> list[str]:
        unknown = [word for word in text.split(",") if word not in known]
        if unknown:
            raise argparse.ArgumentTypeError(f"came {unknown[0]!r}; wanted some of {','.join(known)}")
        return text.split(",")

    return words


def pair(text: str) -> str:
    name, _, python = text.partition("=")
    known = sorted({package.folder for package in PACKAGES.values()})
    if name not in known or not shutil.which(python):
        raise argparse.ArgumentTypeError(f"came {text!r}; wanted NAME=INTERPRETER, NAME one of {', '.join(known)}")
    return text


def whole(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"came {text!r}; wanted a whole number above 0")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
