"""The base of trained models: a network with the configuration that it was trained with, and settings of the sampling."""

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import torch
from torch import Tensor, nn
from tqdm import tqdm

from mwlib.settings import Settings, shown, whole, wholes

Network = TypeVar("Network", bound=nn.Module)
Model = TypeVar("Model", bound="TrainedModel")
MOST_SAMPLES = 100_000  # of a window in one call: own choice, no memory holds more


class TrainedModel:
    """A trained network, its configuration, and the settings that it samples with.

    Args:
        net: trained weights (the moving average).
        cfg: of the training; its group `sampling` says how the model samples.
    """

    sampling_groups: ClassVar[tuple[str, ...]] = ("sampling",)  # groups of settings that `with_sampling` changes

    def __init__(self, net: nn.Module, cfg: Settings) -> None:
        self.net: Any = net.eval()
        self.cfg: Any = cfg

    @property
    def sampling(self) -> Any:
        """The settings of the sampling."""
        return self.cfg.sampling

    @property
    def device(self) -> torch.device:
        """Where the network lives."""
        return next(self.net.parameters()).device

    def to(self: Model, device: torch.device | str) -> Model:
        """Move the network.

        Raises:
            ValueError: there is no such device.
        """
        try:
            self.net.to(torch.empty(0, device=torch.device(device)).device)
        except (TypeError, RuntimeError, AssertionError) as error:
            reason = str(error).strip().partition("\n")[0][:200]
            raise ValueError(f"device is {shown(device)}; expected 'cpu', or a graphics card such as 'cuda': {reason}") from None
        return self

    def with_sampling(self: Model, **changes: Any) -> Model:
        """The same model with other settings of the sampling, e.g. ``model.with_sampling(samples=5)``.

        Raises:
            ValueError: unknown settings, bad values, or settings that the trained model depends on.
        """
        cfg, owners = self.cfg.override(**changes), self.cfg.owners()
        if others := [name for name in changes if owners[name] not in self.sampling_groups]:
            raise ValueError(f"{', '.join(others)} belongs to the trained model; expected settings of the sampling")
        other = copy.copy(self)
        other.cfg = cfg
        return other

    def asked(self, samples: int | None, seed: int | None) -> tuple[int, int]:
        """How many samples and which seed of the noise: as given, or as the settings say.

        Raises:
            ValueError: they are no whole numbers, or out of range.
        """
        count = whole("samples", self.sampling.samples if samples is None else samples, 1, MOST_SAMPLES)
        return count, self.sampling.sampling_seed if seed is None else whole("seed", seed)

    def finite(self, samples: Tensor) -> Tensor:
        """The samples, if they are numbers.

        Raises:
            ValueError: some are none; the message names the settings of the sampling that differ from their defaults.
        """
        if samples.is_meta:
            raise ValueError("the model is on the device meta, which holds no numbers; expected 'cpu' or a graphics card")
        if bool(samples.isfinite().all()):
            return samples
        changed, owners = self.cfg.changed_from(type(self.cfg)()), self.cfg.owners()
        own = [f"{name}={value!r}" for name, value in changed.items() if owners[name] in self.sampling_groups]
        settings = f"the settings of the sampling that differ from the defaults are {', '.join(own) or 'none'}"
        raise ValueError(f"the samples are not finite: numbers overflowed; {settings}; expected such as keep them finite")


def identities(window_ids: Sequence[int] | None, count: int) -> list[int]:
    """The identity of each window, on which its noise depends: as given, or 0..N-1.

    Raises:
        ValueError: there are more or fewer than windows, or one is no whole number of at least 0.
    """
    ids = list(range(count)) if window_ids is None else wholes("window_ids", window_ids)
    if len(ids) != count:
        raise ValueError(f"window_ids has {len(ids)} entries for {count} windows; expected one each")
    return ids


def chunks(count: int, size: int, progress: bool = False) -> Iterator[slice]:
    """Slices of `size` that cover `count` windows in order, under a bar on stderr."""
    for first in tqdm(range(0, count, size), disable=not progress, desc="sampling", unit="chunk"):
        yield slice(first, first + size)


def with_weights(make: Callable[[], Network], weights: Mapping[str, Tensor]) -> Network:
    """A new network with these weights; the caller's randomness is left alone."""
    with torch.random.fork_rng([]):  # initial weights are drawn and thrown away
        network = make()
    network.load_state_dict(weights)
    return network
