from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.makers import make_icvl


@pytest.fixture
def made(tmp_path: Path, rng: np.random.Generator):
    return make_icvl(tmp_path / "Testing", rng)


def test_the_part_its_labels_and_its_sequence_are_one_session(made):
    part, labels, sequence = map(
        open_session, (made.path, made.path / "test_seq_1.txt", made.path / "Depth" / "test_seq_1")
    )
    assert part.format == labels.format == sequence.format == "icvl"
    assert part.fingerprint() == labels.fingerprint() == sequence.fingerprint()
    np.testing.assert_array_equal(sequence[2].truth.joints, part[2].truth.joints)
    assert (sequence.name, sequence.joint_definition, sequence.side) == ("test_seq_1", "icvl", None)


def test_training_layout_has_one_label_file_for_all_sequences(tmp_path, rng):
    sequences = ("201403121135", "22-5/201403121140")
    parts = [make_icvl(tmp_path / "Training", rng, sequence=name) for name in sequences]
    labels = [tmp_path / "Training" / f"{name}.txt" for name in sequences]
    (tmp_path / "Training" / "labels.txt").write_text("".join(path.read_text() for path in labels))
    for path in labels:
        path.unlink()
    for made, name in zip(parts, sequences, strict=True):
        session = open_session(tmp_path / "Training" / "Depth" / name)
        assert len(session) == 4
        np.testing.assert_allclose(session[1].truth.joints, made.joints[1], atol=1e-9)
    together = open_session(tmp_path / "Training")
    assert len(together) == 8
    assert "2 sequences follow one another" in together.warnings[0]


def test_two_test_sequences_are_told(tmp_path, made, rng):
    make_icvl(tmp_path / "Testing", rng, sequence="test_seq_2")
    session = open_session(tmp_path / "Testing")
    assert len(session) == 8
    assert session.warnings == (
        "2 sequences follow one another and the hand jumps between them: to track one, open its folder "
        "(test_seq_1, test_seq_2).",
    )
    assert len(open_session(tmp_path / "Testing" / "test_seq_2.txt")) == 4


def test_images_beside_the_labels(tmp_path, made):
    (made.path / "Depth" / "test_seq_1").rename(made.path / "test_seq_1")
    (made.path / "Depth").rmdir()
    session = open_session(made.path)
    np.testing.assert_array_equal(session.raw_depth(0), made.raw[0])


def test_a_missing_image_is_left_out_and_told(made):
    (made.path / "Depth" / "test_seq_1" / "image_0001.png").unlink()
    session = open_session(made.path)
    assert len(session) == 3
    np.testing.assert_allclose(session[1].truth.joints, made.joints[2], atol=1e-9)
    assert session.warnings == ("1 labelled images are not in the folder and were left out.",)


def test_no_image_at_all_is_told(made):
    for path in (made.path / "Depth" / "test_seq_1").iterdir():
        path.unlink()
    with pytest.raises(SessionError, match="None of the 4 images labelled"):
        open_session(made.path)


def test_a_sequence_without_labels_is_told(made):
    (made.path / "Depth" / "test_seq_1").rename(made.path / "Depth" / "test_seq_5")
    with pytest.raises(SessionError, match=r"No line of .*test_seq_1\.txt labels an image of test_seq_5"):
        open_session(made.path / "Depth" / "test_seq_5")


def test_a_damaged_line_is_named(made):
    path = made.path / "test_seq_1.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], lines[2].rsplit(" ", 3)[0]]))
    with pytest.raises(SessionError, match=r"Line 3 of .*test_seq_1\.txt is damaged"):
        open_session(made.path)
