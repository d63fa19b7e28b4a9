"""The network's file: found, checked, and described by the JSON beside it."""

from __future__ import annotations

import builtins
import hashlib
from importlib.resources import files

import numpy as np
import pytest

from spf.errors import SpfError
from spf.learned import layout
from spf.learned.network import NetworkError, load_network

ASSETS = files("spf.learned") / "assets"


def is_one_sentence(text: str) -> bool:
    return text.endswith(".") and ". " not in text and "\n" not in text


def test_the_shipped_network_is_the_one_described():
    content = (ASSETS / "hand-proposal.onnx").read_bytes()
    about = load_network().about
    assert hashlib.sha256(content).hexdigest() == about["sha256"]
    assert about["samples_seen"] > 0
    assert about["seed"] >= 0
    assert len(content) < 5e6


def test_it_takes_any_number_of_crops():
    network = load_network()
    crops = np.random.default_rng(0).uniform(-1, 1, (5, layout.CROP_SIZE, layout.CROP_SIZE)).astype(np.float32)
    together = network.outputs(crops)
    assert together.shape == (5, layout.OUTPUTS)
    np.testing.assert_allclose(network.outputs(crops[2:3]), together[2:3], atol=1e-3)


def test_a_missing_file_is_one_sentence(tmp_path):
    with pytest.raises(NetworkError) as raised:
        load_network(tmp_path / "nothing.onnx")
    assert isinstance(raised.value, SpfError)
    assert "nothing.onnx" in str(raised.value)
    assert is_one_sentence(str(raised.value))


def test_a_damaged_file_is_one_sentence(tmp_path):
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes((ASSETS / "hand-proposal.onnx").read_bytes()[:5000])
    with pytest.raises(NetworkError, match="cannot be read") as raised:
        load_network(damaged)
    assert is_one_sentence(str(raised.value))


def test_without_onnxruntime_it_says_what_to_install(monkeypatch):
    real_import = builtins.__import__

    def without(name, *arguments, **options):
        if name == "onnxruntime":
            raise ImportError(name)
        return real_import(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(NetworkError, match="onnxruntime"):
        load_network()
