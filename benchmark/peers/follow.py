"""
The last impact of many trajectories by heyoka or by scipy's solve_ivp, as a user would write it.

Run by benchmark/basins.py, with a Python that has the peer: follow.py PEER INITIAL.npy OUT.npy N
follows each for N impacts and writes (phase, velocity) before the last one; prints seconds
of computing. Initial conditions are rows (phase, velocity) on s = 0.
"""

import math
import sys
import time

import numpy as np

ALPHA, BETA, GAMMA, R = 0.48, 0.1, 0.1, 0.9
# Below this speed after an impact a trajectory is given up: nothing here knows how to stick.
SLOW = 1e-7


def by_scipy(initial, count):
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
    last = np.full((len(initial), 2), np.nan)
    for number, (phase, velocity) in enumerate(initial):
        t, s, v = phase, 0.0, velocity
        if v > 0.0:
            v = -R * v
        for _ in range(count):
            found = solve_ivp(flow, (t, t + 200.0), [s, v], events=(upper, lower), rtol=1e-9,
                              atol=1e-12)
            if found.status != 1:
                break
            t, v = float(found.t[-1]), float(found.y[1, -1])
            s = 0.0 if len(found.t_events[0]) else -1.0
            before, v = v, -R * v
            if abs(v) < SLOW:
                break
        else:
            last[number] = t % (2.0 * math.pi), before
    return last


def by_heyoka(initial, count):
    """Integrate with Taylor series and terminal events at both walls."""
    import heyoka as hy
    s, v = hy.make_vars('s', 'v')
    here = [0.0, 0]

    def bounce(ta, direction):
        here[0], here[1] = float(ta.state[1]), here[1] + 1
        ta.state[1] *= -R
        return abs(ta.state[1]) >= SLOW and here[1] < count

    force = -ALPHA * hy.sin(hy.time) + ALPHA * BETA * hy.cos(hy.time) + GAMMA
    walls = [hy.t_event(wall, callback=bounce, direction=direction) for wall, direction in (
        (s, hy.event_direction.positive), (s + 1.0, hy.event_direction.negative))]
    integrator = hy.taylor_adaptive([(s, v), (v, force - BETA * v)], [0.0, 0.0], t_events=walls)
    last = np.full((len(initial), 2), np.nan)
    begin = time.perf_counter()
    for number, (phase, velocity) in enumerate(initial):
        here[0], here[1] = math.nan, 0
        integrator.time = phase
        integrator.state[:] = 0.0, -R * velocity if velocity > 0.0 else velocity
        integrator.reset_cooldowns()
        integrator.propagate_until(phase + 20.0 * count)
        if here[1] == count:
            last[number] = integrator.time % (2.0 * math.pi), here[0]
    return last, time.perf_counter() - begin


def main():
    """Follow the initial conditions by the peer that is named."""
    name, initial, out, count = sys.argv[1:]
    begin = time.perf_counter()
    last = {'heyoka': by_heyoka, 'scipy': by_scipy}[name](np.load(initial), int(count))
    seconds = time.perf_counter() - begin
    if isinstance(last, tuple):
        last, seconds = last
    np.save(out, last)
    print(seconds)


if __name__ == '__main__':
    main()
