"""The kernels of a server: compiled in another process, waited for, given up."""

import logging
import sys

import pytest

from app.kernels import Kernels


def python(code):
    return Kernels((sys.executable, "-c", code))


def test_waiting_ends_when_they_are_ready():
    kernels = python("import time; time.sleep(0.5)")
    said = []
    kernels.wait(lambda text, _share: said.append(text))
    assert "compiled" in said[0]
    assert kernels.progress == ""


def test_waiting_can_be_given_up():
    kernels = python("import time; time.sleep(60)")

    def give_up(_text, _share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kernels.wait(give_up)
    assert kernels.progress != ""
    kernels.close()
    assert kernels.progress == ""


def test_a_failure_is_in_the_log_and_nobody_waits_for_ever(caplog):
    with caplog.at_level(logging.ERROR):
        python("raise OSError('no room')").wait(lambda _text, _share: None)
    assert "no room" in caplog.text
