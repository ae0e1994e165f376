"""What gravity torques can tell about a robot's masses: its regressor, ranks, and what is identifiable, in words."""

from dataclasses import dataclass
from typing import Any

from catenary.arrays import Floats
from catenary.gravity.base_parameters import TILTED, BaseParameters, base_parameters
from catenary.gravity.compact import CompactRegressor, compact_regressor
from catenary.gravity.regressor import standard_gravity_parameters, standard_labels
from catenary.robots.model import RobotModel
from catenary.sensing.vector import LEVEL

WORDS = {
    "alone": "by itself",
    "combined": "in combination",
    "none": "no effect",
    "known": "massless",
}


@dataclass(frozen=True)
class RegressorReport:
    """One robot's regressor on a level base, on a tilted one, and on one that turns."""

    model: RobotModel
    compact: CompactRegressor
    bases: dict[str, BaseParameters]  # "level", "tilted", "turning"
    standard_values: Floats | None  # (4 n_links,) None when links have no inertia
    compact_values: Floats | None  # (p,)

    def base_values(self, name: str) -> Floats | None:
        """Values (rank,) of a base's parameters, None when links have no inertia."""
        return None if self.standard_values is None else self.bases[name].values()

    def added_by_tilting(self) -> tuple[str, ...]:
        """Base parameters on a tilted base that are none on a level one."""
        level, tilted = self.bases["level"], self.bases["tilted"]
        return tuple(
            label
            for label, column in zip(tilted.labels, tilted.columns, strict=True)
            if column not in level.columns
        )

    def sentences(self) -> list[str]:
        """Say what is identifiable and what is not."""
        level, tilted = self.bases["level"], self.bases["tilted"]
        names = standard_labels(self.model)
        said = [
            f"level base: {level.rank} combinations of {len(names)} masses and first moments load the joints, "
            "and torques tell no more than these",
        ]
        for kind, words in (
            ("alone", "identifiable by themselves"),
            ("combined", "identifiable only in combination with others"),
            ("none", "without effect on any torque"),
        ):
            found = [name for name, k in zip(names, level.identifiable, strict=True) if k == kind]
            said.append(f"{words}: {', '.join(found) or 'none'}")
        added = self.added_by_tilting()
        said.append(
            f"tilting the base adds {len(added)}: {'; '.join(added)}"
            if added
            else "tilting the base adds none"
        )
        turning = self.bases["turning"].rank - tilted.rank
        if turning > 0:
            said.append(f"turning it during the measurement adds {turning} more")
        if self.model.massless:
            said.append(f"massless, and so left out: {', '.join(self.model.massless)}")
        if self.model.missing_inertia:
            said.append(f"no inertia in the file, so no values: {', '.join(self.model.missing_inertia)}")
        return said

    def as_data(self) -> dict[str, Any]:
        """Give it as plain data, in kg and kg m."""
        names = standard_labels(self.model)
        kinds = [self.bases[name].identifiable for name in ("level", "tilted")]
        return {
            "robot": self.model.name,
            "compact": {
                "columns": self.compact.entries(),
                "parameters": [
                    {"name": f"s{k + 1}", "expression": label, "unit": unit, "value": value}
                    for k, (label, unit, value) in enumerate(
                        zip(
                            self.compact.labels,
                            self.compact.units,
                            _listed(self.compact_values, len(self.compact.labels)),
                            strict=True,
                        )
                    )
                ],
                "symbols": {
                    name: {"meaning": symbol.meaning, "value": symbol.value}
                    for name, symbol in self.compact.symbols.items()
                },
                "without_effect": list(self.compact.ineffective),
            },
            "standard": [
                {"name": name, "value": value, "level_base": level, "tilted_base": tilted}
                for name, value, level, tilted in zip(
                    names, _listed(self.standard_values, len(names)), *kinds, strict=True
                )
            ],
            "base": {
                name: {
                    "rank": base.rank,
                    "of": len(names),
                    "condition": base.condition,
                    "parameters": [
                        {"combination": label, "value": value}
                        for label, value in zip(
                            base.labels, _listed(self.base_values(name), base.rank), strict=True
                        )
                    ],
                }
                for name, base in self.bases.items()
            },
            "added_by_tilting": list(self.added_by_tilting()),
            "notes": self.sentences(),
        }


def describe_regressor(model: RobotModel) -> RegressorReport:
    """Look a robot's gravity regressor over; values need inertia, everything else does not."""
    compact = compact_regressor(model)
    known = not model.missing_inertia
    return RegressorReport(
        model=model,
        compact=compact,
        bases={
            "level": base_parameters(model, LEVEL),
            "tilted": base_parameters(model, TILTED),
            "turning": base_parameters(model, None),
        },
        standard_values=standard_gravity_parameters(model).values if known else None,
        compact_values=compact.parameters() if known else None,
    )


def _listed(values: Floats | None, count: int) -> list[float | None]:
    return [None] * count if values is None else [float(v) for v in values]
