"""The page of a folder of results in a real browser without a screen: it draws, and a click on a heading sorts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from raytide.bench.report import SUMMARY_HEAD, result_page, summary_page

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
RESULTS = sorted((Path(__file__).resolve().parents[2] / "results").glob("*.bench.json"))
CLICK = """<script>
const head = [...document.querySelectorAll("th")].find((one) => one.textContent === "cornell");
const column = head.cellIndex, table = head.closest("table");
const order = () => [...table.tBodies[0].rows].map((row) => row.cells[column].dataset.value).join(" ");
head.click(); const up = order();
head.click(); const down = order();
document.title = `up: ${up}; down: ${down}; boxes: ${document.querySelectorAll("svg").length}`;
</script>"""


@pytest.fixture(scope="module")
def browser() -> str:
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium here")
    return found


def shown(browser: str, page: Path) -> str:
    """The document as the browser has it after its scripts ran."""
    words = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={page.parent / 'profile'}",
             "--virtual-time-budget=2000", "--dump-dom", page.as_uri()]  # fmt: skip
    return subprocess.run(words, capture_output=True, text=True, timeout=600, check=True).stdout


def with_rate(result: dict[str, Any], rate: float) -> dict[str, Any]:
    copy = json.loads(json.dumps(result))
    copy["workloads"][0]["summary"]["median"] = rate
    return copy


def test_a_click_on_a_heading_sorts_the_devices(browser: str, tmp_path: Path) -> None:
    assert RESULTS and "cornell" in SUMMARY_HEAD
    one = json.loads(RESULTS[0].read_text(encoding="utf-8"))
    page = tmp_path / "summary.html"
    document = summary_page([with_rate(one, rate) for rate in (9e6, 80e6, 0.5e6)])
    page.write_text(document.replace("</body>", f"{CLICK}</body>"), encoding="utf-8")
    title = re.search(r"<title>(.*?)</title>", shown(browser, page))
    assert title and title[1].startswith("up: 0.5 9.0 80.0; down: 80.0 9.0 0.5; boxes:")


def test_a_result_draws_its_values_without_any_network(browser: str, tmp_path: Path) -> None:
    page = tmp_path / "result.html"
    page.write_text(result_page(json.loads(RESULTS[0].read_text(encoding="utf-8"))), encoding="utf-8")
    dom = shown(browser, page)
    assert dom.count("<svg") >= 1 and "Is the picture right?" in dom
    assert not re.search(r"(?:src|href)=\"(?!data:)", dom)
