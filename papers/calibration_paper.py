"""Results of the calibration paper beside the row of table I that reports show.

Peng et al., "Efficient data-driven joint-level calibration of cable-driven surgical robots". A real
RAVEN-II; trained on zig-zag motions in direction J2-J3 (1013 s), tested on 20 minutes of random motion.
"""

# raw and fixed-offset RMSE of every direction, same joints and units
TABLE_1_DIRECTIONS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "J1": ((1.930, 7.927, 11.723), (0.857, 1.106, 0.486)),
    "J2": ((2.015, 8.016, 11.737), (0.911, 1.135, 0.628)),
    "J3": ((2.061, 8.115, 11.754), (0.877, 1.160, 0.498)),
    "J1-J2": ((2.095, 8.064, 11.773), (0.908, 1.168, 0.584)),
    "J2-J3": ((2.103, 7.963, 11.715), (0.859, 1.095, 0.492)),
    "J1-J3": ((2.125, 7.985, 11.778), (0.932, 1.168, 0.557)),
    "J1-J2-J3": ((2.219, 7.945, 11.703), (0.866, 1.038, 0.469)),
}
# section II-G: the linear model and the fixed offset in hour 0 and hour 5 of six hours of unloaded motion, and the
# linear model in hours 0 and 5 with 500 g
SIX_HOURS_LINEAR = ((0.169, 0.247, 0.132), (0.527, 0.353, 0.200))
SIX_HOURS_OFFSET = ((0.879, 1.056, 0.482), (1.000, 1.139, 0.545))
LOADED_LINEAR_HOUR_0 = (0.144, 0.266, 0.138)
LOADED_LINEAR_HOUR_5 = (0.916, 0.588, 0.473)
# section II-I: the linear model on J2 before the first and after the fifth of five homings, none seen in training
HOMINGS_LINEAR_J2 = (0.317, 0.712)
# the same on J1, least and greatest of all six, and on J3 but for an outlier, linear model and network together
HOMINGS_LINEAR_J1 = (0.155, 0.207)
HOMINGS_J3 = (0.113, 0.202)
