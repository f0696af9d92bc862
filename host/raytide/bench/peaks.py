"""Suite `peaks`: what a device does at best. Every kernel's result is checked: a peak of wrong numbers is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from raytide.bench.plan import Plan, repeat, summary_of_kept
from raytide.device import Buffer, Device, Program
from raytide.errors import DeviceError
from raytide.kernels.features import Features
from raytide.kernels.source import Source, assemble

CHAIN = 512  # steps of a chain of multiply-adds
_CHAINS = 8
_NUMBERS = {  # the word, the dtype, and how far a lane of an item may be off
    "fp32": ("float", np.float32, 4e-5),
    "fp64": ("double", np.float64, 1e-9),
    "fp16": ("half", np.float16, 0.2),
}
_EXTENSION = {"fp64": "cl_khr_fp64", "fp16": "cl_khr_fp16"}
_HEADLINE = (  # how a row's name begins, and under which key the best of these stands in the file
    ("fp32", "fp32_flop_per_s"), ("fp64", "fp64_flop_per_s"), ("fp16", "fp16_flop_per_s"), ("read", "read_byte_per_s"),
    ("write", "write_byte_per_s"), ("copy", "copy_byte_per_s"), ("gather_nodes", "gather_nodes_byte_per_s"),
    ("gather_near", "gather_near_byte_per_s"), ("gather", "gather_byte_per_s"), ("local", "local_byte_per_s"),
    ("h2d", "h2d_byte_per_s"), ("d2h", "d2h_byte_per_s"),
)  # fmt: skip
_NEAR = 2 << 20  # bytes
Say = Callable[[str], None]


class WrongResult(Exception):
    """A kernel of a peak gave something else than it must."""


@dataclass(frozen=True)
class Work:
    """One measurement: launch `times` times with `run`, `amount` of `unit` each; `check` raises WrongResult."""

    amount: float
    unit: str
    run: Callable[[int], None]
    check: Callable[[], None]


def measure_peaks(device: Device, plan: Plan, say: Say) -> dict[str, Any]:
    """{"rows": every measurement, and the best of each kind under the names of the result file}."""
    rows: list[dict[str, Any]] = []
    short = replace(plan, warmup_s=plan.warmup_s / 4, repeat_s=plan.repeat_s / 2)  # many rows: the suite has a bound
    for name, doc, make in rows_of(device, plan):
        say(f"peaks: {name}")
        rows.append(measured(device, short if rows else plan, name, doc, make))
    return {"rows": rows, **headline(rows)}


def rows_of(device: Device, plan: Plan) -> list[tuple[str, str, Callable[[], Work]]]:
    """(name, what it is, maker) of every measurement."""
    out: list[tuple[str, str, Callable[[], Work]]] = []
    for number, widths in (("fp32", (1, 4, 8)), ("fp64", (1, 4)), ("fp16", (1, 8))):
        for width in widths:
            doc = f"multiply-adds of {_NUMBERS[number][0]}{width if width > 1 else ''}, eight chains an item"
            out.append((f"{number}x{width}", doc, lambda n=number, w=width: arithmetic(device, n, w)))  # type: ignore[misc]
    memory = Memory(device, plan)
    out += [
        ("read", "bytes read, neighbours side by side", lambda: memory.read("read_coalesced")),
        ("read_runs", "bytes read, a run of its own for each item", lambda: memory.read("read_runs")),
        ("write", "bytes written", memory.write),
        ("copy", "bytes read and written", memory.copy),
        ("gather", "bytes of 16-byte rows at random places", memory.gather),
        ("gather_nodes", "bytes of 256-byte rows at random places", lambda: memory.gather_nodes(memory.nbytes)),
        ("gather_near", "the same from 2 MB, which caches hold", lambda: memory.gather_nodes(_NEAR)),
        ("local", "bytes read of local memory", memory.local),
        ("h2d", "bytes copied from host to device", memory.to_device),
        ("d2h", "bytes copied from device to host", memory.to_host),
    ]
    for kernel, doc in (("one", "adds to one word by all items"), ("many", "adds to 4096 words"),
                        ("local", "adds to one word of local memory by each group")):  # fmt: skip
        out.append((f"atomic_{kernel}", f"atomic {doc}", lambda k=kernel: atomics(device, k)))  # type: ignore[misc]
    out.append(("launch", "launches of an empty kernel, one after the other", lambda: launches(device, 100)))
    out.append(("round_trip", "launches of an empty kernel, each waited for", lambda: launches(device, 1)))
    return out


def measured(device: Device, plan: Plan, name: str, doc: str, make: Callable[[], Work]) -> dict[str, Any]:
    """One row, whatever happens short of a crash."""
    row: dict[str, Any] = {"name": name, "doc": doc, "status": "ok", "reason": None}
    extension = _EXTENSION.get(name[:4])
    if extension and extension not in device.info.extensions:
        return row | {"status": "unsupported", "reason": f"the device has no {extension}"}
    try:
        work = make()
        work.run(1)
        device.finish()
        work.check()
        times = launches_for(device, work, plan.peak_s)

        def once() -> float:
            device.take_times()
            work.run(times)
            device.finish()
            return sum(seconds for _, seconds in device.take_times().values())

        found = repeat(once, plan, device.info.type == "cpu")
        work.check()
    except WrongResult as wrong:
        return row | {"status": "invalid", "reason": str(wrong)}
    except DeviceError as error:
        return row | {"status": "error", "reason": str(error)}
    row["summary"] = summary_of_kept(work.amount * times, found, plan, name, work.unit)
    return row | {"launches_a_value": times, "values_s": found.values_s, "t_offset_s": found.offsets_s,
                  "warmup_s": found.warmup_s, "event_s": found.event_s, "others_frac": found.others_frac}  # fmt: skip


def launches_for(device: Device, work: Work, seconds: float) -> int:
    """How often to launch for a value: doubled until a tenth of `seconds` is filled, then in proportion."""
    import time

    times = 1
    while True:
        begun = time.perf_counter()
        work.run(times)
        device.finish()
        spent = time.perf_counter() - begun
        if spent >= seconds / 10 or times >= 1 << 16:
            return max(1, min(1 << 18, round(times * seconds / max(spent, 1e-9))))
        times *= 2


def headline(rows: list[dict[str, Any]]) -> dict[str, float]:
    """The best of each kind, under the names of the result file."""
    best: dict[str, float] = {}
    for row in rows:
        if row["status"] != "ok":
            continue
        median = row["summary"]["median"]
        if row["name"] in ("launch", "round_trip"):
            best[f"{row['name']}_s"] = 1.0 / median
        elif row["name"].startswith("atomic"):
            best[f"{row['name']}_per_s"] = median
        else:
            key = next(key for start, key in _HEADLINE if row["name"].startswith(start))
            best[key] = max(best.get(key, 0.0), median)
    return best


def built(device: Device, name: str, source: Source) -> Program:
    return device.build({name: source})[name]


def arithmetic(device: Device, number: str, width: int) -> Work:
    """Multiply-adds. Where the device has no fused form that is one instruction, a product and a sum count the same."""
    scalar, dtype, tolerance = _NUMBERS[number]
    real = scalar + (str(width) if width > 1 else "")
    own = {"float": "fma_of", "float4": "fma4", "float8": "fma8"}.get(real)
    fused = f"{own}(x, x, c)" if own else "fma(x, x, c)" if device.kind == "gpu" else ""
    lanes = {1: "(v)", 4: "((v).x + (v).y + (v).z + (v).w)",
             8: "((v).s0 + (v).s1 + (v).s2 + (v).s3 + (v).s4 + (v).s5 + (v).s6 + (v).s7)"}  # fmt: skip
    words = {"SCALAR": scalar, "REAL": real, "CHAIN": f"{CHAIN}u", "LANE_SUM(v)": lanes[width]}
    words["STEP(x, c)"] = fused or "((x) * (x) + (c))"
    head = f"#pragma OPENCL EXTENSION {_EXTENSION[number]} : enable\n" if number in _EXTENSION else ""
    head += "".join(f"#define {name} {text}\n" for name, text in words.items())
    program = built(device, f"arithmetic_{number}x{width}",
                    assemble("", Features(), head + '#include "bench/arithmetic.cl"\n'))  # fmt: skip
    count = max(1 << 14, device.info.compute_units << (12 if device.kind == "gpu" else 8))
    constants = np.random.default_rng(7).uniform(0.249998, 0.25, count).astype(dtype)
    given, out = device.upload(constants), device.empty(constants.nbytes)

    def run(times: int) -> None:
        for _ in range(times):
            device.launch(program, "arithmetic", count, 64, given, out, np.uint32(count))

    def check() -> None:
        came = device.read(out, dtype, 64).astype(np.float64)
        wanted = width * chains(constants[:64])
        if not bool((np.abs(came - wanted) <= tolerance * width).all()):
            raise WrongResult(f"{CHAIN} steps of x = x x + c gave {came[0]:.6g}; wanted {wanted[0]:.6g}")

    return Work(2.0 * CHAIN * _CHAINS * width * count, "flop/s", run, check)


def chains(c: np.ndarray) -> np.ndarray:
    """What one lane of items with constants `c` must end with, in float64."""
    total = np.zeros(len(c))
    for chain in range(_CHAINS):
        constant = (c * c.dtype.type(1 - chain * 2.0**-21)).astype(np.float64)
        x = constant.copy()
        for _ in range(CHAIN):
            x = x * x + constant
        total += x
    return total


class Memory:
    """Measurements of bandwidth on one buffer of random rows; built when the first is asked for."""

    def __init__(self, device: Device, plan: Plan) -> None:
        self.device = device
        info = device.info
        wanted = max(plan.buffer_bytes, plan.buffer_caches * info.cache_bytes)  # caches must not hold it
        limit = min(wanted, info.max_alloc_bytes // 2, info.global_mem_bytes // 8)
        self.nbytes = 1 << (int(limit).bit_length() - 1)
        self.count = self.nbytes // 16
        self.items = max(1 << 14, device.info.compute_units << 11 if device.kind == "gpu" else 1 << 12)
        self._ready = False

    def _prepare(self) -> Program:
        if not self._ready:
            words = np.random.default_rng(11).integers(0, 1 << 32, self.nbytes // 4, np.uint32)
            self.words, self.total = words, int(words.sum(dtype=np.uint64)) % (1 << 32)
            self.rows, self.out = self.device.upload(words), self.device.empty(4 * self.items)
            self.program = built(self.device, "memory", assemble("bench/memory.cl", Features()))
            self._ready = True
        return self.program

    def _sum(self) -> int:
        return int(self.device.read(self.out, np.uint32, self.items).sum(dtype=np.uint64)) % (1 << 32)

    def _launcher(self, kernel: str, *arguments: Buffer | np.uint32) -> Callable[[int], None]:
        def run(times: int) -> None:
            for _ in range(times):
                self.device.launch(self.program, kernel, self.items, 64, *arguments)

        return run

    def read(self, kernel: str) -> Work:
        self._prepare()

        def check() -> None:
            if (came := self._sum()) != self.total:
                raise WrongResult(f"the sum of all words came out as {came}; wanted {self.total}")

        return Work(self.nbytes, "byte/s", self._launcher(kernel, self.rows, np.uint32(self.count), self.out), check)

    def write(self) -> Work:
        self._prepare()
        to = self.device.empty(self.nbytes)

        def check() -> None:
            for first in (0, self.count // 2, self.count - 64):
                i = np.arange(first, first + 64, dtype=np.uint32)
                wanted = np.column_stack([i, i ^ np.uint32(77), np.full_like(i, 77), ~i])
                if (self.device.read(to, np.uint32, 256, 16 * first).reshape(64, 4) != wanted).any():
                    raise WrongResult(f"rows from {first} on were not written")

        run = self._launcher("write_rows", to, np.uint32(self.count), np.uint32(77))
        return Work(self.nbytes, "byte/s", run, check)

    def copy(self) -> Work:
        self._prepare()
        to = self.device.empty(self.nbytes)

        def check() -> None:
            for first in (0, self.count // 2, self.count - 64):
                if (self.device.read(to, np.uint32, 256, 16 * first) != self.words[4 * first :][:256]).any():
                    raise WrongResult(f"rows from {first} on were not copied")

        return Work(2 * self.nbytes, "byte/s", self._launcher("copy_rows", self.rows, to, np.uint32(self.count)), check)

    def gather(self) -> Work:
        self._prepare()
        reads = 64
        total = self.items * reads
        places = scattered(np.arange(total, dtype=np.uint32)) & np.uint32(self.count - 1)
        sums = self.words.reshape(-1, 4).sum(axis=1, dtype=np.uint64)
        wanted = int(sums[places].sum()) % (1 << 32)

        def check() -> None:
            if (came := self._sum()) != wanted:
                raise WrongResult(f"the sum of gathered rows came out as {came}; wanted {wanted}")

        arguments = (self.rows, np.uint32(self.count - 1), np.uint32(reads), self.out)
        return Work(16 * total, "byte/s", self._launcher("gather", *arguments), check)

    def gather_nodes(self, nbytes: int) -> Work:
        """From the first `nbytes` of the buffer, a power of two."""
        self._prepare()
        reads, rows = 32, min(nbytes, self.nbytes) // 256
        total = self.items * reads
        places = scattered(np.arange(total, dtype=np.uint32)) & np.uint32(rows - 1)
        sums = self.words[: 64 * rows].reshape(-1, 64).sum(axis=1, dtype=np.uint64)
        wanted = int(sums[places].sum()) % (1 << 32)

        def check() -> None:
            if (came := self._sum()) != wanted:
                raise WrongResult(f"the sum of gathered rows came out as {came}; wanted {wanted}")

        arguments = (self.rows, np.uint32(rows - 1), np.uint32(reads), self.out)
        return Work(256 * total, "byte/s", self._launcher("gather_nodes", *arguments), check)

    def local(self) -> Work:
        self._prepare()
        rounds = 512
        table = self.words[:1024].reshape(256, 4)
        lane, k = np.arange(64)[:, None], np.arange(rounds)
        wanted = (table[(lane + k) % 256] ^ k[:, None].astype(np.uint32)).sum(axis=(1, 2), dtype=np.uint64) % (1 << 32)

        def check() -> None:
            came = self.device.read(self.out, np.uint32, self.items).reshape(-1, 64)
            if (came != wanted.astype(np.uint32)).any():
                raise WrongResult("sums of local memory are wrong")

        run = self._launcher("local_read", self.rows, np.uint32(rounds), self.out)
        return Work(16 * rounds * self.items, "byte/s", run, check)

    def to_device(self) -> Work:
        self._prepare()
        nbytes = min(self.nbytes, 64 << 20)
        data, to = self.words[: nbytes // 4], self.device.empty(nbytes)

        def run(times: int) -> None:
            for _ in range(times):
                self.device.write(to, data)

        def check() -> None:
            if (self.device.read(to, np.uint32, nbytes // 4) != data).any():
                raise WrongResult("what was copied to the device is not what was sent")

        return Work(nbytes, "byte/s", run, check)

    def to_host(self) -> Work:
        self._prepare()
        nbytes = min(self.nbytes, 64 << 20)
        last: list[np.ndarray] = []

        def run(times: int) -> None:
            for _ in range(times):
                last[:] = [self.device.read(self.rows, np.uint32, nbytes // 4)]

        def check() -> None:
            if (last[0] != self.words[: nbytes // 4]).any():
                raise WrongResult("what was copied to the host is not what the device holds")

        return Work(nbytes, "byte/s", run, check)


def scattered(x: np.ndarray) -> np.ndarray:
    """The hash of bench/memory.cl."""
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        x = (x ^ (x >> np.uint32(shift))) * np.uint32(factor)
    return x ^ (x >> np.uint32(16))


def atomics(device: Device, kernel: str) -> Work:
    """Increments by all items."""
    program = built(device, "overhead", assemble("bench/overhead.cl", Features()))
    items, rounds, words = 1 << 14, 16, 4096
    counters, launched = device.empty(4 * words), [0]

    def run(times: int) -> None:
        device.fill(counters, 0)
        launched[0] = times
        for _ in range(times):
            device.launch(program, f"atomic_{kernel}", items, 64, counters, np.uint32(rounds))

    def check() -> None:
        came = int(device.read(counters, np.uint32, words).sum(dtype=np.uint64))
        wanted = items * rounds * launched[0]
        if came % (1 << 32) != wanted % (1 << 32):
            raise WrongResult(f"{wanted} increments came out as {came}")

    return Work(items * rounds, "1/s", run, check)


def launches(device: Device, together: int) -> Work:
    """Empty kernels, `together` of them between two waits."""
    program = built(device, "overhead", assemble("bench/overhead.cl", Features()))
    counter, launched = device.empty(4), [0]

    def run(times: int) -> None:
        device.fill(counter, 0)
        launched[0] = times
        for _ in range(times):
            for _ in range(together):
                device.launch(program, "launch_nothing", 64, 64, counter, np.uint32(1))
            device.finish()

    def check() -> None:
        came, wanted = int(device.read(counter, np.uint32, 1)[0]), launched[0] * together
        if came != wanted:
            raise WrongResult(f"{wanted} launches counted {came}")

    return Work(together, "1/s", run, check)
