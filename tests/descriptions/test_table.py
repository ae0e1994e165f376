import numpy as np

from oracles.random_robots import random_urdf
from tests.descriptions.__main__ import main


def test_the_table_has_a_row_a_file_with_the_reason_for_what_is_refused(tmp_path, capsys):
    rng = np.random.default_rng(3)
    (tmp_path / "robots" / "arms").mkdir(parents=True)
    for k in range(3):
        text = random_urdf(rng, kinds=("revolute", "prismatic", "continuous"))
        (tmp_path / "robots" / "arms" / f"{k}.urdf").write_text(text)
    (tmp_path / "empty.urdf").write_text("<robot name='e'/>")
    assert main([str(tmp_path), "--version", "made up"]) == 0
    out = capsys.readouterr().out
    assert "made up: 3 of 4 URDFs agree with Pinocchio" in out
    assert "| empty.urdf | - | - | refused: no <link>, expected at least one |" in out
    assert "| arms/0.urdf | 8 |" in out
