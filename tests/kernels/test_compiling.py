"""What is compiled is kept for exactly the sources that it was compiled from."""

from spf.kernels.compiling import _cache_of


def test_a_change_of_any_source_asks_for_a_new_cache(tmp_path):
    (tmp_path / "a.py").write_text("x = 1")
    (tmp_path / "b.py").write_text("y = 1")
    before = _cache_of(tmp_path)
    assert _cache_of(tmp_path) == before
    (tmp_path / "b.py").write_text("y = 2")
    assert _cache_of(tmp_path) != before
