"""Comparing pictures: what is only noise agrees, what is not differs, and the exit code says so."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from raytide.cli.main import main
from raytide.image import write_exr
from raytide.image.compare import ALPHA, agreement, errors_of, tile_probability

SIZE = (45, 61, 3)


def truth() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.1, 2.0, SIZE)


def noisy(seed: int, level: float = 0.1, bias: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A picture with multiplicative noise, and its variances as an estimate with few degrees of freedom has them."""
    rng, mean = np.random.default_rng(seed), truth() * bias
    variance = (level * mean) ** 2
    return rng.normal(mean, np.sqrt(variance)), variance * rng.chisquare(2, SIZE) / 2


def test_noise_alone_agrees_and_alarms_stay_below_their_level() -> None:
    found = [agreement(*noisy(2 * k), *noisy(2 * k + 1)) for k in range(100)]
    assert sum(not one.agrees for one in found) <= 1  # expected: ALPHA x 100 = 0.1
    assert ALPHA == 1e-3 and found[0].tests == 6 * 8 * 3
    ratio = np.mean([one.ratio for one in found], axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=1e-3)


def test_a_small_bias_of_the_whole_picture_is_found_and_its_ratio_measured() -> None:
    found = agreement(*noisy(3, bias=1.03), *noisy(4))
    assert not found.agrees and np.abs(found.mean_z).min() > found.mean_limit
    assert np.all(np.abs(found.ratio - 1.03) < 4 * found.ratio_error)


def test_a_spot_that_the_means_hide_is_found_by_its_tile() -> None:
    a, variance = noisy(5)
    a[8:16, 8:16] += 0.2
    a[16:24, 8:16] -= 0.2
    found = agreement(a, variance, *noisy(6))
    assert not found.agrees and found.beyond >= 2 and np.all(np.abs(found.mean_z) < found.mean_limit)


def test_one_firefly_whose_variance_is_known_is_no_difference() -> None:
    a, variance = noisy(7)
    a[20, 20] += 50.0
    variance[19:22, 19:22] += 50.0**2 / 9  # as the renderer spreads it
    assert agreement(a, variance, *noisy(8)).agrees


def test_constant_pictures_agree_with_themselves_and_with_nothing_else() -> None:
    one, zero = np.ones(SIZE), np.zeros(SIZE)
    assert agreement(one, zero, one, zero).agrees
    assert not agreement(one, zero, one * 1.001, zero).agrees
    assert not agreement(one, zero, one * np.nan, zero).agrees


def test_errors_are_those_of_their_definitions_and_say_their_e() -> None:
    y, x = truth(), truth() * 1.1
    found = errors_of(x, y)
    e = 0.01 * y.mean()
    assert found["e"] == pytest.approx(e)
    assert found["relmse"] == pytest.approx(np.mean((0.1 * y) ** 2 / (y**2 + e**2)))
    assert found["error"] == pytest.approx(np.sqrt(found["relmse"]))
    assert found["smape"] == pytest.approx(np.mean(0.1 * y / (1.05 * y + e)))


def test_the_variance_of_a_reference_is_subtracted() -> None:
    x, _ = noisy(9, level=0.1)
    y, _ = noisy(10, level=0.1)
    plain, corrected = errors_of(x, y), errors_of(x, y, (0.1 * truth()) ** 2)
    assert plain["mse"] == pytest.approx(2 * corrected["mse"], rel=0.1)


def picture(path: Path, seed: int, *, variance: bool = True, bias: float = 1.0, header: dict | None = None) -> str:
    rgb, own = noisy(seed, bias=bias)
    layers = {"beauty": rgb} | ({"variance": own} if variance else {})
    write_exr(path, layers, {"raytide": {"seed": seed, "scene_sha256": "s"} | (header or {})})
    return str(path)


