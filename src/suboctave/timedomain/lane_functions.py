"""Functions that generated code calls: arc tangent, logarithm, sine and cosine as vector instructions, and callbacks.

Calls of a library's functions cannot be put into vector registers. Here both are polynomials without a branch, fitted
at Chebyshev nodes in high precision:

- `atan(z) = pi/2 - atan(1/z)` for z > 1, and `atan(t) = t A(t^2)` on 0 <= t <= 1, |error of A| < 3e-17;
- `log(m 2^e) = e log 2 + s L(s^2)`, s = (m - 1)/(m + 1), m within a factor sqrt(2) of one, |error of L| < 1e-17.

In double precision both are right to about two units in the last place of the larger of the result and one.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.extending import intrinsic

#: interpreted, the functions of `math` would raise where compiled ones give inf or nan
_functions: Any = np if config.DISABLE_JIT else math
sin, cos, tan, arcsin, arccos, arctan, sinh, cosh, tanh, exp, log, sqrt = (
    getattr(_functions, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
)

#: the C function behind `call_back`: number of the law, trajectories, address of the block
CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)

_ARCTAN = (
    1.0, -0.3333333333333286, 0.19999999999929946, -0.14285714281592693, 0.11111110982087126, -0.09090906605656898,
    0.0769227555520563, -0.06666371187721098, 0.05880342002401543, -0.052527255573225747, 0.04719723992321112,
    -0.042125723963855326, 0.03651081352721035, -0.02970071773623423, 0.021740213830758134, -0.013674139288399478,
    0.007038646202989813, -0.0028047655531701315, 0.0008033604181626027, -0.00014617088163625013,
    1.2631178430477426e-05,
)  # fmt: skip
_LOGARITHM = (
    2.0, 0.6666666666666765, 0.3999999999930049, 0.2857142876106032, 0.2222219701200196, 0.18183634112308752,
    0.1531246302957415, 0.148103912163146,
)  # fmt: skip
_SINE = (
    1.0, -0.16666666666666666, 0.00833333333333332, -0.00019841269841252646, 2.7557319213139716e-06,
    -2.505210467005576e-08, 1.6058338571676054e-10, -7.57740241024318e-13,
)  # fmt: skip
_COSINE = (
    1.0, -0.5, 0.04166666666666644, -0.0013888888888859679, 2.4801587283163603e-05, -2.7557312912609514e-07,
    2.0875558847209005e-09, -1.135221164701392e-11,
)  # fmt: skip
_HALF_PI = 0.5 * math.pi
_HALF_PI_HEAD = 1.5707963267341256
_HALF_PI_TAIL = 6.077100506506192e-11
_LOG_2 = math.log(2.0)
#: bits of sqrt(1/2): subtracted, they leave the exponent that makes the rest lie around one
_ROOT_HALF = np.int64(0x3FE6A09E667F3BCD)
_FRACTION = np.int64(0x000FFFFFFFFFFFFF)


@intrinsic
def call_back(typing_context: Any, address: Any, law: Any, lanes: Any, values: Any) -> Any:
    """Call the C function at `address` with (law, lanes, address of the first of `values`)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        integer = ir.IntType(64)
        array = context.make_array(signature.args[3])(context, builder, arguments[3])
        data = builder.ptrtoint(array.data, integer)
        kind = ir.FunctionType(ir.VoidType(), [integer, integer, integer])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(function, [arguments[1], arguments[2], data])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, values), generate


def _call_back_interpreted(address, law, lanes, values):
    CALLBACK(address)(law, lanes, values.ctypes.data)


if config.DISABLE_JIT:  # an intrinsic is nothing to interpreted code
    call_back = _call_back_interpreted


def _polynomial(coefficients: tuple[float, ...]) -> Any:
    """A polynomial by Horner's scheme, written out: a loop would keep the compiler from vector instructions."""
    text = repr(coefficients[-1])
    for c in coefficients[-2::-1]:
        text = f"{c!r} + w * ({text})"
    return njit(inline="always")(eval(f"lambda w: {text}"))


_arctan, _logarithm, _sine, _cosine = (_polynomial(c) for c in (_ARCTAN, _LOGARITHM, _SINE, _COSINE))


@njit(inline="always")
def arctan_log(z):
    """`atan(z)` and `log(1 + z^2)`."""
    a = abs(z)
    large = a > 1.0
    t = (1.0 if large else a) / (a if large else 1.0)
    w = t * t
    angle = t * _arctan(w)
    angle = _HALF_PI - angle if large else angle
    x = 1.0 + z * z
    i = np.float64(x).view(np.int64) - _ROOT_HALF
    m = np.int64((i & _FRACTION) + _ROOT_HALF).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    q = s * s
    return math.copysign(angle, z), float(i >> 52) * _LOG_2 + s * _logarithm(q)


@njit(inline="always")
def sine_cosine(x):
    """`sin(x)` and `cos(x)` for angles of some thousands at most."""
    quarters = math.floor(x * (1.0 / _HALF_PI) + 0.5)
    # pi/2 in two parts: the first one's product with a small whole number is exact
    y = (x - quarters * _HALF_PI_HEAD) - quarters * _HALF_PI_TAIL
    w = y * y
    s, c = y * _sine(w), _cosine(w)
    turn = int(quarters) & 3
    odd = (turn & 1) == 1
    sine = c if odd else s
    cosine = s if odd else c
    return (-sine if turn >= 2 else sine), (-cosine if ((turn + 1) & 2) == 2 else cosine)
