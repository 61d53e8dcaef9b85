"""Models of the codes of MDM, StableMoFusion and Free-T2M, opened without running anything in their files.

Source: Tevet et al. 2023 and its code: ``model000475000.pt``, a state dictionary without CLIP, and ``args.json`` beside it. Huang
et al. 2024 and its code: ``model/latest.tar``, a checkpoint with CLIP in it, and ``opt.txt`` and ``meta`` in the folder above.
Free-T2M replaces parts of both programs that write neither.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from torch import Tensor

from mwlib.data.formats.humanml import HUMANML3D, KIT, FeatureLayout
from mwlib.data.normalisation import Statistics
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, read_text
from mwlib.networks.matching import checkpoint
from mwlib.settings import shown
from mwlib.text_to_motion.config import CLIP, Config
from mwlib.text_to_motion.model import TextDenoiser, TextToMotion
from mwlib.text_to_motion.objective import published_statistics

LAYOUTS = {"humanml": HUMANML3D, "t2m": HUMANML3D, "kit": KIT}  # by the codes' names


class Code(NamedTuple):
    """How a program leaves its models.

    Args:
        preset: of its models.
        title: of what its networks are.
        options: its file of settings, seen from the weights' folder.
        dataset: the setting that names the data.
        weights: where a checkpoint has the average of the weights, and the weights.
        fixed: what names of weights begin with that are not learnt, or are not the network's.
        origin: where people get such models.
        expected: setting -> the values that this package's network and diffusion have; a file may leave them out.
        names: what a name begins with there, and what it begins with here; of several lines the first that fits.
        inner: parts of a name there, and here.
    """

    preset: str
    title: str
    options: str
    dataset: str
    weights: tuple[str, ...]
    fixed: tuple[str, ...]
    origin: str
    expected: dict[str, list[Any]]
    names: str
    inner: str = ""


MDM = Code(
    "mdm",
    "MDM's trans_enc",
    "args.json",
    "dataset",
    ("model_avg", "model"),
    ("clip_model.", "sequence_pos_encoder.", "embed_timestep.sequence_pos_encoder."),
    "the models that https://github.com/GuyTevet/motion-diffusion-model links",
    {
        "arch": ["trans_enc"], "text_encoder_type": ["clip"], "unconstrained": [False], "sigma_small": [True],
        "dataset": ["humanml", "kit"], "noise_schedule": ["cosine", "linear"], "emb_policy": ["add"], "pred_len": [0],
        "context_len": [0], "multi_target_cond": [False],
    },
    """
        input_process.poseEmbedding. enter.
        embed_timestep.time_embed. time.
        embed_text. text.
        seqTransEncoder.layers. encoder.stack.layers.
        output_process.poseFinal. leave.
    """,
)  # fmt: skip
STABLEMOFUSION = Code(
    "stablemofusion",
    "StableMoFusion's U-Net",
    "../opt.txt",
    "dataset_name",
    ("model_ema", "encoder"),
    ("clip_model.", "unet.time_mlp.0."),
    "the models that https://github.com/h-y1heng/StableMoFusion links",
    {
        "dataset_name": ["t2m", "humanml", "kit"], "prediction_type": ["sample"], "beta_schedule": ["linear"],
        "diffusion_steps": [1000], "no_adagn": [False], "no_eff": [False], "text_latent_dim": [256], "time_dim": [512],
    },
    r"""
        embed_text. text.
        textTransEncoder.layers. text_encoder.stack.layers.
        text_ln. text_norm.
        unet.time_mlp.1. time.0.
        unet.time_mlp.3. time.2.
        unet.downs.(\d+).2.conv. shrink.\1.
        unet.downs. downs.
        unet.mid_block1. middle.0.
        unet.mid_block2. middle.1.
        unet.ups.(\d+).0.conv. grow.\1.
        unet.ups.(\d+).1. ups.\1.0.
        unet.ups.(\d+).2. ups.\1.1.
        unet.final_conv. leave.
    """,
    """
        conv1d.blocks.0.block. convolutions.first.
        conv1d.blocks.0.group_norm. convolutions.first_norm.
        conv1d.blocks.1.block. convolutions.second.
        conv1d.blocks.1.norm. convolutions.second_norm.
        conv1d.time_mlp.1. convolutions.film.
        conv1d.residual_conv. convolutions.shortcut.
        cross_attn.cross_attention. attention.
    """,
)  # fmt: skip
LEVELS = 4  # of StableMoFusion's U-Net, whatever its widths: its program pads frames to a multiple of 16
CODES = {".pt": MDM, ".tar": STABLEMOFUSION}  # by the ending of the weights' file


def open_released(file: str | Path, data: str | Path = "", clip_folder: str | Path = CLIP) -> TextToMotion:
    """A model of one of these codes, on the CPU; it samples as published, with guidance 2.5.

    MDM's samples by all its noising steps, StableMoFusion's by SDE-DPM-Solver++ in 10 steps. Of a file with an average of the
    weights the average is taken. Own choice: float32, where StableMoFusion samples in float16; and the U-Net is always given 196
    frames, where that code gives it as many as the longest motion of a batch has.

    Args:
        file: ``model*.pt``, with ``args.json`` beside it; or ``latest.tar``, with ``opt.txt`` in the folder above it.
        data: folder of the collection, here or under MWLIB_DATA (default: HumanML3D or KIT-ML, as the settings say); its Mean.npy
            and Std.npy scale the features, but where a ``latest.tar`` has ``meta/mean.npy`` and ``std.npy`` in the folder above.
        clip_folder: of CLIP ViT-B/32, here or under MWLIB_DATA.

    Raises:
        FileNotFoundError: there is no such file, or CLIP's files are missing; the message says where people get them.
        ImportError: as `ClipText`.
        MotionFormatError: settings or statistics are missing or malformed.
        ValueError: the file holds more than tensors and numbers, other weights, or a model of another kind.
    """
    file = Path(file)
    code = CODES.get(file.suffix)
    if code is None or not file.is_file():
        known = "; ".join(f"*{ending} from {code.origin}" for ending, code in CODES.items())
        raise FileNotFoundError(f"{file} is no file of a released model; expected {known}")
    options = _options(file.parent / code.options, code)
    layout, weights = LAYOUTS[options[code.dataset]], _weights(file, code)
    data = str(data) or layout.name
    try:
        changes = (_unet if code is STABLEMOFUSION else _mdm)(options, weights)
        dropped = float(options.get("cond_mask_prob", 0.1))
        changes |= {"drop_text": dropped} if dropped else {"drop_text": 0.0, "guidance": 1.0}
        cfg = Config.preset(code.preset, data=data, clip_folder=str(clip_folder), shortest=layout.shortest, **changes)
        net = TextDenoiser(cfg.model, layout.width, cfg.forward.steps, ())
        net.body.load_state_dict(weights)
    except (KeyError, IndexError, RuntimeError) as error:
        found = str(error).strip().replace("\n", " ")[:200]
        raise ValueError(f"{file} does not fit: {found}; expected {code.title} for {layout.name}") from None
    return TextToMotion(net.requires_grad_(False), _statistics(file, cfg, layout, options), cfg)


def _mdm(options: Mapping[str, Any], weights: Mapping[str, Tensor]) -> dict[str, Any]:
    """What a model changes of its preset."""
    layers = {name.split(".")[3] for name in weights if name.startswith("encoder.stack.layers.")}
    return {
        "steps": options.get("diffusion_steps", 1000), "layers": len(layers),
        "width": weights["enter.weight"].shape[0], "feedforward": weights["encoder.stack.layers.0.linear1.weight"].shape[0],
        "schedule": options.get("noise_schedule", "cosine"), "mask_frames": options.get("mask_frames", False),
    }  # fmt: skip


def _unet(options: Mapping[str, Any], weights: Mapping[str, Tensor]) -> dict[str, Any]:
    """The same; the file's own tensors say the sizes, lest a few words ask for all memory."""
    base, times = options.get("base_dim", 512), options.get("dim_mults", [2, 2, 2, 2])
    widths = [weights[f"shrink.{level}.weight"].shape[0] for level in range(len(times))]
    if len(widths) != LEVELS or [base * many for many in times] != widths:
        found = f"base_dim {shown(base)} with dim_mults {shown(times)} where the weights have {widths}"
        raise KeyError(f"{found}; the program pads frames for four levels")
    return {"width": base, "multipliers": tuple(times)}


