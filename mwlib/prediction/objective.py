"""The training objective of MotionWavelet: Eq. 5 and its siblings, on random windows of motion."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor, nn

from mwlib.data.sources import Split
from mwlib.data.windows import Bodies, windows
from mwlib.diffusion import DiffusionConfig, alpha_bar, network_target, noised, snr_weights
from mwlib.prediction.config import Config, ObjectiveConfig
from mwlib.prediction.guidance import make_network
from mwlib.prediction.representation import Representation, fit_representation, restored_representation, training_windows
from mwlib.training import Objective, seeded


class DenoisingLoss:
    """Eq. 5 and its siblings: the loss of one batch of windows.

    Args:
        representation: windows as coefficients.
        diffusion: schedule, and what the network predicts.
        options: how often the condition is dropped, how errors are weighed.
    """

    def __init__(self, representation: Representation, diffusion: DiffusionConfig, options: ObjectiveConfig) -> None:
        self.representation, self.prediction, self.options = representation, diffusion.prediction, options
        self.alpha_bar = alpha_bar(diffusion.schedule, diffusion.steps)
        weight = torch.as_tensor(representation.motion.deviation) ** 2
        self.weight = weight / weight.mean() if options.loss_weight == "metric" else None
        self.level = snr_weights(self.alpha_bar) if options.level_weight == "snr" else None

    def __call__(self, network: nn.Module, x: Float[Tensor, "B T C"], generator: torch.Generator) -> Float[Tensor, ""]:
        """Mean squared error of the network's output; t uniform in 1..M-1, condition dropped at random."""
        device, options = x.device, self.options
        y = self.representation.encode(x)
        condition = self.representation.encode_history(x[:, : self.representation.history])
        if network.training and options.blank_condition:
            kept = torch.rand(condition.shape, generator=generator) >= options.blank_condition
            condition = condition * kept.to(device) / (1 - options.blank_condition)  # as dropout does
        t = torch.randint(1, len(self.alpha_bar), (len(x),), generator=generator)
        eps = torch.randn(y.shape, generator=generator).to(device)
        coins = torch.rand(len(x) if options.drop_per == "sample" else 1, generator=generator)
        keep = (coins >= options.drop_condition).expand(len(x)).to(device)
        a = self.alpha_bar[t]  # float64, on the CPU: not every device has that precision
        output = network(noised(y, eps, a), t.to(device), condition, keep=keep)
        error = (output - network_target(self.prediction, y, eps, a)) ** 2
        if self.weight is not None:
            error = error * self.weight.to(device)
        return error.mean() if self.level is None else (error.mean((-2, -1)) * self.level[t].to(device)).mean()


class PredictionObjective(Objective):
    """The training of a predictor, as `mwlib.training.train` takes it.

    Args:
        cfg: configuration.
        split: clips for training and for the validation loss, as `data.sources.prepare` leaves them.
        learnt: what the representation had learnt in an earlier part of the same training; empty: it is fitted now.
    """

    def __init__(self, cfg: Config, split: Split, learnt: Mapping[str, Tensor] | None = None) -> None:
        cut, held_out = cfg.windows, split.validation
        self.bodies = Bodies.of([*split.train, *held_out])
        self.representation = (
            restored_representation(cfg, learnt, self.bodies) if learnt else fit_representation(cfg, split.train)
        )
        with seeded(cfg.training.seed, 0):
            self.network: nn.Module = make_network(cfg.model, self.representation.motion.shape)
        self.windows = training_windows(split.train, cut)
        self.held_out = windows(held_out, cut.history, cut.future, cut.test_stride).x if held_out else None
        self.denoising = DenoisingLoss(self.representation, cfg.diffusion, cfg.objective)

    def to(self, device: torch.device) -> None:
        """Move the windows."""
        self.windows.to(device)
        self.held_out = None if self.held_out is None else self.held_out.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Float[Tensor, "B T C"]:
        """A batch of augmented windows."""
        return self.windows.draw(batch, generator)

    def loss(self, network: nn.Module, batch: Float[Tensor, "B T C"], generator: torch.Generator) -> Float[Tensor, ""]:
        """See `DenoisingLoss`."""
        return self.denoising(network, batch, generator)

    def held_out_loss(self, network: nn.Module, generator: torch.Generator) -> float | None:
        """Mean over the windows of people held out."""
        if self.held_out is None:
            return None
        parts = self.held_out.split(256)
        return sum(float(self.loss(network, part, generator)) * len(part) for part in parts) / len(self.held_out)

    def learnt(self) -> dict[str, Tensor]:
        """Scales, and what the transform learnt."""
        return self.representation.learnt()

    def about(self) -> dict[str, str]:
        """Skeleton, frame rate and up-axis of the clips."""
        return {"bodies": self.bodies.to_json()}
