# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Elementary functions that give the same bits on every CPU.

numpy, and the C library that numba and `math` call, choose their code by CPU and by version, and the last bit differs.
These are made of additions, multiplications, divisions and square roots only, in a fixed order and without fused
operations, which IEEE 754 defines to the last bit. Every function is a ufunc of numpy and can be called in kernels too.

Sources: fdlibm 5.3 (Sun Microsystems 1993) for exp, log, sin, cos and arctan; Wichura 1988 (AS 241) for ndtri;
Cephes (Moshier 1989) for ndtr; Stirling's series (Abramowitz & Stegun 6.1.41) for lgamma.
"""

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic
import numpy as np

from scenario_gen.numerics.exact.elementwise import elementwise
from scenario_gen.numerics.kernels import F, kernel

ROUNDS = 6755399441055744.0  # 1.5 * 2**52: a number added to it is rounded to an integer, which its lowest bits then hold
ROUNDS_BITS = 0x4338000000000000
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
PI = 3.141592653589793
LARGEST_ANGLE = 1e6  # [rad] up to here sin and cos are right to the last bits

# Coefficients, the highest power first.
EXP = (
    4.13813679705723846039e-08,
    -1.65339022054652515390e-06,
    6.61375632143793436117e-05,
    -2.77777777770155933842e-03,
    1.66666666666666019037e-01,
)
LOG_ODD = (1.531383769920937332e-01, 2.222219843214978396e-01, 3.999999999940941908e-01)
LOG_EVEN = (1.479819860511658591e-01, 1.818357216161805012e-01, 2.857142874366239149e-01, 6.666666666666735130e-01)
SIN = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
)
COS = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)
ARCTAN_ODD = (
    1.62858201153657823623e-02,
    4.97687799461593236017e-02,
    6.66107313738753120669e-02,
    9.09088713343650656196e-02,
    1.42857142725034663711e-01,
    3.33333333333329318027e-01,
)
ARCTAN_EVEN = (
    -3.65315727442169155270e-02,
    -5.83357013379057348645e-02,
    -7.69187620504482999495e-02,
    -1.11111104054623557880e-01,
    -1.99999999998764832476e-01,
)
TANH = (-929569 / 638512875, 21844 / 6081075, -1382 / 155925, 62 / 2835, -17 / 315, 2 / 15, -1 / 3, 1.0)
STIRLING = (1 / 156, -691 / 360360, 1 / 1188, -1 / 1680, 1 / 1260, -1 / 360, 1 / 12)
ERF_TOP = (
    9.60497373987051638749e0,
    9.00260197203842689217e1,
    2.23200534594684319226e3,
    7.00332514112805075473e3,
    5.55923013010394962768e4,
)
ERF_BOTTOM = (
    1.0,
    3.35617141647503099647e1,
    5.21357949780152679795e2,
    4.59432382970980127987e3,
    2.26290000613890934246e4,
    4.92673942608635921086e4,
)
NEAR_TOP = (
    2.46196981473530512524e-10,
    5.64189564831068821977e-1,
    7.46321056442269912687e0,
    4.86371970985681366614e1,
    1.96520832956077098242e2,
    5.26445194995477358631e2,
    9.34528527171957607540e2,
    1.02755188689515710272e3,
    5.57535335369399327526e2,
)
NEAR_BOTTOM = (
    1.0,
    1.32281951154744992508e1,
    8.67072140885989742329e1,
    3.54937778887819891062e2,
    9.75708501743205489753e2,
    1.82390916687909736289e3,
    2.24633760818710981792e3,
    1.65666309194161350182e3,
    5.57535340817727675546e2,
)
FAR_TOP = (
    5.64189583547755073984e-1,
    1.27536670759978104416e0,
    5.01905042251180477414e0,
    6.16021097993053585195e0,
    7.40974269950448939160e0,
    2.97886665372100240670e0,
)
FAR_BOTTOM = (
    1.0,
    2.26052863220117276590e0,
    9.39603524938001434673e0,
    1.20489539808096656605e1,
    1.70814450747565897222e1,
    9.60896809063285878198e0,
    3.36907645100081516050e0,
)
MIDDLE_TOP = (
    2.5090809287301226727e3,
    3.3430575583588128105e4,
    6.7265770927008700853e4,
    4.5921953931549871457e4,
    1.3731693765509461125e4,
    1.9715909503065514427e3,
    1.3314166789178437745e2,
    3.3871328727963666080e0,
)
MIDDLE_BOTTOM = (
    5.2264952788528545610e3,
    2.8729085735721942674e4,
    3.9307895800092710610e4,
    2.1213794301586595867e4,
    5.3941960214247511077e3,
    6.8718700749205790830e2,
    4.2313330701600911252e1,
    1.0,
)
OUTER_TOP = (
    7.74545014278341407640e-4,
    2.27238449892691845833e-2,
    2.41780725177450611770e-1,
    1.27045825245236838258e0,
    3.64784832476320460504e0,
    5.76949722146069140550e0,
    4.63033784615654529590e0,
    1.42343711074968357734e0,
)
OUTER_BOTTOM = (
    1.05075007164441684324e-9,
    5.47593808499534494600e-4,
    1.51986665636164571966e-2,
    1.48103976427480074590e-1,
    6.89767334985100004550e-1,
    1.67638483018380384940e0,
    2.05319162663775882187e0,
    1.0,
)
TAIL_TOP = (
    2.01033439929228813265e-7,
    2.71155556874348757815e-5,
    1.24266094738807843860e-3,
    2.65321895265761230930e-2,
    2.96560571828504891230e-1,
    1.78482653991729133580e0,
    5.46378491116411436990e0,
    6.65790464350110377720e0,
)
TAIL_BOTTOM = (
    2.04426310338993978564e-15,
    1.42151175831644588870e-7,
    1.84631831751005468180e-5,
    7.86869131145613259100e-4,
    1.48753612908506148525e-2,
    1.36929880922735805310e-1,
    5.99832206555887937690e-1,
    1.0,
)


@intrinsic  # type: ignore[untyped-decorator,unused-ignore]
def _bits(_context: Any, _x: Any) -> Any:
    """The bits of a float64 as an int64."""
    return types.int64(F), lambda _, builder, __, arguments: builder.bitcast(arguments[0], ir.IntType(64))


@intrinsic  # type: ignore[untyped-decorator,unused-ignore]
def _from_bits(_context: Any, _x: Any) -> Any:
    """The float64 of these bits."""
    return F(types.int64), lambda _, builder, __, arguments: builder.bitcast(arguments[0], ir.DoubleType())


@kernel(inline=True)
def _polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Horner's rule."""
    value: float = coefficients[0]
    for k in range(1, len(coefficients)):
        value = value * x + coefficients[k]
    return value


