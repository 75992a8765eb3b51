import numpy as np
import pytest

from surfsup.viewing.pixel_box import PixelBox

SIZE = (320, 200)


def test_a_box_contains_the_pixels_and_their_margin_but_nothing_outside_the_picture():
    box = PixelBox.around(np.array([[100.5, 70.0], [130.0, 190.0]]), 4, SIZE)
    assert box.left <= 96 and box.right >= 134 and box.top <= 66 and box.bottom == 200
    assert box.size == (box.right - box.left, box.bottom - box.top)


@pytest.mark.parametrize("pixels", [np.empty((0, 2)), np.array([[-500.0, 20.0]]), np.array([[900.0, 900.0]])])
def test_a_box_is_never_empty_nor_outside(pixels):
    box = PixelBox.around(pixels, 2, SIZE)
    assert 0 <= box.left < box.right <= 320 and 0 <= box.top < box.bottom <= 200


def test_slices_pick_the_box_out_of_a_picture_and_of_its_samples():
    box = PixelBox(2, 4, 5, 9)
    assert np.zeros((10, 10))[box.slices()].shape == (2, 4)
    assert np.zeros((20, 20))[box.slices(2)].shape == (4, 8)
    assert box.union(PixelBox(0, 3, 7, 10)) == PixelBox(0, 4, 5, 10)
