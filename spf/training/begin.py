"""Begin a training where an exported network ended: its file has the weights, the norms folded into the convolutions."""

from __future__ import annotations

from pathlib import Path

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
    folded = {  # node "/a/a.1/a.1.0/Conv" is module a.1.0, "/a/a.2/convolution/Conv" is a.2.convolution
        name: node.input[1:]
        for node in graph.node
        if node.op_type == "Conv"
        for name in [_module_of(node.name)]
        if name in modules and node.input[1] not in (f"{name}.weight",)
    }
    norms = {name: modules[_norm_after(name)] for name in folded}
    left = set(arrays) - {name for inputs in folded.values() for name in inputs}
    ours = dict(network.named_parameters())
    for name in sorted(set(ours) - _WITHOUT_EFFECT - _of(folded)):
        if name not in left or arrays[name].shape != ours[name].shape:
            raise SpfError(f"{path} is of another network: it has no {name} of shape {tuple(ours[name].shape)}.")
        ours[name].copy_(arrays[name])
    hooks = []
    for name, (kernel, shift) in folded.items():
        lengths = arrays[kernel].flatten(1).norm(dim=1)
        ours[f"{name}.weight"].copy_(arrays[kernel] / lengths[:, None, None, None])
        hooks.append(norms[name].register_forward_pre_hook(_undoing(lengths, arrays[shift])))
    was_training = network.training
    network.eval()
    network(crops)
    network.train(was_training)
    for hook in hooks:
        hook.remove()


def _module_of(node: str) -> str:
    """Return the name of the module that a node of the graph belongs to."""
    *scopes, _ = node.strip("/").split("/")
    name = ""
    for scope in scopes:
        name = scope if scope.startswith(f"{name}.") else f"{name}.{scope}".strip(".")
    return name


def _norm_after(convolution: str) -> str:
    before, last = convolution.rsplit(".", 1)
    return f"{before}.norm" if last == "convolution" else f"{before}.{int(last) + 1}"


def _of(folded: dict[str, object]) -> set[str]:
    """Names of the parameters of folded convolutions and their norms."""
    return {
        name
        for convolution in folded
        for name in (f"{convolution}.weight", f"{_norm_after(convolution)}.weight", f"{_norm_after(convolution)}.bias")
    }


def _undoing(lengths: Tensor, shift: Tensor) -> object:
    """Return what sets a norm, when it is about to see x, so that it gives ``lengths · x + shift``."""

    def set_norm(norm: nn.BatchNorm2d, inputs: tuple[Tensor]) -> None:
        variance, mean = torch.var_mean(inputs[0], dim=(0, 2, 3), correction=0)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_(lengths * torch.sqrt(variance + norm.eps))
        norm.bias.copy_(lengths * mean + shift)

    return set_norm
