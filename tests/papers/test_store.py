"""Cases, what they leave, and experiments: keys by content, a store of files, the catalogue."""

import json
import lzma
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.errors import InputError
from catenary.simulation.cable_parameters import RAVEN2_ECCENTRIC
from oracles.sweep_cases import quick, summed
from papers import catalog, experiment, store
from papers.catalog import MODULES, named
from papers.experiment import Case, Outcomes, Scope
from papers.kit import by_count
from papers.results_files import RAW, judged
from papers.store import Finished, Store, read_raw, source_digest, write_raw

CASE = quick.case(number=3, folder="here")
DONE = Finished(
    {"number": 3, "value": 0.1 + 0.2, "rows": [[1.5, None], []], "name": "Ω"},
    1.25,
    1.0,
    "0.1.0",
    "abc",
    "2026-11-23T12:00:00+00:00",
    "numpy 2",
)


def test_what_is_kept_comes_back_whole(tmp_path: Path) -> None:
    kept = Store(tmp_path)
    assert kept.read(CASE) is None
    kept.write(CASE, DONE)
    assert Store(tmp_path).read(CASE) == DONE
    content = json.loads((tmp_path / "cases" / f"{CASE.key}.json").read_text())
    assert (content["function"], content["arguments"]) == (CASE.function, {"folder": "here", "number": 3})


def test_raw_results_come_back_whole_and_in_order_and_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / f"calibration-table-1{RAW}"
    with pytest.raises(InputError, match="no raw results; run calibration-table-1 first"):
        read_raw(path)
    kept = {summed.case(number=k, folder="here"): DONE._replace(seconds=float(k)) for k in (2, 1, 3)}
    write_raw(path, kept)
    assert list(read_raw(path).items()) == list(kept.items())
    whole = path.read_bytes()
    write_raw(path, kept)
    assert path.read_bytes() == whole  # nothing to commit again
    for damage in (b"", whole[:-20], b"text", lzma.compress(b'[{"function": "f"}]')):
        path.write_bytes(damage)
        with pytest.raises(InputError, match="no file of raw results"):
            read_raw(path)


@pytest.mark.parametrize(
    "damage",
    [b"", b"{", b"null", b"[1]", b"\xff\xfe\x00", b'{"result": {}}', b'"text"', b'{"result": 1, "seconds": 1, "version": "", "source": ""}'],
    ids=repr,
)  # fmt: skip
def test_a_damaged_file_is_no_result_and_is_written_anew(tmp_path: Path, damage: bytes) -> None:
    kept = Store(tmp_path)
    kept.write(CASE, DONE)
    path = tmp_path / "cases" / f"{CASE.key}.json"
    path.write_bytes(damage)
    assert kept.read(CASE) is None
    kept.write(CASE, DONE)
    assert kept.read(CASE) == DONE
    path.write_bytes(path.read_bytes()[:-20])  # cut off
    assert kept.read(CASE) is None


def test_a_key_depends_on_function_revision_and_every_argument_and_not_on_their_order() -> None:
    others = [
        quick.case(number=4, folder="here"),
        quick.case(number=3, folder="there"),
        summed.case(number=3, folder="here"),
        replace(CASE, revision=2),
    ]
    assert len({case.key for case in [CASE, *others]}) == 5
    again = quick.case(folder="here", number=3)
    assert again == CASE
    assert again.key == CASE.key


def test_a_key_depends_on_the_data_of_simulated_robots_and_of_those_it_names(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    before = CASE.key
    for room in ("robots", "simulation"):
        (tmp_path / room / "data").mkdir(parents=True)
    monkeypatch.setattr(experiment, "files", lambda _: tmp_path)

    def keys(room: str, name: str, text: str) -> tuple[str, str]:
        (tmp_path / room / "data" / f"{name}.toml").write_text(text)
        experiment.robots_digest.cache_clear()
        return CASE.key, quick.case(folder="other_arm", number=3).key

    found = [
        keys("simulation", "cables", "stiffness = 1"), keys("simulation", "cables", "stiffness = 2"),
        keys("robots", "raven2", "mass = 1"), keys("robots", "other_arm", "mass = 2"),
    ]  # fmt: skip
    (tmp_path / "simulation" / "data" / RAVEN2_ECCENTRIC).write_text("a variant")
    experiment.robots_digest.cache_clear()
    of_variant = quick.case(folder=RAVEN2_ECCENTRIC, number=3).key
    assert CASE.key == found[3][0]
    (tmp_path / "simulation" / "data" / RAVEN2_ECCENTRIC).write_text("another")
    experiment.robots_digest.cache_clear()
    assert quick.case(folder=RAVEN2_ECCENTRIC, number=3).key != of_variant
    monkeypatch.undo()
    experiment.robots_digest.cache_clear()
    assert len(set(found)) == 4
    assert found[3][0] == found[2][0]  # it does not name that arm
    assert found[3][1] != found[2][1]
    assert CASE.key == before


def test_the_digest_of_the_source_changes_with_any_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    monkeypatch.setattr(store, "files", lambda _: tmp_path)
    digests = []
    for name, text in (("a.py", "x = 1"), ("robots/a.py", ""), ("a.py", "x = 2"), ("notes.txt", "no source")):
        (tmp_path / name).write_text(text)
        digests.append(source_digest.__wrapped__())
    assert len(set(digests[:3])) == 3
    assert digests[3] == digests[2]


def test_a_case_is_plain_data_and_its_function_a_marked_one() -> None:
    with pytest.raises(TypeError):
        quick.case(number=3)
    with pytest.raises((TypeError, ValueError)):
        quick.case(number=float("nan"), folder="here")
    with pytest.raises(TypeError, match="expected a function marked with @run"):
        Case("oracles.sweep_cases.calls", 1, "{}").load()


@pytest.mark.parametrize(
    ("holds", "verdict"),
    [
        ([True, True], "reproduced"),
        ([True, True, False], "same direction"),
        ([True, False], "not reproduced"),
        ([], "not measured"),
    ],
)
def test_a_claim_of_several_parts_holds_as_far_as_these_do(holds: list[bool], verdict: str) -> None:
    assert by_count(holds, "told").verdict == verdict


@pytest.mark.parametrize("name", MODULES)
def test_every_experiment_says_what_it_is_and_what_it_would_run(name: str) -> None:
    one = catalog.experiment(name)
    assert one.name == name
    # regressor-payload stands on the regressor's page and claims nothing of the paper's
    assert name.startswith(f"{one.paper}-") or one.paper == "beyond"
    assert one.about
    assert one.minutes > 0.0
    # nothing is claimed of what was not measured
    assert {found.verdict for _, found in judged(one, Outcomes({}))} <= {"not measured"}
    for claim in one.claims:
        assert all((claim.says, claim.place, claim.published, claim.criterion))
    if not one.needs_data:
        whole = one.cases(Scope())
        assert one.cases(Scope(robots=(None,), networks=1, quick=True))
        assert len({case.key for case in whole}) == len(set(whole))


def test_names_and_their_beginnings_choose_experiments() -> None:
    assert named(["all"]) == list(MODULES)
    assert named(["calibration-table-1", "calibration-table-1"]) == ["calibration-table-1"]
    assert "calibration-table-1" in named(["calibration"])
    with pytest.raises(catalog.InputError, match="calibration-table-1"):
        named(["table-1"])
