"""The house's rules for OpenCL C: includes, sizes, words and forms that hold in every kernel file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from raytide.kernels.records import RECORDS
from raytide.kernels.widen import SERVE_BOTH

CL = Path(__file__).resolve().parents[2] / "cl"
FILES = sorted(CL.rglob("*.cl"))
RANKS = (
    {"base"},
    {"accel", "shape", "material", "light", "texture", "dispatch"},
    {"wave", "build", "probe", "bench"},
)
RANK = {folder: rank for rank, folders in enumerate(RANKS) for folder in folders}
GENERATED = {f"dispatch/{name}.cl" for name in ("shape", "material", "material8", "light", "texture")}
GENERATED |= {name.replace(".cl", "8.cl") for name in SERVE_BOTH}
PORTABLE = "base/portable.cl"
VENDORS = "nvidia amd intel pocl apple cuda mali adreno qualcomm rocm clover mesa rusticl oclgrind".split()
MOST_LINES, MOST_FUNCTION_LINES, MOST_KERNEL_LINES = 400, 60, 80
MEMBER_TYPES = {"float", "int", "uint", "float4", "uint4", "float8", "uint8"}
# A function's head at the start of a line, up to the brace that opens its body.
HEAD = re.compile(
    r"^[ \t]*(?P<head>[A-Za-z_](?:(?!\breturn\b|\belse\b)[\w \t*])*?(?P<name>\b\w+)\s*\([^;{}]*\))\s*\{", re.MULTILINE
)


def name_of(path: Path) -> str:
    return path.relative_to(CL).as_posix()


def code_of(path: Path) -> str:
    """The text with comments and kernel attributes blanked out, line numbers kept."""
    text = path.read_text(encoding="utf-8")

    def blank(found: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", found.group())

    text = re.sub(r"/\*.*?\*/|//[^\n]*", blank, text, flags=re.DOTALL)
    return re.sub(r"__attribute__\s*\(\((?:[^()]|\([^()]*\))*\)\)|\b(?:VEC_LEN_HINT|ALWAYS_INLINE)\b", blank, text)


def functions_of(code: str) -> Iterator[tuple[str, str, int]]:
    """(head, name, number of lines) of each function defined at the top level."""
    for found in HEAD.finditer(code):
        depth, place = 1, found.end()
        while depth and place < len(code):
            depth += {"{": 1, "}": -1}.get(code[place], 0)
            place += 1
        yield found["head"], found["name"], code.count("\n", found.start(), place) + 1


def test_the_reader_of_this_test_sees_functions() -> None:
    found = {name: (head.split()[0], lines) for head, name, lines in functions_of(code_of(CL / "wave" / "primary.cl"))}
    assert found["primary"][0] in ("kernel", "__kernel")
    assert all(lines > 1 for _, lines in found.values())
    sample = "#define X(a) { a }\nstatic int f(const int a,\n  const int b)\n{\n  if (a) { return 1; }\n}\nint g() {}\n"
    assert [(name, lines) for _, name, lines in functions_of(sample)] == [("f", 5), ("g", 1)]


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_includes_stay_in_cl_and_never_point_up(path: Path) -> None:
    code = path.read_text(encoding="utf-8")
    own = RANK[path.relative_to(CL).parts[0]]
    for included in re.findall(r"^\s*#\s*include\s+(.*?)\s*$", code, re.MULTILINE):
        assert re.fullmatch(r'"[\w/]+\.cl"', included), f"{included}: only files of cl, by their full path"
        name = included.strip('"')
        assert name in GENERATED or (CL / name).is_file(), f"{name}: no such file"
        assert RANK[name.split("/")[0]] <= own, f"{name}: an include that points up"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_contraction_is_off_from_the_first_line(path: Path) -> None:
    lines = [line.strip() for line in code_of(path).splitlines() if line.strip()]
    assert lines[0] == "#pragma OPENCL FP_CONTRACT OFF"
    if name_of(path) != PORTABLE:  # may map fma_of to a contracted product, where that is what the device rounds once
        assert "FP_CONTRACT ON" not in code_of(path)


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_sizes_fit_the_head(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES
    for head, name, lines in functions_of(code_of(path)):
        most = MOST_KERNEL_LINES if re.match(r"(__)?kernel\b", head) else MOST_FUNCTION_LINES
        assert lines <= most, f"{name}: {lines} lines"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_helpers_are_static(path: Path) -> None:
    for head, name, _ in functions_of(code_of(path)):
        assert re.match(r"(static|kernel|__kernel)\b", head), f"{name}: neither static nor a kernel"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_no_fast_inexact_built_ins(path: Path) -> None:
    names = "sin|cos|tan|exp|exp2|exp10|log|log2|log10|powr|recip|rsqrt|sqrt|divide"
    assert not re.findall(rf"\b(?:native|half)_(?:{names})\b", code_of(path))


@pytest.mark.parametrize("path", [path for path in FILES if name_of(path) != PORTABLE], ids=name_of)
def test_vendor_words_live_in_one_file(path: Path) -> None:
    pattern = rf"(?<![a-z])(?:{'|'.join(VENDORS)})(?![a-z])|\bcl_(?:nv|amd|intel|arm|qcom)_"
    assert not re.findall(pattern, code_of(path), re.IGNORECASE)


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_switches_are_always_defined_and_no_code_is_half_alive(path: Path) -> None:
    code = code_of(path)
    assert not re.findall(r"#\s*ifn?def\s+HAS_\w+|defined\s*\(?\s*HAS_\w+", code)
    assert not re.findall(r"#\s*if\s+[01]\s*$", code, re.MULTILINE)


def test_records_hold_only_types_of_one_layout() -> None:
    assert RECORDS
    for record in RECORDS.values():
        assert {member.ctype for member in record.members} <= MEMBER_TYPES, record.name
        assert record.size % 16 == 0, record.name
        assert record.dtype.itemsize == record.size, record.name
