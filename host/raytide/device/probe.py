"""What a device really does: record layout, contraction, NaN, denormals, precision. Measured once for each driver.

Sources: OpenCL-Docs #302 (no layout guarantee between compilers); Kahan's antisymmetry test for contraction.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from raytide.device.cache import FileCache, digest
from raytide.device.compile import binary_key
from raytide.device.environment import log
from raytide.device.info import DeviceInfo
from raytide.errors import DeviceError
from raytide.kernels import RECORDS, Features, Source, assemble

if TYPE_CHECKING:
    from raytide.device.build import Program
    from raytide.device.device import Device

_INPUTS = 1 << 16
_SMALLEST_DENORMAL = 1
_PRODUCT_BITS = int(np.float32(1e-40).view(np.uint32))


@dataclass(frozen=True)
class ProbeResult:
    """The probe's answers. `unfit` empty: the device may be used; `warnings`: what a report should tell."""

    layout_differences: tuple[str, ...]  # "Ray.direction: 32 here, 16 in the table"
    contracted: int  # of 65536 inputs: products fused against the pragma
    nan_bits: bool  # the bit tests for NaN and infinity hold
    nan_unequal: bool  # NaN != NaN
    nan_isnan: bool
    nan_compares_false: bool  # NaN >= 1 and NaN < 1 are both false
    fmin_hides_nan: bool
    denormals_made: bool  # 1e-20 squared is not zero
    denormals_read: bool
    fma_once: float  # share of inputs where fma_of rounds once; 1 with hardware fma
    divide_ulp: float  # largest error, in units of the last place
    sqrt_ulp: float

    @property
    def unfit(self) -> tuple[str, ...]:
        """Why results of this device cannot be trusted."""
        reasons = [f"record layout differs: {text}" for text in self.layout_differences]
        if not self.nan_bits:
            reasons.append("NaN cannot be told by its bits")
        return tuple(reasons)

    @property
    def flushes(self) -> bool:
        """Whether denormals vanish, made or read."""
        return not (self.denormals_made and self.denormals_read)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What weakens the promises, but not the trust."""
        said = []
        if self.contracted:
            said.append(f"the compiler fuses products against FP_CONTRACT OFF ({self.contracted} of {_INPUTS} inputs)")
        if self.fma_once < 1.0:
            said.append(f"fma rounds twice on {100.0 * (1.0 - self.fma_once):.3g} % of inputs")
        if not self.nan_compares_false:
            said.append("comparisons with NaN are true")
        if self.flushes:
            said.append("denormal numbers are flushed to zero")
        return tuple(said)

    def refuse_if_unfit(self, info: DeviceInfo) -> None:
        """Raise DeviceError where the device must not be used."""
        if self.unfit:
            raise DeviceError(f"{info.id} cannot be used: {'; '.join(self.unfit)}; choose another with --device")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "unfit": list(self.unfit), "warnings": list(self.warnings)}


def probe_source() -> Source:
    """The probe program, with a kernel that tells size and offsets of every record."""
    return assemble("probe/probe.cl", Features(), _layout_kernel())


def _layout_kernel() -> str:
    lines = ["// Bytes: for each record its size, then the offset of each member. Run by one item.",
             "kernel void probe_layout(global const uint4 *memory, global uint *results)",
             "{"]  # fmt: skip
    index = 0
    for record in RECORDS.values():
        lines.append(f"    results[{index}] = (uint)sizeof({record.name});")
        index += 1
        for member in record.members:
            address = f"(global const char *)&((global const {record.name} *)memory)->{member.name}"
            lines.append(f"    results[{index}] = (uint)({address} - (global const char *)memory);")
            index += 1
    return "\n".join([*lines, "}"])


def _expected_layout() -> list[tuple[str, int]]:
    rows = []
    for record in RECORDS.values():
        rows.append((f"sizeof({record.name})", record.size))
        rows += [(f"{record.name}.{name}", offset) for name, offset in record.offsets.items()]
    return rows


def _key(info: DeviceInfo, options: Sequence[str]) -> str:
    return digest("probe", binary_key(info, options, probe_source().sha256))


def load_probe(info: DeviceInfo, options: Sequence[str]) -> ProbeResult | None:
    """The result of an earlier process on the same device, driver and probe source."""
    cache = FileCache("probes")
    entry = cache.get(_key(info, options))
    cache.report_damage()
    if entry is None:
        return None
    content = json.loads(entry.payload)
    content["layout_differences"] = tuple(content["layout_differences"])
    return ProbeResult(**content)


def run_probe(device: Device, program: Program, keep: bool = True) -> ProbeResult:
    """Run the probe's kernels and log what weakens the device; `keep` writes the result for later processes."""
    special = _special(device, program)
    fma_once, divide_ulp, sqrt_ulp = _precision(device, program)
    result = ProbeResult(
        layout_differences=_layout(device, program),
        contracted=_contracted(device, program),
        nan_bits=bool(special[0] and special[1]),
        nan_unequal=bool(special[2]),
        nan_isnan=bool(special[3]),
        nan_compares_false=bool(special[7]),
        fmin_hides_nan=bool(special[4]),
        denormals_made=int(special[5]) in (_PRODUCT_BITS - 1, _PRODUCT_BITS, _PRODUCT_BITS + 1),
        denormals_read=int(special[6]) == 2 * _SMALLEST_DENORMAL,
        fma_once=fma_once,
        divide_ulp=divide_ulp,
        sqrt_ulp=sqrt_ulp,
    )
    device.take_times()  # the probe's launches are not the caller's
    for text in result.warnings:
        log.info("%s: %s", device.info.id, text)
    facts = {"device": device.info.id, "driver": device.info.driver}
    if keep:
        FileCache("probes").put(_key(device.info, device.options), facts, json.dumps(asdict(result)).encode())
    return result


