"""Runs the parts of a suite on one device, in child processes: a driver that crashes or hangs is a result, not an end.

A child that dies or falls silent takes only the part that it was at with it; another child does the rest.
"""

from __future__ import annotations

import hashlib
import json
import os
import queue
import subprocess
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import IO, Any

from raytide.bench import record
from raytide.bench.child import PLANS
from raytide.bench.model import SCHEMA
from raytide.bench.plan import PARTS, VISITS
from raytide.bench.roofline import add_limiters
from raytide.bench.score import score_of
from raytide.bench.shipped import edited_reasons
from raytide.bench.visits import joined
from raytide.bench.workloads import WORKLOADS
from raytide.device.worker import child_command

WORKLOAD_PARTS = ("renders", *(f"again{visit}" for visit in range(2, VISITS + 1)))
PATIENCE_S = 300.0  # without a word from the child
Say = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """What to measure on one device. `only` names workloads (all of them where empty)."""

    device: str
    suite: str = "quick"
    quick: bool = False
    threads: int | None = None
    only: tuple[str, ...] = ()
    scramble: int | None = None
    soak_s: float = 0.0
    patience_s: float = PATIENCE_S
    traversal: str = "single"

    @property
    def plan(self) -> str:
        return "quick" if self.quick or self.suite == "quick" else "full"

    @property
    def visits(self) -> int:
        """How often each workload is visited: more than once where there is a score."""
        return VISITS if self.scramble is None and not self.soak_s else 1

    @property
    def parts(self) -> list[str]:
        """In the order in which they run; workloads in another one where scrambled."""
        wanted: Sequence[str] = PARTS if self.suite in ("quick", "full") else [self.suite]
        if self.suite == "renders":
            wanted = [part for part in PARTS if part in WORKLOAD_PARTS]
        names = [name for name in WORKLOADS if not self.only or name in self.only]
        if self.scramble is not None:
            import random

            random.Random(self.scramble).shuffle(names)
        if self.visits == 1:
            wanted = [part for part in wanted if not part.startswith("again")]
        return [one for part in wanted
                for one in ([f"{part}/{name}" for name in names] if part in WORKLOAD_PARTS else [part])]  # fmt: skip


