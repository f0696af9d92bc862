"""The same device with other arithmetic: what compilers and processors elsewhere may do to the same source.

A variant changes the text of every program that is built, or its options; whoever uses the device need not know.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from raytide.device import Device, Program
from raytide.device.build import Progress, SourceLike
from raytide.device.compile import FLUSHED
from raytide.errors import UsageError
from raytide.kernels.paths import kernel_dir
from raytide.kernels.source import Source

FUSED, FAST = "-cl-mad-enable", "-cl-fast-relaxed-math"
# Results of raytide's own functions, as the kernels have them, and what makes them as wrong as built-in ones may be.
_RESULTS = {
    "*s = fma_of(x * z, p, x);": "worse_sine",
    "*c = fma_of(z * z, q, 1.0f - 0.5f * z);": "worse_sine",
    "const float result = fma_of(r * r, p, r) + 1.0f;": "worse_power",
    "const float result = fma_of(e, 0.693359375f, f + tail);": "worse_power",
}
_OFF, _ON = "#pragma OPENCL FP_CONTRACT OFF", "#pragma OPENCL FP_CONTRACT ON"
_CONSTANT = re.compile(r"[0-9.]\S*|[A-Z_][A-Z_0-9]*\b(?!\s*\()")
_TYPE = re.compile(r"\(\s*(float|int|uint|ulong|long)[0-9]*\s*\)")
_NAME = re.compile(r"[A-Za-z_][A-Za-z_0-9]*|[0-9.][0-9a-zA-Z.]*")


@dataclass(frozen=True)
class Variant:
    """One other arithmetic: `text` rewrites a program, `options` go to the compiler."""

    name: str
    words: str
    text: Callable[[str], str] = str
    options: tuple[str, ...] = ()


def contracted(text: str) -> str:
    """Products and sums fused wherever the compiler likes: the source's own pragmas say so now."""
    return text.replace(_OFF, _ON)


def unfused(text: str) -> str:
    """fma_of in two roundings, as on hardware without the instruction."""
    out = text.replace("    return fma(a, b, c);", "    return a * b + c;")
    return out.replace(_ON, _OFF)


def worse(text: str) -> str:
    """Quotients, roots, sines, exponentials and logarithms with the largest errors that OpenCL allows."""
    helpers = (kernel_dir() / "probe" / "worse.cl").read_text(encoding="utf-8")
    out = "".join(_worse_line(line) for line in text.splitlines(keepends=True))
    for root in ("__builtin_sqrtf(x)", "sqrt(x)"):
        out = out.replace(f"return {root};", f"return worse_root({root});")
    for line, wrong in _RESULTS.items():
        place, value = line[:-1].split(" = ")
        out = out.replace(line, f"{place} = {wrong}({value});")
    return helpers + out


def _worse_line(line: str) -> str:
    """Every divisor of a line of C that is not a constant becomes worse(divisor)."""
    if line.lstrip().startswith(("#line", "#if", "#elif", "#pragma", "//")):
        return line
    code, mark, comment = line.partition("//")
    out, at = "", 0
    while (slash := code.find("/", at)) >= 0:
        start = slash + 1 + (code[slash + 1 : slash + 2] == "=")
        start += len(code[start:]) - len(code[start:].lstrip())
        end = _operand_end(code, start)
        operand = code[start:end]
        whole = bool(operand) and not _CONSTANT.fullmatch(operand)
        out += code[at:start] + (f"worse({_worse_line(operand)})" if whole else operand)
        at = end
    return out + code[at:] + mark + comment


def _operand_end(code: str, start: int) -> int:
    """Where the operand ends that starts at `start`: casts, a name or a bracket, then calls, indices and members."""
    at = start
    while cast := _TYPE.match(code, at):
        at = cast.end()
    if at < len(code) and code[at] == "-":
        at += 1
    name = _NAME.match(code, at)
    at = name.end() if name else _closed(code, at)
    while at < len(code):
        if code[at] in "([":
            at = _closed(code, at)
        elif member := re.compile(r"(\.|->)[A-Za-z_]\w*").match(code, at):
            at = member.end()
        else:
            break
    return at


def _closed(code: str, at: int) -> int:
    """The place after the bracket that opens at `at`, or `at` where none does."""
    depth = 0
    for place in range(at, len(code)):
        depth += (code[place] in "([") - (code[place] in ")]")
        if depth == 0:
            return place + 1 if place > at else at
    return len(code)


VARIANTS = {
    one.name: one
    for one in (
        Variant("flushed", "denormals flushed to zero", options=(FLUSHED,)),
        Variant("contracted", "products fused into sums everywhere", contracted),
        Variant("unfused", "fused operations in two roundings", unfused),
        Variant("worse", "all functions as wrong as allowed, denormals flushed, sums fused where nothing forbids it",
                worse, (FLUSHED, FUSED)),  # fmt: skip
        Variant("fast", "fast mathematics, where numbers are finite and sums may be fused", options=(FAST,)),
    )
}


class VariantDevice(Device):
    """An open device that builds every program as `variant` has it, with `threads` of a CPU."""

    def __init__(self, device: Device, variant: Variant, threads: int | None = None) -> None:
        from raytide.device.environment import opencl

        super().__init__(opencl(), device.info, threads, options=variant.options)
        self.variant = variant
        if FAST in variant.options:  # Intel's compiler removes is_finite then; rays are asked for, not infinities
            self._probes = replace(self.probes, nan_bits=True)

    def build(self, sources: Mapping[str, SourceLike], progress: Progress | None = None) -> dict[str, Program]:
        """As Device.build, of the rewritten sources."""
        return super().build({name: self._rewritten(source) for name, source in sources.items()}, progress)

    def load(self, sources: Mapping[str, SourceLike]) -> dict[str, Program]:
        """As Device.load, of the rewritten sources."""
        return super().load({name: self._rewritten(source) for name, source in sources.items()})

    def _rewritten(self, source: Any) -> Source:
        text = self.variant.text(source.text)
        return replace(source, text=text, sha256=hashlib.sha256(text.encode()).hexdigest())


def with_arithmetic(device: Device, name: str, threads: int | None = None) -> Device:
    """The same device, opened once more, with `threads` of a CPU and the arithmetic of that name. Raises UsageError."""
    return VariantDevice(device, variant_named(name), threads)


def variant_named(name: str) -> Variant:
    """The variant of that name. UsageError lists what there is."""
    if name not in VARIANTS:
        raise UsageError(f"variant: came {name!r}; wanted one of {', '.join(VARIANTS)}")
    return VARIANTS[name]
