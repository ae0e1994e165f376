"""Numbers of Peng et al., "Efficient data-driven joint-level calibration of cable-driven surgical robots", table I.

A real RAVEN-II; trained on zig-zag motions in direction J2-J3 (1013 s), tested on 20 minutes of random motion.
"""

# RMSE on J1 [deg], J2 [deg], J3 [mm]
TABLE_1: dict[str, tuple[float, float, float]] = {
    "raw": (2.103, 7.963, 11.715),
    "fixed offset": (0.859, 1.095, 0.492),
    "linear": (0.174, 0.186, 0.166),
    "polynomial": (0.118, 0.222, 0.173),
    "neural, preset paper": (0.104, 0.120, 0.118),
}