def _layout(device: Device, program: Program) -> tuple[str, ...]:
    rows = _expected_layout()
    memory, results = device.empty(4096), device.empty(4 * len(rows))
    device.launch(program, "probe_layout", 1, 1, memory, results)
    found = device.read(results, np.uint32, len(rows))
    return layout_differences(found)


def layout_differences(found: np.ndarray) -> tuple[str, ...]:
    """Where sizes and offsets that a device told, shape (rows,), differ from the table."""
    pairs = zip(_expected_layout(), found, strict=True)
    return tuple(f"{name}: {int(here)} here, {wanted} in the table" for (name, wanted), here in pairs if here != wanted)


def _random_inputs() -> np.ndarray:
    """Mantissas and exponents that products of which neither overflow nor lose bits to denormals; (n, 4) float32."""
    random = np.random.default_rng(20120)
    sign = random.choice(np.array([-1.0, 1.0]), (_INPUTS, 4))
    return (sign * random.uniform(1.0, 2.0, (_INPUTS, 4)) * 2.0 ** random.integers(-8, 8, (_INPUTS, 4))).astype("f4")


def _contracted(device: Device, program: Program) -> int:
    inputs, flags = device.upload(_random_inputs()), device.empty(4 * _INPUTS)
    device.launch(program, "probe_contraction", _INPUTS, 64, inputs, flags)
    return int(device.read(flags, np.uint32, _INPUTS).sum())


def _precision(device: Device, program: Program) -> tuple[float, float, float]:
    inputs = _random_inputs()
    results = device.empty(16 * _INPUTS)
    device.launch(program, "probe_precision", _INPUTS, 64, device.upload(inputs), results)
    product, rest, quotient, root = device.read(results, np.float32, 4 * _INPUTS).reshape(-1, 4).T.astype(float)
    x, y = inputs[:, 0].astype(float), inputs[:, 1].astype(float)
    once = float(np.mean(product + rest == x * y))  # both sides are exact in float64
    return once, _largest_ulp(quotient, x / y), _largest_ulp(root, np.sqrt(np.abs(x)))


def _largest_ulp(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest error in float32 ulp of the exact value; infinity where a result is not finite."""
    unit = np.spacing(np.abs(exact).astype(np.float32)).astype(float)
    error = np.abs(found - exact) / unit
    return float(np.max(error)) if np.all(np.isfinite(error)) else float("inf")


def _special(device: Device, program: Program) -> np.ndarray:
    inputs = np.array([np.nan, 1.0, 1e-20, 0.0, np.inf], np.float32)
    inputs[3:4].view(np.uint32)[0] = _SMALLEST_DENORMAL
    results = device.empty(4 * 8)
    device.launch(program, "probe_special", 1, 1, device.upload(inputs), results)
    return device.read(results, np.uint32, 8)
