"""The result file, `*.bench.json`: one device, one run. Readers ignore keys that they do not know."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

SCHEMA = "raytide.bench/1"
Status = Literal["ok", "invalid", "unsupported", "skipped", "error"]


class Open(BaseModel):
    """A table that may hold more than is listed."""

    model_config = ConfigDict(extra="allow")


class Part(Open):
    """Anything that was measured, or was to be."""

    status: Status = Field(description="ok; invalid: wrong results; unsupported; skipped; error: the device failed")
    reason: str | None = Field(None, description="why the status is not ok")


class Summary(Open):
    """Repeated values in few numbers; never the best of them."""

    metric: str
    unit: str
    higher_is_better: bool
    median: float
    mad: float = Field(description="median absolute deviation")
    min: float
    max: float
    n: int = Field(ge=1)
    ci95: tuple[float, float] = Field(description="bootstrap interval of the median")
    cv: float = Field(description="coefficient of variation")
    median_cv: float | None = Field(None, description="coefficient of variation of the median, by bootstrap")
    unstable: bool = Field(description="cv of 0.1 or more, or median_cv above 0.03")
    drifting: bool = Field(description="the last third is more than 3 % off the first")
    left_out: int | None = Field(None, description="values that others disturbed, and that are not in these numbers")
    disturbed: bool | None = Field(None, description="others disturbed so many values that all of them count")
    visit_medians: list[float] | None = Field(None, description="of each visit of a workload by itself")


class Tool(Open):
    version: str
    git_commit: str | None
    git_dirty: bool | None
    suite_version: str
    suite_sha256: str
    kernels_sha256: str


class Host(Open):
    os: str
    kernel: str
    architecture: str
    cpu_model: str
    cpu_logical: int | None
    mem_bytes: int | None
    virtualised: bool
    container: bool
    load_avg_1m_start: float | None
    load_avg_1m_end: float | None = None
    python: str
    numpy: str
    pyopencl: str


class DriverFile(Open):
    role: Literal["icd", "driver", "loader"]
    name: str
    sha256: str | None


class DeviceRecord(Open):
    id: str
    name: str
    type: Literal["gpu", "cpu", "other"]
    platform: str
    platform_version: str
    vendor: str
    driver: str
    device_version: str
    compute_units: int = Field(description="as the driver says; drivers may say what is not so")
    max_clock_mhz: int
    global_mem_bytes: int
    max_alloc_bytes: int
    options: list[str]
    driver_files: list[DriverFile]


class PeakRow(Part):
    name: str
    doc: str
    summary: Summary | None = None
    values_s: list[float] = []


class Peaks(Part):
    """Best figures by kind as numbers (fp32_flop_per_s, read_byte_per_s, ...), and every measurement."""

    rows: list[PeakRow] = []


class BuildRow(Part):
    builder: str
    triangles: int
    summary: Summary | None = None
    sah_cost: float | None = None


class Builds(Part):
    rows: list[BuildRow] = []


class Rays(Part):
    scenes: dict[str, Any] = {}
    scaling: dict[str, Any] = {}
    ray_scaling: dict[str, Any] = {}
    brute_force: dict[str, Any] = {}


class Validity(Open):
    passed: bool
    same_samples: dict[str, Any] | None = None
    unbiased: dict[str, Any] | None = None
    counters: dict[str, Any] | None = None
    counters_match: bool | None = None


class Timing(Open):
    clock: str
    work_per_value: dict[str, float]
    warmup_s: list[float]
    values_s: list[float]
    t_offset_s: list[float]
    event_s: list[float] = Field(description="by the device's clock")
    event_gap_frac: float | None = Field(None, description="share of the host's time that the device's clock misses")
    others_frac: list[float | None] | None = Field(
        None, description="at least this share of the processor others had; null: nobody can tell"
    )
    visits: list[int] | None = Field(None, description="values of each visit")


class Telemetry(Open):
    """A row a value where the machine lets itself be read; empty lists where not."""

    temp_c: list[float] = []
    clock_mhz: list[float] = []
    power_w: list[float] = []
    method: str | None = Field(None, description="how power was measured")
    scope: str | None = Field(None, description="of what")


class Kernel(Open):
    name: str
    launches: int
    event_s: float
    share: float
    limiter: str | None = None


class Workload(Part):
    id: str
    version: int | None = None
    workload_sha256: str | None = None
    settings: dict[str, Any] = {}
    tuning: dict[str, Any] = {}
    scene: dict[str, Any] = {}
    validity: Validity | None = None
    cold: dict[str, Any] = {}
    timing: Timing | None = None
    summary: Summary | None = None
    kernels: list[Kernel] = []
    telemetry: Telemetry | None = None
    ledger: dict[str, Any] | None = None
    soak: dict[str, Any] | None = Field(None, description="--soak: a long run, its last third against its first")
    scramble: dict[str, Any] | None = Field(None, description="--scramble: rates in disguise over plain ones")
    pictures: dict[str, Any] = Field({}, description="for people: PNG files in base64")


class Score(Open):
    """Geometric mean over the workloads; null where any of them was not valid."""

    name: str = Field(description="Score or Quick score; of the open class: Open score or Open quick score")
    value: float | None
    ci95: tuple[float, float] | None = Field(None, description="where another run may end, by noise and visits")
    visits: list[float] | None = Field(None, description="the score of each visit by itself")
    reference_table: str
    method: str
    valid_workloads: int
    of: int
    parts: dict[str, float] = {}


class Integrity(Open):
    canonical_sha256: str = Field(description="of the file without this table: detects edits, prevents no forging")


class Result(Open):
    """One run on one device."""

    schema_: Literal["raytide.bench/1"] = Field(alias="schema")
    run_id: str
    created_utc: str
    duration_s: float
    suite: str
    partial: bool = Field(False, description="Ctrl-C ended the run: parts are missing, and there is no score")
    class_: Literal["closed", "open"] = Field(alias="class", description="closed: raytide as shipped, nothing set")
    class_reasons: list[str]
    verification: Literal["unverified", "reproduced"]
    command: str
    tool: Tool
    host: Host
    device: DeviceRecord | None = Field(description="null where the device could not even be opened")
    device_id: str
    env: dict[str, str]
    peaks: Peaks | None = None
    build: Builds | None = None
    rays: Rays | None = None
    workloads: list[Workload] = []
    score: Score | None = None
    problems: list[str] = []
    integrity: Integrity


def json_schema() -> dict[str, Any]:
    """The published schema of result files."""
    found = {**Result.model_json_schema(by_alias=True), "title": SCHEMA}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}
