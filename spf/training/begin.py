"""Begin a training where an exported network ended: its file has the weights, the norms folded into the convolutions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from spf.errors import SpfError
from spf.training.network import HandNetwork

__all__ = ["begin_from"]

_WITHOUT_EFFECT = {"attention.bias"}  # the same for all cells, which softmax does not see


@torch.no_grad()
def begin_from(network: HandNetwork, path: Path, crops: Tensor) -> None:
    """Give a network the weights of an exported one, so that it answers as that does.

    A folded convolution has the scale and the shift of the norm that followed it. Here the norm follows again: its
    convolution is scaled to channels of length 1, and the norm's scale and shift undo that and what it subtracts on some crops.

    Args:
        network: whose weights are replaced.
        path: the .onnx file of :func:`spf.training.export.export_network`.
        crops: (N, 1, S, S), some hundred samples.

    Raises:
        SpfError: if the file is of another network.
    """
    graph = onnx.load(str(path)).graph
    arrays = {item.name: torch.from_numpy(np.array(numpy_helper.to_array(item))) for item in graph.initializer}
    modules = dict(network.named_modules())
    kernels = {_module_of(node.name): node.input[1:3] for node in graph.node if node.op_type == "Conv"}
    norms = {name: norm for name in kernels if isinstance(norm := modules.get(_norm_after(name)), nn.BatchNorm2d)}
    of_norms = {f"{_norm_after(name)}.{part}" for name in norms for part in ("weight", "bias")}
    ours = dict(network.named_parameters())
    for name in ours.keys() - of_norms - _WITHOUT_EFFECT:
        convolution = name.removesuffix(".weight")
        source = kernels[convolution][0] if convolution in norms else name
        if source not in arrays or arrays[source].shape != ours[name].shape:
            raise SpfError(f"{path} is of another network: it has no {name} of shape {tuple(ours[name].shape)}.")
        ours[name].copy_(arrays[source])
    hooks = []
    for name, norm in norms.items():
        kernel, shift = (arrays[part] for part in kernels[name])
        lengths = kernel.flatten(1).norm(dim=1)
        ours[f"{name}.weight"].copy_(kernel / lengths[:, None, None, None])
        hooks.append(norm.register_forward_pre_hook(_undoing(lengths, shift)))
    was_training = network.training
    network.eval()
    network(crops)
    network.train(was_training)
    for hook in hooks:
        hook.remove()


def _module_of(node: str) -> str:
    """Name of the module that a node is of: "/a/a.1/a.1.0/Conv" is of a.1.0, "/a/a.2/convolution/Conv" of a.2.convolution."""
    name = ""
    for scope in node.strip("/").split("/")[:-1]:
        name = scope if scope.startswith(f"{name}.") else f"{name}.{scope}".strip(".")
    return name


def _norm_after(convolution: str) -> str:
    """Name of the norm after a convolution, if there is one."""
    before, _, last = convolution.rpartition(".")
    return f"{before}.{int(last) + 1}" if last.isdecimal() else f"{before}.norm" if last == "convolution" else ""


def _undoing(lengths: Tensor, shift: Tensor) -> Callable[[nn.Module, tuple[Any, ...]], None]:
    """Return what sets a norm, when it is about to see x, so that it gives ``lengths · x + shift``."""

    def set_norm(norm: nn.Module, inputs: tuple[Any, ...]) -> None:
        assert isinstance(norm, nn.BatchNorm2d)
        assert norm.running_mean is not None
        assert norm.running_var is not None
        variance, mean = torch.var_mean(inputs[0], dim=(0, 2, 3), correction=0)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_(lengths * torch.sqrt(variance + norm.eps))
        norm.bias.copy_(lengths * mean + shift)

    return set_norm
