import numpy as np
from numpy.testing import assert_allclose

from catenary.gravity.compact import compact_regressor
from catenary.gravity.shared_terms import SharedTerms
from catenary.gravity.terms import terms_text
from oracles.latex import value, values
from oracles.random_trees import random_robot


def test_every_entry_in_shared_terms_is_that_of_the_regressor(rng) -> None:
    checked = 0
    for seed in range(30):
        model = random_robot(seed).model
        regressor = compact_regressor(model)
        q, gravity = rng.uniform(-1.0, 1.0, model.n), rng.normal(size=3)
        shared = SharedTerms(model, gravity)
        Z = np.zeros((model.n, len(regressor.expressions)))
        texts = [
            (r, target, terms_text(shared.entry(r, link, along), latex=True))
            for (link, along), target in zip(regressor.columns, regressor.targets, strict=True)
            for r in range(model.n)
        ]
        named = values([f"{name} = {terms_text(t, latex=True)}" for name, t in shared.definitions.items()], q)
        for r, target, text in texts:
            Z[r, target] += value(text, q, named)
        assert_allclose(Z, regressor.Z(q, gravity), atol=2e-4)  # six digits at each of several steps
        checked += Z.size
    assert checked > 500
