# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One thread for BLAS: matrices of this package are small, and more threads only wait."""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

import scipy.linalg  # noqa: F401 - loads the libraries that are limited, NumPy's and SciPy's
from threadpoolctl import ThreadpoolController


@cache
def _libraries() -> Any:
    return ThreadpoolController()


def one_blas_thread() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread in a block; the caller's setting returns after it.

    Examples:
        >>> import numpy as np
        >>> with one_blas_thread():
        ...     float(np.eye(2).trace())
        2.0
    """
    limited: AbstractContextManager[Any] = _libraries().limit(limits=1, user_api="blas")
    return limited
