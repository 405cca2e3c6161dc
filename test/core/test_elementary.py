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

"""Elementary functions against 60-digit mpmath, in units of the last place."""

import ast
from collections.abc import Iterator
import math
from pathlib import Path
import re

import mpmath as mp
import numpy as np
import pytest

from gear_rattle_ros.core.flight import elementary, fingerprint
from gear_rattle_ros.core.flight.elementary import (
    arctangent,
    exp_minus,
    length,
    logarithm,
    relaxation,
    sine_cosine,
    sine_defect,
    TWO_PI,
    TWO_PI_TAIL,
)


def ulps(value: float, exact: mp.mpf) -> float:
    """Return the error in units of the last place of the exact value."""
    return float(abs(mp.mpf(value) - exact) / math.ulp(float(exact)))


@pytest.fixture(autouse=True)
def _digits() -> Iterator[None]:
    with mp.workdps(60):
        yield


def sample(low: float, high: float, count: int = 400) -> np.ndarray:
    """Return numbers of all magnitudes between two positive ones."""
    rng = np.random.default_rng(2001)
    return np.exp(rng.uniform(math.log(low), math.log(high), count))


def test_two_pi_in_two_pieces() -> None:
    """The tail of 2 pi is what the double lacks."""
    assert float(2 * mp.pi - mp.mpf(TWO_PI)) == TWO_PI_TAIL


def test_sine_and_cosine_within_an_ulp() -> None:
    """Sine and cosine are good to an ulp of themselves where flights need them."""
    for x in np.concatenate([sample(1e-12, 2e2), -sample(1e-12, 2e2, 50)]):
        sine, cosine = sine_cosine(float(x))
        assert ulps(sine, mp.sin(mp.mpf(float(x)))) < 1.5
        assert ulps(cosine, mp.cos(mp.mpf(float(x)))) < 1.5


def test_arctangent_within_two_ulps() -> None:
    """The inverse tangent is good to two ulps for numbers of all sizes, and odd."""
    for x in np.concatenate([sample(1e-12, 1e12), sample(0.3, 3.0), [0.0, 1.0]]):
        angle = arctangent(float(x))
        assert angle == 0.0 if x == 0.0 else ulps(angle, mp.atan(mp.mpf(float(x)))) < 2.0
        assert arctangent(float(-x)) == -angle


@pytest.mark.parametrize('k', [1, 2, 3, 4, 5, 100, 255, 65535, 600000])
def test_sine_and_cosine_beside_multiples_of_half_pi(k: int) -> None:
    """Next to its zeros a function keeps an absolute accuracy of an ulp of one."""
    near = float(k * mp.pi / 2)
    for x in (near, math.nextafter(near, 0.0), math.nextafter(near, 1e9), near + 1e-9):
        sine, cosine = sine_cosine(x)
        assert abs(sine - mp.sin(mp.mpf(x))) < 2.3e-16
        assert abs(cosine - mp.cos(mp.mpf(x))) < 2.3e-16
        if k < 256:
            assert ulps(sine, mp.sin(mp.mpf(x))) < 2.0
            assert ulps(cosine, mp.cos(mp.mpf(x))) < 2.0


def test_sine_less_argument_does_not_cancel() -> None:
    """The difference sin d - d is good to ulps of itself for small d."""
    for d in sample(1e-9, 20.0):
        value = sine_defect(float(d), sine_cosine(float(d))[0])
        assert ulps(value, mp.sin(mp.mpf(float(d))) - mp.mpf(float(d))) < 4.0


def test_decaying_exponential() -> None:
    """exp(-x) is good to an ulp down to the subnormals, and then zero."""
    for x in np.concatenate([sample(1e-12, 708.0), -sample(1e-12, 700.0, 100)]):
        assert ulps(exp_minus(float(x)), mp.exp(-mp.mpf(float(x)))) < 1.5
    assert exp_minus(0.0) == 1.0
    assert exp_minus(744.0) == pytest.approx(float(mp.exp(-744)), abs=5e-324)
    assert exp_minus(747.0) == exp_minus(1e300) == exp_minus(math.inf) == 0.0


def test_logarithm_within_an_ulp() -> None:
    """The logarithm is good to an ulp, near one and at the subnormals too."""
    rng = np.random.default_rng(3)
    below = rng.integers(1, 2**52, 300).view(np.float64)
    beside = 1.0 + rng.normal(size=300) * 10.0**rng.uniform(-16.0, -1.0, 300)
    ends = [5e-324, 2.0**-1022, math.nextafter(2.0**-1022, 0.0), math.sqrt(0.5), math.sqrt(2.0),
            math.nextafter(1.0, 0.0), math.nextafter(1.0, 2.0), math.nextafter(math.inf, 0.0)]
    for x in np.concatenate([sample(1e-307, 1e308, 600), sample(0.4, 3.0, 600), below, beside,
                             ends]):
        if x != 1.0:
            assert ulps(logarithm(float(x)), mp.log(mp.mpf(float(x)))) < 0.85, x


