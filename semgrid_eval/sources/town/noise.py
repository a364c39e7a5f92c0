"""The imperfections of stereo disparity and of a segmentation network's labels, drawn frame by frame."""

from copy import copy
from dataclasses import dataclass
from statistics import NormalDist
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.labels import LABEL_ID

Float32s = NDArray[np.float32]
Labels = NDArray[np.uint8]
FULL_WIDTH_PX = 2048
_LABEL_WIDTH_PX = 512
# Smoothness of: displacement right, down; bad borders; confusion; mistakes.
_LABEL_FIELDS_PX = (2.5, 2.5, 6.0, 4.0, 7.0)
_NEVER = 9.0  # standard deviations that no field reaches
_MIDDLE_PX = 12.0  # disparity, of 2048, of 39 m: half way between near and far dropouts
_MISTAKES = {
    "road": (0.010, "sidewalk", "sidewalk"),
    "sidewalk": (0.07, "road", "terrain"),
    "building": (0.06, "vegetation", "wall"),
    "wall": (0.30, "building", "vegetation"),
    "fence": (0.30, "vegetation", "building"),
    "pole": (0.10, "building", "vegetation"),
    "traffic light": (0.10, "vegetation", "building"),
    "traffic sign": (0.10, "building", "vegetation"),
    "vegetation": (0.05, "building", "terrain"),
    "terrain": (0.20, "sidewalk", "vegetation"),
    "person": (0.03, "building", "rider"),
    "rider": (0.10, "person", "bicycle"),
    "car": (0.015, "truck", "building"),
    "truck": (0.15, "car", "bus"),
    "bus": (0.12, "truck", "building"),
    "bicycle": (0.06, "person", "building"),
}
"""Share of a label's area that networks take for another one, and for which two, one half each."""


@dataclass(frozen=True)
class DisparityNoise:
    """Errors of disparity; standard deviations are in pixels of a 2048 pixel wide image."""

    correlated_px: float = 0.28  # smooth over `correlation` of the image's width, new in each frame
    slow_px: float = 0.26  # likewise smooth, but carried from frame to frame with `persistence`
    white_px: float = 0.25  # of each pixel for itself
    correlation: float = 0.012  # standard deviation of the smoothing kernel as a share of the width
    persistence: float = 0.9  # share of the slow error, and of where mismatches are, that the next frame keeps
    mismatched: float = 0.010  # share of the image in patches that were matched to something else
    mismatch_px: float = 6.0  # standard deviation of the error there
    dropout: float = 0.04  # share of patches without disparity near the camera, and ...
    far_dropout: float = 0.18  # ... at an infinite distance, where a matching window holds more borders
    dropout_persistence: float = 0.7  # share of where dropouts are that the next frame keeps
    speckle: float = 0.015  # share of single pixels without disparity
    fattened: float = 0.6  # share of the borders at which the foreground spreads over the background
    sky: float = 0.45  # share of the sky that has a wrong, small disparity


@dataclass(frozen=True)
class LabelNoise:
    """Errors of labels; lengths are in pixels of a 512 pixel wide image."""

    warp_px: float = 0.35  # standard deviation of the borders' displacement
    border_px: float = 2.0  # how far from the true place a border may be in a bad patch
    bad_borders: float = 0.10  # share of the image in such patches
    confused_px: float = 8.0  # how far the labels of a patch of confusion may be from their true place
    confused: float = 0.004  # share of the image in such patches
    mistaken: float = 0.5  # factor on the shares of `_MISTAKES`, patches that get another label as a whole
    persistence: float = 0.7  # share of the borders' error fields that the next frame keeps; the rest flickers
    mistakes_persistence: float = 0.9  # likewise, of the patches with another label


