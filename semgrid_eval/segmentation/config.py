"""How a segmentation network wants its image, and how its answer is to be read."""

from typing import Annotated, Literal

from pydantic import Field

from semgrid_eval.config import Config

Channels = tuple[float, float, float]
Spread = Annotated[float, Field(gt=0)]
Side = Annotated[int, Field(ge=1)]
Resampling = Literal["bilinear", "nearest"]
_SIZE = "Width and height for the network.  [default: the image's]"
_OUTPUT = "Which output of the model to read, where there are several."
_CLASSES = (
    "What its classes are: cityscapes (19 train ids), cityscapes-ids (34 label ids), mapillary (65 or 66), "
    "ade20k (150), or a YAML file of your own."
)
_LAYOUT = "Order of the axes of image and scores; auto: channels come last where only the last axis is said to be 3."


class SegmentationConfig(Config):
    """What an ONNX file does not say of itself; defaults are ImageNet's."""

    mean: Annotated[Channels, Field(description="Of RGB in 0..1.")] = (0.485, 0.456, 0.406)
    std: Annotated[tuple[Spread, Spread, Spread], Field(description="Of RGB in 0..1.")] = (0.229, 0.224, 0.225)
    layout: Annotated[Literal["auto", "nchw", "nhwc"], Field(description=_LAYOUT)] = "auto"
    size: Annotated[tuple[Side, Side] | None, Field(description=_SIZE)] = None
    output: Annotated[str | None, Field(description=_OUTPUT)] = None
    classes: Annotated[str, Field(description=_CLASSES)] = "cityscapes"
    upsample: Annotated[Resampling, Field(description="How scores get the image's size.")] = "bilinear"
