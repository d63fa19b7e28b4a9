from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions.png import png_header, read_colour_png, read_depth_png, read_packed_depth_png


@pytest.fixture
def depth(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(0, 65536, (48, 64), dtype=np.uint16)


@pytest.fixture
def path(tmp_path: Path, depth: np.ndarray) -> Path:
    cv2.imwrite(str(tmp_path / "depth.png"), depth)
    return tmp_path / "depth.png"


def test_reads_all_sixteen_bits(path, depth):
    read = read_depth_png(path)
    assert read.dtype == np.uint16
    np.testing.assert_array_equal(read, depth)


def test_header_without_pixels(path):
    header = png_header(path)
    assert (header.width, header.height, header.bits) == (64, 48, 16)
    assert str(header) == "64×48 16-bit grey PNG"


def test_colour_is_rgb(tmp_path, rng):
    rgb = rng.integers(0, 256, (10, 12, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "rgb.png"), rgb[..., ::-1])
    np.testing.assert_array_equal(read_colour_png(tmp_path / "rgb.png"), rgb)


def test_packed_depth_is_green_and_blue(tmp_path, depth):
    bgr = np.stack([depth & 255, depth >> 8, depth * 0 + 7], axis=-1).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "packed.png"), bgr)
    np.testing.assert_array_equal(read_packed_depth_png(tmp_path / "packed.png"), depth)


@pytest.mark.parametrize("kept", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_torn_image_is_named(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(SessionError, match=r"depth\.png.*(empty|torn|not a PNG)"):
        read_depth_png(path)


def test_a_flipped_bit_is_noticed(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(SessionError, match="torn"):
        read_depth_png(path)


def test_missing_image_is_named(tmp_path):
    with pytest.raises(SessionError, match=r"gone\.png cannot be read"):
        read_depth_png(tmp_path / "gone.png")


@pytest.mark.parametrize(
    ("image", "said"),
    [(np.ones((4, 5), np.uint8), "8-bit grey"), (np.ones((4, 5, 3), np.uint8), "8-bit colour")],
)
def test_images_that_are_no_depth_are_named(tmp_path, image, said):
    cv2.imwrite(str(tmp_path / "other.png"), image)
    with pytest.raises(SessionError, match=f"other.png is a 5×4 {said} PNG, not a 16-bit"):
        read_depth_png(tmp_path / "other.png")