@dataclass
class Findings:
    """What children told so far."""

    device: dict[str, Any] | None = None
    parts: dict[str, dict[str, Any]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    partial: bool = False  # somebody ended the run before its end
    origin: float = field(default_factory=time.perf_counter)  # of time stamps; the same clock in children

    def samples(self) -> dict[str, int]:
        """Samples a pixel of a value of each workload that was right."""
        return {part.partition("/")[2]: one["timing"]["work_per_value"]["spp"] for part, one in self.parts.items()
                if part.startswith("renders/") and one["status"] == "ok" and "timing" in one}  # fmt: skip


def run_job(job: Job, say: Say, words: Sequence[str] = ()) -> dict[str, Any]:
    """The result of one device, ready for its file; never raises for what a driver does. Ctrl-C ends it with what was
    finished, `partial`; where nothing was, KeyboardInterrupt goes on."""
    begun, created = time.perf_counter(), time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    host = record.host_record()
    found = Findings()
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder:
        environment = dict(os.environ)
        if job.plan == "full":
            environment["RAYTIDE_CACHE_DIR"] = folder  # nothing is warm: builds are timed
        try:
            while missing := [part for part in job.parts if part not in found.parts]:
                run_child(job, missing, environment, found, say)
        except KeyboardInterrupt:
            if not found.parts:
                raise
            found.partial = True
            left = len(job.parts) - len(found.parts)
            found.problems.append(f"interrupted: {left} of {len(job.parts)} parts were not measured")
            say(found.problems[-1])
    host["load_avg_1m_end"] = record.load()
    return result_of(job, found, host, created, time.perf_counter() - begun, words)


def run_child(job: Job, parts: list[str], environment: dict[str, str], found: Findings, say: Say) -> None:
    """One child for `parts`. Afterwards at least one more of them has an outcome."""
    errors = tempfile.TemporaryFile()
    child = subprocess.Popen(child_command("raytide.bench.child"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                             stderr=errors, env=environment, text=True, encoding="utf-8")  # fmt: skip
    assert child.stdin and child.stdout
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=listen, args=(child.stdout, lines), daemon=True).start()
    at, done = "", False
    try:
        order = {"device": job.device, "threads": job.threads, "parts": parts, "plan": job.plan,
                 "scramble": job.scramble, "soak_s": job.soak_s, "traversal": job.traversal,
                 "visits": job.visits, "origin": found.origin, "spp": found.samples()}  # fmt: skip
        try:
            child.stdin.write(json.dumps(order) + "\n")
            child.stdin.close()
        except OSError:
            pass  # it died at once: its words say why
        while True:
            line = lines.get(timeout=job.patience_s)
            if not line:
                break
            event = json.loads(line)
            at, done = note(event, found, at, say) or at, done or event["event"] == "failed"
        code = child.wait(timeout=60.0)
        trouble = None if code == 0 else last_words(code, errors)
    except (queue.Empty, subprocess.TimeoutExpired):
        trouble = f"the driver said nothing for {job.patience_s:.0f} s, and was ended"
    finally:
        child.kill()
        child.wait()
        child.stdout.close()
        errors.close()
    settle(parts, at, trouble, done, found, say)


def listen(stream: IO[str], lines: queue.SimpleQueue[str]) -> None:
    """Every line of a child, and at its end an empty one."""
    try:
        for line in stream:
            lines.put(line)
    except ValueError:
        pass  # closed from the other side
    lines.put("")


def note(event: dict[str, Any], found: Findings, at: str, say: Say) -> str | None:
    """Takes over what a child said; gives the part that it began."""
    kind = event["event"]
    if kind == "device":
        found.device = event["record"]
    elif kind == "end":
        found.parts[event["part"]] = event["result"]
        if event["result"]["status"] != "ok":
            say(f"{event['part']}: {event['result']['status']}: {event['result']['reason']}")
    elif kind == "say":
        say(event["text"])
    elif kind == "failed":
        found.problems.append(event["reason"])
    return event["part"] if kind == "begin" else None


def settle(parts: list[str], at: str, trouble: str | None, failed: bool, found: Findings, say: Say) -> None:
    """What a child that ended left undone: the part that it was at is an error; all are, where it never got to one."""
    undone = [part for part in parts if part not in found.parts]
    if not undone:
        return
    reason = trouble or (found.problems[-1] if found.problems else "the child ended without a word")
    if trouble:
        found.problems.append(f"{at or 'opening the device'}: {trouble}")
        say(f"{at or 'opening the device'}: {trouble}")
    lost = [at] if at in undone and not failed else undone
    for part in lost:
        found.parts[part] = {"status": "error", "reason": reason}


def last_words(code: int, errors: IO[bytes]) -> str:
    errors.seek(0)
    said = errors.read().decode(errors="replace").strip().splitlines()
    cause = f"crashed with signal {-code}" if code < 0 else f"ended with code {code}"
    return f"the driver's process {cause}" + (f": {said[-1][:300]}" if said else "")


def result_of(
    job: Job, found: Findings, host: dict[str, Any], created: str, seconds: float, words: Sequence[str]
) -> dict[str, Any]:
    """The file's content."""
    device = found.device
    renders = {part.partition("/")[2]: one for part, one in found.parts.items() if part.startswith("renders/")}
    workloads = [{"id": name, **joined(one, later_visits(found, name), PLANS[job.plan])}
                 for name, one in renders.items()]  # fmt: skip
    workloads.sort(key=lambda one: list(WORKLOADS).index(one["id"]))
    peaks = found.parts.get("peaks")
    for one in workloads if peaks and device else []:
        add_limiters(one, peaks or {}, (device or {}).get("cache_bytes", 0))
    settings = {"threads": job.threads, "scramble": job.scramble, "only": list(job.only), "traversal": job.traversal}
    reasons = record.class_reasons(tuple((device or {}).get("options", ())), settings) + edited_reasons()
    scored = workloads and job.scramble is None and not job.soak_s and not found.partial
    result: dict[str, Any] = {
        "schema": SCHEMA, "run_id": str(uuid.uuid4()), "created_utc": created, "duration_s": seconds,
        "suite": job.suite, "partial": found.partial, "plan": {"name": job.plan, **vars(PLANS[job.plan])},
        "class": "open" if reasons else "closed", "class_reasons": reasons, "verification": "unverified",
        "command": record.command_record(list(words)), "tool": record.tool_record(), "host": host,
        "device_id": device["id"] if device else job.device, "device": device, "env": record.environment_record(),
        **{part: found.parts[part] for part in ("peaks", "build", "rays") if part in found.parts},
        "workloads": workloads, "score": score_of(workloads, job.plan, not reasons) if scored else None,
        "problems": found.problems,
    }  # fmt: skip
    return sealed(result)


def later_visits(found: Findings, name: str) -> list[dict[str, Any]]:
    """What later visits of a workload gave, those that there were."""
    return [found.parts[f"{part}/{name}"] for part in WORKLOAD_PARTS[1:] if f"{part}/{name}" in found.parts]


def sealed(result: dict[str, Any]) -> dict[str, Any]:
    """With the hash of all the rest, which tells edits and prevents no forging."""
    return {**result, "integrity": {"canonical_sha256": canonical_sha256(result)}}


def canonical_sha256(result: dict[str, Any]) -> str:
    """Of the canonical JSON of everything but `integrity`."""
    content = json.loads(json.dumps({key: value for key, value in result.items() if key != "integrity"}))
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def statuses(result: dict[str, Any]) -> dict[str, str]:
    """Status by part."""
    parts = {part: result[part]["status"] for part in ("peaks", "build", "rays") if result.get(part)}
    return parts | {one["id"]: one["status"] for one in result["workloads"]}
