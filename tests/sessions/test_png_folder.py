from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions import open_session
from tests.sessions.makers import make_png_folder


@pytest.fixture
def folder(tmp_path: Path, rng: np.random.Generator) -> Path:
    return make_png_folder(tmp_path / "images", rng).path


def rewrite_camera(folder: Path, **entries) -> None:
    values = {**json.loads((folder / "camera.json").read_text()), **entries}
    (folder / "camera.json").write_text(json.dumps(values))


def test_everything_that_a_camera_file_may_say(folder):
    rewrite_camera(
        folder, depth_unit=0.0005, fps=60, side="left", model="orthographic", sensor="my sensor", width=64, height=48
    )
    session = open_session(folder)
    assert session.camera == Camera(64, 48, 70.5, 71.0, 31.5, 23.5, "orthographic")
    assert (session.side, session.depth_unit, session.metadata) == ("left", 0.0005, {"sensor": "my sensor"})
    np.testing.assert_allclose(session.times, np.arange(12) / 60, atol=1e-9)


def test_counts_that_are_no_reading(folder):
    path = folder / "depth_0.png"
    raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    raw[0, :4] = 7, 65535, 601, 600
    cv2.imwrite(str(path), raw)
    assert open_session(folder).raw_depth(0)[0, :4].tolist() == [7, 65535, 601, 600]
    rewrite_camera(folder, no_reading=[7, 65535])
    assert open_session(folder).raw_depth(0)[0, :4].tolist() == [0, 0, 601, 600]
    rewrite_camera(folder, no_reading=[7], max_valid=600)
    assert open_session(folder).raw_depth(0)[0, :4].tolist() == [0, 0, 0, 600]


def test_a_camera_from_elsewhere(folder, tmp_path):
    expected = open_session(folder)
    (folder / "camera.json").rename(tmp_path / "elsewhere.json")
    with pytest.raises(SessionError, match=r'no camera file .*camera\.json: write one like \{"fx"'):
        open_session(folder)
    for camera in (tmp_path / "elsewhere.json", str(tmp_path / "elsewhere.json"), expected.camera):
        assert open_session(folder, camera=camera).fingerprint() == expected.fingerprint()
    with pytest.raises(SessionError, match=r"no camera file .*gone\.json"):
        open_session(folder, camera=tmp_path / "gone.json")


def test_the_example_that_is_shown_is_enough(tmp_path, folder):
    (folder / "camera.json").unlink()
    with pytest.raises(SessionError) as caught:
        open_session(folder)
    example = str(caught.value).partition("write one like ")[2].partition("}")[0] + "}"
    (folder / "camera.json").write_text(example)
    assert len(open_session(folder)) == 12


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "no JSON"),
        ("[1, 2]", "no JSON object"),
        ('{"fx": 1, "fy": 1}', "lacks cx, cy"),
        ('{"fx": -1, "fy": 1, "cx": 1, "cy": 1}', "fx is -1: it should be a positive number"),
        ('{"fx": NaN, "fy": 1, "cx": 1, "cy": 1}', "fx is NaN"),
        ('{"fx": "1", "fy": 1, "cx": 1, "cy": 1}', 'fx is "1"'),
        ('{"fx": true, "fy": 1, "cx": 1, "cy": 1}', "fx is true"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": null}', "cy is null"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "depth_unit": 0}', "depth_unit is 0"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "depth_scale": 1}', "unknown entry 'depth_scale'"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "side": "both"}', 'side is "both": it should be "left" or "right"'),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "model": "fisheye"}', "model is"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 63.5}', "width is 63.5"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "no_reading": 0}', "a list of counts"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "max_valid": 70000}', "max_valid is 70000"),
        ('{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 32}', "64×48, but the camera given is 32×48:"),
    ],
)
def test_a_wrong_camera_file_is_told(folder, text, said):
    (folder / "camera.json").write_text(text)
    with pytest.raises(SessionError, match=said):
        open_session(folder)


@pytest.mark.parametrize(("factor", "depth_unit"), [(0.001, 0.001), (0.1, 0.001), (1, 1.0), (100, 0.001), (1, 0.00001)])
def test_depth_in_the_wrong_unit_is_told(folder, factor, depth_unit):
    rewrite_camera(folder, depth_unit=depth_unit)
    for path in folder.glob("*.png"):
        raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), np.ceil(raw * factor).clip(0, 65535).astype(np.uint16))
    with pytest.raises(SessionError, match=r"depth in the wrong unit: with .* m a count.*set depth_unit"):
        open_session(folder)


def test_the_right_unit_is_enough(folder):
    for path in folder.glob("*.png"):
        cv2.imwrite(str(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED) * 100)
    rewrite_camera(folder, depth_unit=0.00001)
    assert 0.3 <= open_session(folder)[0].depth.max() <= 0.6


def test_images_without_any_reading_are_told(folder):
    for path in folder.glob("*.png"):
        cv2.imwrite(str(path), np.zeros((48, 64), np.uint16))
    with pytest.raises(SessionError, match="no depth reading in the 5 frames"):
        open_session(folder)


def test_an_image_of_another_size_is_named(folder):
    cv2.imwrite(str(folder / "depth_7.png"), np.full((48, 60), 400, np.uint16))
    with pytest.raises(SessionError, match=r"depth_7\.png is 60×48, but depth_0\.png is 64×48"):
        open_session(folder)


def test_an_empty_image_is_named(folder):
    (folder / "depth_7.png").write_bytes(b"")
    with pytest.raises(SessionError, match=r"depth_7\.png is empty"):
        open_session(folder)


def test_a_torn_image_is_named_when_it_is_read(folder):
    path = folder / "depth_7.png"
    path.write_bytes(path.read_bytes()[:-30])
    session = open_session(folder)
    with pytest.raises(SessionError, match=r"depth_7\.png is torn"):
        session[7]
    with pytest.raises(SessionError, match=r"depth_7\.png is torn"):
        session.fingerprint()
    assert session[6].depth.any()


def test_an_image_that_changes_its_size_while_open_is_named(folder):
    session = open_session(folder)
    cv2.imwrite(str(folder / "depth_7.png"), np.full((10, 10), 400, np.uint16))
    with pytest.raises(SessionError, match=r"depth_7\.png is 10×10"):
        session[7]


@pytest.mark.parametrize("image", [np.full((48, 64), 40, np.uint8), np.full((48, 64, 3), 40, np.uint8)])
def test_images_that_are_no_depth_are_named(folder, image):
    for path in folder.glob("*.png"):
        cv2.imwrite(str(path), image)
    with pytest.raises(SessionError, match=r"depth_0\.png is a 64×48 8-bit .* PNG, not a 16-bit grey PNG"):
        open_session(folder)
