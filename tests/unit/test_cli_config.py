"""Settings from outside the scene: rank of the layers, and messages that name the layer at fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from fake_renderer import SCENE as ONE_BALL
from raytide.cli.config import gather, unknown_variables
from raytide.cli.main import main
from raytide.cli.options import check_outputs, size_of
from raytide.errors import SceneError, UsageError
from raytide.scene.given import bytes_of
from raytide.scene.load import load

SCENE = ONE_BALL.replace("spp = 8", "spp = 2")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a scene, and a user configuration `user.toml` beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


def test_higher_layers_win_and_are_named(place: Path) -> None:
    user, local = place / "user.toml", place / "raytide.toml"
    layers = [
        ("user", lambda: user.write_text("[render]\nspp = 4\n"), str(user)),
        ("local", lambda: local.write_text("[render]\nspp = 8\n"), "raytide.toml"),
        ("variable", lambda: None, "RAYTIDE_SPP"),
        ("option", lambda: None, "--spp"),
        ("set", lambda: None, "--set render.spp=64"),
    ]
    scene = load("scene.toml", layers=gather({}, {}, user).layers)
    assert (scene.render.spp, scene.origins["render.spp"]) == (2, "scene file")
    assert scene.origins["render.max_depth"] == "default"
    for rank, (_, make, origin) in enumerate(layers):
        make()
        environment = {"RAYTIDE_SPP": "16"} if rank >= 2 else {}
        options = {"spp": "32" if rank >= 3 else None}
        overrides = ["render.spp=64"] if rank >= 4 else []
        scene = load("scene.toml", layers=gather(options, environment, user).layers, overrides=overrides)
        assert (scene.render.spp, scene.origins["render.spp"]) == (4 << rank, origin)


@pytest.mark.parametrize(
    ("options", "environment", "origin", "words"),
    [
        ({"spp": "4.5"}, {}, "--spp", "4.5"),
        ({"spp": "many"}, {}, "--spp", "many"),
        ({"spp": "nan"}, {}, "--spp", "NaN"),
        ({"integrator": "pth"}, {}, "--integrator", "path"),
        ({"size": "10by10"}, {}, "--size", "10by10"),
        ({"size": "0x10"}, {}, "--size", "[0, 10]"),
        ({}, {"RAYTIDE_MAX_DEPTH": "0"}, "RAYTIDE_MAX_DEPTH", "from 1"),
        ({"threads": "0"}, {}, "--threads", "at least 1"),
        ({"memory": "lots"}, {}, "--memory", "512M"),
        ({"device": ""}, {}, "--device", "device id"),
        ({}, {"RAYTIDE_THREADS": "two"}, "RAYTIDE_THREADS", "two"),
    ],
)
def test_wrong_values_name_their_layer_and_what_was_wanted(
    place: Path, options: dict[str, str], environment: dict[str, str], origin: str, words: str
) -> None:
    with pytest.raises(SceneError) as caught:
        load("scene.toml", layers=gather(options, environment, place / "none.toml").layers)
    message = str(caught.value)
    assert message.startswith(origin)
    assert words in message
    assert caught.value.exit_code == 2


def test_unknown_configuration_keys_are_errors_with_file_and_line(place: Path) -> None:
    (place / "raytide.toml").write_text("# mine\nthreads = 2\ndevise = 'cpu'\n")
    with pytest.raises(SceneError) as caught:
        gather({}, {}, place / "none.toml")
    assert str(caught.value).startswith("raytide.toml:3: devise:")
    assert "'device'" in str(caught.value)
    (place / "raytide.toml").write_text("[render]\nsp = 2\n")
    with pytest.raises(SceneError) as caught:
        load("scene.toml", layers=gather({}, {}, place / "none.toml").layers)
    assert "raytide.toml" in str(caught.value)
    assert "'spp'" in str(caught.value)


def test_all_configuration_problems_come_at_once(place: Path) -> None:
    (place / "raytide.toml").write_text("threads = 0\ndevise = 'cpu'\n")
    with pytest.raises(SceneError) as caught:
        gather({"memory": "x"}, {}, place / "none.toml")
    assert len(caught.value.problems) == 3


def test_machine_settings_keep_their_rank(place: Path) -> None:
    (place / "raytide.toml").write_text("threads = 2\nmemory = '1G'\ndevice = 'pocl'\n")
    settings = gather({"device": "nvidia"}, {"RAYTIDE_DEVICE": "intel", "RAYTIDE_THREADS": "3"}, place / "none.toml")
    found = {key: (setting.value, setting.origin) for key, setting in settings.host.items()}
    assert found == {
        "device": ("nvidia", "--device"),
        "threads": (3, "RAYTIDE_THREADS"),
        "memory": (2**30, "raytide.toml"),
    }


def test_variables_that_nothing_reads_are_told_with_the_nearest_that_something_does() -> None:
    right = {"RAYTIDE_SPP": "4", "RAYTIDE_CACHE_DIR": "/x", "RAYTIDE_TEST_WHAT": "1", "HOME": "/"}
    assert unknown_variables(right) == []
    wrong = {"RAYTIDE_SSP": "4", "RAYTIDE_XYZXYZ": "1", "RAYTIDE_CACH_DIR": "/x"}
    assert unknown_variables(right | wrong) == [
        "RAYTIDE_CACH_DIR: an unknown variable, ignored; did you mean 'RAYTIDE_CACHE_DIR'?",
        "RAYTIDE_SSP: an unknown variable, ignored; did you mean 'RAYTIDE_SPP'?",
        "RAYTIDE_XYZXYZ: an unknown variable, ignored",
    ]


def test_every_command_tells_of_unknown_variables(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RAYTIDE_DEVISE", "cpu")
    assert main(["verify", "--list"]) == 0
    assert capsys.readouterr().err.startswith("raytide: warning: RAYTIDE_DEVISE: an unknown variable")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("converge s.toml -o out --replicates 1", "--replicates: came 1; wanted a whole number at least 2"),
        ("converge s.toml -o out --start-runs -1", "--start-runs: came -1; wanted a whole number at least 0"),
        ("converge s.toml -o out --seed -1", "--seed: came -1; wanted a whole number from 0 to 2147483647"),
        ("audit s.toml -o out --seeds 1", "--seeds: came 1; wanted a whole number at least 2"),
        ("audit s.toml -o out --spp 16,8",
         "--spp: came '16,8'; wanted rising samples a pixel of at least 16, such as 16,64"),
        ("reference s.toml -o r.exr --slices 1", "--slices: came 1; wanted a whole number at least 2"),
        ("verify --fuzz 0", "--fuzz: came 0; wanted a whole number at least 1"),
        ("verify --fuzz -1", "--fuzz: came -1; wanted a whole number at least 1"),
    ],
)  # fmt: skip
def test_a_number_outside_its_range_is_named_alone(
    place: Path, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    assert main(words.split()) == 2
    assert capsys.readouterr().err == f"raytide: {message}\n"


@pytest.mark.parametrize("command", ["render scene.toml", "merge a.shard"])
@pytest.mark.parametrize("stops", ["nan", "inf", "-inf", "2000"])
def test_an_exposure_that_leaves_no_picture_is_refused(
    place: Path, capsys: pytest.CaptureFixture[str], command: str, stops: str
) -> None:
    assert main([*command.split(), "-o", "a.png", f"--exposure={stops}"]) == 2
    assert "--exposure" in (told := capsys.readouterr().err) and "from -100 to 100" in told


def test_an_empty_name_is_called_one(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "scene.toml", "-o", ""]) == 2
    assert "came an empty name" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [("640x360", [640, 360]), ("1X1", [1, 1]), ("640", "640"), ("-1x4", "-1x4"), ("4x4x4", "4x4x4")],
)
def test_sizes_read_as_width_and_height(text: str, expected: list[int] | str) -> None:
    assert size_of(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1", 1), ("512M", 2**29), ("1.5g", 3 * 2**29), ("2 KiB", 2048), ("-1", None), ("M", None), ("1T", None)],
)
def test_byte_counts_use_powers_of_1024(text: str, expected: int | None) -> None:
    assert bytes_of(text) == expected


def test_outputs_are_checked_before_any_work(place: Path) -> None:
    (place / "there.exr").write_bytes(b"old")
    (place / "folder.exr").mkdir()
    (place / "file").write_text("")
    check_outputs([Path("new/deep/a.exr"), Path("b.PNG")], [Path("r/report.json"), None], True)
    assert (place / "new" / "deep").is_dir()
    assert (place / "r").is_dir()
    for outputs, no_clobber in (
        ([Path("a.tif")], False),
        ([Path("a")], False),
        ([Path("folder.exr")], False),
        ([Path("there.exr")], True),
        ([Path("a.exr"), Path("./a.exr")], False),
        ([Path("file/a.exr")], False),
    ):
        with pytest.raises(UsageError):
            check_outputs(outputs, [], no_clobber)
    with pytest.raises(UsageError, match=r"\.exr, \.png"):
        check_outputs([Path("a.jpg")], [], False)
    assert (place / "there.exr").read_bytes() == b"old"
