"""The bundled sample sessions: there, whole, and made by the command that says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.make_samples import SAMPLES, main
from spf.sessions import open_session
from spf.synthetic import synthesise

BUNDLED = Path(__file__).resolve().parents[2] / "sessions"


@pytest.mark.parametrize("name", SAMPLES)
def test_a_bundled_sample_is_what_its_settings_say(name: str) -> None:
    """Its truth and what it shows; not its bytes, which may differ in a last digit from machine to machine."""
    stored, made = open_session(BUNDLED / f"{name}.mcap"), synthesise(SAMPLES[name])
    assert len(stored) == len(made)
    assert (stored.side, stored.camera, stored.depth_unit) == (made.side, made.camera, made.depth_unit)
    assert stored.hand_shape == made.hand_shape
    assert stored.warnings == ()
    for index in (0, len(made) // 2, len(made) - 1):
        frame, expected = stored[index], made[index]
        assert frame.truth is not None
        assert expected.truth is not None
        np.testing.assert_allclose(frame.truth.joints, expected.truth.joints, atol=1e-5)
        assert (np.abs(frame.depth - expected.depth) < 0.02).mean() > 0.97


def test_the_samples_are_described_and_small() -> None:
    described = (BUNDLED / "README.md").read_text(encoding="utf-8")
    assert all(f"`{name}.mcap`" in described for name in SAMPLES)
    assert sum((BUNDLED / f"{name}.mcap").stat().st_size for name in SAMPLES) < 8e6


def test_the_command_makes_the_one_that_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["fast-wave", "-o", str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["fast-wave.mcap"]
    assert open_session(tmp_path / "fast-wave.mcap").fingerprint() == synthesise(SAMPLES["fast-wave"]).fingerprint()
    assert "fast-wave.mcap" in capsys.readouterr().out


def test_the_command_names_an_unknown_sample(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["slow-wave", "-o", str(tmp_path)])
    assert "there is no sample slow-wave; the samples are open-close" in capsys.readouterr().err
