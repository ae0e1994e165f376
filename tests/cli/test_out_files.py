"""Files that commands write: a name is taken as it was typed, in every command, or refused before any work."""

import json
import os
import shlex
from pathlib import Path

import pytest

import simulated_arm
from catenary.cli.main import Commands
from catenary.cli.out_files import EXCITATION, HEADER, LOG, MODEL, MOUNTING, PAGE, PARAMETERS, URDF, refuse_outputs
from catenary.files import card_path
from command_line import catenary, refusal

# a line that writes a file, up to the file's name; an ending of another kind of file; its own kind
WRITING = {
    "fit --out": ("fit {run} --model offset --folds 0 --out", ".parquet", MODEL),
    "fit --report": ("fit {run} --model offset --folds 0 --out {new}/o.npz --report", ".npz", PAGE),
    "evaluate --report": ("evaluate {model} {run} --report", ".csv", PAGE),
    "refresh --out": ("refresh {model} {another} --out", ".csv", MODEL),
    "refresh --report": ("refresh {model} {another} --out {new}/o.npz --report", ".csv", PAGE),
    "drift --report": ("drift {model} {another} --report", ".csv", PAGE),
    "identify --out": ("identify {motion} --robot raven2 --free --friction none --no-prior --out", ".csv", PARAMETERS),
    "identify --report": (
        "identify {motion} --robot raven2 --free --friction none --no-prior --out {new}/o.npz --report",
        ".npz",
        PAGE,
    ),
    "identify --urdf": ("identify {motion} --robot raven2 --out {new}/o.npz --urdf", ".npz", URDF),
    "excitation --out": ("excitation raven2 --static 12 --trials 1 --out", ".txt", EXCITATION),
    "excite --out": ("excite --refresh --out", ".txt", EXCITATION),
    "import --out": ("import {run} --units rad,rad,m --out", ".csv", LOG),
    "export --c": ("export two_link --c", ".c", HEADER),
    "sense --out": ("sense --simulated --tumble --seed 1 --out", ".npz", MOUNTING),
    "track --report": ("track two_link --q 0.4,0.9 --axes x,z --seconds 2 --report", ".csv", PAGE),
    "hold --report": ("hold two_link --q 0.4,0.9 --seconds 0.1 --report", ".csv", PAGE),
}
# what names a folder, or never replaces anything: by tests of their own
OTHERS = {"demo --out", "plot --out", "recover --out"}
QUICK = ("fit --out", "import --out", "excite --out")
SLOW = ("excitation --out", "evaluate --report", "refresh --out", "identify --out", "export --c", "sense --out")


NAMES = ("run", "model", "motion", "another", "new")


def line(case: str, request: pytest.FixtureRequest, folder: Path, **instead: str) -> list[str]:
    """The words of a case's line, its fixtures made, `new` a folder of its own."""
    text = WRITING[case][0].format_map({name: f"{{{name}}}" for name in NAMES} | instead)
    names = {name: request.getfixturevalue(name) for name in ("run", "model", "motion") if f"{{{name}}}" in text}
    new = folder / "beside"
    new.mkdir()
    if "{another}" in text:
        names["another"] = simulated_arm.write(new / "another.npz", seed=7)
    return shlex.split(text.format(**names, new=new))


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name != "beside")


def test_every_option_that_writes_is_in_the_table() -> None:
    commands = Commands()
    found = {
        f"{name} {option.opts[0]}"
        for name in commands
        for option in commands[name].params
        if option.opts[0] in ("--out", "--report", "--urdf", "--c")
    }
    assert found == {*WRITING, *OTHERS}


@pytest.mark.parametrize("case", [*QUICK, *(pytest.param(case, marks=pytest.mark.slow) for case in SLOW)])
def test_a_name_is_taken_as_typed_and_replaced_by_its_own_kind_only(
    case: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, kind = line(case, request, tmp_path), WRITING[case][2]
    monkeypatch.chdir(tmp_path)
    for name in ("x", "name with spaces \u00fc", "./-x", "x.v2") if case in QUICK else ("x",):
        done = catenary(*words, name)
        assert done.code == 0, done.err
        path = Path(name)
        cards = [card_path(path).name] if kind in (MODEL, PARAMETERS) else []
        assert files_in(tmp_path) == sorted([path.name, *cards])
        refuse_outputs({"--out": (path, kind)})  # an older one is replaced
        path.write_text("notes of years\n")
        assert "is there and is something else" in refusal(*words, name)
        assert path.read_text() == "notes of years\n"
        for written in (path, *map(Path, cards)):
            written.unlink()


@pytest.mark.alike
@pytest.mark.parametrize("case", WRITING)
def test_a_name_that_cannot_be_meant_is_refused_before_any_work(
    case: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = line(case, request, tmp_path, motion="{run}")  # which is not read, and is there already
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").write_text("notes")
    names = {
        f"x{WRITING[case][1]}": "expected",
        ".": "is a folder",
        "missing/x": "folder missing does not exist",
        "notes.txt/x": "is a file, no folder",
        "": "expected the name of a file, got an empty one",
        "-": "standard output",
        "-x": "a file of this name is ./-x",
        "--report": "looks like another option",
    }
    for name, said in names.items():
        assert said in refusal(*words, name)
    assert files_in(tmp_path) == ["notes.txt"]
    assert [path.name for path in (tmp_path / "beside").iterdir() if path.name != "another.npz"] == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write into every folder")
def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "read_only"
    folder.mkdir(mode=0o555)
    assert "cannot be written to" in refusal("excitation", "raven2", "--static", 12, "--out", folder / "x")


def test_a_recording_is_not_replaced_by_a_model_nor_a_model_by_parameters(
    run: Path, model: Path, motion: Path, tmp_path: Path
) -> None:
    for there in (run, model):
        kept = tmp_path / there.name
        kept.write_bytes(there.read_bytes())
        said = refusal("identify", motion, "--robot", "raven2", "--out", kept)
        assert "something else than an arm's parameters" in said
        assert kept.read_bytes() == there.read_bytes()


def test_files_without_an_ending_are_read_by_what_is_in_them(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert catenary("import", run, "--units", "rad,rad,m", "--out", "log").code == 0
    assert catenary("fit", "log", "--model", "linear", "--folds", "0", "--out", "arm").code == 0
    assert catenary("evaluate", "arm", "log").code == 0
    kinds = [json.loads(catenary("check", name, "--json").out)["kind"] for name in ("log", "arm")]
    assert kinds == ["recording", "calibration model"]


def test_models_whose_names_have_points_have_a_card_each(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("arm.v1", "arm.v2"):
        assert catenary("fit", run, "--model", "offset", "--folds", "0", "--out", name).code == 0
    assert files_in(tmp_path) == ["arm.v1", "arm.v1.card.json", "arm.v2", "arm.v2.card.json"]


def test_a_stream_may_be_written_to(run: Path) -> None:
    assert catenary("fit", run, "--model", "offset", "--folds", "0", "--out", "/dev/null").code == 0
