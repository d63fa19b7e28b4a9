"""The network and its loss."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from spf.learned import layout

__all__ = ["HandNetwork", "Losses", "loss_of", "rotation_of"]

_OTHERS = 0.05  # weight of the hypotheses that did not win
# Weights against the likelihood of the points.
_ROTATION, _ANGLES, _SIZE, _CHOICE, _TOGETHER, _PLACE, _SIDE, _MIRRORED = 1.0, 4.0, 1.0, 0.3, 4.0, 4.0, 3.0, 0.3
_ANGLE_KNEE = 0.1  # rad under which the error of an angle counts squared
_LOG_SPREAD_RANGE = (-6.0, 0.0)
_CELL, _CELLS = 4, layout.CROP_SIZE // 4  # pixels along a side of a cell, cells along a side of the crop
_POINTS = layout.HYPOTHESES * 22
_REST = layout.NUMBERS - layout.ROTATION.start  # numbers of a hypothesis that are not of its points

Losses = dict[str, Tensor]


def _convolution(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


class _Residual(nn.Module):
    """``relu(x + bn(conv(x)))``: one convolution, for they are what costs."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(channels, channels, 3, 1, 1, bias=False)
        self.norm = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.norm(self.convolution(x)), inplace=True)


class HandNetwork(nn.Module):
    """Crops (N, 1, 64, 64) → (N, OUTPUTS), see :mod:`spf.learned.layout`.

    Features at 16×16 cells know their surroundings from 8×8 and 4×4 cells. Every point of every hypothesis attends to
    cells: it lies where they lie on the average, as deep as the surface that they show, plus an offset that is linear in
    their mean features and in a description of the whole crop.
    """

    places: Tensor

    def __init__(self, widths: tuple[int, int, int] = (32, 64, 128), whole: int = 192, own: int = 12) -> None:
        super().__init__()
        a, b, c = widths
        self.own = own
        self.fine = nn.Sequential(nn.PixelUnshuffle(_CELL), _convolution(_CELL**2, a), _Residual(a))
        self.middle = nn.Sequential(_convolution(a, b, 2), _Residual(b))
        self.coarse = nn.Sequential(_convolution(b, c, 2), _Residual(c), _Residual(c))
        self.whole = nn.Sequential(nn.Flatten(), nn.Linear(16 * c, whole), nn.ReLU(inplace=True))
        self.to_middle = _Merge(b, c)
        self.to_fine = _Merge(a, b)
        self.described = nn.Linear(whole, b)
        self.attention = nn.Linear(a, _POINTS)
        self.offsets = nn.Parameter(torch.randn(_POINTS, a + b, 4 + own) * 0.3 / math.sqrt(a + b))
        self.offsets_of_whole = nn.Linear(whole, _POINTS * 4)
        self.rest_of_points = nn.Parameter(torch.randn(layout.HYPOTHESES, 22 * own, _REST) * 0.3 / math.sqrt(22 * own))
        self.rest = nn.Linear(whole, layout.HYPOTHESES * _REST)
        self.of_crop = nn.Linear(whole, layout.OUTPUTS - layout.PRESENT)
        self._begin()
        steps = (torch.arange(_CELLS) + 0.5) / _CELLS - 0.5
        down, right = torch.meshgrid(steps, steps, indexing="ij")
        self.register_buffer("places", torch.stack([right, down], dim=-1).view(_CELLS**2, 2), persistent=False)

    @torch.no_grad()
    def _begin(self) -> None:
        """Begin near what is usual, and with hypotheses that differ."""
        self.offsets_of_whole.weight *= 0.3
        bias = self.offsets_of_whole.bias.view(_POINTS, 4)
        bias[:, :3] = torch.randn(_POINTS, 3) * 0.02
        bias[:, 3] = -2.5
        self.rest.weight *= 0.3
        bias = self.rest.bias.view(layout.HYPOTHESES, _REST)
        start = layout.ROTATION.start
        bias[:, layout.ANGLES.start - start : layout.ANGLES.stop - start] = 0.4
        bias[:, layout.LOG_SIZE - start] = -0.3
        bias[:, : layout.ANGLES.start - start] += torch.randn(layout.HYPOTHESES, 6) * 0.5

    def forward(self, crops: Tensor) -> Tensor:
        """Return the numbers of layout for crops."""
        return self.look(crops)[0]

    def look(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """Return the numbers, and where in the crop each point's attention is, (N, H, 22, 2), in sides of the crop."""
        fine = self.fine(crops)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        whole = self.whole(coarse)
        middle = self.to_middle(middle, coarse, self.described(whole)[:, :, None, None])
        fine = self.to_fine(fine, middle)
        places, numbers, own = self._points(crops, fine, middle, whole)
        own = functional.relu(own).reshape(-1, layout.HYPOTHESES, 22 * self.own).transpose(0, 1)
        rest = (own @ self.rest_of_points).transpose(0, 1) + self.rest(whole).view(-1, layout.HYPOTHESES, _REST)
        points = numbers[..., :3].reshape(-1, layout.HYPOTHESES, 66)
        log_spreads = numbers[..., 3].reshape(-1, layout.HYPOTHESES, 22)
        numbers = torch.cat([torch.cat([points, log_spreads, rest], dim=-1).flatten(1), self.of_crop(whole)], dim=1)
        return numbers, places.view(-1, layout.HYPOTHESES, 22, 2)

    def _points(self, crops: Tensor, fine: Tensor, middle: Tensor, whole: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return places (N, H·22, 2), points and log spreads (N, H·22, 4), and what else cells say of points (N, H·22, own)."""
        cells = _cells(fine)
        attention = (self.attention.weight @ cells.transpose(1, 2) + self.attention.bias[:, None]).softmax(-1)
        wide = attention.view(-1, _POINTS, _CELLS // 2, 2, _CELLS // 2, 2).sum((3, 5)).flatten(2)
        seen = torch.cat([attention @ cells, wide @ _cells(middle)], dim=-1)
        said = (seen.transpose(0, 1) @ self.offsets).transpose(0, 1)
        there = (crops < 1.0).to(crops.dtype)
        surface = functional.avg_pool2d(torch.cat([0.5 * crops * there, there], dim=1), _CELL)
        deep = attention @ _cells(surface)
        depth = deep[..., :1] / (deep[..., 1:] + 0.02)
        places = attention @ self.places
        base = torch.cat([places, depth, torch.zeros_like(depth)], dim=-1)
        numbers = base + said[..., :4] + self.offsets_of_whole(whole).view(-1, _POINTS, 4)
        return places, numbers, said[..., 4:]


class _Merge(nn.Module):
    """``relu(bn(conv(fine)) + coarse twice as large + more)``."""

    def __init__(self, channels: int, coarser: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(channels, channels, 3, 1, 1, bias=False)
        self.norm = nn.BatchNorm2d(channels)
        self.down = nn.Conv2d(coarser, channels, 1)

    def forward(self, fine: Tensor, coarse: Tensor, more: Tensor | float = 0.0) -> Tensor:
        larger = functional.interpolate(self.down(coarse) + more, scale_factor=2.0, mode="nearest")
        return functional.relu(self.norm(self.convolution(fine)) + larger)


def _cells(features: Tensor) -> Tensor:
    """(N, C, S, S) → (N, S², C)."""
    return features.flatten(2).transpose(1, 2)


def rotation_of(columns: Tensor) -> Tensor:
    """Orthonormalise two columns (…, 6) into rotations (…, 3, 3) (Gram–Schmidt)."""
    first = functional.normalize(columns[..., :3], dim=-1)
    second = columns[..., 3:] - (first * columns[..., 3:]).sum(-1, keepdim=True) * first
    second = functional.normalize(second, dim=-1)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)


def loss_of(outputs: Tensor, places: Tensor, batch: tuple[Tensor, ...]) -> Losses:
    """Loss and its parts.

    A hypothesis costs ``mean(r/b + 3 log b)/3`` over its points, r the error in lengths of the hand (a Laplace density
    in space), a share of the plain error, ``‖R̂ − R‖²/2``, a smooth L1 of the angles, and of the log size. Per sample the best
    hypothesis gets nearly all the weight, and the logits learn which it was. Of left hands only the spreads learn: how far
    a right hand is from what is seen.

    Args:
        outputs: (N, OUTPUTS).
        places: (N, H, 22, 2) of the attention, which is drawn to where the points are in the crop.
        batch: the tensors of :class:`~spf.training.generator.Batch` without the crops.
    """
    points, rotations, angles, perspectives, log_sizes, present, right = batch
    raw = outputs[:, : layout.PRESENT].view(-1, layout.HYPOTHESES, layout.NUMBERS)
    unit = torch.exp(-log_sizes)[:, None, None]  # sides of the cube to lengths of the hand
    found = raw[..., layout.POINTS].unflatten(-1, (22, 3))
    away = 1.0 + found[..., 2:] * perspectives[:, None, None, None]
    apart = torch.cat([found[..., :2] * away, found[..., 2:]], dim=-1) - points[:, None]
    errors = torch.sqrt((apart**2).sum(-1) + 1e-10) * unit
    log_spreads = raw[..., layout.LOG_SPREADS].clamp(*_LOG_SPREAD_RANGE) - log_sizes[:, None, None]
    likelihood = (errors * torch.exp(-log_spreads) / 3.0 + log_spreads).mean(-1)
    turned = ((rotation_of(raw[..., layout.ROTATION]) - rotations[:, None]) ** 2).sum((-1, -2)) / 2.0
    bent = functional.smooth_l1_loss(
        raw[..., layout.ANGLES], angles[:, None].expand(-1, layout.HYPOTHESES, -1), beta=_ANGLE_KNEE, reduction="none"
    ).mean(-1)
    sized = functional.smooth_l1_loss(
        raw[..., layout.LOG_SIZE], log_sizes[:, None].expand(-1, layout.HYPOTHESES), beta=0.05, reduction="none"
    )
    each = likelihood + _TOGETHER * errors.mean(-1) + _ROTATION * turned + _ANGLES * bent + _SIZE * sized
    best = each.detach().argmin(1)
    weights = torch.full_like(each, _OTHERS / (layout.HYPOTHESES - 1)).scatter_(1, best[:, None], 1.0 - _OTHERS)
    shown = (points[..., :2] / (1.0 + points[..., 2:] * perspectives[:, None, None])).clamp(-0.47, 0.47)
    beside = torch.linalg.vector_norm(places - shown[:, None], dim=-1).mean(-1)
    each = each + _PLACE * beside
    choice = functional.cross_entropy(raw[..., layout.LOGIT], best, reduction="none")
    valid = present * right
    count = valid.sum().clamp(min=1.0)
    pose = (((each * weights).sum(1) + _CHOICE * choice) * valid).sum() / count
    left = present * (1.0 - right)
    unsure = (errors.detach() * torch.exp(-log_spreads) / 3.0 + log_spreads).mean((-1, -2))
    mirrored = (unsure * left).sum() / left.sum().clamp(min=1.0)
    presence = functional.binary_cross_entropy_with_logits(outputs[:, layout.PRESENT], present)
    side = functional.binary_cross_entropy_with_logits(outputs[:, layout.RIGHT], right, weight=present)
    winner = errors.mean(-1).gather(1, best[:, None])[:, 0]
    top = errors.mean(-1).gather(1, raw[..., layout.LOGIT].argmax(1)[:, None])[:, 0]
    return {
        "loss": pose + presence + _SIDE * side + _MIRRORED * mirrored,
        "best": (winner * valid).sum() / count,
        "top": (top * valid).sum() / count,
        "angles": (bent.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "turned": (turned.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "size": (sized.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "presence": presence,
        "side": side,
    }
