"""Trained networks as ONNX files, and beside each one all that its sampling needs besides, as JSON."""

from __future__ import annotations

import importlib
import json
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from mwlib.body.skeleton import Skeleton
from mwlib.files import write_together
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.objective import SizedNetwork
from mwlib.inbetweening.representation import LEAST
from mwlib.inbetweening.space import PositionSpace
from mwlib.networks.mdm import MDM
from mwlib.networks.text import EncodedText, WordTransformer
from mwlib.prediction.predictor import Predictor, temperatures
from mwlib.settings import of_kind
from mwlib.synthetic.acts import TIMED, usual_times
from mwlib.synthetic.sentences_typed import tables
from mwlib.text_to_motion.model import TextToMotion
from mwlib.text_to_motion.motions import ARM_WEIGHT, CONTACT_WEIGHT, HEIGHT_WEIGHT, STEP_WEIGHT
from mwlib.training import TrainedModel

OPSET = 18
FREE = torch.export.Dim.DYNAMIC
DRAWN = 50  # futures at most, of which the file beside a network says how wide they are drawn


class _Traceable(nn.Module):
    """A network of tensors alone, inputs to follow it with, by name, and which of their axes are free."""

    inputs: dict[str, Tensor]
    free: tuple[dict[int, Any] | None, ...]


class _OfCoefficients(_Traceable):
    """A network of prediction, its condition embedded inside; items with `told` 0 are not told it."""

    def __init__(self, model: Predictor) -> None:
        super().__init__()
        self.net = model.net
        y = torch.zeros(2, *model.transform.shape)
        self.inputs = {"y_t": y, "t": torch.tensor([1]), "condition": y[:1], "told": torch.ones(2)}
        self.free = {0: FREE}, None, None, {0: FREE}

    def forward(
        self,
        y_t: Float[Tensor, "B rows columns"],
        t: Int[Tensor, " 1"],
        condition: Float[Tensor, "1 rows columns"],
        told: Float[Tensor, " B"],
    ) -> Float[Tensor, "B rows columns"]:
        """The network's output."""
        return self.net.evaluate(y_t, t, self.net.embed_condition(condition) * told[:, None])[0]


class _OfSentences(_Traceable):
    """A denoiser of one sentence, its encoder inside, for motions of one length; items with `told` 0 are not told it."""

    def __init__(self, model: TextToMotion) -> None:
        super().__init__()
        self.text, self.body, m = model.net.text, model.net.body, model.cfg.model
        if not (isinstance(self.text, WordTransformer) and isinstance(self.body, MDM)):
            raise ValueError(f"the model has network={m.network} and text={m.text}; expected network=mdm and text=words")
        words = self.text.numbers([" ".join(self.text.vocabulary[:2])])
        y = torch.zeros(2, model.lengths[0], model.layout.width)
        self.inputs = {"y_t": y, "t": torch.tensor([1]), "words": words, "told": torch.ones(2)}
        self.free = {0: FREE, 1: FREE}, None, {1: FREE}, {0: FREE}

    def forward(
        self, y_t: Float[Tensor, "B T D"], t: Int[Tensor, " 1"], words: Int[Tensor, "1 L"], told: Float[Tensor, " B"]
    ) -> Float[Tensor, "B T D"]:
        """The clean motion, normalised."""
        said = EncodedText(*(part.expand(y_t.shape[0], *part.shape[1:]) for part in self.text.encode_numbers(words)))
        valid = torch.ones_like(y_t[..., 0], dtype=torch.bool)
        return self.body(y_t, t.expand(y_t.shape[0]), valid, said, told == 0)


class _OfKeyframes(_Traceable):
    """A denoiser of motions of one length between the same keyframes, and the mean and the size of what it denoises."""

    def __init__(self, model: Bridge) -> None:
        super().__init__()
        self.net, task = model.net, model.cfg.task
        if not (isinstance(self.net, SizedNetwork) and isinstance(model.space, PositionSpace) and task.past == task.future == 2):
            found = f"departure_scale={model.cfg.model.departure_scale} state={task.state} past={task.past} future={task.future}"
            raise ValueError(f"the model has {found}; expected departure_scale=window state=positions past=2 future=2")
        y = torch.zeros(2, *model.representation.transform(task.fewest).shape)
        given = torch.zeros(1, len(y[0]), self.net.inner.net.enter.in_features - y.shape[-1])
        ends = torch.zeros(1, self.net.state_dict()["log_factor.0.weight"].shape[1])
        self.inputs = {"y_t": y, "t": torch.tensor([1]), "condition": given, "ends": ends}
        self.free = {0: FREE, 1: FREE}, None, {1: FREE}, None

    def forward(
        self,
        y_t: Float[Tensor, "B rows columns"],
        t: Int[Tensor, " 1"],
        condition: Float[Tensor, "1 rows conditioning"],
        ends: Float[Tensor, "1 entering"],
    ) -> tuple[Float[Tensor, "B rows columns"], Float[Tensor, "1 rows columns"], Float[Tensor, "1 rows 1"]]:
        """The clean tokens, and what makes tokens in usual sizes of them: they are times the factor, plus the mean."""
        rows, net = y_t.shape[1], self.net
        output = net(y_t, t, condition.expand(y_t.shape[0], -1, -1))
        return output, net.mean(ends, rows), net.factor_of_samples(ends, rows)