@elementwise
def exp(x: float) -> float:
    """Return e to the power of x."""
    y = min(max(x, -746.0), 710.0)
    shifted = y * 1.4426950408889634 + ROUNDS
    k = _bits(shifted) - ROUNDS_BITS
    n = shifted - ROUNDS
    high, low = y - n * LN2_HIGH, n * LN2_LOW
    r = high - low
    z = r * r
    c = r - z * _polynomial(z, EXP)
    value = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    half = k >> 1  # in two factors, so that results below the normal range are rounded once
    value *= _from_bits((half + 1023) << 52)
    value *= _from_bits((k - half + 1023) << 52)
    return x if np.isnan(x) else value


@elementwise
def log(x: float) -> float:
    """Return the natural logarithm; -inf at 0, NaN below."""
    small = x < 2.2250738585072014e-308
    b = _bits(x * 1.8014398509481984e16 if small else x)  # 2**54
    b += 0x3FF0000000000000 - 0x3FE6A09E00000000  # so that the mantissa lies between sqrt(1/2) and sqrt(2)
    k = float((b >> 52) - (1077 if small else 1023))
    f = _from_bits((b & 0x000FFFFFFFFFFFFF) + 0x3FE6A09E00000000) - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    r = w * _polynomial(w, LOG_ODD) + z * _polynomial(w, LOG_EVEN)
    half = 0.5 * f * f
    value = k * LN2_HIGH - ((half - (s * (half + r) + k * LN2_LOW)) - f)
    if x == 0.0:
        return -np.inf
    if x < 0.0 or np.isnan(x):
        return np.nan
    return x if x == np.inf else value


@kernel(inline=True)
def _reduced(x: float) -> tuple[float, float, int]:
    """The angle less n quarter turns, as a sum of two numbers, and n (Cody & Waite with 118 bits of pi/2)."""
    y = x if abs(x) < LARGEST_ANGLE else x - (x * 0.15915494309189535 + ROUNDS - ROUNDS) * 6.283185307179586
    y = y if abs(y) < LARGEST_ANGLE + 1.0 else y - y  # of such an angle no digit is left
    shifted = y * 6.36619772367581382433e-01 + ROUNDS
    n = shifted - ROUNDS
    t = y - n * 1.57079632673412561417e00
    w = n * 6.07710050630396597660e-11
    r = t - w
    w = n * 2.02226624879595063154e-21 - ((t - r) - w)
    high = r - w
    return high, (r - high) - w, (_bits(shifted) - ROUNDS_BITS) & 3


@kernel(inline=True)
def _sine(x: float, low: float) -> float:
    z = x * x
    v = z * x
    return x - ((z * (0.5 * low - v * _polynomial(z, SIN)) - low) - v * -1.66666666666666324348e-01)


@kernel(inline=True)
def _cosine(x: float, low: float) -> float:
    z = x * x
    r = z * _polynomial(z, COS)
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * low))


@elementwise
def sin(x: float) -> float:
    """Return the sine of an angle [rad]."""
    high, low, n = _reduced(x)
    s, c = _sine(high, low), _cosine(high, low)
    value = c if n & 1 else s
    return -value if n & 2 else value


