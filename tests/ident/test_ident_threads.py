"""Results are the same bits for any number of BLAS threads, and the caller's number is kept."""

import os
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from command import python
from helisim.ident import frequency_response, identify, structures, verify
from helisim.records.record import one_blas_thread
from ident_data import heave


def blas_threads():
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def numbers():
    frf = frequency_response(heave(1, 12_000), inputs="col", outputs="w", band=(0.3, 12.0))
    fit = identify(frf, structures.heave)
    verified = verify(fit, heave(2, 2000))
    values = [*fit.values.values(), *(one.cramer_rao for one in fit.parameters.values())]
    return frf.response.tobytes() + np.array([*values, verified.tic]).tobytes()


@pytest.mark.slow
def test_the_number_of_blas_threads_does_not_matter():
    code = "import test_ident_threads as t; print(t.numbers().hex())"
    printed, path = set(), os.pathsep.join(sys.path)
    for threads in ("1", "5"):
        count = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), threads)
        printed.add(python(code, env={**os.environ, **count, "PYTHONPATH": path}))
    assert len(printed) == 1
    assert len(printed.pop()) > 1000


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor has one thread anyway")
def test_the_callers_threads_are_kept():
    with threadpool_limits(limits=2, user_api="blas"):
        with one_blas_thread():
            assert blas_threads() == {1}
            with one_blas_thread():
                assert blas_threads() == {1}
            assert blas_threads() == {1}
        assert blas_threads() == {2}