class DisparityErrors:
    """Adds the errors of stereo matching to exact disparities, frame after frame; invalid is 0."""

    def __init__(self, noise: DisparityNoise, rng: np.random.Generator) -> None:
        self._noise = noise
        self._rng = rng
        self._slow: Float32s | None = None
        self._mismatch: Float32s | None = None
        self._dropout: Float32s | None = None

    def branched(self, rng: np.random.Generator) -> Self:
        """Return the same errors after the same frames, which go on by other random numbers."""
        branch = copy(self)  # fields are replaced and never changed
        branch._rng = rng
        return branch

    def add(self, exact_px: Float32s, frames: int = 1) -> Float32s:
        """Return the disparity (H, W) with errors of the frame that comes `frames` later, in pixels of its own width.

        What nobody asks for between is not drawn: an autoregressive sequence can go on by several frames at once.
        """
        noise, rng, shape = self._noise, self._rng, exact_px.shape
        sigma = noise.correlation * shape[1]
        self._slow = _carried(self._slow, _smooth_field(shape, sigma, rng), noise.persistence**frames)
        seen = _fattened(exact_px, noise.fattened, rng)
        error = noise.correlated_px * _smooth_field(shape, sigma, rng) + noise.slow_px * self._slow
        error += noise.white_px * rng.standard_normal(shape, np.float32)
        error += self._mismatch_px(shape, frames)
        noisy = np.asarray(seen + error * np.float32(shape[1] / FULL_WIDTH_PX), np.float32)
        fresh = _smooth_field(shape, 0.006 * shape[1], rng)
        self._dropout = _carried(self._dropout, fresh, noise.dropout_persistence**frames)
        lost = self._dropout > self._dropout_threshold(seen)
        lost |= rng.random(shape, np.float32) < noise.speckle
        noisy[lost | _is_occluded(seen) | (seen <= 0.0)] = 0.0
        _match_sky(noisy, exact_px, noise.sky, rng)
        return np.maximum(noisy, 0.0)

    def _mismatch_px(self, shape: tuple[int, ...], frames: int) -> Float32s:
        """Return the error (H, W) of patches that were matched to something else, 0 around them."""
        noise, sigma = self._noise, 0.008 * shape[1]
        persistence = noise.persistence**frames
        self._mismatch = _carried(self._mismatch, _smooth_field(shape, sigma, self._rng), persistence)
        error_px = np.float32(noise.mismatch_px) * _smooth_field(shape, 2.0 * sigma, self._rng)
        return np.where(self._mismatch > _threshold(noise.mismatched), error_px, np.float32(0.0))

    def _dropout_threshold(self, disparity_px: Float32s) -> Float32s:
        """Return what a Gaussian field exceeds (H, W) on the share of dropouts at each pixel's range."""
        near, far = _threshold(self._noise.dropout), _threshold(self._noise.far_dropout)
        middle_px = np.float32(_MIDDLE_PX * disparity_px.shape[1] / FULL_WIDTH_PX)
        return np.asarray(near + np.float32(far - near) * middle_px / (middle_px + disparity_px), np.float32)


class LabelErrors:
    """Adds the errors of a segmentation network to exact labels, frame after frame: bent borders, bad patches."""

    def __init__(self, noise: LabelNoise, rng: np.random.Generator) -> None:
        self._noise = noise
        self._rng = rng
        self._fields: list[Float32s | None] = [None] * len(_LABEL_FIELDS_PX)
        self._kept = (*[noise.persistence] * (len(_LABEL_FIELDS_PX) - 1), noise.mistakes_persistence)
        self._mistakes = _mistake_tables(noise.mistaken)

    def branched(self, rng: np.random.Generator) -> Self:
        """Return the same errors after the same frames, which go on by other random numbers."""
        branch = copy(self)  # fields are replaced and never changed
        branch._rng = rng
        return branch

    def add(self, exact: Labels, frames: int = 1) -> Labels:
        """Return the labels (H, W) with errors of the frame that comes `frames` later, as `DisparityErrors.add`."""
        noise, scale = self._noise, exact.shape[1] / _LABEL_WIDTH_PX
        fresh = [_smooth_field(exact.shape, sigma_px * scale, self._rng) for sigma_px in _LABEL_FIELDS_PX]
        kept = [persistence**frames for persistence in self._kept]
        fields = [_carried(*each) for each in zip(self._fields, fresh, kept, strict=True)]
        self._fields = list(fields)
        right, down, border, confusion, mistake = fields
        reach = np.full(exact.shape, noise.warp_px * scale, np.float32)
        reach[border > _threshold(noise.bad_borders)] = noise.border_px * scale
        reach[confusion > _threshold(noise.confused)] = noise.confused_px * scale
        rows, columns = np.indices(exact.shape, np.float32)
        places = (columns + reach * right, rows + reach * down)
        mode = cv2.BORDER_REPLICATE
        bent = np.asarray(cv2.remap(exact, *places, cv2.INTER_NEAREST, borderMode=mode), np.uint8)
        limit, high, low = self._mistakes
        rare = limit[bent]
        return np.where(mistake > rare, high[bent], np.where(mistake < -rare, low[bent], bent))