def _statistics(file: Path, cfg: Config, layout: FeatureLayout, options: Mapping[str, Any]) -> Statistics:
    """Those that lie beside the model, else the collection's."""
    meta = file.parent.parent / "meta"
    if cfg.model.network == "unet" and meta.is_dir():
        return published_statistics(cfg, layout, (meta / "mean.npy", meta / "std.npy"), "stablemofusion")
    if (bias := options.get("feat_bias", 5)) != 5:
        raise MotionFormatError(meta, "folder", "none", f"mean.npy and std.npy, as feat_bias is {shown(bias)} and not 5")
    return published_statistics(cfg, layout)


def _options(file: Path, code: Code) -> dict[str, Any]:
    """The settings of a model that can be opened."""
    if not file.is_file():
        raise MotionFormatError(file, "file", "none", f"the {file.name} that lies with {code.title}")
    text = read_text(file, SMALL_TEXT)
    try:
        found = json.loads(text) if file.suffix == ".json" else dict(map(_option, re.findall(r"(\w+): (.*)", text)))
    except (ValueError, RecursionError) as error:
        raise MotionFormatError(file, "settings", str(error)[:100], f"those of a training of {code.title}") from None
    if not isinstance(found, dict) or code.dataset not in found:
        raise MotionFormatError(file, "settings", shown(found), f"those of a training of {code.title}, {code.dataset} among them")
    for name, values in code.expected.items():
        if found.get(name, values[0]) not in values:
            raise ValueError(f"{file} says {name} {shown(found[name])}; expected {' or '.join(map(str, values))}")
    return found


def _option(line: tuple[str, str]) -> tuple[str, Any]:
    """Name and value of a line of opt.txt, which Python wrote."""
    name, value = line[0], line[1].strip()
    try:
        return name, json.loads({"True": "true", "False": "false"}.get(value, value))
    except ValueError:
        return name, value


def _weights(file: Path, code: Code) -> dict[str, Tensor]:
    """Learnt weights by the names of this package's networks."""
    tree = checkpoint(file)
    if isinstance(tree, Mapping):
        tree = next((tree[name] for name in code.weights if isinstance(tree.get(name), Mapping)), tree)
    if not isinstance(tree, Mapping) or not all(isinstance(value, Tensor) for value in tree.values()):
        raise ValueError(f"{file} holds {shown(type(tree).__name__)}; expected weights of {code.title} by their names")
    found, (names, inner) = {}, (dict(map(str.split, text.strip().splitlines())) for text in (code.names, code.inner))
    for name, value in tree.items():
        own = re.sub(r"^(module\.|n_averaged$)", "", str(name))  # torch's averages have these
        if not own or own.startswith(code.fixed):
            continue
        begins = next((old for old in names if re.match(old, own)), None)
        if begins is None:
            raise ValueError(f"{file} has weights {shown(name)}; expected those of {code.title}: {', '.join(names)}")
        own = re.sub(begins, names[begins], own, count=1)
        found[next((own.replace(old, new) for old, new in inner.items() if old in own), own)] = value.float()
    return found
