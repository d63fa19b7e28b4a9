"""Arrays of MATLAB files, as SciPy writes them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io

from spf.errors import SessionError
from spf.sessions.mat_file import read_mat_array


@pytest.mark.parametrize("packed", [False, True])
def test_an_array_is_read_beside_others(packed, tmp_path, rng):
    path, array = tmp_path / "a.mat", rng.normal(size=(3, 40, 36, 3))
    scipy.io.savemat(path, {"x": np.arange(3.0), "a_long_name_for_it": array, "t": "text"}, do_compression=packed)
    np.testing.assert_array_equal(read_mat_array(path, "a_long_name_for_it"), array)
    with pytest.raises(SessionError, match="holds no other"):
        read_mat_array(path, "other")
