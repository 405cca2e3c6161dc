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
The impacts of many trajectories by scipy's solve_ivp and by heyoka, with their own rule for rest.

Run by benchmark/long_runs.py, with a Python that has the peer: chains.py PEER JOB.npz OUT.npz.
scipy follows the driven gear itself, x = s - alpha sin(tau), under x'' = gamma - beta x', walls
moving; heyoka the displacement in the backlash. Neither uses a closed form of anything.

A row of the result: number of the trajectory, tau [rad], velocity before the impact [1], time at
rest on a wall so far [1]. Impacts slower than STRONG are followed, but not written: at which speed
chatter turns into rest then makes no difference.
"""

import math
import sys
import time

import numpy as np

TWO_PI = 2.0 * math.pi
# Slower impacts are not written.
STRONG = 1e-2
# Slower than this after an impact a gear that is pressed rests: a flight then takes about SLOW
# and rises SLOW**2, which the tolerances still resolve.
SLOW = 1e-5
# Time for which a gear that leaves a wall from rest is followed without looking for impacts.
LEAVE = 0.01
SCAN = np.linspace(0.0, TWO_PI, 721)


def press(tau, setting):
    """Return the force on a gear at rest on a wall, upwards."""
    alpha, beta, gamma, _ = setting
    return gamma + alpha * (beta * math.cos(tau) - math.sin(tau))


def next_zero(tau, sign, setting):
    """Return the time until sign * press falls below 0, by scan and bisection; inf if never."""
    alpha, beta, gamma, _ = setting
    values = sign * (gamma + alpha * (beta * np.cos(tau + SCAN) - np.sin(tau + SCAN)))
    below = np.flatnonzero(values < 0.0)
    if len(below) == 0:
        return math.inf
    if below[0] == 0:
        return 0.0
    low, high = float(SCAN[below[0] - 1]), float(SCAN[below[0]])
    for _ in range(60):
        middle = 0.5 * (low + high)
        if sign * press(tau + middle, setting) < 0.0:
            high = middle
        else:
            low = middle
    return high


def stay(tau, sign, after, setting):
    """
    Return how long a gear stays on a wall after an impact, and how much of it at rest.

    None: it flies on. The chatter that is left when it is as slow as SLOW is a geometric series.
    """
    if after == 0.0 or (abs(after) < SLOW and setting[3] < 1.0):
        force = sign * press(tau, setting)
        if force <= 0.0:
            return (0.0, 0.0) if after == 0.0 else None
        delay = next_zero(tau, sign, setting)
        return delay, max(delay - 2.0 * abs(after) / (force * (1.0 - setting[3])), 0.0)
    return None


def safe(tau, sign, setting):
    """Return a time for which a gear that leaves a wall is certainly on its way."""
    return min(LEAVE, 0.5 * next_zero(tau, -sign, setting))


def by_scipy(states, setting, most, until):
    """
    Follow the driven gear from turn to turn and to the walls, with terminal events.

    Between two turns the displacement is monotone: only the wall ahead can be met, and a graze is
    a turn that is found. So no flight begins on a zero of an event that it looks for.
    """
    from scipy.integrate import solve_ivp
    alpha, beta, gamma, restitution = setting
    way = 1.0

    def flow(t, y):
        return (y[1], gamma - beta * y[1])

    def wall(t, y):
        return way * (y[0] + alpha * math.sin(t)) - (way < 0.0)

    def turn(t, y):
        return way * (y[1] + alpha * math.cos(t))

    wall.terminal = turn.terminal = True
    wall.direction, turn.direction = 1.0, -1.0

    def go(t, y, d, events):
        return solve_ivp(flow, (t, t + d), y, 'DOP853', events=events, rtol=1e-12, atol=1e-13,
                         max_step=0.1)

    rows = []
    for number, (tau, s, v) in enumerate(states.tolist()):
        base, rest, count = 0.0, 0.0, 0
        way = 1.0 if v > 0.0 or (v == 0.0 and press(tau, setting) > 0.0) else -1.0
        y = [s - alpha * math.sin(tau), v - alpha * math.cos(tau)]
        while count < most:
            if wall(tau, y) < 0.0:
                found = go(tau, y, until - base - tau, (wall, turn))
                tau, y = float(found.t[-1]), found.y[:, -1].tolist()
                if found.status == 0:
                    break
                if len(found.t_events[1]):
                    way = -way
                    continue
            v = y[1] + alpha * math.cos(tau)
            if abs(v) >= STRONG:
                rows.append((number, base + tau, v, rest))
                count += 1
            v *= -restitution
            held = stay(tau, way, v, setting)
            if held is not None:
                rest += held[1]
                tau += held[0]
                v = 0.0
            if base + tau >= until:
                break
            base += TWO_PI * math.floor(tau / TWO_PI)
            tau %= TWO_PI
            y = [(0.0 if way > 0.0 else -1.0) - alpha * math.sin(tau), v - alpha * math.cos(tau)]
            if held is not None:
                found = go(tau, y, safe(tau, way, setting), None)
                tau, y = float(found.t[-1]), found.y[:, -1].tolist()
            way = -way
    return np.array(rows).reshape(-1, 4)


class Taylor:
    """heyoka's Taylor series, which finds the zeros of events on the polynomial of a step."""

    def __init__(self):
        """Compile both integrators once, for all settings."""
        import heyoka as hy
        s, v = hy.make_vars('s', 'v')
        alpha, beta, gamma = hy.par[0], hy.par[1], hy.par[2]
        force = alpha * (beta * hy.cos(hy.time) - hy.sin(hy.time)) + gamma - beta * v
        system = [(s, v), (v, force)]
        walls = [hy.t_event(wall, callback=self._bounce(sign), direction=direction)
                 for wall, sign, direction in (
                     (s, 1.0, hy.event_direction.positive),
                     (s + 1.0, -1.0, hy.event_direction.negative))]
        self.flight = hy.taylor_adaptive(system, [-0.5, 0.0], pars=[1.0] * 3, t_events=walls)
        self.leaving = hy.taylor_adaptive(system, [-0.5, 0.0], pars=[1.0] * 3)
        self.cut = hy.taylor_outcome.time_limit

    def _bounce(self, sign):
        def bounce(ta, direction):
            v = float(ta.state[1])
            if abs(v) >= STRONG:
                self.rows.append((self.number, ta.time, v, self.rest))
                self.left -= 1
            v *= -self.setting[3]
            ta.state[0], ta.state[1] = (0.0 if sign > 0.0 else -1.0), v
            self.held = stay(ta.time, sign, v, self.setting)
            self.sign = sign
            return self.left > 0 and self.held is None
        return bounce

    def __call__(self, states, setting, most, until):
        """Follow every initial condition."""
        self.setting, self.rows = setting, []
        self.flight.pars[:] = self.leaving.pars[:] = setting[:3]
        for self.number, (tau, s, v) in enumerate(states.tolist()):
            self.left, self.rest = most, 0.0
            while self.left > 0:
                self.held = None
                self.flight.time = tau
                self.flight.state[:] = s, v
                self.flight.reset_cooldowns()
                outcome = self.flight.propagate_until(until)[0]
                if outcome == self.cut or self.held is None:
                    break
                tau = self.flight.time + self.held[0]
                self.rest += self.held[1]
                if tau >= until:
                    break
                wall = 0.0 if self.sign > 0.0 else -1.0
                self.leaving.time = tau
                self.leaving.state[:] = wall, 0.0
                self.leaving.propagate_for(safe(tau, self.sign, setting))
                tau, (s, v) = self.leaving.time, self.leaving.state.tolist()
            if not -1.000001 < self.flight.state[0] < 0.000001:
                raise RuntimeError(f'heyoka went through a wall: {self.number} of {setting}')
        return np.array(self.rows).reshape(-1, 4)


def main():
    """Follow the initial conditions of every setting by the peer that is named."""
    peer, job, out = sys.argv[1:]
    given = np.load(job)
    follow = by_scipy if peer == 'scipy' else Taylor()
    begin = time.process_time()
    found = {}
    for number, setting in enumerate(given['settings'].tolist()):
        start = time.process_time()
        found[str(number)] = follow(given['states'], setting, int(given['most']),
                                    float(given['until']))
        print(f'{peer} {setting} {time.process_time() - start:.1f} s', file=sys.stderr)
    np.savez(out, **found)
    print(time.process_time() - begin)


if __name__ == '__main__':
    main()
