"""The network and its loss."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from spf.learned import layout

__all__ = ["HandNetwork", "Losses", "loss_of", "rotation_of"]

_OTHERS = 0.05  # weight of the hypotheses that did not win
_ROTATION, _ANGLES, _SIZE, _CHOICE, _TOGETHER, _SIDE = 1.0, 4.0, 1.0, 0.3, 4.0, 3.0  # against the points' likelihood
_ANGLE_KNEE = 0.1  # rad under which the error of an angle counts squared
_LOG_SPREAD_RANGE = (-6.0, 0.0)

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
    """Crops (N, 1, 64, 64) → (N, OUTPUTS), see :mod:`spf.learned.layout`."""

    def __init__(self, widths: tuple[int, int, int] = (32, 64, 128), hidden: int = 320) -> None:
        super().__init__()
        a, b, c = widths
        self.body = nn.Sequential(
            nn.PixelUnshuffle(4),
            *(_convolution(16, a), _Residual(a)),
            *(_convolution(a, b, 2), _Residual(b)),
            *(_convolution(b, c, 2), _Residual(c)),
            nn.Flatten(),
            nn.Linear(16 * c, hidden),
            nn.ReLU(inplace=True),
        )
        self.head = nn.Linear(hidden, layout.OUTPUTS)
        with torch.no_grad():
            self.head.weight *= 0.3
            for k in range(layout.HYPOTHESES):
                bias = self.head.bias[k * layout.NUMBERS : (k + 1) * layout.NUMBERS]
                bias[layout.LOG_SPREADS] = -2.5
                bias[layout.ANGLES] = 0.4
                bias[layout.LOG_SIZE] = -0.3
                bias[layout.ROTATION] += torch.randn(6) * 0.5

    def forward(self, crops: Tensor) -> Tensor:
        """Return the numbers of layout for crops."""
        return self.head(self.body(crops))


def rotation_of(columns: Tensor) -> Tensor:
    """Orthonormalise two columns (…, 6) into rotations (…, 3, 3) (Gram–Schmidt)."""
    first = functional.normalize(columns[..., :3], dim=-1)
    second = columns[..., 3:] - (first * columns[..., 3:]).sum(-1, keepdim=True) * first
    second = functional.normalize(second, dim=-1)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)


def loss_of(outputs: Tensor, batch: tuple[Tensor, ...]) -> Losses:
    """Loss and its parts.

    A hypothesis costs ``mean(r/b + 3 log b)/3`` over its points, r the error in lengths of the hand (a Laplace density
    in space), a share of the plain error, ``‖R̂ − R‖²/2``, a smooth L1 of the angles, and of the log size. Per sample the best
    hypothesis gets nearly all the weight, and the logits learn which it was.

    Args:
        outputs: (N, OUTPUTS).
        batch: the tensors of :class:`~spf.training.generator.Batch` without the crops.
    """
    points, rotations, angles, log_sizes, present, right = batch
    raw = outputs[:, : layout.PRESENT].view(-1, layout.HYPOTHESES, layout.NUMBERS)
    unit = torch.exp(-log_sizes)[:, None, None]  # sides of the cube to lengths of the hand
    apart = raw[..., layout.POINTS].unflatten(-1, (22, 3)) - points[:, None]
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
    choice = functional.cross_entropy(raw[..., layout.LOGIT], best, reduction="none")
    valid = present * right
    count = valid.sum().clamp(min=1.0)
    pose = (((each * weights).sum(1) + _CHOICE * choice) * valid).sum() / count
    presence = functional.binary_cross_entropy_with_logits(outputs[:, layout.PRESENT], present)
    side = functional.binary_cross_entropy_with_logits(outputs[:, layout.RIGHT], right, weight=present)
    winner = errors.mean(-1).gather(1, best[:, None])[:, 0]
    top = errors.mean(-1).gather(1, raw[..., layout.LOGIT].argmax(1)[:, None])[:, 0]
    return {
        "loss": pose + presence + _SIDE * side,
        "best": (winner * valid).sum() / count,
        "top": (top * valid).sum() / count,
        "angles": (bent.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "turned": (turned.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "size": (sized.gather(1, best[:, None])[:, 0] * valid).sum() / count,
        "presence": presence,
        "side": side,
    }
