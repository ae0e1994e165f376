import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError
from catenary.files import card_path
from catenary.identification.identification import identify
from catenary.identification.identification_file import identification_card, load_identification, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.catalog import load_robot
from moving_arm import recorded

ARM = load_robot("raven2")


@pytest.fixture(scope="module")
def identified():
    return identify([recorded(ARM, 0)], ARM, IdentifyOptions(consistent=True), tests=[recorded(ARM, 1)])


@pytest.fixture
def saved(identified, tmp_path):
    path = tmp_path / "arm.npz"
    save_identification(identified, identification_card(identified, [], ("a note",)), path)
    return path


def test_a_file_gives_back_the_same_torques_to_the_bit_and_the_robot(identified, saved):
    with np.load(saved, allow_pickle=False) as archive:
        assert all(archive[key].dtype.kind in "fiuU" for key in archive.files)  # no Python objects
    loaded, card = load_identification(saved)
    q = np.random.default_rng(0).uniform(ARM.lower, ARM.upper, size=(5, 3))
    assert_array_equal(loaded.predict(q, q, q), identified.predict(q, q, q))
    assert_array_equal(loaded.std, identified.std)
    assert loaded.options == identified.options
    assert card["notes"] == ["a note"]
    assert loaded.robot().link_names == ARM.link_names
    assert_array_equal(loaded.robot().tree.mass, identified.robot().tree.mass)
    assert loaded.tests[0].verdict == "holds"


def test_the_card_says_what_a_stranger_must_know(identified, saved):
    card = json.loads(card_path(saved).read_text())
    assert card["n_base"] == identified.base.count == len(card["parameters"])
    assert {"name", "value", "std", "unit", "is"} <= set(card["parameters"][0])
    assert_allclose([p["value"] for p in card["parameters"]], identified.beta)
    assert card["tests"][0]["verdict"] == "holds"


OLDER = "expected 'catenary.identification.3': another version wrote it; `catenary identify` makes it again"


def damaged(path, change):
    with np.load(path) as archive:
        arrays = dict(archive)
    structure = json.loads(str(arrays["structure"]))
    change(arrays, structure)
    arrays["structure"] = np.array(json.dumps(structure))
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a, s: a.pop("beta"), "holds no identified parameters"),
        (lambda a, s: s.update(format="catenary.identification.1"), OLDER),
        (lambda a, s: a.update(beta=a["beta"][:-1]), "combination has shape"),
        (lambda a, s: a.update(beta=np.full_like(a["beta"], np.nan)), "of finite numbers"),
        (lambda a, s: a.update(columns=a["columns"] + 1000), "columns outside 0 to"),
        (lambda a, s: s["robot"].pop("tree"), "the robot in it is damaged"),
        (lambda a, s: s["robot"]["tree"].update(parent=[5, 5, 5]), "parents do not come first"),
        (
            lambda a, s: s["options"].update(terms="half"),
            "options: terms: Input should be 'full' or 'static', got 'half'",
        ),
        (lambda a, s: s["tests"][0].update(verdict="fine"), "tests[0]: verdict: Input should be"),
        (lambda a, s: a.update(card=np.array("[]")), "card: holds [], expected a table"),
        (lambda a, s: a["beta"].__setitem__(0, 9.0), "numbers are not those that its card was written for"),
    ],
)
def test_a_damaged_file_is_refused(saved, change, message):
    damaged(saved, change)
    with pytest.raises(FileFormatError) as caught:
        load_identification(saved)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(saved))


def test_the_robot_in_a_file_whose_numbers_were_changed_is_refused_too(saved):
    damaged(saved, lambda a, s: a["phi"].__setitem__(0, 9.0))
    with pytest.raises(FileFormatError, match=r"damaged: its numbers are not .*; `catenary identify` makes it again"):
        load_robot(str(saved))


def test_a_recording_is_no_parameter_file(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, q=np.zeros((3, 3)))
    with pytest.raises(FileFormatError, match="written by catenary identify"):
        load_identification(path)
