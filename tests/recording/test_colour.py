import io

import numpy as np
import pytest
from PIL import Image

from semgrid_eval.errors import InputError
from semgrid_eval.recording.colour import ImageSize, decode_colour, kind_of, read_size, require_whole


def photo(mode="RGB", kind="JPEG", size=(40, 24)):
    """A file of an image that is green on the left and red on the right, and noisy."""
    pixels = np.random.default_rng(3).integers(0, 60, (size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2, 1] = 200
    pixels[:, size[0] // 2 :, 0] = 200
    file = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(file, kind)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_both_kinds_have_size_and_pixels(kind):
    data = photo(kind=kind)
    assert kind_of(data) == kind.lower()
    assert read_size(data) == require_whole(data) == ImageSize(40, 24)
    pixels = decode_colour(data)
    assert pixels.shape == (24, 40, 3)
    assert (pixels[:, :16, 1] > 150).all()
    assert (pixels[:, 24:, 0] > 150).all()


def test_gray_is_repeated():
    pixels = decode_colour(photo("L"))
    assert (pixels[..., 0] == pixels[..., 2]).all()


@pytest.mark.parametrize("end", [4, 30, -200])
def test_a_jpeg_file_that_ends_early_is_refused(end):
    with pytest.raises(InputError, match="is a damaged JPEG file"):
        require_whole(photo()[:end])


def test_inks_are_refused():
    with pytest.raises(InputError, match="is a JPEG file in CMYK; colour or gray is needed"):
        require_whole(photo("CMYK"))


def test_a_size_is_written_as_width_and_height():
    assert f"{ImageSize(width=320, height=96)}" == "320 x 96"
