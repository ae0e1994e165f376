"""What the gravity-regressor paper prints, by its place.

"Generalized gravity regressor": estimation of gravity by regressor and parameters, an upper body of 19 joints. It
states no error in numbers.
"""

# figure 2, the planar arm: the block row of each joint in the full Z, its columns by frame (base, 1, 2, 3)
FULL_BLOCK = ("1", "0", "0", "c1", "-s1", "0", "c12", "-s12", "0", "c123", "-s123", "0")
# figure 2: s_1, s_2, s_3, and where they stand among the 36 entries of s, from zero
PARAMETERS = ("l1 (m2+m3) + lg1 m1", "l2 m3 + lg2 m2", "lg3 m3")
PLACES = ((3,), (6, 18), (9, 21, 33))
# section II-C: the compact form
COMPACT = (("c1", "c12", "c123"), ("0", "c12", "c123"), ("0", "0", "c123"))

# section III-A [s]
APPROACH_POSE = (0.2, 7.0)
ESTIMATION = (7.0, 12.0)
HOMING = (12.0, 17.0)
APPROACH_ONE = (17.0, 21.0)
APPROACH_TWO = (22.0, 26.0)
HOMING_AGAIN = (27.0, 31.0)
JOINTS = 19
RATE_HZ = 1000.0
