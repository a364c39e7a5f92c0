"""How a segmentation network wants its image, and how its answer is to be read."""

from typing import Annotated, Literal

from pydantic import Field

from semgrid_eval.config import Config
from semgrid_eval.recording.png import MAX_PIXELS

Channels = tuple[float, float, float]
Spread = Annotated[float, Field(gt=0)]
Side = Annotated[int, Field(ge=1, le=MAX_PIXELS)]


class SegmentationConfig(Config):
    """What an ONNX file does not say of itself.

    Args:
        mean: of red, green and blue, between 0 and 1, taken off the image; default: ImageNet's.
        std: of red, green and blue, by which the image is then divided; default: ImageNet's.
        layout: order of the axes of the image and of the scores.
        size: (width, height) of the image for the network, where the model leaves it open; None: as the image is.
        output: name of the output to read; None: the only one.
        label_ids: the classes are Cityscapes label ids (0..33), not the 19 train ids.
        upsample: how scores of another size are brought to the image's size.
    """

    mean: Channels = (0.485, 0.456, 0.406)
    std: tuple[Spread, Spread, Spread] = (0.229, 0.224, 0.225)
    layout: Literal["nchw", "nhwc"] = "nchw"
    size: tuple[Side, Side] | None = None
    output: str | None = None
    label_ids: bool = False
    upsample: Literal["bilinear", "nearest"] = "bilinear"
