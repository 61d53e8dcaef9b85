"""The training loop: it yields every step, averages the weights, and resumes to the bit."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from accelerate import Accelerator
from accelerate.state import AcceleratorState
from torch import Tensor, nn

from mwlib.training.checkpoint import MovingAverage, State, part, read_checkpoint
from mwlib.training.config import TrainingConfig, learning_rate


@contextmanager
def seeded(*numbers: int) -> Iterator[torch.Generator]:
    """Yield a generator seeded from the numbers; seed torch's global one too, and restore it on exit.

    Dropout and initial weights draw from the global one. Own choice: every step's randomness is a function of (seed, step,
    process). The numbers are mixed first, as torch's CPU generator looks at the low 32 bits of a seed only.
    """
    seed, other = (int(n) for n in np.random.SeedSequence(numbers).generate_state(2))
    with torch.random.fork_rng([torch.cuda.current_device()] if torch.cuda.is_available() else []):
        torch.manual_seed(seed)
        yield torch.Generator().manual_seed(other)


class Objective(ABC):
    """What a system trains: a network, batches to draw, and their loss."""

    network: nn.Module

    @abstractmethod
    def draw(self, batch: int, generator: torch.Generator) -> Any:
        """A batch of so many items."""

    @abstractmethod
    def loss(self, network: nn.Module, batch: Any, generator: torch.Generator) -> Tensor:
        """The number to lower; `network` is the one above, perhaps wrapped for several processes."""

    def to(self, device: torch.device) -> None:  # noqa: B027  (nothing to move is a fair answer)
        """Move what `draw` and `loss` use; the loop moves the network."""

    @torch.inference_mode()
    def validate(self, network: nn.Module) -> float | None:
        """`held_out_loss` of the averaged network, without dropout; its noise is the same every time."""
        with seeded(7, 7) as generator:
            return self.held_out_loss(network.eval(), generator)

    def held_out_loss(self, network: nn.Module, generator: torch.Generator) -> float | None:
        """Loss on data held out for it; None if there are none."""
        return None

    def learnt(self) -> dict[str, Tensor]:
        """What was fitted before the first step and belongs to the model, such as scales."""
        return {}

    def about(self) -> dict[str, str]:
        """Short texts that the finished model carries."""
        return {}


class TrainingStep(NamedTuple):
    """One optimisation step: its number (from 1), loss, learning rate, and the validation loss where one was taken."""

    step: int
    loss: float
    lr: float
    validation: float | None


def train(
    make_objective: Callable[[Mapping[str, Tensor]], Objective],
    settings: TrainingConfig,
    folder: Path | None = None,
    key: str = "",
    about: Mapping[str, str] | None = None,
) -> Iterator[TrainingStep]:
    """Train, yielding every step; stops by itself after `train_steps`.

    With a folder, a checkpoint is written every `checkpoint_every` steps and at the end (to a temporary name, then
    renamed), and an existing one is taken up: on the CPU the result is bit-identical to a run that was never stopped.
    Several processes started by ``accelerate launch`` share each batch. If the last step's checkpoint is there already, model and
    curves are written from it where they are missing or do not hold what it does.

    Args:
        make_objective: builds the objective; it is given what the objective had learnt where the training goes on, else nothing.
        settings: of the optimisation.
        folder: where checkpoint and model go; None keeps nothing.
        key: hash of all that the training depends on.
        about: short texts that the finished model carries beside the objective's.

    Raises:
        ValueError: the folder's checkpoint has another key, or the loss is no number any more; what was saved before stays.
    """
    AcceleratorState._reset_state()  # an earlier training of this process may have had another precision
    accelerator = Accelerator(mixed_precision=settings.mixed_precision)
    objective, state = _start(make_objective, settings, folder, key, accelerator)
    state.about |= about or {}
    kept = folder if accelerator.is_main_process else None
    if kept and state.step == settings.train_steps:
        state.mend(kept)
    network = accelerator.prepare_model(state.network, evaluation_mode=True)  # a loss asks it for more than `forward`
    optimiser = accelerator.prepare(state.optimiser)
    share = max(settings.batch // accelerator.num_processes, 1)
    while state.step < settings.train_steps:
        # the learning rate of this step
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(settings, state.step)
        # forward, backward, update; all randomness follows from seed, step and process
        with seeded(settings.seed, state.step + 1, accelerator.process_index) as generator:
            network.train()
            loss = objective.loss(network, objective.draw(share, generator), generator)
            accelerator.backward(loss)
            _share_gradients(network, accelerator)
            if settings.clip_gradient:
                accelerator.clip_grad_norm_(network.parameters(), settings.clip_gradient)
            optimiser.step()
            optimiser.zero_grad()
        state.curve.append(_finite(loss, state.step + 1))
        state.step += 1
        state.average.update(state.step)
        # now and then: validation and checkpoint
        is_last, value = state.step == settings.train_steps, None
        if is_last or state.step % settings.checkpoint_every == 0:
            value = objective.validate(state.average.averaged())
            if value is not None:
                state.validation.append((state.step, value))
            if kept:
                state.save(kept, is_last)
        yield TrainingStep(state.step, state.curve[-1], optimiser.param_groups[0]["lr"], value)


def _share_gradients(network: nn.Module, accelerator: Accelerator) -> None:
    """Means over the processes that share a batch."""
    if accelerator.num_processes > 1:
        gradients = [parameter.grad for parameter in network.parameters() if parameter.grad is not None]
        mean = accelerator.reduce(torch.cat([gradient.flatten() for gradient in gradients]), "mean")
        for gradient, part in zip(gradients, mean.split([gradient.numel() for gradient in gradients]), strict=True):  # pyright: ignore[reportArgumentType, reportAttributeAccessIssue]
            gradient.copy_(part.view_as(gradient))


def _finite(loss: Tensor, step: int) -> float:
    value = float(loss.detach())
    if not math.isfinite(value):
        raise ValueError(
            f"the loss of step {step} is {value}; expected a number. A smaller lr, clip_gradient=1 or mixed_precision=no "
            "may help; windows that hold still or jump may be the reason"
        )
    return value


def _start(
    make_objective: Callable[[Mapping[str, Tensor]], Objective],
    settings: TrainingConfig,
    folder: Path | None,
    key: str,
    accelerator: Accelerator,
) -> tuple[Objective, State]:
    """The objective and everything that training changes, new or as a checkpoint left them."""
    saved, metadata = read_checkpoint(folder, key)
    objective = make_objective(part(saved, "objective."))
    objective.to(accelerator.device)
    network = objective.network.to(accelerator.device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay, fused=True)
    average = MovingAverage(network, settings.ema, settings.ema_start)
    state = State(network, average, optimiser, objective.learnt(), key, objective.about(), accelerator.scaler)
    if saved:
        state.restore(saved, metadata)
    return objective, state
