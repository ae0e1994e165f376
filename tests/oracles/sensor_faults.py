"""By which names, and how soon, a broken inertial unit must be told: docs/reliability.md and docs/gravity-vector.md."""

# the latest that a fault is named by one of these names [s]; ten samples for what repeats, a second for what only the
# mean shows; rates in deg/s are noise on a base that stands still, and so is what is not named then
NAMED: dict[str, tuple[float, set[str]]] = {
    "drop_out": (0.1, {"interrupted"}),
    "not_finite": (0.05, {"not_finite"}),
    "stuck": (0.15, {"stuck"}),
    "wrong_sign": (0.05, {"wrong_sign"}),
    "axes_swapped": (0.1, {"axes_swapped", "jump", "spike"}),
    "saturated": (0.05, {"saturated", "spike", "magnitude"}),
    "spikes": (0.15, {"spike", "magnitude"}),
    "jump": (0.1, {"jump", "spike", "axes_swapped", "magnitude"}),
    "unit_g": (0.05, {"unit_g"}),
    "unit_cm": (0.05, {"unit_cm"}),
    "gravity_stripped": (0.05, {"gravity_stripped"}),
    "wrong_scale": (0.1, {"magnitude", "jump", "spike"}),
    "stamp_backwards": (0.05, {"stamp_backwards"}),
    "stamp_repeated": (0.05, {"stamp_repeated"}),
    "stamp_future": (0.05, {"stamp_future"}),
    "rates_drop_out": (0.1, {"rates_interrupted"}),
    "rates_not_finite": (0.05, {"rate_not_finite"}),
    "rates_stuck": (0.15, {"rate_stuck"}),
    "rates_in_deg": (1.0, {"rate_too_fast", "rate_contradicts", "rate_spike", "rate_saturated"}),
}
