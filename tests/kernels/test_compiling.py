"""What is compiled is kept for exactly the sources that it was compiled from, and computes what it did when it was compiled."""

from importlib import import_module
from pkgutil import iter_modules

from numba.core.registry import CPUDispatcher

import spf.kernels
from spf.kernels.compiling import _cache_of


def test_a_change_of_any_source_asks_for_a_new_cache(tmp_path):
    (tmp_path / "a.py").write_text("x = 1")
    (tmp_path / "b.py").write_text("y = 1")
    before = _cache_of(tmp_path)
    assert _cache_of(tmp_path) == before
    (tmp_path / "b.py").write_text("y = 2")
    assert _cache_of(tmp_path) != before


def test_kernels_compute_with_nothing_but_what_is_compiled_into_them():
    """Of two compiled copies of a function, a process that loads them may use another than one that compiles them."""
    modules = [import_module(f"spf.kernels.{found.name}") for found in iter_modules(spf.kernels.__path__)]
    functions = {value for module in modules for value in vars(module).values() if isinstance(value, CPUDispatcher)}
    shared = {
        (caller.__name__, callee.__name__)
        for caller in functions
        for name in caller.py_func.__code__.co_names
        if isinstance(callee := caller.py_func.__globals__.get(name), CPUDispatcher)
        and not callee.targetoptions.get("forceinline")
        and callee.targetoptions.get("_nrt") is False  # what allocates does not compute
    }
    assert len(functions) > 40
    assert not shared
