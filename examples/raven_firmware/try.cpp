/* Try grav_comp.cpp on the stand-in: poses and grav_dir from standard input, torques to standard output.

   A line in: J1 J2 [rad] J3 [m], and grav_dir x y z [cm/s2]. A line out, gold then green: three joint torques [Nm, Nm, N]
   and three tau_g [Nm]. How long a call takes, for both arms, goes to standard error. */
#include <cstdio>
#include <ctime>

#include "grav_comp.h"

int NUM_MECH = 2;

void getJointGravity(const device &d0, int m, double tau[3]);

int main() {
  const int CALLS = 200000;
  device d0 = device();
  param_pass params = param_pass();
  d0.mech[0].type = GOLD_ARM;
  d0.mech[1].type = GREEN_ARM;
  float q[3];
  position &g = d0.grav_dir;
  while (std::scanf("%f %f %f %d %d %d", &q[0], &q[1], &q[2], &g.x, &g.y, &g.z) == 6) {
    for (int m = 0; m < NUM_MECH; ++m) {
      for (int j = 0; j < 3; ++j) d0.mech[m].joint[j].jpos = q[j];
    }
    getGravityTorque(d0, params);
    for (int m = 0; m < NUM_MECH; ++m) {
      double tau[3];
      getJointGravity(d0, m, tau);
      for (int j = 0; j < 3; ++j) std::printf("%.17g ", tau[j]);
      for (int j = 0; j < 3; ++j) std::printf("%.9g ", static_cast<double>(d0.mech[m].joint[j].tau_g));
    }
    std::printf("\n");
  }
  float sum = 0.0f; /* told below, so that no call is left out by the compiler */
  const std::clock_t begin = std::clock();
  for (int k = 0; k < CALLS; ++k) {
    d0.mech[0].joint[ELBOW].jpos = d0.mech[1].joint[ELBOW].jpos = 1.0f + 1e-6f * static_cast<float>(k);
    getGravityTorque(d0, params);
    sum += d0.mech[0].joint[SHOULDER].tau_g + d0.mech[1].joint[SHOULDER].tau_g;
  }
  const double ns = 1e9 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC / CALLS;
  std::fprintf(stderr, "%.0f ns per call for two arms, on this machine (mean tau_g %.3f Nm)\n", ns, static_cast<double>(sum / CALLS));
  return 0;
}