def export_onnx(model: TrainedModel, file: Path) -> list[Path]:
    """Write a trained network as an ONNX file, and beside it a JSON file of what its sampling needs besides.

    All networks take noised items ``y_t`` (B, ...), one diffusion index ``t`` (1,), and what they are conditioned on. Those of
    prediction and of sentences take ``told`` (B,), too: 1 for an item that is told it, 0 for one that is not. That is all of
    classifier-free guidance. The condition of prediction is ``condition`` (1, rows, columns), that of in-betweening
    ``condition`` (1, rows, conditioning), see `Representation.conditioning`, and ``ends`` (1, entering), see
    `Representation.ends`; that of sentences ``words`` (1, L), numbers of the start and the words. They give ``output``: what the
    network predicts (the setting `prediction`; sentences: y0), and of in-betweening ``mean`` (1, rows, columns) and ``factor``
    (1, rows, 1), see `SizedNetwork`. B, and of sentences L and T, and rows of in-betweening, are free.

    Weights stay as they are. Those that half precision holds exactly, as in the shipped models, are stored so.

    Args:
        model: of prediction; of in-betweening of places, with departure_scale "window" and one frame given beyond each keyframe,
            as `inbetween` is; or of text to motion with the network "mdm" and the text encoder "words".
        file: gets the network; JSON stands beside it under the same name.

    Returns:
        The two files.

    Raises:
        ImportError: a package is missing; the message says how to install it.
        ValueError: a model of another system or kind, or a file that does not end in .onnx.
    """
    if file.suffix != ".onnx":
        raise ValueError(f"file is {str(file)!r}; expected a name that ends in .onnx")
    opened: Any = of_kind("model", model, (*KINDS,), "one of prediction, inbetweening or text_to_motion")
    network, about = next(parts for kind, parts in KINDS.items() if isinstance(model, kind))
    traced = network(opened)
    said = {"alpha_bar": opened.alpha_bar.tolist(), **about(opened), "inputs": [*traced.inputs]}
    files = {file: _halved(_exported(traced, model.device)), file.with_suffix(".json"): json.dumps(said, separators=(",", ":"))}
    write_together(files)
    return [*files]


def _exported(module: _Traceable, device: torch.device) -> Any:
    """The module as an ONNX model: of torch's exporter, without its talk."""
    try:
        importlib.import_module("onnx")
        importlib.import_module("onnxscript")
    except ModuleNotFoundError as error:
        found = f"{error.name} is missing, which writes ONNX"
        raise ImportError(f"{found}; install both with: pip install onnx onnxscript") from error
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(action="ignore"), torch.no_grad():  # on torch's own future
            given = tuple(tensor.to(device) for tensor in module.inputs.values())
            graph = torch.export.export(module.eval(), given, dynamic_shapes=module.free, strict=True)
            program = torch.onnx.export(
                graph,
                dynamo=True,
                verbose=False,
                opset_version=OPSET,
                input_names=[*module.inputs],
                output_names=["output", "mean", "factor"][: len(graph.graph_signature.user_outputs)],
            )
    finally:
        logging.disable(logging.NOTSET)
    assert program is not None  # as dynamo is asked for
    return program.model_proto


