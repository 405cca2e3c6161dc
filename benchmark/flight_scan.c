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

/* The usual way to find impacts: scan a flight with a fixed step, bisect on a change of sign.
   Equations (4)-(5) of de Souza & Caldas as they are printed; built by flight.py with cc. */
#include <math.h>

static double displacement(double d, double p, double s0, double v0, double a, double b, double g)
{
  double e = exp(-b * d), k = g / b;
  return s0 + a * (sin(p + d) - sin(p)) + k * d + (1.0 - e) / b * (v0 - a * cos(p) - k);
}

static double velocity(double d, double p, double v0, double a, double b, double g)
{
  double k = g / b;
  return a * cos(p + d) + (v0 - a * cos(p) - k) * exp(-b * d) + k;
}

/* Follow `count` impacts; state = phase, displacement, velocity. Writes phase, displacement and
   velocity before each impact. Returns the number written. */
long scan(double *state, long count, double a, double b, double g, double r, double step,
          double *out)
{
  double p = state[0], s0 = state[1], v0 = state[2];
  const double two_pi = 6.283185307179586;
  long n;
  for (n = 0; n < count; n++) {
    double low = 0.0, high = step, s, v;
    for (;;) {
      s = displacement(high, p, s0, v0, a, b, g);
      if (s > 0.0 || s < -1.0) break;
      low = high;
      high += step;
    }
    double wall = s > 0.0 ? 0.0 : -1.0;
    while (high - low > 1e-14) {
      double middle = 0.5 * (low + high);
      if (middle == low || middle == high) break;
      s = displacement(middle, p, s0, v0, a, b, g);
      if (s > 0.0 || s < -1.0) high = middle; else low = middle;
    }
    v = velocity(low, p, v0, a, b, g);
    p = fmod(p + low, two_pi);
    s0 = wall;
    v0 = -r * v;
    out[3 * n] = p;
    out[3 * n + 1] = wall;
    out[3 * n + 2] = v;
  }
  state[0] = p;
  state[1] = s0;
  state[2] = v0;
  return n;
}
