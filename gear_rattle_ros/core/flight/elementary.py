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
Sine, cosine, inverse tangent, logarithm and exponential relaxation, from arithmetic alone.

Only operations that IEEE 754 rounds exactly are used, so the results do not depend on the
machine's mathematical library, and the code vectorises. Each function is good to about one ulp.
"""

import math

import numpy as np

from .lanes_simd import inlined
from ..arrays import Whole
from ..compiled import kernel

TWO_PI = 2.0 * math.pi
HALF_PI = 0.5 * math.pi
# Added to a number, it leaves the nearest whole one in the last bits.
WHOLE_BITS = 1.5 * 2.0**52
# 2 pi minus its nearest double.
TWO_PI_TAIL = 2.4492935982947064e-16
# pi/2 in three pieces; the first two have 33 bits, so that a product with k < 2**20 is exact.
HALF_PI_1 = float.fromhex('0x1.921fb544p+0')
HALF_PI_2 = float.fromhex('0x1.0b4611a6p-34')
HALF_PI_3 = float.fromhex('0x1.3198a2e037073p-69')
# ln 2 in two pieces; the first has 33 bits.
LN2_1 = float.fromhex('0x1.62e42fefp-1')
LN2_2 = float.fromhex('0x1.473de6af278edp-34')
INVERSE_LN2 = float.fromhex('0x1.71547652b82fep+0')
# The bits of sqrt(1/2).
HALF_ROOT_BITS = 0x3FE6A09E667F3BCD
SMALLEST_NORMAL = 2.0**-1022
# The series 2/3 + 2 y/5 + 2 y^2/7 + ... of `logarithm`, shortened by Remez' algorithm for
# y up to ((sqrt(2) - 1)/(sqrt(2) + 1))^2: 2^-59 of 2 artanh s.
LOG_SERIES = (0.66666666666667344, 0.39999999999414680, 0.28571428742387026, 0.22222198573260878,
              0.18183564321557862, 0.15314050680658006, 0.14795948321045246)
# Beyond this exp(-x) is zero in float64.
EXP_UNDERFLOW = 746.0

# Where `relaxation` goes from its series to the exponential.
SERIES_MAXIMUM = 2.0


@kernel
def sine_series(y: float) -> float:
    """Sum ``(sin r - r)/r^3`` for ``y = r^2 <= 1``, even and odd terms apart for speed."""
    z = y * y
    return y * (
        1.0 / 120 + z * (1.0 / 362880 + z * (1.0 / 6227020800 + z * (1.0 / 355687428096000)))
    ) - (1.0 / 6 + z * (1.0 / 5040 + z * (1.0 / 39916800 + z * (1.0 / 1307674368000))))


@inlined
def signed(x: float, quadrant: Whole) -> float:
    """Change the sign of a number in the third and fourth quadrant."""
    return np.int64(np.float64(x).view(np.int64) ^ ((quadrant & 2) << 62)).view(np.float64)


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Return ``sin x`` and ``cos x`` of an angle [rad] with ``|x| < 1e6``."""
    nearest = x * (2.0 / math.pi) + WHOLE_BITS
    k = nearest - WHOLE_BITS
    r = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3
    y = r * r
    z = y * y
    sine = r + r * (y * sine_series(y))
    half = 0.5 * y
    w = 1.0 - half
    cosine = w + (
        ((1.0 - w) - half) + z * (
            (1.0 / 24 + z * (1.0 / 40320 + z * (1.0 / 479001600 + z * (1.0 / 20922789888000))))
            - y * (1.0 / 720 + z * (1.0 / 3628800 + z * (
                1.0 / 87178291200 + z * (1.0 / 6402373705728000)))))
    )
    # Selections rather than branches: the quadrant cannot be predicted.
    quadrant = np.float64(nearest).view(np.int64)
    odd = (quadrant & 1) != 0
    return (signed(cosine if odd else sine, quadrant),
            signed(sine if odd else cosine, quadrant + 1))


@kernel
def arctangent(x: float) -> float:
    """Return ``atan x`` [rad], by Newton's method on ``sin y = x cos y``."""
    steep = abs(x) > 1.0
    slope = 1.0 / x if steep else x
    y = slope / (1.0 + 0.28 * slope * slope)
    # From 0.005 off: the error is cubed at each step.
    for _ in range(3):
        sine, cosine = sine_cosine(y)
        y -= (sine - slope * cosine) / (cosine + slope * sine)
    if not steep:
        return y
    return (HALF_PI if x > 0.0 else -HALF_PI) - y


@kernel
def sine_defect(d: float, sine: float) -> float:
    """Return ``sin d - d`` for d >= 0 [rad] without cancellation, given ``sin d``."""
    if d > 1.0:
        return sine - d
    y = d * d
    return d * (y * sine_series(y))


@kernel
def power_of_two(k: int) -> float:
    """Return two to the power of k, from -1022 to 1023."""
    return np.int64((k + 1023) << 52).view(np.float64)


