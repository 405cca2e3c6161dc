# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The last impact of many trajectories by heyoka or by scipy's solve_ivp, as a user would write it.

Run by benchmark/basins.py, with a Python that has the peer: follow.py PEER INITIAL.npy OUT.npy
follows each until it is periodic and writes (phase, velocity) before the last impact, nan where it
was given up; prints seconds of computing. Initial conditions are rows (phase, s, velocity); those
on the upper wall, or next to it, that move up have their impact at once.
"""

import math
import sys
import time

import numpy as np

ALPHA, BETA, GAMMA, R = 0.48, 0.1, 0.1, 0.9
TURN = 2.0 * math.pi
# Below this speed after an impact a trajectory is given up: nothing here knows how to stick.
SLOW = 1e-7
# Orbits here have two or three impacts: it is periodic once the sixth impact is as the first.
PERIOD, SAME, MOST = 6, 1e-8, 2000


class Impacts:
    """The impacts of a trajectory so far."""

    def __init__(self):
        """Begin without any."""
        self.seen = []

    def go_on(self, phase, before):
        """Take an impact; whether the trajectory has to be followed further."""
        self.seen.append((phase % TURN, before))
        return not (R * abs(before) < SLOW or self.is_periodic() or len(self.seen) == MOST)

    def is_periodic(self):
        """Whether the last impact is the one a period before."""
        if len(self.seen) <= PERIOD:
            return False
        (phase, velocity), (here, now) = self.seen[-1 - PERIOD], self.seen[-1]
        return (abs(now - velocity) < SAME
                and abs(math.remainder(here - phase, TURN)) < SAME)

    def last(self):
        """Return the last impact if the trajectory was not given up."""
        return self.seen[-1] if self.is_periodic() else (math.nan, math.nan)


def by_scipy(initial):
    """Integrate from impact to impact with terminal events."""
    from scipy.integrate import solve_ivp

    def flow(t, y):
        return [y[1], -BETA * y[1] - ALPHA * math.sin(t) + ALPHA * BETA * math.cos(t) + GAMMA]

    def upper(t, y):
        return y[0]

    def lower(t, y):
        return y[0] + 1.0

    upper.terminal = lower.terminal = True
    upper.direction, lower.direction = 1.0, -1.0
    yield
    for t, s, v in initial:
        impacts, more = Impacts(), True
        while more:
            # A first step longer than the flight would find the impact that it begins with.
            found = solve_ivp(flow, (t, t + 200.0), [s, v], 'DOP853', events=(upper, lower),
                              rtol=1e-13, atol=1e-15, first_step=min(0.1, abs(v)))
            t, before = float(found.t[-1]) % TURN, float(found.y[1, -1])
            s, v = (0.0 if len(found.t_events[0]) else -1.0), -R * before
            more = found.status == 1 and impacts.go_on(t, before)
        yield impacts.last()


def by_heyoka(initial):
    """Integrate with Taylor series and terminal events at both walls."""
    import heyoka as hy
    s, v = hy.make_vars('s', 'v')
    impacts = Impacts()

    def bounce(ta, direction):
        before = float(ta.state[1])
        ta.state[1] *= -R
        return impacts.go_on(ta.time, before)

    force = -ALPHA * hy.sin(hy.time) + ALPHA * BETA * hy.cos(hy.time) + GAMMA
    walls = [hy.t_event(wall, callback=bounce, direction=direction) for wall, direction in (
        (s, hy.event_direction.positive), (s + 1.0, hy.event_direction.negative))]
    integrator = hy.taylor_adaptive([(s, v), (v, force - BETA * v)], [0.0, 0.0], t_events=walls)
    yield
    for phase, *state in initial:
        impacts = Impacts()
        integrator.time = phase
        integrator.state[:] = state
        integrator.reset_cooldowns()
        integrator.propagate_until(phase + 20.0 * MOST)
        yield impacts.last()


def main():
    """Follow the initial conditions by the peer that is named."""
    name, initial, out = sys.argv[1:]
    states = np.load(initial)
    upwards = (states[:, 1] > -1e-200) & (states[:, 2] > 0.0)
    states[upwards, 2] *= -R
    found = {'heyoka': by_heyoka, 'scipy': by_scipy}[name](states)
    # What is prepared only once does not count.
    next(found)
    begin = time.process_time()
    last = list(found)
    print(time.process_time() - begin)
    np.save(out, last)


if __name__ == '__main__':
    main()