@elementwise
def cos(x: float) -> float:
    """Return the cosine of an angle [rad]."""
    high, low, n = _reduced(x)
    s, c = _sine(high, low), _cosine(high, low)
    value = s if n & 1 else c
    return -value if (n + 1) & 2 else value


@elementwise
def tan(x: float) -> float:
    """Return the tangent of an angle [rad]."""
    high, low, n = _reduced(x)
    s, c = _sine(high, low), _cosine(high, low)
    return -c / s if n & 1 else s / c


@kernel(inline=True)
def _arctan_of(x: float) -> float:
    a = abs(x)
    high, low, t = 0.0, 0.0, a
    if a > 2.4375:
        high, low, t = 1.57079632679489655800e00, 6.12323399573676603587e-17, -1.0 / a
    elif a > 1.1875:
        high, low, t = 9.82793723247329054082e-01, 1.39033110312309984516e-17, (a - 1.5) / (1.0 + 1.5 * a)
    elif a > 0.6875:
        high, low, t = 7.85398163397448278999e-01, 3.06161699786838301793e-17, (a - 1.0) / (a + 1.0)
    elif a > 0.4375:
        high, low, t = 4.63647609000806093515e-01, 2.26987774529616870924e-17, (2.0 * a - 1.0) / (2.0 + a)
    z = t * t
    w = z * z
    value = high - ((t * (z * _polynomial(w, ARCTAN_ODD) + w * _polynomial(w, ARCTAN_EVEN)) - low) - t)
    return -value if x < 0.0 else value


@elementwise
def arctan(x: float) -> float:
    """Return the angle [rad], in [-pi/2, pi/2], whose tangent is x."""
    return _arctan_of(x)


@elementwise
def arctan2(y: float, x: float) -> float:
    """Return the angle [rad], in [-pi, pi], of the point (x, y)."""
    if np.isnan(x) or np.isnan(y):
        return x + y
    down, left = _bits(y) < 0, _bits(x) < 0
    a, b = abs(y), abs(x)
    if a == 0.0:
        value = PI if left else 0.0
    elif b == 0.0:
        value = 0.5 * PI
    elif a == b:  # infinities too
        value = 0.75 * PI if left else 0.25 * PI
    else:
        value = _arctan_of(a / b)
        if left:
            value = PI - (value - 1.2246467991473531772e-16)
    return -value if down else value


@elementwise
def tanh(x: float) -> float:
    """Return the hyperbolic tangent."""
    if abs(x) < 0.1:  # where the difference below would lose digits
        return x * _polynomial(x * x, TANH)
    value = 1.0 - 2.0 / (exp(2.0 * min(abs(x), 22.0)) + 1.0)
    return -value if x < 0.0 else value


@elementwise
def hypot(x: float, y: float) -> float:
    """Return the length of (x, y), without care for what overflows."""
    return math.sqrt(x * x + y * y)


@elementwise
def lgamma(x: float) -> float:
    """Return the logarithm of the gamma function for x > 0; NaN else."""
    if not x > 0.0:
        return np.nan
    product, a = 1.0, x
    while a < 10.0:
        product *= a
        a += 1.0
    return (a - 0.5) * log(a) - a + 0.91893853320467274178 + _polynomial(1.0 / (a * a), STIRLING) / a - log(product)


@elementwise
def ndtr(x: float) -> float:
    """Return the standard normal distribution's probability up to x."""
    if np.isnan(x):
        return x
    a = abs(x) * 0.70710678118654752440
    z = a * a
    if a < 1.0:
        half = 0.5 * a * _polynomial(z, ERF_TOP) / _polynomial(z, ERF_BOTTOM)
        return 0.5 - half if x < 0.0 else 0.5 + half
    if a < 8.0:
        share = _polynomial(a, NEAR_TOP) / _polynomial(a, NEAR_BOTTOM)
    else:
        share = _polynomial(a, FAR_TOP) / _polynomial(a, FAR_BOTTOM)
    tail = 0.5 * exp(-z) * share if z < 745.0 else 0.0
    return tail if x < 0.0 else 1.0 - tail


@elementwise
def ndtri(p: float) -> float:
    """Return the x up to which the standard normal distribution has the probability p."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(r, MIDDLE_TOP) / _polynomial(r, MIDDLE_BOTTOM)
    r = min(p, 1.0 - p)
    if r == 0.0:
        return -np.inf if q < 0.0 else np.inf
    if not r > 0.0:
        return np.nan
    r = math.sqrt(-log(r))
    if r <= 5.0:
        value = _polynomial(r - 1.6, OUTER_TOP) / _polynomial(r - 1.6, OUTER_BOTTOM)
    else:
        value = _polynomial(r - 5.0, TAIL_TOP) / _polynomial(r - 5.0, TAIL_BOTTOM)
    return -value if q < 0.0 else value


def power(x: Any, n: int) -> Any:
    """Return x ** n for a whole n, a number or an array, by multiplication alone (and one division if n < 0)."""
    value = x if n else x * 0.0 + 1.0
    for _ in range(abs(n) - 1):
        value = value * x
    return 1.0 / value if n < 0 else value