def _mistake_tables(factor: float) -> tuple[Float32s, Labels, Labels]:
    """Return tables (256,) by label: beyond what value of a field it is mistaken, and for what above and below."""
    limit, high = np.full(256, np.inf, np.float32), np.arange(256, dtype=np.uint8)
    low = high.copy()
    for name, (share, above, below) in _MISTAKES.items():
        label = LABEL_ID[name]
        limit[label], high[label], low[label] = _threshold(0.5 * factor * share), LABEL_ID[above], LABEL_ID[below]
    return limit, high, low


def _carried(old: Float32s | None, fresh: Float32s, persistence: float) -> Float32s:
    """Return the next field of an autoregressive sequence whose variance stays what it is."""
    if old is None:
        return fresh
    return np.float32(persistence) * old + np.float32((1.0 - persistence**2) ** 0.5) * fresh


def _smooth_field(shape: tuple[int, ...], sigma: float, rng: np.random.Generator) -> Float32s:
    """Return a Gaussian field (H, W) of unit variance, smooth over `sigma` pixels.

    It is drawn on a coarser lattice and interpolated, which costs a fraction of blurring at full size.
    """
    step = max(1, round(sigma))
    coarse = rng.standard_normal((shape[0] // step + 4, shape[1] // step + 4), np.float32)
    coarse = np.asarray(cv2.GaussianBlur(coarse, (0, 0), 1.0), np.float32)
    size = (coarse.shape[1] * step, coarse.shape[0] * step)
    fine = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)[step : step + shape[0], step : step + shape[1]]
    return np.asarray(fine / max(float(fine.std()), 1e-6), np.float32)


def _threshold(share: float) -> float:
    """Return the value that a Gaussian field exceeds on this share of its area."""
    if share >= 1.0:
        return -_NEVER
    return NormalDist().inv_cdf(1.0 - share) if share > 0.0 else _NEVER


def _fattened(disparity_px: Float32s, share: float, rng: np.random.Generator) -> Float32s:
    """Let the foreground spread over its border by half a matching window, in patches."""
    scale = disparity_px.shape[1] / 512
    kernel = np.ones((2 * round(scale) + 1, 4 * round(scale) + 1), np.uint8)
    spread = cv2.dilate(disparity_px, kernel)
    patches = _smooth_field(disparity_px.shape, 0.02 * disparity_px.shape[1], rng) < -_threshold(share)
    is_border = spread - disparity_px > 0.02 * spread + 0.25
    return np.where(patches & is_border, spread, disparity_px)


def _is_occluded(disparity_px: Float32s) -> NDArray[np.bool_]:
    """Return which points (H, W) of the left image something nearer hides from the right camera."""
    column_right = np.arange(disparity_px.shape[1], dtype=np.float32) - disparity_px
    nearest = np.minimum.accumulate(column_right[:, ::-1], axis=1)[:, ::-1]
    return nearest < column_right - np.float32(0.5)


def _match_sky(noisy_px: Float32s, exact_px: Float32s, share: float, rng: np.random.Generator) -> None:
    """Set a small disparity in patches of the sky, as matching does where there is nothing to match."""
    shape = exact_px.shape
    patches = (exact_px <= 0.0) & (_smooth_field(shape, 0.01 * shape[1], rng) > _threshold(share))
    wrong = np.abs(_smooth_field(shape, 0.02 * shape[1], rng)) * np.float32(2.0 * shape[1] / 512)
    noisy_px[patches] = wrong[patches]
