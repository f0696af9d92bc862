"""Files that others wrote: numbers that are none, indices and sizes that lie, paths that escape, bombs (cases I).

Nothing here touches a device, but for the furnace of mirrored meshes.
"""

from __future__ import annotations

import json
import os
import struct
import tempfile
import zlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import raytide as rt
from raytide.errors import RaytideError, SceneError
from raytide.importers.geometry import load_mesh
from raytide.importers.picture import load_picture
from raytide.scene import Camera, Scene, load, mesh, sky
from raytide.verify.case import Judged, Trial, bounded, case, forbidden, once
from raytide.verify.host import measured, outcome, refusal, tables
from raytide.verify.lab import Lab

MIB = 1 << 20


def written(folder: str, name: str, content: str | bytes) -> Path:
    """A file with that content."""
    path = Path(folder) / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def said(text: str, suffix: str = ".json") -> tuple[str, list[str]]:
    """Outcome of loading a scene file of that text, and the keys that it is refused for."""
    with tempfile.TemporaryDirectory() as folder:
        path = written(folder, f"scene{suffix}", text)
        keys: list[str] = []

        def attempt() -> None:
            try:
                load(path)
            except SceneError as error:
                keys.extend(problem.key for problem in error.problems)
                raise

        return outcome(attempt), keys


def counted(wrong: dict[str, bool], figures: dict[str, Any] | None = None) -> Judged:
    """Named conditions of one trial that must not be."""
    named = [name for name, bad in wrong.items() if bad]
    return Judged(forbidden(np.array([bool(named)])), {"wrong": ", ".join(named) or "none", **(figures or {})})


def read_each(files: dict[str, tuple[str | bytes, str]], timed: bool) -> Judged:
    """Reads files, scenes or meshes by their suffixes: the outcome is one of the words beside the content, memory grows
    by less than 256 MiB and, where `timed`, none takes more than 2 s of processor time."""
    wrong, slowest = {}, 0.0
    for name, (content, wanted) in files.items():
        read = load_mesh if name.endswith((".gltf", ".serialized")) else lambda path: load(path).flatten()
        with tempfile.TemporaryDirectory() as folder:
            path = written(folder, name, content)
            with measured() as cost:
                result = outcome(partial(read, path))
        slowest = max(slowest, cost.processor)
        late = timed and (cost.processor > 2 or cost.seconds > 20)  # the clock tells of waits, and of other work
        wrong[f"{name}: {result}, {cost.processor:.1f} s, {cost.seconds:.1f} s on the clock"] = (
            result not in wanted.split() or late or cost.bytes > 256 * MIB)
    return counted(wrong, {"slowest": f"{slowest:.2f} s"})


@case("I1", "input", "NaN, Infinity, 1e999, -0, 1e-320 and 0x10 as numbers of a JSON scene",
      "the first three refused with the path of the key; -0 and denormals taken as zero's neighbours, or refused",
      "Python's JSON takes NaN")  # fmt: skip
