"""Settings: what is declared is what is accepted, and everything else is one clear sentence."""

import math
from dataclasses import FrozenInstanceError, dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.errors import SettingError, SpfError
from spf.settings import Settings, setting


@dataclass(frozen=True)
class Cost(Settings):
    k: float = setting(3.0, "weight of the normals", group="Cost", low=0.0, high=100.0, symbol="k")
    reach: float = setting(0.01, "length scale", group="Cost", low=0.001, high=0.1, unit="m")


@dataclass(frozen=True)
class Tracker(Cost):
    n: int = setting(4, "number of particles", group="Filter", low=1, high=256, symbol="N")
    correct: bool = setting(True, "divide by the proposal's density", group="Filter")
    kernel: str = setting("gaussian", "kernel of the density", group="Filter", choices=("gaussian", "box"))


def test_defaults_are_valid_and_named_once():
    assert Tracker().to_dict() == {"k": 3.0, "reach": 0.01, "n": 4, "correct": True, "kernel": "gaussian"}
    infos = {info.name: info for info in Tracker.describe()}
    assert list(infos) == ["k", "reach", "n", "correct", "kernel"]
    assert infos["n"].kind is int
    assert (infos["n"].low, infos["n"].high, infos["n"].symbol) == (1, 256, "N")
    assert infos["reach"].unit == "m"
    assert infos["kernel"].choices == ("gaussian", "box")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n", 0),
        ("n", 257),
        ("n", -1),
        ("n", 4.5),
        ("n", "4"),
        ("n", True),
        ("n", None),
        ("n", math.nan),
        ("k", math.nan),
        ("k", math.inf),
        ("k", -0.001),
        ("k", True),
        ("k", "3"),
        ("reach", 0.0),
        ("correct", 1),
        ("correct", "on"),
        ("kernel", "triangle"),
        ("kernel", 3),
    ],
)
def test_a_bad_value_is_refused_by_every_way_in(name, value):
    for make in (lambda: Tracker(**{name: value}), lambda: Tracker().replace(**{name: value})):
        with pytest.raises(SettingError, match=f"'{name}'") as error:
            make()
        assert isinstance(error.value, SpfError)
        assert "\n" not in str(error.value)
        assert str(error.value).endswith(".")


def test_the_range_and_unit_stand_in_the_sentence():
    with pytest.raises(SettingError, match=r"number of particles.* is 0, outside its range 1 to 256"):
        Tracker(n=0)
    with pytest.raises(SettingError, match=r"0\.001 to 0\.1 m"):
        Tracker(reach=1.0)


@dataclass(frozen=True)
class HalfOpen(Settings):
    least: float = setting(1.0, "a length", group="Sizes", low=0.0, unit="m")
    most: int = setting(1, "a count", group="Sizes", high=3)


@pytest.mark.parametrize(
    ("change", "sentence"), [({"least": -1}, "is -1, and has to be at least 0 m"), ({"most": 4}, "at most 3")]
)
def test_a_range_may_be_open_at_one_end(change, sentence):
    with pytest.raises(SettingError, match=sentence):
        HalfOpen(**change)


@pytest.mark.parametrize("value", [8, 8.0, np.int64(8), np.float64(8)])
def test_values_have_the_declared_type_whatever_number_type_they_came_as(value):
    assert type(Tracker(n=value).n) is int
    assert type(Tracker(k=value).k) is float
    assert Tracker(n=value, k=value) == Tracker(n=8, k=8.0)


def test_an_unknown_name_lists_the_known_ones():
    for change in (lambda: Tracker().replace(particles=3), lambda: Tracker().with_text({"particles": "3"})):
        with pytest.raises(SettingError, match=r"no setting 'particles'.*correct, k, kernel, n, reach"):
            change()


def test_replace_leaves_the_original_alone():
    tracker = Tracker()
    assert tracker.replace(n=8).n == 8
    assert tracker.n == 4
    with pytest.raises(FrozenInstanceError):
        tracker.n = 9


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("k", "2.5", 2.5),
        ("k", " 1e1 ", 10.0),
        ("n", "16", 16),
        ("correct", "off", False),
        ("correct", " YES ", True),
        ("correct", "0", False),
        ("kernel", " box ", "box"),
    ],
)
def test_text_becomes_a_value_of_the_declared_type(name, text, value):
    parsed = getattr(Tracker().with_text({name: text}), name)
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("n", "4.5"),
        ("n", "four"),
        ("n", ""),
        ("n", "0"),
        ("k", "nan"),
        ("k", "inf"),
        ("k", "3,5"),
        ("correct", "maybe"),
        ("kernel", ""),
    ],
)
def test_text_that_is_no_value_is_refused(name, text):
    with pytest.raises(SettingError, match=f"'{name}'"):
        Tracker().with_text({name: text})


@given(st.floats(0, 100), st.integers(1, 256), st.booleans())
def test_text_round_trip(k, n, correct):
    tracker = Tracker(k=k, n=n, correct=correct)
    text = {name: repr(value) if name != "kernel" else value for name, value in tracker.to_dict().items()}
    assert Tracker().with_text(text) == tracker


@given(st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.integers()))
def test_a_number_is_accepted_exactly_when_it_is_in_range(value):
    if math.isfinite(value) and 0 <= value <= 100:
        assert Tracker(k=value).k == value
    else:
        with pytest.raises(SettingError):
            Tracker(k=value)