def _halved(network: Any) -> bytes:
    """The model with those weights in half precision that it holds exactly; they are cast when the model is opened."""
    onnx, graph, casts = importlib.import_module("onnx"), network.graph, []
    for weight in graph.initializer:
        values = onnx.numpy_helper.to_array(weight)
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        if values.dtype != np.float32 or values.size < 64 or not np.array_equal(half.astype(np.float32), values):
            continue
        name = weight.name
        weight.CopyFrom(onnx.numpy_helper.from_array(half, f"{name}.half"))
        casts.append(onnx.helper.make_node("Cast", [f"{name}.half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:], graph.value_info[:]
    for part in (network, graph, *nodes):  # where each line of torch came from is of no use to a reader of the file
        del part.metadata_props[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(network)
    return network.SerializeToString()


# What the sampling of an exported network needs besides, in JSON values; lists are rows of matrices.


def _of_prediction(model: Predictor) -> dict[str, Any]:
    """How histories become conditions and coefficients futures, if the transform is one matrix along time; else no matrices."""
    seen, bodies, s = model.representation, model.bodies, model.sampling
    scales = {"": seen.motion, "condition_": seen.condition}
    rows = model.transform.time_rows()
    return {
        "system": "prediction", "prediction": model.cfg.diffusion.prediction, "shape": [*model.transform.shape],
        "history": seen.history, "frames": seen.frames, "fps": bodies.fps, "up": bodies.up, "relative": seen.relative,
        "facing": seen.facing is not None, "skeleton": of_skeleton(bodies.skeleton),
        "sampling": {
            "steps": s.ddim_steps, "spacing": s.spacing, "temperature": s.temperature, "guidance": s.guidance_weight,
            "form": s.guidance_form, "decoding": s.decoding, "bones": s.bones,
            "spread": temperatures(DRAWN, 1.0, s.temperature_spread).tolist(),
        },
        # Analysis (all, T), and of the continuation what acts on coefficients (F, all) and on the history (F, H).
        "matrices": None if rows is None else {
            "analysis": _numbers(rows), "of_coefficients": _numbers(model.continuation.of_coefficients.array),
            "of_history": _numbers(model.continuation.of_history.array),
        },
        "scales": {
            f"{of}{name}": _numbers(getattr(scale, name)) for of, scale in scales.items() for name in ("mean", "deviation")
        },
    }  # fmt: skip


def _of_keyframes(model: Bridge) -> dict[str, Any]:
    """The statistics of its `Representation`."""
    seen, bodies, s, task = model.representation, model.space.bodies, model.cfg.sampling, model.cfg.task
    learnt = {name: _numbers(tensor) for name, tensor in seen.learnt().items() if name != "departure"}  # that is 1
    return {
        "system": "inbetweening", "prediction": model.cfg.diffusion.prediction, "fps": bodies.fps, "up": bodies.up,
        "skeleton": of_skeleton(bodies.skeleton), "frames": task.gap, "between": [task.shortest, task.between],
        "coast": model.cfg.model.coast, "least_room": LEAST, "rows": model.cfg.model.rows,
        "sampling": {"steps": s.ddim_steps, "spacing": s.spacing, "temperature": s.temperature, "bones": s.bones}
        | {"centred": model.cfg.model.mean_width > 0},
        **learnt,
    }  # fmt: skip


def _of_text(model: TextToMotion) -> dict[str, Any]:
    """Words, statistics of the features, how they become joints, and how typed sentences are put into the grammar's words."""
    layout, s, words = model.layout, model.sampling, model.net.text.vocabulary
    of_people = model.cfg.data.data == "people"
    return {
        "system": "text_to_motion", "fps": layout.fps, "metres_per_unit": layout.metres_per_unit, "lengths": [*model.lengths],
        "frames_per_token": model.cfg.model.frames_per_token, "mask_frames": model.cfg.model.mask_frames,
        "skeleton": of_skeleton(layout.skeleton), "contact_joints": [*layout.contact_joints],
        "arm_joints": [*layout.arm_joints], "blocks": {name: [block.start, block.stop] for name, block in layout.blocks.items()},
        "weights": {"step": STEP_WEIGHT, "contact": CONTACT_WEIGHT, "height": HEIGHT_WEIGHT, "arm": ARM_WEIGHT},
        "mean": _numbers(model.statistics.mean), "deviation": _numbers(model.statistics.deviation),
        "sampling": {
            "sampler": s.sampler, "steps": s.sampling_steps or model.cfg.forward.steps, "guidance": s.guidance,
            "guidance_above": s.guidance_above,
        },
        "words": [*words], "typed": tables() | {"timed": TIMED, "times": usual_times()} if of_people else None,
    }  # fmt: skip


def of_skeleton(skeleton: Skeleton) -> dict[str, Any]:
    """Names, parents and sides of joints, in JSON values."""
    return {name: [*getattr(skeleton, name)] for name in ("joints", "parents", "left", "right")}


def _numbers(array: np.ndarray | Tensor) -> list[Any]:
    """An array as numbers that float32 tells apart, in as few digits."""
    return json.loads(json.dumps(np.asarray(array, np.float32).astype(str).tolist()).replace('"', ""))


KINDS: dict[type[TrainedModel], tuple[Any, Any]] = {  # -> what is traced of a model, and what its sampling needs besides
    Predictor: (_OfCoefficients, _of_prediction),
    Bridge: (_OfKeyframes, _of_keyframes),
    TextToMotion: (_OfSentences, _of_text),
}
