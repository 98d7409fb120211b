# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The normal equations are SciPy's product of the Jacobian with itself, to the last bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from sonar_explore.slam.normal_equations import normal_equations


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_the_products_are_those_of_sparse_matrices(seed):
    rng = np.random.default_rng(seed)
    size, m = int(rng.integers(1, 12)), int(rng.integers(1, 30))
    columns = [rng.permutation(size)[: rng.integers(1, size + 1)] for _ in range(m)]
    starts = np.cumsum([0, *map(len, columns)])
    values = rng.normal(size=starts[-1]) * rng.integers(0, 2, starts[-1])
    residual = rng.normal(size=m)
    normal, slope = normal_equations(starts, np.concatenate(columns), values, residual, size)
    jacobian = sparse.csr_matrix((values, np.concatenate(columns), starts), shape=(m, size)).tocsc()
    expected = (jacobian.T @ jacobian).tocsc()
    expected.eliminate_zeros()
    assert (normal.toarray() == expected.toarray()).all()
    assert normal.nnz == expected.nnz and normal.has_canonical_format
    assert (slope == jacobian.T @ residual).all()


def test_a_column_that_no_row_has_stays_empty():
    normal, slope = normal_equations(np.array([0, 1]), np.array([2]), np.array([3.0]), np.array([2.0]), 4)
    assert normal.nnz == 1 and normal[2, 2] == 9.0
    assert slope.tolist() == [0.0, 0.0, 6.0, 0.0]
