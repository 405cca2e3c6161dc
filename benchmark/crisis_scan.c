// Copyright 2026 The gear_rattle_ros authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/* Escapes from the chaotic transient, by the usual scan with a fixed step and bisection on
   eqs. (4)-(5) of de Souza & Caldas as they are printed; built by crisis.py with cc. */
#include <math.h>

static double displacement(double d, double p, double s0, double v0, double a, double b, double g)
{
  double e = exp(-b * d), k = g / b;
  return s0 + a * (sin(p + d) - sin(p)) + k * d + (1.0 - e) / b * (v0 - a * cos(p) - k);
}

/* Follow a trajectory for at most `count` impacts, or until its velocities have come back after
   four impacts, to 1e-7, forty times in a row. Returns the number of the impact from which on they
   do, or -1 where they never do. */
long escape(double p, double s0, double v0, long count, double a, double b, double g, double r,
            double step)
{
  const double two_pi = 6.283185307179586, k = g / b;
  double last[4] = {9.0, 9.0, 9.0, 9.0};
  long n, row = 0;
  for (n = 0; n < count; n++) {
    double low = 0.0, high = step, s, v;
    for (;;) {
      s = displacement(high, p, s0, v0, a, b, g);
      if (s > 0.0 || s < -1.0) break;
      low = high;
      high += step;
    }
    double wall = s > 0.0 ? 0.0 : -1.0;
    while (high - low > 1e-13) {
      double middle = 0.5 * (low + high);
      s = displacement(middle, p, s0, v0, a, b, g);
      if (s > 0.0 || s < -1.0) high = middle; else low = middle;
    }
    v = a * cos(p + low) + (v0 - a * cos(p) - k) * exp(-b * low) + k;
    p = fmod(p + low, two_pi);
    s0 = wall;
    v0 = -r * v;
    row = fabs(v - last[n % 4]) < 1e-7 ? row + 1 : 0;
    last[n % 4] = v;
    if (row == 40) return n - row;
  }
  return -1;
}
