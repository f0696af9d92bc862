"""Compiling in child processes.

PoCL's compiler holds one lock for the whole process, so only processes build in parallel; and where it aborts, only a
parent can tell. A child reads one JSON line for each program and answers with a JSON line and the binary's bytes. It
leaves when its input ends, or after 20 s without work.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from raytide.device.compile import Compiled, compile_text
from raytide.device.failure import BuildFailure
from raytide.device.info import DeviceInfo
from raytide.errors import DeviceError

_IDLE_S = 20.0
_LIMIT_S = 600.0  # for one program


def child_command(module: str) -> list[str]:
    """How to run main() of a module of this very raytide in another Python, wherever it was imported from."""
    root = str(Path(__file__).resolve().parents[2])
    boot = (
        f"import sys; sys.path.insert(0, {root!r}); import raytide; del sys.path[0]; from {module} import main; main()"
    )
    return [sys.executable, "-P", "-c", boot]


class WorkerDied(DeviceError):
    """The child ended without an answer: its compiler crashed, or it was too slow."""


class Worker:
    """One child process that compiles for one device; start, then compile() any number of programs."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info
        self._idle_since = time.monotonic()
        self._stderr = tempfile.TemporaryFile()
        environment = dict(os.environ)
        if info.icd_file and sys.platform.startswith("linux"):
            environment["OCL_ICD_VENDORS"] = info.icd_file  # the child needs no other driver
        self._process = subprocess.Popen(
            [*child_command("raytide.device.worker"), info.id, info.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=environment,
            start_new_session=True,  # Ctrl-C goes to the parent alone, which decides
        )

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    @property
    def stays(self) -> bool:
        """Whether the child lives and takes another program: one near the end of its idle time may leave meanwhile."""
        return self.alive and time.monotonic() - self._idle_since < _IDLE_S / 2

    def compile(self, name: str, text: str, options: Sequence[str], limit_s: float = _LIMIT_S) -> Compiled:
        """Compile one program. Raises BuildFailure for a refused text, WorkerDied where the child ends."""
        guard = threading.Timer(limit_s, self._process.kill)
        guard.start()
        try:
            return self._converse({"name": name, "text": text, "options": list(options)})
        except (OSError, ValueError):
            raise WorkerDied(self._last_words(name)) from None
        finally:
            guard.cancel()
            self._idle_since = time.monotonic()

    def _converse(self, job: dict[str, Any]) -> Compiled:
        into, out = self._pipes()
        into.write(json.dumps(job).encode() + b"\n")
        into.flush()
        answer = json.loads(out.readline() or b"?")  # an empty line is the end: not JSON
        if "refused" in answer:
            raise BuildFailure(answer["refused"], answer["log"])
        binary = out.read(answer["bytes"])
        if len(binary) != answer["bytes"]:
            raise ValueError("the child ended while it answered")
        return Compiled(binary, answer["log"], answer["build_s"])

    def _pipes(self) -> tuple[IO[bytes], IO[bytes]]:
        into, out = self._process.stdin, self._process.stdout
        if into is None or out is None:
            raise OSError("the child has no pipes")
        return into, out

    def _last_words(self, name: str) -> str:
        self._process.kill()
        code = self._process.wait()
        self._stderr.seek(0)
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        cause = f"signal {-code}" if code < 0 else f"exit code {code}"
        said = f": {lines[-1]}" if lines else ""
        return f"the compiler of {self.info.id} crashed on program '{name}' ({cause}){said}; try another --device"

    def kill(self) -> None:
        """End the child at once; a compile() that waits for it in another thread raises WorkerDied."""
        self._process.kill()

    def close(self) -> None:
        """Let the child go: it ends when its input does."""
        for pipe in (self._process.stdin, self._process.stdout):
            try:
                if pipe:
                    pipe.close()
            except OSError:
                pass  # the child is gone and had unread input
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._stderr.close()


def main() -> None:
    """The child's life: find the device, answer jobs until there are no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a driver prints must not mix with answers
    from raytide.device.environment import opencl
    from raytide.device.find import list_devices

    cl = opencl()
    devices = list_devices()
    wanted_id, wanted_name = sys.argv[1:3]
    same = [device for device in devices if device.id == wanted_id] or [
        device for device in devices if device.name == wanted_name
    ]
    info = same[0]
    handle = cl.get_platforms()[info.place[0]].get_devices()[info.place[1]]
    context = cl.Context([handle])
    while job := _next_job():
        try:
            _, done = compile_text(cl, context, handle, info, job["name"], job["text"], job["options"])
        except BuildFailure as refused:
            _answer(answers, {"refused": str(refused), "log": refused.build_log})
            continue
        _answer(answers, {"bytes": len(done.binary), "log": done.log, "build_s": done.build_s}, done.binary)


def _next_job() -> dict[str, Any] | None:
    import select

    ready, _, _ = select.select([sys.stdin.buffer], [], [], _IDLE_S)
    line = sys.stdin.buffer.readline() if ready else b""
    return json.loads(line) if line else None


def _answer(answers: IO[bytes], head: dict[str, Any], payload: bytes = b"") -> None:
    answers.write(json.dumps(head).encode() + b"\n" + payload)
    answers.flush()
