"""Named settings of text-to-motion."""

from __future__ import annotations

from typing import Any

# MDM as published; its learning rate stays, its later releases average the weights (0.9999).
_MDM: dict[str, Any] = dict(
    lr=1e-4, lr_schedule="constant", weight_decay=0.0, train_steps=600_000, ema=0.9999, ema_start=2000,
)  # fmt: skip
# StableMoFusion as published: a linear schedule of 1,000 steps, sampled in 10. It averages the weights every 32 steps with a
# decay of 0.9932; here they are averaged at every step, with its 32nd root.
_STABLEMOFUSION: dict[str, Any] = dict(
    network="unet", schedule="linear", steps=1000, normalisation="stablemofusion", sampler="sde_dpm", sampling_steps=10,
    lr=2e-4, weight_decay=0.01, lr_schedule="multistep", lr_gamma=0.9, lr_milestones=tuple(range(5000, 50_000, 5000)),
    train_steps=50_000, ema=0.999787, ema_start=0, clip_gradient=1.0,
)  # fmt: skip
# Own choice, for two cores: four frames make a token, the learning rate falls along a cosine, and root and contacts weigh more,
# as in StableMoFusion: of 263 numbers four say where a body goes. So weighed, they show through a hundred times their power of
# noise: under the cosine schedule steps and ways are settled within five of 50 levels, under the linear one within twenty.
_TEACHING: dict[str, Any] = dict(
    data="people", longest=120, normalisation="stablemofusion", schedule="linear", width=192, layers=4, heads=4,
    feedforward=512, text_width=128, text_layers=1, dropout=0.0, attention_dropout=0.0, frames_per_token=4, lr=1e-3,
    lr_schedule="cosine", warmup=100, weight_decay=0.01,
    ema=0.995, ema_start=200,
)  # fmt: skip

PRESETS: dict[str, dict[str, Any]] = {
    # A minute on two cores; synthetic people.
    "tiny": _TEACHING | dict(
        clips=600, width=64, layers=2, feedforward=256, text_width=64, train_steps=400, batch=32, lr=2e-3, ema=0.99, ema_start=50,
        checkpoint_every=200, test_clips=96, repeated=8, repeats=4, pool=16,
    ),
    # Half an hour on one core; synthetic people.
    "laptop": _TEACHING | dict(train_steps=8000, batch=64, checkpoint_every=500),
    # The CMU clips at hand with their captions: far too few for more than a demonstration.
    "cmu": _TEACHING | dict(
        data="cmu", longest=196, dropout=0.1, train_steps=4000, batch=64, checkpoint_every=500, pool=16,
        evaluator="cmu_evaluator", critic="cmu_critic",
    ),
    # The published sizes, for a graphics card and a folder of HumanML3D or KIT that you give as `data`. CLIP, which both were
    # published with, is a folder of yours: text=clip clip_folder=FOLDER. The evaluator is to be trained on these data, or is a
    # folder with the published one.
    "mdm": _MDM | dict(data="HumanML3D"),
    "stablemofusion": _STABLEMOFUSION | dict(data="HumanML3D"),
}  # fmt: skip
# One name builds the figures of all systems; where the others have big data, so has this one.
PRESETS |= {"laptop_paper": PRESETS["laptop"], "cmu_paper": PRESETS["cmu"], "h36m": PRESETS["mdm"], "humaneva": PRESETS["mdm"]}