def test_noise_exits_0_and_a_difference_exits_4(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = picture(tmp_path / "a.exr", 1), picture(tmp_path / "b.exr", 2)
    c = picture(tmp_path / "c.exr", 3, bias=1.05)
    assert main(["compare", a, b]) == 0
    out, err = capsys.readouterr()
    assert err == "" and ": agree" in out and "(e = " in out and "mean of A / mean of B: " in out
    assert main(["compare", a, c, "--json", "-"]) == 4
    found = json.loads(capsys.readouterr().out)
    assert found["grade"] == "differ" and found["test"]["mean_ratio"][0] == pytest.approx(1 / 1.05, abs=0.01)
    assert found["notes"] == []
    assert main(["compare", a, a, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["grade"] == "identical"


def test_a_reference_tells_which_is_better(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, r = (picture(tmp_path / f"{name}.exr", seed, bias=bias) for name, seed, bias in
               (("a", 1, 1.0), ("b", 2, 1.5), ("r", 3, 1.0)))  # fmt: skip
    assert main(["compare", a, b, "--reference", r, "--json", "-"]) == 4
    found = json.loads(capsys.readouterr().out)["reference"]
    assert found["file"] == r and found["a"]["relmse"] < found["b"]["relmse"] / 5
    assert found["a"]["reference_variance_subtracted"]


def test_without_variances_only_equal_pictures_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = picture(tmp_path / "a.exr", 1)
    b, again = (picture(tmp_path / name, seed, variance=False) for name, seed in (("b.exr", 2), ("again.exr", 1)))
    assert main(["compare", a, b, "--json", "-"]) == 4
    found = json.loads(capsys.readouterr().out)
    assert found["test"] is None and "b.exr" in found["notes"][0] and "a.exr" not in found["notes"][0]
    assert main(["compare", a, again]) == 0


def test_what_makes_a_comparison_doubtful_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = picture(tmp_path / "a.exr", 1)
    b = picture(tmp_path / "b.exr", 2, header={"seed": 1, "scene_sha256": "other"})
    main(["compare", a, b])
    out = capsys.readouterr().out
    assert "same seed" in out and "different scenes" in out


def test_a_file_that_is_no_picture_is_the_caller_s_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.exr").write_text("a scene, perhaps")
    b = picture(tmp_path / "b.exr", 2)
    assert main(["compare", b, str(tmp_path / "text.exr")]) == 2
    assert "text.exr" in capsys.readouterr().err


def test_a_broken_pixel_never_agrees_and_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rgb, variance = noisy(1)
    rgb[3, 4] = np.nan
    write_exr(tmp_path / "a.exr", {"beauty": rgb, "variance": variance})
    b = picture(tmp_path / "b.exr", 2)
    assert main(["compare", str(tmp_path / "a.exr"), b, "--json", "-"]) == 4
    found = json.loads(capsys.readouterr().out)
    assert found["a_against_b"]["nonfinite"] == 1 and found["a_against_b"]["relmse"] is None
    assert main(["compare", str(tmp_path / "a.exr"), str(tmp_path / "a.exr")]) == 4


def test_p_values_of_noise_are_even_and_a_spot_has_its_own(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    freedom = np.full((60, 60, 1), 20.0)
    t = rng.standard_t(20.0, (60, 60, 1))
    p = tile_probability(t, freedom)
    for share in (0.01, 0.1, 0.5, 0.9):
        assert np.mean(p < share) == pytest.approx(share, abs=4 * (share * (1 - share) / p.size) ** 0.5 + 0.01 * share)
    three = tile_probability(rng.standard_t(20.0, (60, 60, 3)), np.full((60, 60, 3), 20.0))
    assert np.mean(three < 0.1) == pytest.approx(0.1, abs=0.025)
    a, variance = noisy(5)
    a[8:16, 16:24] += 0.3
    found = agreement(a, variance, *noisy(6)).p
    assert np.unravel_index(found.argmin(), found.shape) == (1, 2) and found.min() < 1e-4


def test_the_tail_is_that_of_the_pixels() -> None:
    y = np.full((100, 100, 3), 2.0)
    x = y.copy()
    x[:2, :60] *= 1.5  # 1.2 % of the pixels
    x[50, 50] *= 4.0
    found = errors_of(x, y)["tail"]
    assert found["p99"] == pytest.approx(0.5, rel=1e-3) and found["largest"] == pytest.approx(3.0, rel=1e-3)


def test_flip_is_a_number_or_words_that_say_how_to_get_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = picture(tmp_path / "a.exr", 1), picture(tmp_path / "b.exr", 2)
    main(["compare", a, b])
    out = capsys.readouterr().out
    assert "HDR-FLIP 0." in out if find_spec("flip_evaluator") else "pip install 'raytide[flip]'" in out


def test_a_page_and_json_are_written_where_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = picture(tmp_path / "a.exr", 1), picture(tmp_path / "b&.exr", 2, bias=1.2)
    html, data = tmp_path / "out" / "c.html", tmp_path / "out" / "c.json"
    assert main(["compare", a, b, "--reference", a, "--html", str(html), "--json", str(data)]) == 4
    assert ": differ" in capsys.readouterr().out
    found = json.loads(data.read_text())
    assert found["grade"] == "differ" and np.array(found["test"]["p_map"]).shape == (6, 8)
    page = html.read_text(encoding="utf-8")
    assert '<b class="bad">differ</b>' in page and "b&amp;.exr" in page and page.count("data:image/png") == 8


def test_black_pictures_can_be_compared(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"beauty": np.zeros(SIZE)})
    assert main(["compare", str(tmp_path / "a.exr"), str(tmp_path / "a.exr")]) == 0


def test_what_cannot_be_compared_exits_2_and_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = picture(tmp_path / "a.exr", 1)
    write_exr(tmp_path / "small.exr", {"beauty": np.ones((4, 6, 3))})
    for words, said in (([a, str(tmp_path / "small.exr")], "6x4"), ([a, str(tmp_path / "absent.exr")], "absent.exr"),
                        ([a, a, "--reference", str(tmp_path / "small.exr")], "61x45")):  # fmt: skip
        assert main(["compare", *words]) == 2
        out, err = capsys.readouterr()
        assert out == "" and said in err and "Traceback" not in err
