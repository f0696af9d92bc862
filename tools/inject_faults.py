"""Does to a render's files and to its process what disks, people and systems do, and checks that nothing is lost.

Every case is a whole command on a fresh copy of an unfinished render: it must exit as promised, say why in words that
name the file, and leave the picture of a render that was never disturbed, bit for bit, or the generation before.

    python3 tools/run.py python tools/inject_faults.py [CASE...]

Kills at random instants are in kill_and_resume.py.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from raytide.image import read_exr
from raytide.render import checkpoint_file

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "scenes/cornell/cornell.toml"
SIZE, SPP, LONG = "64x64", 512, "1000000"
STOP_S = 2.0  # from a signal to the end of the process
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1  # linux/prctl.h, linux/capability.h


class Lab:
    """The undisturbed picture, and an unfinished render of it with two generations. Checkpoints name their scene and
    picture by whole paths, so that every case has the same folder, made anew."""

    def __init__(self, folder: Path) -> None:
        self.work, self.origin = folder / "work", folder / "origin"
        self.work.mkdir()
        shutil.copy(SCENE, self.work / "scene.toml")
        self.run(self.work, "render", "scene.toml", "--size", SIZE, "--spp", str(SPP), "-o", "whole.exr")
        child = self.start(self.work, *self.begin())
        until(child, lambda: spp_of(self.work / "a.ck") >= 32)
        child.terminate()
        child.communicate()
        assert checkpoint_file.old_of(self.work / "a.ck").exists()
        (self.work / "a.exr").unlink()
        self.work.rename(self.origin)

    def begin(self, checkpoint: str = "a.ck", spp: int = SPP) -> list[str]:
        """The command that keeps its render."""
        return ["render", "scene.toml", "--size", SIZE, "--spp", str(spp), "-o", "a.exr", "--checkpoint", checkpoint,
                "--every", "0.02"]  # fmt: skip

    def anew(self) -> Path:
        """The folder with the unfinished render, as it was."""
        shutil.rmtree(self.work, ignore_errors=True)
        return Path(shutil.copytree(self.origin, self.work))

    def start(self, folder: Path, *words: str, **other: object) -> subprocess.Popen[str]:
        command = [sys.executable, "-P", "-m", "raytide", *words]
        environment = os.environ | {"PYTHONPATH": str(ROOT / "host")}
        return subprocess.Popen(command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, **other)  # type: ignore[call-overload, no-any-return] # fmt: skip

    def run(self, folder: Path, *words: str, code: int = 0, says: str = "") -> str:
        """A command to its end; what it said. AssertionError where it did not end or speak as it must."""
        child = self.start(folder, *words)
        said = child.communicate(timeout=600)[1]
        assert child.returncode == code, f"exit {child.returncode} instead of {code}: {said}"
        assert says in said and "Traceback" not in said, f"wanted {says!r}; said {said!r}"
        return said

    def same(self, folder: Path) -> str:
        """Whether the picture is the undisturbed one."""
        a, b = (read_exr(path).layers for path in (self.origin / "whole.exr", folder / "a.exr"))
        assert all(np.array_equal(a[layer], b[layer], equal_nan=True) for layer in a), "another picture"
        return "same picture"


def until(child: subprocess.Popen[str], ready: Callable[[], bool]) -> None:
    """Waits while the command runs."""
    while not ready():
        assert child.poll() is None, child.communicate()[1]
        time.sleep(0.005)


def spp_of(path: Path) -> int:
    """Samples in a checkpoint; -1 without one."""
    facts = checkpoint_file.peek(path) if path.exists() else None
    return int(facts["spp"]) if facts else -1


def truncated(lab: Lab, folder: Path) -> str:
    """The newest generation torn: the one before goes on."""
    data = (folder / "a.ck").read_bytes()
    (folder / "a.ck").write_bytes(data[: len(data) // 2])
    lab.run(folder, "resume", "a.ck", says="a.ck")
    return lab.same(folder)


def both_truncated(lab: Lab, folder: Path) -> str:
    """No whole generation: refused, both named."""
    for path in (folder / "a.ck", checkpoint_file.old_of(folder / "a.ck")):
        path.write_bytes(path.read_bytes()[:-1])
    assert "a.ck.old" in lab.run(folder, "resume", "a.ck", code=2, says="truncated or damaged")
    return "refused"


def foreign(lab: Lab, folder: Path) -> str:
    """A file that is no checkpoint: never written over, and not resumed."""
    (folder / "b.ck").write_text("a thesis")
    lab.run(folder, *lab.begin("b.ck"), code=2, says="no checkpoint")
    lab.run(folder, "resume", "b.ck", code=2, says="no checkpoint")
    assert (folder / "b.ck").read_text() == "a thesis"
    return "refused, file kept"


def unfinished(lab: Lab, folder: Path) -> str:
    """A new render over an unfinished one: refused."""
    before = (folder / "a.ck").read_bytes()
    lab.run(folder, *lab.begin(), code=2, says="raytide resume")
    assert (folder / "a.ck").read_bytes() == before
    return "refused, file kept"


def other_scene(lab: Lab, folder: Path) -> str:
    """The scene edited since: refused; edited back, it goes on."""
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace("fov = ", "fov = 1", 1))
    lab.run(folder, "resume", "a.ck", code=2, says="SHA-256")
    (folder / "scene.toml").write_text(text)
    lab.run(folder, "resume", "a.ck")
    return "refused; edited back: " + lab.same(folder)


def mortal() -> None:
    """In a child: permissions hold for root too."""
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


def read_only(lab: Lab, folder: Path) -> str:
    """A folder that cannot be written: refused before any work; where it becomes so, the render goes on."""
    place = folder / "kept"
    place.mkdir(0o555)
    child = lab.start(folder, *lab.begin("kept/a.ck"), preexec_fn=mortal)
    said = child.communicate(timeout=600)[1]
    assert child.returncode == 2 and "cannot be written" in said, said
    place.chmod(0o755)
    child = lab.start(folder, *lab.begin("kept/a.ck"), preexec_fn=mortal)
    until(child, lambda: spp_of(place / "a.ck") >= 8)
    place.chmod(0o555)
    said = child.communicate(timeout=600)[1]
    place.chmod(0o755)
    assert child.returncode == 1 and "the render goes on" in said and "picture was written" in said, said
    return f"refused; midway: told, exit 1, {lab.same(folder)}, {goes_on(lab, folder, place / 'a.ck')}"


def goes_on(lab: Lab, folder: Path, path: Path) -> str:
    """The generation that was left goes on to the same picture."""
    spp = spp_of(path)
    (folder / "a.exr").unlink()
    lab.run(folder, "resume", str(path))
    lab.same(folder)
    return f"generation of {spp} spp goes on to it too"


def disk_full(lab: Lab, folder: Path) -> str:
    """A disk that fills up: told, the render goes on, the old generation stays."""
    place = folder / "kept"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "none", str(place)], capture_output=True)
    if mounted.returncode:
        return "left out: no small file system can be mounted here"
    try:
        child = lab.start(folder, *lab.begin("kept/a.ck"))
        until(child, lambda: spp_of(place / "a.ck") >= 8)
        with open(place / "rest", "wb", buffering=0) as rest:
            while child.poll() is None:  # also what a writer gives back
                try:
                    rest.write(bytes(4096))
                except OSError:
                    time.sleep(0.001)
        said = child.communicate()[1]
        assert child.returncode == 1 and "No space left" in said and "picture was written" in said, said
        (place / "rest").unlink()
        return f"told, exit 1, {lab.same(folder)}, {goes_on(lab, folder, place / 'a.ck')}"
    finally:
        subprocess.run(["umount", str(place)], check=True)


def other_device(lab: Lab, folder: Path) -> str:
    """On another device a render goes on, and says so."""
    from raytide.device import list_devices

    names = [device.id for device in list_devices()]
    first = (checkpoint_file.peek(folder / "a.ck") or {})["device"]
    others = [name for name in names if name != first]
    if not others:
        return "left out: there is one device only"
    said = lab.run(folder, "resume", "a.ck", "--device", others[0], says="was begun on")
    a, b = (read_exr(path).layers["beauty"][..., :3] for path in (lab.origin / "whole.exr", folder / "a.exr"))
    off = float(np.abs(a - b).mean() / a.mean())
    assert off < 1e-3 and others[0] in said, off
    return f"{first} -> {others[0]}: mean difference {off:.1e} of the radiance"


def signals(lab: Lab, folder: Path) -> str:
    """SIGTERM and Ctrl-C: checkpoint and picture within two seconds, and exit codes."""
    found = []
    for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)) * 3:
        for path in folder.glob("s.*"):
            path.unlink()
        words = [word.replace("a.", "s.") for word in lab.begin(spp=int(LONG))]
        child = lab.start(folder, *words[:-2])
        until(child, lambda: spp_of(folder / "s.ck") >= 0)
        time.sleep(2.0)
        sent = time.monotonic()
        child.send_signal(number)
        said = child.communicate(timeout=60)[1]
        found.append(time.monotonic() - sent)
        assert child.returncode == code and (folder / "s.exr").exists() and spp_of(folder / "s.ck") > 0, said
    assert max(found) < STOP_S, found
    return f"exit 143, 130; ended after {', '.join(f'{seconds:.2f}' for seconds in found)} s"


CASES = (truncated, both_truncated, foreign, unfinished, other_scene, read_only, disk_full, other_device, signals)


def main() -> int:
    """Every case, a line each; 1 where one was not survived."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", help=", ".join(case.__name__ for case in CASES))
    wanted = parser.parse_args().cases
    lost = 0
    with tempfile.TemporaryDirectory() as name:
        lab = Lab(Path(name))
        for case in CASES:
            if wanted and case.__name__ not in wanted:
                continue
            try:
                told = case(lab, lab.anew())
            except (AssertionError, subprocess.TimeoutExpired) as error:
                told, lost = f"NOT SURVIVED: {error}", lost + 1
            print(f"{case.__name__:16}{told}", flush=True)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
