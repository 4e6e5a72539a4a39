"""Dark, noisy and blurred images are named, by what the tags in them look like."""

import numpy as np
import pytest
from test_detectors import photograph

from hero_localization.tracking.tag_pose import TagCorners
from hero_localization.tracking.tracker import ImageQuality

SQUARE = np.array(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)))


def list_texts(noise=0.0, **conditions):
    quality, random = ImageQuality(), np.random.RandomState(0)
    image = np.hstack([photograph(index, seed=index, **conditions) for index in range(5)])
    side_px = image.shape[0]
    centers = [((index + 0.5) * side_px, side_px / 2.0) for index in range(5)]
    tags = [TagCorners(index, 13.0 * SQUARE + center) for index, center in enumerate(centers)]
    quality.measure(np.clip(image + random.normal(0.0, noise, image.shape), 0, 255).astype(np.uint8), tags)
    return [text for text, _ in quality.list_problems(26.0)]


@pytest.mark.parametrize("conditions", [{}, {"gamma": 2.2}, {"blur_px": 1.1}, {"shade": 0.4}, {"noise": 5.0}])
def test_usual_images_are_good(conditions):
    assert list_texts(**conditions) == []


def test_what_spoils_images_is_named():
    (text,) = list_texts(noise=25.0)
    assert text.startswith("it is too dark, images are noisy (2")
    (text,) = list_texts(blur_px=2.0)
    assert text.startswith(("images are blurred by 1.", "images are blurred by 2."))


def test_images_without_tags_are_not_called_blurred():
    quality = ImageQuality()
    quality.measure(np.full((48, 64), 120, np.uint8), [])
    assert quality.list_problems(26.0) == []
