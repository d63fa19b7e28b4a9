"""Train the network: ``python -m spf.training.train -o RUN --samples 3000000``.

Seeded, and resumed from the run's last checkpoint when it is started again; ``--begin FILE.onnx`` begins with the weights of
another run's network. Samples are made in a second thread while
the first learns; both together take little more than one core. Every few minutes the averaged weights are exported
to ``RUN/hand-proposal.onnx`` with a JSON beside it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path

import torch
from torch import Tensor

from spf.training.begin import begin_from
from spf.training.export import export_network
from spf.training.generator import Batch, Generator
from spf.training.network import HandNetwork, Losses, loss_of

__all__ = ["Plan", "Trainer", "batches", "main"]


@dataclass(frozen=True)
class Plan:
    """How to train; everything that the result depends on.

    Attributes:
        samples: how many in all.
        batch: how many a step.
        seed: of the weights and the samples.
        shapes: how many different hands.
        rate: highest learning rate (AdamW; a cosine from a short warm-up to 1 % of it).
        decay: weight decay.
        average: decay of the average of the weights a step.
        begun_from: SHA-256 of the network whose weights it began with; none: with random ones.
    """

    samples: int = 3_000_000
    batch: int = 64
    seed: int = 0
    shapes: int = 400
    rate: float = 3e-3
    decay: float = 1e-4
    average: float = 0.999
    begun_from: str | None = None

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.samples // self.batch


class Trainer:
    """The state of a training: weights, their average, optimiser and the step reached."""

    def __init__(self, plan: Plan) -> None:
        torch.manual_seed(plan.seed)
        self.plan, self.step = plan, 0
        self.network, self.averaged = HandNetwork(), HandNetwork()
        self.averaged.load_state_dict(self.network.state_dict())
        self.network.to(memory_format=torch.channels_last)  # a third faster
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), lr=plan.rate, weight_decay=plan.decay, betas=(0.9, 0.98), fused=True
        )

    def rate(self) -> float:
        """Learning rate of the current step."""
        warm = min(1.0, (self.step + 1) / 300)
        done = min(self.step / max(self.plan.steps, 1), 1.0)
        return self.plan.rate * warm * (0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * done)))

    def learn(self, batch: tuple[Tensor, ...]) -> Losses:
        """Take one step on a batch: crops, then the answers."""
        self.network.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate()
        losses = loss_of(*self.network.look(batch[0].contiguous(memory_format=torch.channels_last)), batch[1:])
        self.optimiser.zero_grad(set_to_none=True)
        losses["loss"].backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimiser.step()
        self.step += 1
        self._average()
        return {name: value.detach() for name, value in losses.items()}

    @torch.no_grad()
    def _average(self) -> None:
        keep = min(self.plan.average, (self.step + 1) / (self.step + 10))
        ours: list[Tensor] = list(self.averaged.parameters())
        theirs: list[Tensor] = list(self.network.parameters())
        torch._foreach_lerp_(ours, theirs, 1.0 - keep)
        for mine, its in zip(self.averaged.buffers(), self.network.buffers(), strict=True):
            mine.copy_(its)

    def save(self, path: Path) -> None:
        """Write a checkpoint; a torn write leaves the last one whole."""
        state = {
            "plan": asdict(self.plan),
            "step": self.step,
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(),
        }
        torch.save(state, path.with_suffix(".new"))
        path.with_suffix(".new").replace(path)

    @classmethod
    def load(cls, path: Path) -> Trainer:
        """Go on from a checkpoint."""
        state = torch.load(path, weights_only=True)
        trainer = cls(Plan(**state["plan"]))
        trainer.step = state["step"]
        trainer.network.load_state_dict(state["network"])
        trainer.averaged.load_state_dict(state["averaged"])
        trainer.optimiser.load_state_dict(state["optimiser"])
        return trainer


def begun(plan: Plan, network: Path | None) -> Trainer:
    """Return a trainer at its first step, with random weights or those of an exported network."""
    if network is None:
        return Trainer(plan)
    trainer = Trainer(replace(plan, begun_from=hashlib.sha256(network.read_bytes()).hexdigest()))
    crops = tensors(Generator(plan.seed, plan.shapes).batch(plan.steps, 512))[0]
    begin_from(trainer.network, network, crops)
    trainer.averaged.load_state_dict(trainer.network.state_dict())
    return trainer


def tensors(batch: Batch) -> tuple[Tensor, ...]:
    """Return a batch as tensors, the crops (N, 1, S, S)."""
    return torch.from_numpy(batch.crops)[:, None], *(torch.from_numpy(array) for array in batch[1:])


def batches(generator: Generator, first: int, size: int) -> Iterator[tuple[Tensor, ...]]:
    """Yield batches from number ``first`` on, made ahead in another thread; batch n depends on nothing but n."""
    with ThreadPoolExecutor(1) as maker:
        ahead = deque(maker.submit(generator.batch, first + i, size) for i in range(2))
        for number in count(first):
            new = ahead.popleft().result()
            ahead.append(maker.submit(generator.batch, number + 2, size))
            yield tensors(new)


def train(trainer: Trainer, folder: Path, minutes_between_exports: float) -> None:
    """Train to the end of the plan, writing checkpoints, exports and ``log.jsonl`` into a folder."""
    plan = trainer.plan
    generator = Generator(plan.seed, plan.shapes)
    recent: dict[str, float] = {}
    started, exported, first = time.monotonic(), time.monotonic(), trainer.step
    for batch in batches(generator, trainer.step, plan.batch):
        for name, value in trainer.learn(batch).items():
            recent[name] = recent.get(name, float(value)) * 0.99 + 0.01 * float(value)
        if trainer.step % 200 == 0:
            pace = (time.monotonic() - started) / ((trainer.step - first) * plan.batch)
            line = {"step": trainer.step, "samples": trainer.step * plan.batch, "ms_a_sample": round(1e3 * pace, 3)}
            line |= {"minutes_left": round((plan.steps - trainer.step) * plan.batch * pace / 60, 1)}
            line |= {name: round(value, 4) for name, value in recent.items()}
            print(json.dumps(line), flush=True)
            with (folder / "log.jsonl").open("a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")
        done = trainer.step >= plan.steps
        if done or time.monotonic() - exported > 60.0 * minutes_between_exports:
            trainer.save(folder / "checkpoint.pt")
            export_network(trainer.averaged, folder, {**asdict(plan), "samples_seen": trainer.step * plan.batch})
            exported = time.monotonic()
        if done:
            return


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of the run; resumed when it has a checkpoint"
    )
    parser.add_argument("--samples", type=int, help="in all; of a resumed run, a new end of its plan")
    parser.add_argument("--seed", type=int, default=Plan.seed)
    parser.add_argument("--batch", type=int, default=Plan.batch)
    parser.add_argument("--shapes", type=int, default=Plan.shapes)
    parser.add_argument("--rate", type=float, default=Plan.rate, help="highest learning rate")
    parser.add_argument("--begin", type=Path, metavar="FILE.onnx", help="begin with the weights of this network")
    parser.add_argument("--export-minutes", type=float, default=5.0)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.output.mkdir(parents=True, exist_ok=True)
    checkpoint = options.output / "checkpoint.pt"
    plan = Plan(batch=options.batch, seed=options.seed, shapes=options.shapes, rate=options.rate)
    trainer = Trainer.load(checkpoint) if checkpoint.exists() else begun(plan, options.begin)
    if options.samples is not None:
        trainer.plan = replace(trainer.plan, samples=options.samples)
    train(trainer, options.output, options.export_minutes)


if __name__ == "__main__":
    main()
