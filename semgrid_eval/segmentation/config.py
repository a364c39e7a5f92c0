"""How a segmentation network wants its image, and how its answer is to be read."""

from typing import Annotated, Literal

from pydantic import Field

from semgrid_eval.config import Config
from semgrid_eval.recording.png import MAX_PIXELS

Channels = tuple[float, float, float]
Spread = Annotated[float, Field(gt=0)]
Side = Annotated[int, Field(ge=1, le=MAX_PIXELS)]


class SegmentationConfig(Config):
    """What an ONNX file does not say of itself; defaults are ImageNet's."""

    mean: Annotated[Channels, Field(description="Of RGB in 0..1.")] = (0.485, 0.456, 0.406)
    std: Annotated[tuple[Spread, Spread, Spread], Field(description="Of RGB in 0..1.")] = (0.229, 0.224, 0.225)
    layout: Annotated[Literal["nchw", "nhwc"], Field(description="Order of the axes of image and scores.")] = "nchw"
    size: Annotated[
        tuple[Side, Side] | None, Field(description="Width and height for the network.  [default: the image's]")
    ] = None
    output: Annotated[str | None, Field(description="Which output of the model to read, where there are several.")] = (
        None
    )
    label_ids: Annotated[
        bool, Field(description="Classes are Cityscapes label ids (0..33) instead of the 19 train ids.")
    ] = False
    upsample: Annotated[Literal["bilinear", "nearest"], Field(description="How scores get the image's size.")] = (
        "bilinear"
    )