def numbers(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        wrong = {}
        for word in ("NaN", "Infinity", "-Infinity", "1e999", "-1e999", "0x10", "1e19"):
            text = json.dumps(tables()).replace('"type": "sphere"', f'"type": "sphere", "radius": {word}', 1)
            result, keys = said(text)
            named = "objects.ball.radius" in keys or word == "0x10"  # that is not JSON at all
            wrong[word] = result != "refused" or not named
        for word in ("-0", "1e-320", "-0.0"):
            text = json.dumps(tables()).replace("[0, 0, 0]", f"[{word}, 0, 0]", 1)
            wrong[word] = said(text)[0] not in ("taken", "refused")
        return counted(wrong)

    yield once("", judge)


@case("I2", "input",
      "mesh indices of -1, n, 2^31 and 2^32 + 1 in scenes and files; OBJ counted from the end; files with "
      "random bytes changed", "refused, or every index below the number of vertices; no other exception",
      "read out of bounds")  # fmt: skip
def indices(lab: Lab) -> Iterator[Trial]:
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

    def typed() -> Judged:
        wrong = {}
        for index in (-1, 3, 2**31, 2**32 + 1, 2**64):
            shape = {"type": "mesh", "vertices": points, "faces": [[0, 1, index]], "material": "m"}
            wrong[f"scene {index}"] = refusal({"objects": {"ball": shape}}) == []
            with tempfile.TemporaryDirectory() as folder:
                path = written(folder, "m.obj", f"{obj}f 1 2 {index + 1}\n")
                wrong[f"obj {index}"] = outcome(lambda path=path: load_mesh(path)) != "refused"  # type: ignore[misc]
        with tempfile.TemporaryDirectory() as folder:
            made = load_mesh(written(folder, "m.obj", f"{obj}f -3 -2 -1\n"))
            wrong["from the end"] = made.triangles.tolist() != [[0, 1, 2]]
        return counted(wrong)

    def fuzzed(suffix: str, content: bytes) -> Judged:
        rng, wrong, taken = lab.rng(1202), {}, 0
        with tempfile.TemporaryDirectory() as folder:
            for place in range(lab.count(100, 25_000)):
                data = bytearray(content)
                for _ in range(rng.integers(1, 6)):
                    data[rng.integers(len(data))] = rng.integers(256)
                cut = len(data) if rng.random() < 0.8 else int(rng.integers(len(data)))
                path = written(folder, f"m{suffix}", bytes(data[:cut]))
                try:
                    made = load_mesh(path)
                    taken += 1
                    if len(made.triangles) and made.triangles.max() >= len(made.vertices):
                        wrong[f"{place}: out of bounds"] = True
                except RaytideError:
                    pass
                except Exception as error:  # anything else is what is looked for
                    wrong[f"{place}: {type(error).__name__}"] = True
        return counted(wrong, {"taken": taken})

    yield once("typed", typed)
    for suffix, content in mesh_files().items():
        yield once(f"fuzzed {suffix}", partial(fuzzed, suffix, content))


def mesh_files() -> dict[str, bytes]:
    """A small sound file of each format."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    head = ("ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
            "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n")  # fmt: skip
    body = corners.tobytes() + b"".join(struct.pack("<B3i", 3, *face) for face in faces.tolist())
    lines = [f"v {x} {y} {z}" for x, y, z in corners.tolist()] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    rows = [struct.pack("<3f", 0, 0, 1) + corners[face].tobytes() + b"\0\0" for face in faces]
    buffer = corners.tobytes() + faces.astype("<u4").tobytes()
    scene = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
             "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
             "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                           {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}],
             "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}],
             "buffers": [{"byteLength": len(buffer)}]}  # fmt: skip
    words = json.dumps(scene).encode()
    words += b" " * (-len(words) % 4)
    chunks = struct.pack("<I4s", len(words), b"JSON") + words + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    glb = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
    return {".ply": head.encode() + body, ".obj": "\n".join(lines).encode(),
            ".stl": b"\0" * 80 + struct.pack("<I", 4) + b"".join(rows), ".glb": glb}  # fmt: skip


@case("I3", "input", "no faces, faces of 2 and of 100,000 corners, mixed line ends, a byte-order mark", "a documented "
      "result: taken or refused", "a crash")  # fmt: skip
def odd_faces(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        corners = lab.count(10_000, 1_000_000)
        ring = "".join(f"v {np.cos(t):.6f} {np.sin(t):.6f} 0\n" for t in np.linspace(0, 6.28, corners, endpoint=False))
        base = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
        files = {
            "no faces": (base, "refused taken"), "two corners": (base + "f 1 2\n", "taken refused"),
            "a polygon": (ring + "f " + " ".join(str(i + 1) for i in range(corners)) + "\n", "taken"),
            "mixed line ends": ("v 0 0 0\r\nv 1 0 0\nv 0 1 0\rf 1 2 3\n", "taken refused"),
            "CRLF": ((base + "f 1 2 3\n").replace("\n", "\r\n"), "taken"),
            "byte-order mark": ("\ufeff" + base + "f 1 2 3\n", "taken"), "nothing": ("", "refused taken"),
        }  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            found = {name: outcome(partial(load_mesh, written(folder, "m.obj", text)))
                     for name, (text, _) in files.items()}  # fmt: skip
        wanted = {name: words.split() for name, (_, words) in files.items()}
        return counted({f"{name}: {result}": result not in wanted[name] for name, result in found.items()})

    yield once("", judge)


@case("I4", "input", "a PLY header of 200 bytes that claims 2^60 vertices, and one of 2^40 faces",
      "refused; memory grows by less than 64 MiB", "allocated before it is looked at")  # fmt: skip
def huge_claims(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        wrong, most = {}, 0
        for vertices, faces in ((2**60, 1), (3, 2**40), (-5, 1), (2**64, 2**64)):
            head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n"
                    f"property float y\nproperty float z\nelement face {faces}\n"
                    "property list uchar int vertex_indices\nend_header\n")  # fmt: skip
            with tempfile.TemporaryDirectory() as folder, measured() as cost:
                result = outcome(partial(load_mesh, written(folder, "m.ply", head + "\0" * 64)))
            most = max(most, cost.bytes)
            wrong[f"{vertices} {faces}: {result}"] = result != "refused" or cost.bytes > 64 * MIB
        return counted(wrong, {"memory": f"{most / MIB:.0f} MiB"})

    yield once("", judge)


@case("I5", "input", "paths out of the scene's folder: .., absolute, links, \\\\server, NUL, devices, pipes",
      "none opened",
      "a scene reads any file of its user")  # fmt: skip
def escapes(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        wrong = {}
        with tempfile.TemporaryDirectory() as base:
            inside = Path(base) / "scene"
            inside.mkdir()
            secret = written(base, "secret.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
            (inside / "link.obj").symlink_to(secret)
            (inside / "folder").symlink_to(base)
            os.mkfifo(inside / "pipe.obj")
            names = ["../secret.obj", str(secret), "link.obj", "folder/secret.obj", "\\\\server\\share\\m.obj",
                     "a\0.obj", "/dev/zero", "pipe.obj", "C:\\m.obj", "./../scene/../secret.obj"]  # fmt: skip
            for name in names:
                shape = {"type": "mesh", "mesh": name, "material": "m"}
                path = inside / "scene.json"
                path.write_text(json.dumps(tables(objects={"ball": shape})))
                with measured() as cost:
                    result = outcome(lambda path=path: load(path).flatten())  # type: ignore[misc]
                wrong[f"{name!r}: {result}"] = result != "refused" or cost.seconds > 10
        return counted(wrong, {"paths": len(names)})

    yield once("", judge)


@case("I6", "input", "instances of themselves, chains of 10,000, glTF nodes that double 40 times, a file that includes "
      "itself", "refused or right; less than 256 MiB; full: within 2 s of processor time",
      "2^30 instances from 1 KB")  # fmt: skip
def explosions(lab: Lab) -> Iterator[Trial]:
    def cases() -> dict[str, tuple[str | bytes, str]]:
        ball = {"type": "sphere", "material": "m"}
        loop = {"a": {"type": "instance", "of": "b"}, "b": {"type": "instance", "of": "a"}}
        chain: dict[str, Any] = {"n0": ball}
        chain |= {f"n{i}": {"type": "instance", "of": f"n{i - 1}"} for i in range(1, 10_000)}
        nodes: list[dict[str, Any]] = [{"children": [i + 1, i + 1]} for i in range(40)] + [{"mesh": 0}]
        doubled = [{"children": [2 * i + 1, 2 * i + 2]} for i in range(2**12 - 1)] + [{"mesh": 0}] * 2**12
        gltf: dict[str, Any] = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}]}
        gltf["meshes"] = [{"primitives": [{"attributes": {}}]}]
        return {
            "a loop.json": (json.dumps(tables(objects=loop)), "refused"),
            "a chain.json": (json.dumps(tables(objects=chain)), "refused taken"),
            "twins.gltf": (json.dumps(gltf | {"nodes": nodes}), "refused"),
            "a tree.gltf": (json.dumps(gltf | {"nodes": doubled}), "refused taken"),
            "itself.xml": ('<scene version="3.0.0"><include filename="itself.xml"/></scene>', "refused"),
        }

    yield once("", lambda: read_each(cases(), lab.full))


@case("I7", "input", "100,000 brackets in JSON, TOML and XML; a string of 64 MB; compressed bombs",
      "refused; no RecursionError; full: within 2 s of processor time", "the parser's stack overflows")  # fmt: skip
def bombs(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        deep = 100_000
        bomb = zlib.compress(b"\0" * (64 * MIB), 9)
        serialized = struct.pack("<HH", 0x041C, 4) + bomb + struct.pack("<QI", 0, 1)
        names = ["a", *(f"a{i}" for i in range(30))]
        twice = "".join(f'<!ENTITY {new} "&{old};&{old};">' for old, new in zip(names, names[1:], strict=False))
        files: dict[str, str | bytes] = {
            "brackets.json": '{"camera":' + "[" * deep + "]" * deep + "}", "open.json": "[" * deep,
            "brackets.toml": "a = " + "[" * deep + "]" * deep, "tags.xml": "<scene>" * deep,
            "string.json": '{"format": "' + "x" * (64 * MIB) + '"}', "bomb.serialized": serialized,
            "entities.xml": f'<!DOCTYPE s [<!ENTITY a "aaaaaaaaaa">{twice}]><s>&a29;</s>',
        }  # fmt: skip
        return read_each({name: (content, "refused") for name, content in files.items()}, lab.full)

    yield once("", judge)


@case("I8", "input", "unknown and repeated keys, wrong types, trailing commas, in JSON and TOML",
      "refused with the key, or the line; the nearest right word", "silently ignored")  # fmt: skip
def wrong_words(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        good = json.dumps(tables())
        edits = {
            "unknown": ('"type": "sphere"', '"type": "sphere", "radios": 1', "objects.ball.radios"),
            "repeated": ('"type": "sphere"', '"type": "sphere", "radius": 1, "radius": 2', "objects.ball.radius"),
            "wrong type": ('"type": "sphere"', '"type": "sphere", "radius": "big"', "objects.ball.radius"),
            "a list": ('"type": "sphere"', '"type": "sphere", "radius": [1]', "objects.ball.radius"),
            "unknown kind": ('"type": "sphere"', '"type": "sphree"', "objects.ball.type"),
            "trailing comma": ('"type": "sphere"', '"type": "sphere",', ""),
            "null": ("[0, 0, 4]", "null", "camera.origin"),
        }  # fmt: skip
        wrong = {}
        for name, (before, after, key) in edits.items():
            result, keys = said(good.replace(before, after, 1))
            wrong[name] = result != "refused" or key not in keys
        texts = {"toml": "[camera]\norigin = [0, 0, 4,]\ntarget = 3 3", "binary": "\0\x01\xff", "empty": ""}
        for name, text in texts.items():
            wrong[name] = said(text, ".toml")[0] != "refused"
        return counted(wrong)

    yield once("", judge)


@case("I9", "input", "singular, NaN, mirrored and 1e-30 transforms",
      "the first two refused; a mirrored mesh stays a white furnace; 1e-30 right or refused",
      "normals point inwards")  # fmt: skip
def transforms(lab: Lab) -> Iterator[Trial]:
    def refused() -> Judged:
        steps = {"singular": {"scale": [1, 0, 1]}, "nan": {"scale": float("nan")}, "vanishing": {"scale": 1e-30},
                 "matrix": {"matrix": [1.0] * 16}, "infinite": {"translate": [float("inf"), 0, 0]}}  # fmt: skip
        ball = {"type": "sphere", "material": "m"}
        return counted({name: not refusal({"objects": {"ball": ball | {"transform": [step]}}})
                        for name, step in steps.items()})  # fmt: skip

    def mirrored() -> Judged:
        scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0), fov=20, size=(8, 8)))
        # facets of 7.5 degrees: directions below a facet and above its smooth normal lose 7e-4 (2.8e-3 at 15 degrees)
        across, down = 48, 24
        t = np.linspace(0, 2 * np.pi, across, endpoint=False)
        rows = [np.stack([np.cos(t) * np.sin(a), np.full(across, np.cos(a)), np.sin(t) * np.sin(a)], 1)
                for a in np.linspace(0.05, np.pi - 0.05, down)]  # fmt: skip
        faces = [(r * across + i, r * across + (i + 1) % across, (r + 1) * across + i)
                 for r in range(down - 1) for i in range(across)]  # fmt: skip
        faces += [(b, b + across, a + across) for a, b, _ in faces]
        shape = mesh(vertices=np.concatenate(rows), faces=faces, smooth=True).scale((-1, 1, 1))
        scene.add(shape, rt.Diffuse(1.0), name="ball")
        scene.add(sky(1.0), name="sky")
        off = lab.render(scene, spp=256, max_depth=32).rgb.mean(dtype=np.float64) - 1
        return Judged(bounded(np.array([off]), 3e-3), {"off": f"{off:.1e}"})

    yield once("refused", refused)
    yield once("mirrored furnace", mirrored)


@case("I10", "input", "pictures of 1x1, 65535x1, 16 bits, CMYK, cut short; EXR without channels, or of huge windows",
      "right, or refused; no other exception", "a crash, or gigabytes")  # fmt: skip
def pictures(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        from PIL import Image

        from raytide.image import write_exr

        wrong: dict[str, bool] = {}
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            Image.new("RGB", (1, 1), (255, 0, 0)).save(root / "one.png")
            Image.new("RGB", (65535, 1), (9, 9, 9)).save(root / "long.png")
            Image.fromarray(np.full((4, 4), 65535, np.uint16)).save(root / "deep.png")
            Image.new("CMYK", (4, 4)).save(root / "cmyk.jpg")
            Image.new("RGB", (64, 64), (1, 2, 3)).save(root / "whole.jpg")
            write_exr(root / "whole.exr", {"beauty": np.full((16, 16, 4), 0.5, np.float32)}, {})
            for name in ("whole.jpg", "whole.exr", "one.png"):
                data = (root / name).read_bytes()
                written(folder, f"cut_{name}", data[: len(data) * 2 // 3])
                written(folder, f"none_{name}", b"")
            huge = bytearray((root / "whole.exr").read_bytes())
            at = huge.find(b"dataWindow\0box2i\0")
            huge[at + 21 : at + 37] = struct.pack("<4i", -(2**30), -(2**30), 2**30, 2**30)
            written(folder, "huge.exr", bytes(huge))
            for path in sorted(root.iterdir()):
                with measured() as cost:
                    result = outcome(partial(load_picture, path))
                wanted = "refused" if path.name.startswith(("cut_", "none_", "huge")) else "taken"
                wrong[f"{path.name}: {result}"] = result != wanted or cost.bytes > 256 * MIB
            wrong["deep is white"] = abs(float(load_picture(root / "deep.png").texels.max()) - 1) > 1e-6
        return counted(wrong)

    yield once("", judge)
