"""RVL against bytes worked out by hand, an encoder written from the paper, and damage."""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spf.sessions.rvl import decode_rvl
from tests.reference.rvl import encode_rvl

# 2 zeros, 2 others, +5 as 10 = 012 in octal, -1 as 1, 1 zero, 0 others: nibbles 2 2 a 1 1 1 0, one of padding.
STEPS = struct.pack("<II", 5, 1) + bytes.fromhex("0011a122")
# No zero, 1 other, +65535 as 131070 = 377776 in octal.
LARGEST = struct.pack("<II", 1, 1) + bytes.fromhex("f3ffef01")


def test_bytes_worked_out_by_hand():
    assert decode_rvl(STEPS).tolist() == [[0, 0, 5, 4, 0]]
    assert decode_rvl(LARGEST).tolist() == [[65535]]
    assert encode_rvl(np.array([[0, 0, 5, 4, 0]])) == STEPS
    assert encode_rvl(np.array([[65535]])) == LARGEST


images = st.tuples(st.integers(1, 12), st.integers(1, 12)).flatmap(
    lambda shape: arrays(np.uint16, shape, elements=st.sampled_from([0, 0, 0, 1, 2, 500, 501, 65534, 65535]))
)


@given(images)
def test_images_come_back(image):
    np.testing.assert_array_equal(decode_rvl(encode_rvl(image)), image)


@given(images, st.data())
def test_damage_is_told_or_gives_an_image(image, data):
    code = bytearray(encode_rvl(image))
    for _ in range(data.draw(st.integers(1, 4))):
        code[data.draw(st.integers(8, len(code) - 1))] = data.draw(st.integers(0, 255))
    with suppress(ValueError):
        assert decode_rvl(bytes(code)).shape == image.shape


@pytest.mark.parametrize(
    "code",
    [
        b"",
        STEPS[:8],  # nothing behind the size
        STEPS[:10],
        struct.pack("<II", 0, 5) + STEPS[8:],
        struct.pack("<II", 2**16, 2**16) + STEPS[8:],
        struct.pack("<II", 3, 1) + STEPS[8:],  # more pixels than the image has
        struct.pack("<II", 9, 1) + STEPS[8:],  # fewer
        struct.pack("<III", 5, 1, 0x01100000),  # a depth of -1
        struct.pack("<III", 5, 1, 0xFFFFFFFF),  # a number that does not end
        struct.pack("<IIII", 5, 1, 0xFFFFFFFF, 0xFFFFFFFF),  # or not soon enough
    ],
)
def test_what_cannot_be_is_refused(code):
    with pytest.raises((ValueError, struct.error)):
        decode_rvl(code)
