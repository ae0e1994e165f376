"""What Lewis and Hannaford 2014 state in numbers, by its place.

A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot", ICRA 2014. One
RAVEN-II. Figures 7 to 10 are drawn without tables; of their values only those stand here that the text gives.
"""

# figure 7: bases about Z0 [deg]
FIGURE_7_DEG = (0, 25)
# section IV-B: bases about Z0 "ranged from 0 to 20 degrees"
LARGEST_BASE_DEG = 20
# sections V-B, V-C: joint 1's RMS error with DG below PD's, at 20 deg and on the rocking base [%]
GAIN_PERCENT = 12.0