def test_logarithm_of_what_has_none() -> None:
    """Zero, infinity, nan and negative numbers give what IEEE 754 recommends."""
    assert logarithm(1.0) == 0.0
    assert logarithm(0.0) == logarithm(-0.0) == -math.inf
    assert logarithm(math.inf) == math.inf
    assert all(math.isnan(logarithm(x)) for x in (math.nan, -5e-324, -1.0, -math.inf))


def test_length_of_vectors_of_every_size() -> None:
    """The length is good to an ulp where squares overflow or vanish, and as hypot elsewhere."""
    for scale in (5e-324, 1e-310, 1e-200, 1e-141, 1.0, 1e150, 1e200, 1e307):
        for x, y in np.random.default_rng(4).normal(size=(100, 2)) * scale:
            exact = mp.sqrt(mp.mpf(float(x))**2 + mp.mpf(float(y))**2)
            assert exact == length(float(x), float(y)) or ulps(length(x, y), exact) < 2.0
    assert length(0.0, -0.0) == 0.0
    assert length(-math.inf, 1.0) == length(0.0, math.inf) == math.inf
    assert math.isnan(length(math.nan, 1.0))


def test_kernels_call_no_function_that_a_library_may_round_in_its_own_way() -> None:
    """In kernels only what IEEE 754 rounds exactly is called of math and numpy."""
    exact = {'math.sqrt', 'math.floor', 'math.ceil', 'math.copysign', 'math.isfinite',
             'math.isnan', 'math.isinf', 'np.rint', 'np.floor', 'np.signbit', 'np.empty',
             'np.arange', 'np.zeros', 'np.ones', 'np.full', 'np.float32', 'np.float64', 'np.int32',
             'np.int64', 'np.uint32', 'np.uint64',
             # These copy, count or compare.
             'np.concatenate', 'np.zeros_like', 'np.array', 'np.count_nonzero', 'np.argmax'}
    kernels = 0
    for path in Path(elementary.__file__).parents[1].rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef) or not {'kernel', 'inlined'} & {
                    ast.unparse(decorator) for decorator in node.decorator_list}:
                continue
            kernels += 1
            for part in ast.walk(node):
                if isinstance(part, ast.Call):
                    name = ast.unparse(part.func)
                    inexact = re.fullmatch(r'(math|np)\.[\w.]+', name) and name not in exact
                    assert not inexact, (path, name)
                if isinstance(part, ast.BinOp) and isinstance(part.op, ast.Pow):
                    assert isinstance(part.left, ast.Constant), (path, ast.unparse(part))
    assert kernels > 50


def test_the_fingerprint_depends_on_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """One case of the fingerprint is noisy, so it covers the draws too."""
    plain = fingerprint.fingerprint()
    monkeypatch.setattr(fingerprint, '_NOISE', (0.0,) * len(fingerprint._CASES))
    assert fingerprint.fingerprint.__wrapped__() != plain
    monkeypatch.undo()
    assert fingerprint.fingerprint.__wrapped__() == plain


def test_relaxation_functions_of_every_damping() -> None:
    """E, B and C are good to a few ulp, from negligible damping to complete decay."""
    rng = np.random.default_rng(9)
    durations = sample(1e-9, 400.0, 300)
    dampings = np.concatenate([sample(1e-18, 100.0, 280), rng.uniform(0.09, 0.11, 20)])
    for d, beta in zip(durations, dampings, strict=True):
        x, b = mp.mpf(float(d)), mp.mpf(float(beta))
        fall = -mp.expm1(-b * x) / b
        decay, integral, second = relaxation(float(d), float(beta))
        allowed = 1.5 + float(b * x)  # The rounding of the exponent beta d allows this error.
        assert ulps(decay, mp.exp(-b * x)) < allowed
        assert ulps(integral, fall) < 3.0
        assert ulps(second, (x - fall) / b) < 8.0


def test_relaxation_backwards() -> None:
    """E, B and C of a negative damping, which grow, are as good."""
    rng = np.random.default_rng(10)
    for d, growth in zip(sample(1e-9, 400.0, 200), 10.0**rng.uniform(-9.0, 2.7, 200), strict=True):
        beta = -growth / float(d)
        x, b = mp.mpf(float(d)), mp.mpf(beta)
        rise = -mp.expm1(-b * x) / b
        decay, integral, second = relaxation(float(d), beta)
        allowed = 1.5 + growth
        assert ulps(decay, mp.exp(-b * x)) < allowed
        assert ulps(integral, rise) < allowed + 1.5
        assert ulps(second, (x - rise) / b) < allowed + 6.0


@pytest.mark.parametrize('d', [0.0, 1e-300, 1e-9, 0.7, 300.0])
@pytest.mark.parametrize('beta', [0.0, 5e-324, 1e-300, 1e-30])
def test_relaxation_without_damping(d: float, beta: float) -> None:
    """At beta = 0 the motion is that of a constant force: 1, d, d^2/2."""
    assert relaxation(d, beta) == (1.0, d, d * d * 0.5)


def test_relaxation_is_continuous_where_its_formula_changes() -> None:
    """The series below beta d = 1 joins the closed form above it."""
    below = relaxation(math.nextafter(10.0, 0.0), 0.1)
    above = relaxation(10.0, 0.1)
    assert np.allclose(below, above, rtol=2e-15, atol=0.0)
