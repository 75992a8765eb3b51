import numpy as np

from surfsup.viewing.label import label

PLAIN = np.full((120, 300, 3), 90, dtype=np.uint8)


def test_a_label_changes_only_the_upper_left_corner():
    labeled = label(PLAIN, "model")
    changed = (labeled != PLAIN).any(axis=-1)
    rows, columns = np.nonzero(changed)
    assert labeled.shape == PLAIN.shape
    assert rows.max() < 40
    assert columns.max() < 100
    assert labeled[changed].min() < 80  # text
    assert labeled[changed].max() > 150  # patch


def test_a_longer_text_has_a_wider_patch_of_the_same_height():
    short, long = ((label(PLAIN, text) != PLAIN).any(axis=-1) for text in ("a", "(a model)"))
    assert long.any(axis=0).sum() > short.any(axis=0).sum()
    assert long.any(axis=1).sum() == short.any(axis=1).sum()
