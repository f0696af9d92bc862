"""Error against time: the statistics find what was put in, and the reference's own noise adds nothing."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
import pytest

from raytide.cli.converge import lines
from raytide.cli.main import main
from raytide.cli.replicates import budgets_of, named_scenes, picture_size
from raytide.errors import UsageError
from raytide.image import write_exr
from raytide.report.convergence import Point, Truth, fit, time_to
from raytide.report.convergence_files import Outcome, csv_text, result_of
from raytide.report.convergence_page import document
from raytide.report.experiment import Budget, Plan, Track, Variant, order, small_size, variants_of
from raytide.report.files import write_json
from raytide.report.reference import read_reference
from raytide.report.start_cost import StartCost

SIZE = (24, 32, 3)
LEVEL = 0.5  # standard deviation of one sample, as a share of the radiance


def radiance() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.2, 2.0, SIZE)


def truth(noise: float = 0.0, seed: int = 2) -> Truth:
    variance = (noise * radiance()) ** 2
    return Truth(np.random.default_rng(seed).normal(radiance(), np.sqrt(variance)), variance)


def point(spp: int, of: Truth, replicates: int = 16, power: float = 1.0, bias: float = 0.0, seed: int = 3) -> Point:
    """Renders whose variance is LEVEL^2 / spp^power of the radiance squared, all too bright by `bias`."""
    rng, out = np.random.default_rng((seed, spp)), Point(of, f"{spp} spp")
    for k in range(replicates):
        x = rng.normal(radiance() * (1 + bias), LEVEL * radiance() * spp ** (-power / 2))
        out.add(x.astype(np.float32), k, spp, 0.01 * spp)
    return out


def test_relmse_is_its_definition_whatever_noise_the_reference_has() -> None:
    expected = LEVEL**2 / 16 * np.mean(radiance() ** 2 / (radiance() ** 2 + truth().epsilon ** 2))
    for noise in (0.0, 0.05):
        found = point(16, truth(noise)).figures()
        assert found["relmse"] == pytest.approx(expected, rel=0.02)
        assert found["reference_relmse"] == pytest.approx(noise**2, rel=0.05)


def test_the_interval_of_relmse_holds_its_mean_as_often_as_it_says() -> None:
    of, held, trials = truth(), 0, 200
    expected = LEVEL**2 / 4 * np.mean(radiance() ** 2 * of.weight)
    for seed in range(trials):
        found = point(4, of, replicates=4, seed=seed).figures()
        held += found["relmse_low"] <= expected <= found["relmse_high"]
    assert 0.9 * trials <= held <= 0.99 * trials


def test_bias_and_spread_are_told_apart() -> None:
    of = truth(0.01)
    found = point(64, of, bias=0.05).figures()
    share = np.mean(radiance() ** 2 * of.weight)
    assert found["relative_variance"] == pytest.approx(LEVEL**2 / 64 * share, rel=0.05)
    assert found["relative_bias2"] == pytest.approx(0.05**2 * share, rel=0.1)
    assert abs(point(64, of).figures()["relative_bias2"]) < 0.1 * 0.05**2


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_the_slope_that_was_put_in_is_inside_its_interval(power: float) -> None:
    of = truth(0.001)
    found = fit([point(2**k, of, power=power) for k in range(8)])
    assert found and found.slope99[0] <= -power / 2 <= found.slope99[1]
    assert found.slope99[1] - found.slope99[0] < 0.03 and found.points == 8
    if power == 1.0:
        assert found.floor95[0] <= 0.0 <= found.floor95[1]
    else:
        assert found.slope99[1] < -0.5


def test_a_bias_is_the_floor_of_the_fit() -> None:
    found = fit([point(2**k, truth(), bias=0.02) for k in range(10)])
    assert found and found.floor95[0] <= 0.02**2 <= found.floor95[1] and found.floor95[0] > 0


def test_points_stop_counting_where_the_reference_is_too_noisy() -> None:
    of = truth(0.1)  # own relMSE 0.01
    points = [point(2**k, of) for k in range(8)]
    assert [one.counts() for one in points] == [LEVEL**2 / 2**k > 10 * 0.01 for k in range(8)]
    assert fit(points[4:]) is None


def test_time_to_an_error_is_interpolated_and_extrapolated_by_one_octave_at_most() -> None:
    points = [point(2**k, truth()) for k in range(7)]  # 0.01 s a sample
    at = lambda n: math.sqrt(float(np.mean(LEVEL**2 / n * radiance() ** 2 * truth().weight)))  # noqa: E731
    for spp, beyond in ((23.0, False), (100.0, True)):
        found = time_to(points, at(spp), set_up_s=5.0)
        assert found and found[1] is beyond and found[0] - 5.0 == pytest.approx(0.01 * spp, rel=0.05)
    assert time_to(points, at(300.0)) is None and time_to(points, 2.0) is None


def test_a_broken_pixel_makes_the_error_infinite_and_is_counted() -> None:
    of, broken = truth(), radiance().astype(np.float32)
    broken[3, 4, 1] = np.nan
    one = Point(of, "1 spp")
    one.add(broken, 0, 1, 0.1)
    assert one.figures()["nonfinite"] == 1 and one.figures()["relmse"] == math.inf and not one.counts()


def outcome(tmp_path: Path) -> Outcome:
    of = truth(0.001)
    plan = Plan(tmp_path / "a<b.toml", variants_of(["sampler=sobol,random"]), (Budget(1), Budget(4), Budget(16)), 4)
    tracks = []
    for variant in plan.variants:
        points = [point(one.spp or 1, of, 4) for one in plan.budgets]
        tracks.append(Track(variant, points, {"in_process": 0.5}, {"device": "fake"}))
    return Outcome(plan, of, tracks, {plan.variants[0].name: StartCost(1.5, 4.5, {})})


@pytest.mark.parametrize(("slower", "said"), [(1.0, None), (1.04, None), (1.2, "20 % longer"), (0.8, "20 % less")])
def test_a_machine_that_changes_while_it_is_timed_is_told(slower: float, said: str | None, tmp_path: Path) -> None:
    """Equal work, in turns: the last replicates take `slower` times what the first did, whatever their budget."""
    of = truth(0.001)
    plan = Plan(tmp_path / "a.toml", variants_of(["sampler=sobol,random"]), (Budget(1), Budget(16)), 9)
    tracks = [Track(variant, [Point(of, one.label) for one in plan.budgets], {"in_process": 0.5}, {})
              for variant in plan.variants]  # fmt: skip
    for track in tracks:
        for budget, made in zip(plan.budgets, track.points, strict=True):
            for k in range(9):
                noise = 1 + 0.01 * (k % 3)
                seconds = 0.01 * budget.spp * noise * (slower if k >= 6 else 1.0)
                made.add((radiance() * (1.1 if k % 2 else 0.9)).astype(np.float32), k, budget.spp, seconds)
    one = Outcome(plan, of, tracks, {})
    drift = one.drift()
    assert drift is not None and drift == pytest.approx(slower - 1, abs=1e-9)
    assert (one.warning() is None) if said is None else (said in str(one.warning()))
    page = document([one], {"command": "raytide converge"})
    assert ("not to be relied on" in page) == (said is not None) and "efficiency" in page
    timed = Outcome(Plan(plan.scene, plan.variants, (Budget(seconds=1.0),), 9), of, tracks, {})
    assert timed.drift() is None, "budgets of time are no equal work"


@pytest.mark.parametrize(("replicates", "said"), [(4, "the slope (as the scene says) is known to"), (400, None)])
def test_what_too_few_replicates_leave_open_is_told_with_how_many_would_do(replicates: int, said: str | None) -> None:
    """Independent pixels: relMSE is known well, the slope by so few replicates is not."""
    plan = Plan(Path("a.toml"), variants_of([]), (Budget(1), Budget(4), Budget(16)), replicates)
    rng, of, points = np.random.default_rng(8), truth(), []
    for budget in plan.budgets:
        points.append(Point(of, budget.label))
        for k in range(replicates):
            x = radiance() * (1 + 0.1 * rng.normal(1.0, 0.2) / (budget.spp or 1) ** 0.5 * rng.choice((-1, 1), SIZE))
            points[-1].add(x.astype(np.float32), k, budget.spp or 1, 0.01)
    one = Outcome(plan, of, [Track(plan.variants[0], points, {"in_process": 0.5}, {})], {})
    found = one.wanting()
    assert (found is None) if said is None else (said in str(found) and "add replicates, about" in str(found))
    assert ("add replicates" in document([one], {"command": "raytide converge"})) == (said is not None)


def test_an_interrupted_experiment_is_told_though_a_variant_was_never_rendered(tmp_path: Path) -> None:
    one = outcome(tmp_path)
    one.tracks[1].points = [Point(one.truth, budget.label) for budget in one.plan.budgets]
    assert "sampler=sobol" in lines([one]) and "sampler=random" not in lines([one])
    assert "sampler=random" in document([one], {"command": "raytide converge"})
    assert result_of([one], {})["scenes"][0]["variants"][1]["points"] == []


def test_a_reference_of_a_replicates_seed_is_refused(tmp_path: Path) -> None:
    plan = Plan(Path("s.toml"), variants_of([]), (Budget(1), Budget(4)), 2, seed=0)
    assert plan.seeds() == {0, 1, 2, 3}
    for seed, refused in ((3, True), (4, False), (2**31, False)):
        path = tmp_path / f"{seed}.exr"
        write_exr(path, {"beauty": radiance()}, {"raytide": {"seed": seed}})
        if refused:
            with pytest.raises(UsageError, match="seed 3, which a replicate has, too.*another --seed"):
                read_reference(path, plan.seeds())
        else:
            assert read_reference(path, plan.seeds()).rgb.shape == SIZE


def test_files_hold_every_render_and_the_page_shows_every_variant(tmp_path: Path) -> None:
    import json

    one = outcome(tmp_path)
    rows = list(csv.DictReader(io.StringIO(csv_text([one]))))
    assert len(rows) == 2 * 3 * 4 and {row["variant"] for row in rows} == {"sampler=sobol", "sampler=random"}
    assert float(rows[0]["relmse"]) == one.tracks[0].points[0].rows[0].relmse
    write_json(tmp_path / "out.json", result_of([one], {"command": "raytide converge"}))
    found = json.loads((tmp_path / "out.json").read_text())
    first, second = found["scenes"][0]["variants"]
    assert found["scenes"][0]["drift"] is None, "four replicates tell nothing"
    assert first["points"][0]["wall_s"] == pytest.approx(first["points"][0]["render_s"] + 1.5)  # the measured start
    assert second["points"][0]["wall_s"] == pytest.approx(second["points"][0]["render_s"] + 0.5)
    page = document([one], {"command": "raytide converge <x>"})
    assert page.count("sampler=random") > 3 and "a&lt;b" in page and "<x>" not in page and page.count("<svg") >= 4


def test_every_render_of_a_variant_has_a_seed_of_its_own_below_those_of_references() -> None:
    for seed in (1, 2**31 - 1):
        plan = Plan(Path("s.toml"), variants_of([]), tuple(Budget(2**k) for k in range(8)), 64, seed=seed)
        seeds = [plan.seed_of(replicate, at) for replicate, variant, at in order(plan)]
        assert len(set(seeds)) == 512 and 0 <= min(seeds) and max(seeds) < 2**31


def test_what_varies_is_every_combination_and_wrong_keys_are_named() -> None:
    found = variants_of(["sampler=sobol,random", "device=cpu,gpu"], "any")
    assert [one.name for one in found] == [
        "sampler=sobol, device=cpu", "sampler=sobol, device=gpu", "sampler=random, device=cpu",
        "sampler=random, device=gpu",
    ]  # fmt: skip
    assert found[1] == Variant(found[1].name, (("sampler", "sobol"),), "gpu")
    assert variants_of([], "any")[0].device == "any"
    assert [one.precision for one in variants_of(["precision=exact,worse"])] == ["exact", "worse"]
    for wrong, word in ((["samplr=a,b"], "sampler"), (["spp=1,2"], "spp"), (["bvh"], "bvh=A,B"),
                        (["bvh=a,a"], "differ"), (["bvh=a", "bvh=b"], "twice")):  # fmt: skip
        with pytest.raises(UsageError, match=word):
            variants_of(wrong)


def test_budgets_and_sizes_are_read_as_people_type_them() -> None:
    assert budgets_of("1, 4,16") == (Budget(1), Budget(4), Budget(16))
    assert budgets_of("1s,2min") == (Budget(seconds=1.0), Budget(seconds=120.0))
    for wrong in ("", "4,1", "1,1", "1,2s", "0,1", "x", "-1", "1.5", "0s"):
        with pytest.raises(UsageError, match="rising"):
            budgets_of(wrong)
    assert named_scenes((Path("a/s.toml"), Path("b/s.toml"), Path("b/t.toml"))) == [
        (Path("a/s.toml"), "a-s"), (Path("b/s.toml"), "b-s"), (Path("b/t.toml"), "t"),
    ]  # fmt: skip
    assert picture_size("64x48") == (64, 48) and small_size((640, 320)) == (91, 45) and small_size((8, 6)) == (8, 6)


@pytest.mark.parametrize(("words", "said"), [
    (["converge", "absent.toml"], "-o FOLDER"),
    (["converge", "-o", "out"], "no scene"),
    (["converge", "absent.toml", "-o", "out"], "absent.toml"),
    (["converge", "x/a/s.toml", "y/a/s.toml", "-o", "out"], "share this name"),
    (["converge", "absent.toml", "-o", "out", "--replicates", "1"], "at least 2"),
    (["converge", "absent.toml", "-o", "out", "--budgets", "1s,2s"], "--reference-spp"),
    (["reference", "absent.toml"], "-o FILE.exr"),
    (["reference", "absent.toml", "-o", "r.png"], "r.png"),
    (["reference", "absent.toml", "-o", "r.exr", "--slices", "1"], "--slices: came 1; wanted a whole number at"),
])  # fmt: skip
def test_wrong_requests_exit_2_and_say_what_was_wanted(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == "" and said in err and "Traceback" not in err
