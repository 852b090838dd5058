"""How the networks that learn from relit objects are fitted, `lamp_network_training` and
`shape_network_training`.

Adam with decoupled weight decay (I. Loshchilov and F. Hutter 2019, arXiv:1711.05101), a cosine of
steps after a rise, weights averaged.
"""

import argparse
import copy
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
import torch
from torch import nn

from training.networks.scene_classifier import follow

RATE, HEAD_RATE = 4e-4, 1e-3  # of an encoder that knows something, and of what is new
_DECAY, _WARM_UP, _SHOWN, _KEPT = 1e-2, 100, 100, 1000

Net = TypeVar("Net", bound=nn.Module)


def optimised(
    network: Net,
    encoder: nn.Module,
    batches: Iterator[Any],
    loss_of: Callable[[Net, Any], tuple[torch.Tensor, list[float]]],
    given: argparse.Namespace,
) -> Net:
    """The network after `given.steps` batches, its weights averaged over the last ones; every
    thousand steps those are kept as the output's name with .pt. `loss_of` gives the loss and the
    parts of it that are shown; all but the `encoder` learns at `HEAD_RATE`.
    """
    known = {id(weights) for weights in encoder.parameters()}
    heads = [weights for weights in network.parameters() if id(weights) not in known]
    rates = (RATE, HEAD_RATE)
    groups = [
        {"params": group, "lr": rate}
        for group, rate in zip((encoder.parameters(), heads), rates, strict=True)
    ]
    optimizer = torch.optim.AdamW(groups, weight_decay=_DECAY)
    average, shown, began = copy.deepcopy(network).eval(), np.zeros(1), time.time()
    for step in range(given.steps):
        share = min(1.0, (step + 1) / _WARM_UP) * 0.5 * (1 + math.cos(math.pi * step / given.steps))
        for group, full in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = share * full
        loss, parts = loss_of(network, next(batches))
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        follow(average, network, step)
        shown = 0.99 * shown + 0.01 * np.array(parts)
        if (step + 1) % _SHOWN == 0:
            told = ", ".join(f"{part:.4f}" for part in shown / (1 - 0.99 ** (step + 1)))
            print(
                f"step {step + 1} of {given.steps}, losses {told}, {time.time() - began:.0f} s",
                flush=True,
            )
        if (step + 1) % _KEPT == 0:
            torch.save(average.state_dict(), given.output.with_suffix(".pt"))
    return average
