"""The calibration paper's results, by their place.

Peng et al., "Efficient data-driven joint-level calibration of cable-driven surgical robots". A real
RAVEN-II; trained on zig-zag motions in direction J2-J3 (1013 s), tested on 20 minutes of random motion.
"""

# table I: RMSE on J1 [deg], J2 [deg], J3 [mm] by direction and method
TABLE_1: dict[str, dict[str, tuple[float, float, float]]] = {
    direction: dict(zip(("network", "polynomial", "linear", "fixed offset", "raw"), errors, strict=True))
    for direction, errors in {
        "J1": ((0.215, 0.248, 0.179), (0.193, 0.311, 0.406), (0.214, 0.288, 0.239), (0.857, 1.106, 0.486),
                (1.930, 7.927, 11.723)),
        "J2": ((0.186, 0.313, 0.216), (0.156, 0.242, 0.357), (0.214, 0.250, 0.257), (0.911, 1.135, 0.628),
                (2.015, 8.016, 11.737)),
        "J3": ((0.115, 0.241, 0.111), (0.144, 0.203, 0.141), (0.198, 0.294, 0.134), (0.877, 1.160, 0.498),
                (2.061, 8.115, 11.754)),
        "J1-J2": ((0.209, 0.234, 0.183), (0.169, 0.276, 0.416), (0.231, 0.221, 0.253), (0.908, 1.168, 0.584),
                   (2.095, 8.064, 11.773)),
        "J2-J3": ((0.104, 0.120, 0.118), (0.118, 0.222, 0.173), (0.174, 0.186, 0.166), (0.859, 1.095, 0.492),
                   (2.103, 7.963, 11.715)),
        "J1-J3": ((0.120, 0.265, 0.161), (0.114, 0.294, 0.178), (0.257, 0.266, 0.179), (0.932, 1.168, 0.557),
                   (2.125, 7.985, 11.778)),
        "J1-J2-J3": ((0.143, 0.130, 0.164), (0.145, 0.148, 0.274), (0.221, 0.169, 0.168), (0.866, 1.038, 0.469),
                      (2.219, 7.945, 11.703)),
    }.items()
}  # fmt: skip
# section II-I, least and greatest of all six on J1 [deg], by model and how many homings its training data saw
HOMINGS_J1 = {
    ("network", 0): (0.117, 0.146),
    ("network", 1): (0.133, 0.152),
    ("linear", 0): (0.155, 0.207),
    ("linear", 1): (0.163, 0.218),
}
# on J2 [deg] before the first and after the fifth, no homing seen; and the greatest of all six with one seen
HOMINGS_J2 = {"network": (0.255, 0.627), "linear": (0.317, 0.712)}
HOMINGS_J2_SEEN = {"network": 0.413, "linear": 0.493}
HOMINGS_J3 = (0.113, 0.202)  # of both models [mm], but for an outlier
# table III: errors on J1 [deg], J2 [deg], J3 [mm] of unloaded arms, least and greatest of hours 0 to 5 where
# two; others by source, robot and model
TABLE_3_OURS: dict[str, tuple[tuple[float, float], ...]] = {
    "network": ((0.142, 0.553), (0.230, 0.343), (0.125, 0.176)),
    "linear": ((0.169, 0.522), (0.248, 0.376), (0.133, 0.206)),
}
TABLE_3_OTHERS: dict[tuple[str, str, str], tuple[float, float, float]] = {
    ("Haghighipanah [13]", "RAVEN-II", "UKF"): (1.195, 1.242, 0.927),
    ("Hwang [32], left arm", "dVRK", "RNN"): (0.115, 0.069, 0.150),
    ("Hwang [32], right arm", "dVRK", "RNN"): (0.172, 0.206, 0.510),
}
# table IV: errors of the tool's position in x, y, z and distance [mm]; None where the paper has none
TABLE_4_OURS: dict[str, tuple[tuple[float, float], ...]] = {
    "network": ((0.362, 0.538), (0.301, 1.503), (0.205, 0.581), (0.513, 1.318)),
    "linear": ((0.389, 0.589), (0.351, 0.998), (0.231, 0.564), (0.572, 1.289)),
}
TABLE_4_OTHERS: dict[tuple[str, str, str], tuple[float | None, float | None, float | None, float | None]] = {
    ("Hwang [32], pick", "dVRK", "RNN"): (None, None, None, 0.65),
    ("Hwang [32], random", "dVRK", "RNN"): (None, None, None, 2.05),
    ("Mahler [42]", "RAVEN-II", "GPR"): (1.4, 1.4, 1.1, None),
    ("Peng [12]", "RAVEN-II", "DNN"): (0.818, 1.078, 0.518, None),
}
# section II-A, figure 1: distance of the tool's reported position from the true one [mm], "around"
TIP_RAW = 20.0
# section II-F: how long zig-zags of direction J2-J3 take to record [s], by sparsities
DURATIONS = {(1 / 2,): 209.0, (1 / 2, 1 / 3): 537.0, (1 / 2, 1 / 3, 1 / 4): 1013.0}
# section II-B: share of a joint's range, by how many joints the direction has
BOX_SHARES = {1: 3.0**-0.5, 2: 2.0**0.5 * 3.0**-0.5, 3: 1.0}
# section II-G: hour 0 and hour 5 on J1 [deg], J2 [deg], J3 [mm], the mean of the three longest training sets
SIX_HOURS = {
    "idle": {
        "fixed offset": ((0.863, 1.084, 0.520), (0.879, 1.094, 0.541)),
        "linear": ((0.162, 0.237, 0.131), (0.193, 0.232, 0.132)),
        "network": ((0.124, 0.211, 0.113), (0.172, 0.217, 0.113)),
    },
    "unloaded": {
        "fixed offset": ((0.879, 1.056, 0.482), (1.000, 1.139, 0.545)),
        "linear": ((0.169, 0.247, 0.132), (0.527, 0.353, 0.200)),
        "network": ((0.142, 0.232, 0.126), (0.553, 0.331, 0.165)),
    },
    "loaded": {
        "fixed offset": ((0.878, 1.092, 0.485), (1.174, 1.109, 0.554)),
        "linear": ((0.144, 0.266, 0.138), (0.916, 0.588, 0.473)),
        "network": ((0.114, 0.251, 0.122), (0.855, 0.432, 0.181)),
    },
}
# the polynomial, of which the paper gives joint 1 [deg] alone
SIX_HOURS_POLYNOMIAL_J1 = {"idle": (0.241, 0.493), "unloaded": (0.235, 1.529), "loaded": (0.221, 1.045)}
# section II-H, mean of six hours unloaded: with 16 inputs over all training sets, with 138 over the three longest
INPUTS_16 = {"network": (0.328, 0.264, 0.167), "linear": (0.361, 0.355, 0.167)}
INPUTS_138 = {
    "network": (0.700, 0.754, 0.388),
    "larger network": (0.397, 0.565, 0.229),
    "linear": (1.985, 1.834, 1.352),
}
PARAMETERS = {"network of 16": 12_103, "network of 138": 24_303, "larger network of 138": 585_503}
# table II, mean of all sparsities and six hours unloaded: trained on the error, and end to end
TABLE_2 = {
    "network": ((0.328, 0.264, 0.167), (0.831, 0.875, 1.583)),
    "linear": ((0.369, 0.366, 0.176), (0.369, 0.366, 0.176)),
    "polynomial": ((1.062, 2.539, 1.766), (1.062, 2.539, 1.766)),
}
# section II-F, figure 5: RMSE by recording time; "short" is the mean of recordings below 500 s, "long" above 800 s
FIGURE_5_J1 = {  # [deg] at 1/2, 209 s, and at 1/2 + 1/3 + 1/4, 1013 s
    "1/2": {"network": 0.232, "polynomial": 0.834, "linear": 0.446, "fixed offset": 0.846},
    "1/2+1/3+1/4": {"network": 0.120, "polynomial": 0.119, "linear": 0.176},
}
FIGURE_5_J2 = {  # [deg]
    "short": {"network": 0.288, "linear": 0.364},
    "long": {"network": 0.203, "linear": 0.248},
}
FIGURE_5_J2_POLYNOMIAL = 0.302  # [deg] at the longest
FIGURE_5_J3 = {  # [mm]
    "short": {"network": 0.202, "linear": 0.307},
    "1/2+1/3": {"network": 0.121, "linear": 0.132},
}
# section III, table V: by how much the network's error is less than the linear model's on J1 [deg], J2 [deg], J3 [mm],
# with the three longest and the three shortest training sets; unloaded, with the longest, "very close"
TABLE_5_ACCURACY = {"loaded": (0.015, 0.109, 0.124)}
TABLE_5_HUNGER = {"unloaded": (0.052, 0.189, -0.037), "loaded": (0.128, 0.360, 0.178)}
# the same: training [s], at most; inference of one row [ms]
TABLE_5_TRAINING = {"network": 50.0, "linear": 2.0}
TABLE_5_INFERENCE = {"network": 61.0, "linear": 0.38}
