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
The attractor reached, in 50 digits and by independent formulas: who is right where peers disagree.

Impacts are found by steps that cannot pass a wall (the acceleration is bounded), so none is
missed; errors of 1e-50 are still small after the hundreds of impacts of a transient.
"""

import mpmath as mp

ALPHA, BETA, GAMMA, R = (mp.mpf(x) for x in (0.48, 0.1, 0.1, 0.9))
# As exact as the doubles that the others use; the package sticks below this speed too.
STICKS = mp.mpf(1e-10)
NEAR = mp.mpf(10)**-6
CLOSE = mp.mpf(10)**-40
LEAVES = mp.mpf(10)**-6
CAP = 3000


def acceleration(tau, v):
    """Return s''."""
    return -ALPHA * mp.sin(tau) + ALPHA * BETA * mp.cos(tau) + GAMMA - BETA * v


def after(d, tau, s, v):
    """Return displacement and velocity a time d later, by eqs. (4) and (5)."""
    g = GAMMA / BETA
    w = v - ALPHA * mp.cos(tau) - g
    e = mp.exp(-BETA * d)
    return (s + ALPHA * (mp.sin(tau + d) - mp.sin(tau)) + g * d + (1 - e) / BETA * w,
            ALPHA * mp.cos(tau + d) + w * e + g)


def next_impact(tau, s, v):
    """Return the time to the next impact and the velocity before it."""
    bound = ALPHA + abs(GAMMA - BETA * (v - ALPHA * mp.cos(tau)))
    d, here, u = mp.mpf(0), s, v
    left = abs(s) < CLOSE and u <= 0 or abs(s + 1) < CLOSE and u >= 0
    while True:
        steps = []
        for gap, speed, towards in ((-here, u, s == 0), (here + 1, -u, s == -1)):
            if left and towards:
                # From the wall itself: back on it no sooner than the speed away allows.
                steps.append(-2 * speed / bound if speed < 0 else mp.mpf(0))
                continue
            gap = max(gap, mp.mpf(0))
            root = mp.sqrt(speed * speed + 2 * bound * gap)
            steps.append(2 * gap / (speed + root) if speed > 0 else (root - speed) / bound)
        d += max(min(steps), CLOSE)
        left = False
        here, u = after(d, tau, s, v)
        if (here > -CLOSE and u > 0) or (here + 1 < CLOSE and u < 0):
            return d, u


def release(tau, sign):
    """Return the time after which the force no longer presses on a wall."""
    size, lag = ALPHA * mp.sqrt(1 + BETA**2), mp.atan(BETA)
    base = mp.asin(GAMMA / size)
    for turn in range(-1, 3):
        for root in (base, mp.pi - base):
            delay = root + lag + 2 * mp.pi * turn - mp.fmod(tau, 2 * mp.pi)
            falls = -sign * mp.cos(root) < 0
            if delay > CLOSE and falls:
                yield delay


def label_of(phase, velocity, orbits):
    """Return the number of the orbit, a list of points (phase, velocity), that is reached."""
    with mp.workdps(50):
        tau, s, v = mp.mpf(phase), mp.mpf(0), mp.mpf(velocity)
        if v > 0:
            v = -R * v
        for _ in range(CAP):
            sign = 1 if s == 0 else -1
            if abs(v) < STICKS and sign * acceleration(tau, 0) > 0:
                # Past the release by so little that it has not come back yet.
                tau += min(release(tau, sign))
                s, v = after(LEAVES, tau, s, mp.mpf(0))
                tau += LEAVES
            d, u = next_impact(tau, s, v)
            tau, s, v = mp.fmod(tau + d, 2 * mp.pi), mp.mpf(0 if u > 0 else -1), -R * u
            for number, points in enumerate(orbits):
                for p, w in points:
                    if abs(u - w) < NEAR and abs(mp.sin((tau - p) / 2)) < NEAR / 2:
                        return number
    return -1