@kernel
def exp_minus(x: float) -> float:
    """Return ``exp(-x)`` for x from -700 on."""
    if x > EXP_UNDERFLOW:
        return 0.0
    k = np.rint(x * INVERSE_LN2)
    r = -((x - k * LN2_1) - k * LN2_2)
    polynomial = 1.0 + r * (1.0 + r * (1.0 / 2 + r * (1.0 / 6 + r * (1.0 / 24 + r * (
        1.0 / 120 + r * (1.0 / 720 + r * (1.0 / 5040 + r * (1.0 / 40320 + r * (
            1.0 / 362880 + r * (1.0 / 3628800 + r * (1.0 / 39916800 + r * (
                1.0 / 479001600 + r * (1.0 / 6227020800)))))))))))))
    # Only the second factor can round, where the result is subnormal.
    most = min(int(k), 1000)
    return polynomial * power_of_two(-most) * power_of_two(most - int(k))


@kernel
def logarithm(x: float) -> float:
    """Return ``ln x``, -inf at zero and nan below it."""
    if not 0.0 < x < math.inf:
        return x if x > 0.0 else -math.inf if x == 0.0 else math.nan
    k: Whole = 0
    if x < SMALLEST_NORMAL:
        x *= 2.0**54
        k = -54
    # x = 2^k (1 + f) with 1 + f from sqrt(1/2) to sqrt(2); the subtraction is exact.
    bits = np.float64(x).view(np.int64)
    above = (bits - HALF_ROOT_BITS) >> 52
    k += above
    f = np.int64(bits - (above << 52)).view(np.float64) - 1.0
    # ln(1 + f) = 2 artanh s = f - f^2/2 + s (f^2/2 + 2 s^2/3 + 2 s^4/5 + ...)
    s = f / (2.0 + f)
    y = s * s
    z = y * y
    series = y * (
        LOG_SERIES[0] + z * (LOG_SERIES[2] + z * (LOG_SERIES[4] + z * LOG_SERIES[6]))
    ) + z * (LOG_SERIES[1] + z * (LOG_SERIES[3] + z * LOG_SERIES[5]))
    half = 0.5 * f * f
    return k * LN2_1 - ((half - (s * (half + series) + k * LN2_2)) - f)


@kernel
def length(x: float, y: float) -> float:
    """Return ``sqrt(x^2 + y^2)``, where the square would overflow or vanish too."""
    square = x * x + y * y
    if 1e-280 < square < math.inf:
        return math.sqrt(square)
    larger = max(abs(x), abs(y))
    if not 0.0 < larger < math.inf:
        return square
    ratio = min(abs(x), abs(y)) / larger
    return larger * math.sqrt(1.0 + ratio * ratio)


@kernel
def relaxation_series(x: float) -> float:
    """Sum ``(exp(-x) - 1 + x)/x^2`` for x in [-1, 1], even and odd terms apart for speed."""
    y = x * x
    return (
        1.0 / 2 + y * (1.0 / 24 + y * (1.0 / 720 + y * (1.0 / 40320 + y * (
            1.0 / 3628800 + y * (1.0 / 479001600 + y * (1.0 / 87178291200 + y * (
                1.0 / 20922789888000)))))))
        - x * (1.0 / 6 + y * (1.0 / 120 + y * (1.0 / 5040 + y * (1.0 / 362880 + y * (
            1.0 / 39916800 + y * (1.0 / 6227020800 + y * (1.0 / 1307674368000 + y * (
                1.0 / 355687428096000))))))))
    )


@inlined
def relax(d: float, beta: float) -> tuple[float, float, float]:
    """Do as `relaxation` for ``|beta d| < 1``."""
    x = beta * d
    second = relaxation_series(x)
    first = 1.0 - x * second
    return 1.0 - x * first, d * first, d * d * second


@inlined
def relax_twice(d: float, beta: float) -> tuple[float, float, float]:
    """Do as `relaxation` for ``|beta d| < 2``: half the time twice."""
    decay, integral, second = relax(0.5 * d, beta)
    return decay * decay, integral + decay * integral, 2.0 * second + integral * integral


@kernel
def relaxation(d: float, beta: float) -> tuple[float, float, float]:
    """Return ``E = exp(-beta d)``, ``B = (1 - E)/beta`` and ``C = (d - B)/beta``, for d >= 0."""
    # A flight backwards has a negative beta; x from -700 on.
    x = beta * d
    if abs(x) < 1.0:
        return relax(d, beta)
    if abs(x) < SERIES_MAXIMUM:
        return relax_twice(d, beta)
    decay = exp_minus(x)
    integral = (1.0 - decay) / beta
    return decay, integral, (d - integral) / beta


@kernel
def relaxation_third(d: float, beta: float, second: float) -> float:
    """Return ``(d^2/2 - C)/beta`` for d >= 0, given the C of `relaxation`."""
    x = beta * d
    if abs(x) >= 1.0:
        return (0.5 * d * d - second) / beta
    # The sum of (-x)^k/(k + 3)!.
    total = 1.0
    for k in range(20, 3, -1):
        total = 1.0 - x * total / k
    return d * d * d * total / 6.0
