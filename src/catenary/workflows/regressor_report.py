"""Report what gravity torques reveal of a robot's masses: its regressor, ranks, and identifiable parameters."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.compact_regressor import CompactRegressor, compact_regressor
from catenary.gravity.gravity_regressor import standard_gravity_parameters, standard_labels
from catenary.identification.base_parameters import TILTED, BaseParameters, gravity_base_parameters
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

WORDS = {"alone": "by itself", "combined": "in combination", "none": "no effect", "known": "massless"}


@dataclass(frozen=True)
class RegressorReport:
    """One robot's regressor on a level base, on a tilted one, and on one that turns."""

    model: RobotModel
    compact: CompactRegressor
    bases: dict[str, BaseParameters]  # "level", "tilted", "turning"
    standard_values: Floats  # (4 n_links,) NaN where links have no inertia
    compact_values: Floats  # (p,)

    @property
    def unknown(self) -> list[int]:
        """Indices of the standard parameters that may be nonzero: those of links not declared massless."""
        links = enumerate(self.model.link_names)
        return [4 * i + k for i, link in links if link not in self.model.massless for k in range(4)]

    def identifiable(self, name: str) -> tuple[str, ...]:
        """Return the dependence of torques, on a base, on each standard parameter: a key of `WORDS`."""
        kinds = ["known"] * len(standard_labels(self.model))
        for parameter, kind in zip(self.unknown, self.bases[name].identifiable, strict=True):
            kinds[parameter] = kind
        return tuple(kinds)

    def combinations(self, name: str) -> tuple[str, ...]:
        """Return a base's parameters as sums of standard ones: mx(elbow) + 0.4 m(hand)."""
        base, labels = self.bases[name], standard_labels(self.model)
        names = [labels[parameter] for parameter in self.unknown]
        return tuple(base.describe(k, names, digits=4) for k in range(base.count))

    def base_values(self, name: str) -> Floats:
        """Return the values of a base's parameters, NaN where links have no inertia."""
        return self.bases[name].combination @ self.standard_values[self.unknown]

    def added_by_tilting(self) -> tuple[str, ...]:
        """Return the base parameters that only a tilted base adds to those of a level one."""
        level, tilted = self.bases["level"].columns, self.bases["tilted"].columns
        pairs = zip(self.combinations("tilted"), tilted, strict=True)
        return tuple(label for label, column in pairs if column not in level)

    def sentences(self) -> list[str]:
        """Return the sentences about identifiable and unidentifiable parameters."""
        level, tilted = self.bases["level"], self.bases["tilted"]
        names = standard_labels(self.model)
        lines = [
            f"level base: {level.count} combinations of {len(names)} masses and first moments load the joints, "
            "and torques determine only these"
        ]
        for kind, words in (
            ("alone", "identifiable by themselves"),
            ("combined", "identifiable only in combination with others"),
            ("none", "without effect on any torque"),
        ):
            labels = [name for name, k in zip(names, self.identifiable("level"), strict=True) if k == kind]
            lines.append(f"{words}: {', '.join(labels) or 'none'}")
        added = self.added_by_tilting()
        lines.append(
            f"tilting the base adds {len(added)}: {'; '.join(added)}" if added else "tilting the base adds none"
        )
        turning = self.bases["turning"].count - tilted.count
        if turning > 0:
            lines.append(f"turning it during the measurement adds {turning} more")
        lines += [note for note in self.model.notes if "quarter turns" in note]
        if self.model.massless:
            lines.append(f"massless, and so left out: {', '.join(self.model.massless)}")
        if self.model.missing_inertia:
            lines.append(f"no inertia in the file, so no values: {', '.join(self.model.missing_inertia)}")
        return lines

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in kg and kg m."""
        form, names = self.compact, standard_labels(self.model)

        def rows(keys: tuple[str, ...], *columns: Iterable[Any]) -> list[dict[str, Any]]:
            return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]

        numbers = [f"s{k}" for k in range(1, len(form.labels) + 1)], form.labels, form.units, self.compact_values
        kinds = self.identifiable("level"), self.identifiable("tilted")
        return {
            "robot": self.model.name,
            "compact": {
                "columns": form.entries(),
                "parameters": rows(("name", "expression", "unit", "value"), *numbers),
                "symbols": {name: symbol._asdict() for name, symbol in form.symbols.items()},
                "without_effect": list(form.ineffective),
            },
            "standard": rows(("name", "value", "level_base", "tilted_base"), names, self.standard_values, *kinds),
            "base": {
                name: {
                    "rank": base.count, "of": len(names), "condition": base.condition,
                    "parameters": rows(("combination", "value"), self.combinations(name), self.base_values(name)),
                }
                for name, base in self.bases.items()
            },
            "added_by_tilting": list(self.added_by_tilting()),
            "notes": self.sentences(),
        }  # fmt: skip


def describe_regressor(model: RobotModel) -> RegressorReport:
    """Describe a robot's gravity regressor; values need inertia, everything else does not."""
    compact = compact_regressor(model)
    model = compact.model  # its quarter turns exact
    known, unknown = not model.missing_inertia, np.full(4 * len(model.link_names), np.nan)
    return RegressorReport(
        model=model,
        compact=compact,
        bases={
            "level": gravity_base_parameters(model, LEVEL),
            "tilted": gravity_base_parameters(model, TILTED),
            "turning": gravity_base_parameters(model, None),
        },
        standard_values=standard_gravity_parameters(model).values if known else unknown,
        compact_values=compact.parameters() if known else np.full(len(compact.labels), np.nan),
    )
