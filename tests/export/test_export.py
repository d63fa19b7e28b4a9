"""A run as files: every value of the track, pictures with the hand in them, a film with all frames."""

import dataclasses

import cv2
import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest

from spf.errors import RunError, SettingError
from spf.export import VIEWS, write_film, write_hand, write_picture, write_table
from spf.hand.shape import SHAPE_PARAMETERS, read_hand_shape
from spf.trackfile import read_track
from tests.made_runs import LOST, WORST, made_run, made_session


@pytest.fixture(scope="module")
def session():
    return made_session()


@pytest.fixture(scope="module")
def run(session):
    return made_run(session)


def test_a_table_holds_the_track_in_both_formats(run, tmp_path):
    write_table(run.track, tmp_path / "track.csv")
    write_table(run.track, tmp_path / "track.parquet")
    text = pyarrow.csv.read_csv(tmp_path / "track.csv")
    binary = pyarrow.parquet.read_table(tmp_path / "track.parquet")
    assert text.column_names == binary.column_names
    assert text.column("joint_thumb_tip_z").to_pylist() == pytest.approx(run.track.joints[:, 4, 2].tolist())
    assert [text.column("ess")[i].as_py() for i in LOST] == [None, None]
    np.testing.assert_array_equal(read_track(tmp_path / "track.parquet").poses, run.track.poses)
    assert {path.name for path in tmp_path.iterdir()} == {"track.csv", "track.parquet"}


def test_a_hand_is_written_in_the_shape_of_a_frame(run, tmp_path):
    changes = np.zeros((len(run.track), len(SHAPE_PARAMETERS)))
    changes[3:, 0], changes[-1, 0] = 0.05, 0.1
    refined = run._replace(track=dataclasses.replace(run.track, shape_changes=changes))
    begun = run.plan.start.shape
    assert write_hand(refined, tmp_path / "hand.json") == run.track.frame[-1]
    assert read_hand_shape(tmp_path / "hand.json").scale == pytest.approx(begun.scale * np.exp(0.1))
    assert write_hand(refined, tmp_path / "hand.json", 0) == 0
    assert read_hand_shape(tmp_path / "hand.json") == begun
    lost = refined._replace(track=dataclasses.replace(run.track, lost=np.ones(len(run.track), bool)))
    with pytest.raises(RunError, match="held in no frame"):
        write_hand(lost, tmp_path / "other.json")
    assert {path.name for path in tmp_path.iterdir()} == {"hand.json"}


def test_another_ending_is_refused(run, session, tmp_path, renderer):
    with pytest.raises(RunError, match=r"\.csv or \.parquet"):
        write_table(run.track, tmp_path / "track.xls")
    with pytest.raises(SettingError, match=r"\.png or \.jpg"):
        write_picture(run, session, 0, tmp_path / "frame.gif", renderer)
    with pytest.raises(SettingError, match=r"\.mp4"):
        write_film(run, session, tmp_path / "run.avi", renderer)


def test_a_picture_shows_the_hand_from_the_side_that_is_asked_for(run, session, tmp_path, renderer):
    pictures = []
    for name in ("sensor", "side"):
        write_picture(run, session, 0, tmp_path / f"{name}.png", renderer, view=VIEWS[name], size=(320, 240))
        pictures.append(cv2.imread(str(tmp_path / f"{name}.png")).astype(int))
    assert pictures[0].shape == (240, 320, 3)
    for picture in pictures:  # a blue hand (BGR) in the middle
        hand = picture[..., 0] > picture[..., 2] + 25
        assert hand.mean() > 0.03
        assert np.abs(np.argwhere(hand).mean(axis=0) - [120, 160]).max() < 40
    assert np.abs(pictures[0] - pictures[1]).mean() > 3


def test_a_frame_that_was_not_tracked_has_no_picture(run, session, tmp_path, renderer):
    with pytest.raises(RunError, match="Frame 99 was not tracked: choose one of 0 to 7"):
        write_picture(run, session, 99, tmp_path / "frame.png", renderer)


def test_a_film_has_every_frame_and_shows_when_the_hand_is_lost(run, session, tmp_path, renderer):
    shares = []
    path = tmp_path / "run.mp4"
    write_film(run, session, path, renderer, height=192, progress=lambda _text, share: shares.append(share))
    video = cv2.VideoCapture(str(path))
    frames = [picture for _ in range(9) for ok, picture in [video.read()] if ok]
    assert len(frames) == len(run.track) == len(shares)
    assert shares[-1] == 1.0
    right = [frame[:192, 256:].astype(int) for frame in frames]
    blue = [(picture[..., 0] > picture[..., 2] + 25).mean() for picture in right]
    assert min(blue[i] for i in range(8) if i not in LOST) > 0.03
    assert max(blue[i] for i in LOST) < 0.01
    assert blue[WORST] > 0.03


def test_a_film_that_is_given_up_leaves_no_file(run, session, tmp_path, renderer):
    def give_up(_text, share):
        if share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(run, session, tmp_path / "run.mp4", renderer, height=96, progress=give_up)
    assert list(tmp_path.iterdir()) == []
