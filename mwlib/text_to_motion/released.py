"""Models that the authors of MDM released, or that their code trained, opened without running anything in the files.

Source: Tevet et al. 2023 and its code: ``model000475000.pt``, a state dictionary without CLIP, and ``args.json`` beside it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from mwlib.data.formats.humanml import HUMANML3D, KIT
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, read_text
from mwlib.networks.matching import checkpoint
from mwlib.settings import shown
from mwlib.text_to_motion.config import CLIP, Config
from mwlib.text_to_motion.model import TextDenoiser, TextToMotion
from mwlib.text_to_motion.objective import published_statistics

LAYOUTS = {"humanml": HUMANML3D, "kit": KIT}  # by the code's names
# What names begin with there -> what they begin with in `MDM`.
NAMES = {
    "input_process.poseEmbedding.": "enter.",
    "embed_timestep.time_embed.": "time.",
    "embed_text.": "text.",
    "seqTransEncoder.layers.": "encoder.stack.layers.",
    "output_process.poseFinal.": "leave.",
}
FIXED = ("clip_model.", "sequence_pos_encoder.", "embed_timestep.sequence_pos_encoder.")  # CLIP, and sinusoids: not learnt
# Settings of args.json -> the values that this package's network and diffusion have; a file may leave them out.
EXPECTED: dict[str, tuple[Any, ...]] = {
    "arch": ("trans_enc",), "text_encoder_type": ("clip",), "unconstrained": (False,), "sigma_small": (True,),
    "dataset": tuple(LAYOUTS), "noise_schedule": ("cosine", "linear"),
}  # fmt: skip


def open_mdm(file: str | Path, data: str | Path, clip_folder: str | Path = CLIP) -> TextToMotion:
    """A model of MDM's code for HumanML3D or KIT-ML, on the CPU; it samples as published, with guidance 2.5.

    Of a file with an average of the weights ("model_avg") the average is taken.

    Args:
        file: ``model*.pt``, with ``args.json`` beside it.
        data: folder of the collection, here or under MWLIB_DATA; its Mean.npy and Std.npy scale the features.
        clip_folder: of CLIP ViT-B/32, here or under MWLIB_DATA.

    Raises:
        FileNotFoundError: there is no such file, or CLIP's files are missing.
        ImportError: as `ClipText`.
        MotionFormatError: args.json, Mean.npy or Std.npy is missing or malformed.
        ValueError: the file holds more than tensors and numbers, other weights, or a model of another kind.
    """
    file = Path(file)
    args, weights = _arguments(file.parent / "args.json"), _weights(file)
    layout = LAYOUTS[args["dataset"]]
    layers = {name.split(".")[3] for name in weights if name.startswith("encoder.stack.layers.")}
    steps = args.get("diffusion_steps", 1000)
    try:
        cfg = Config.preset("mdm", data=str(data), clip_folder=str(clip_folder), steps=steps, layers=len(layers)).override(
            width=weights["enter.weight"].shape[0],
            feedforward=weights["encoder.stack.layers.0.linear1.weight"].shape[0],
            schedule=args.get("noise_schedule", "cosine"),
            mask_frames=args.get("mask_frames", False),
            drop_text=float(args.get("cond_mask_prob", 0.1)),
            shortest=layout.shortest,
        )
        net = TextDenoiser(cfg.model, layout.width, steps, ())
        net.body.load_state_dict(weights)
    except (KeyError, IndexError, RuntimeError) as error:
        found = str(error).strip().replace("\n", " ")[:200]
        raise ValueError(f"{file} does not fit: {found}; expected MDM's trans_enc for {layout.name}, without its CLIP") from None
    return TextToMotion(net.requires_grad_(False), published_statistics(cfg, layout), cfg)


def _arguments(file: Path) -> dict[str, Any]:
    """args.json, of a model that can be opened."""
    if not file.is_file():
        raise MotionFormatError(file, "file", "none", "the args.json that lies beside the model")
    try:
        found = json.loads(read_text(file, SMALL_TEXT))
    except ValueError as error:
        raise MotionFormatError(file, "json", str(error)[:100], "the settings of a training of MDM") from None
    if not isinstance(found, dict) or "dataset" not in found:
        raise MotionFormatError(file, "json", shown(found), "the settings of a training of MDM, dataset among them")
    for name, values in EXPECTED.items():
        if found.get(name, values[0]) not in values:
            raise ValueError(f"{file} says {name} {shown(found[name])}; expected {' or '.join(map(str, values))}")
    return found


def _weights(file: Path) -> dict[str, Tensor]:
    """Learnt weights by the names of `MDM`."""
    tree = checkpoint(file)
    parts = tree if isinstance(tree, Mapping) else {}
    tree = next((parts[name] for name in ("model_avg", "model") if isinstance(parts.get(name), Mapping)), tree)
    if not isinstance(tree, Mapping) or not all(isinstance(value, Tensor) for value in tree.values()):
        raise ValueError(f"{file} holds {shown(type(tree).__name__)}; expected weights of MDM by their names")
    found = {}
    for name, value in tree.items():
        prefix = next((prefix for prefix in NAMES if name.startswith(prefix)), None)
        if prefix:
            found[NAMES[prefix] + name.removeprefix(prefix)] = value.float()
        elif not name.startswith(FIXED):
            raise ValueError(f"{file} has weights {name!r}; expected those of MDM's trans_enc: {', '.join(NAMES)}")
    return found
