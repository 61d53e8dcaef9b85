"""What reading places, steps and contacts together does to generated bodies: jerk, feet, bones, and what they are seen to do.

    python benchmarks/fused_joints.py [--people val] [--clips 360]

One caption of each clip, one motion each; means over clips, with standard errors. Weights are chosen on `--people val`.
"""

from __future__ import annotations

import argparse

import torch

import mwlib as mw
from mwlib.body.kinematics import bones_of
from mwlib.data.captioned import load_clips, one_caption_each
from mwlib.data.formats.humanml import CaptionedClip, FeatureLayout, joints_of
from mwlib.metrics import foot_skate, jerk, speed
from mwlib.text_to_motion.attributes import measured_attributes
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.motions import fused_joints

NAMES = (
    "speed (m/s)",
    "jerk (m/s³)",
    "skate (m/s)",
    "bones from frame to frame (mm)",
    "standing feet, mean (m/s)",
    "median (m/s)",
)
CLAIMS = ("action", "path", "speed")
WEIGHTS = {"height_weight": (0.0, 0.3, 3.0, 10.0), "arm_weight": (0.0, 0.3, 1.0)}


def movement(joints: torch.Tensor, features: torch.Tensor, layout: FeatureLayout) -> list[float]:
    """The numbers of a motion (T, J, 3); a foot stands where its features say so."""
    flat, toes = joints.flatten(-2)[None, None], layout.contact_joints[1::2]
    floor = float(joints[:, toes, 1].amin())
    bones = bones_of((joints[:, 1:] - joints[:, :1]).flatten(-2), layout.skeleton).norm(dim=-1)
    feet = joints[:, list(layout.contact_joints)][..., [0, 2]].diff(dim=0).norm(dim=-1) * layout.fps
    feet = feet[features[:-1, layout.blocks["contacts"]] > 0.5]
    slides = foot_skate(joints.flatten(-2), toes, layout.fps, up="y", floor=floor)
    return [
        float(speed(flat, layout.fps)),
        float(jerk(flat, layout.fps)),
        float(slides),
        1000 * float(bones.diff(dim=0).abs().mean()),
        float(feet.mean()),
        float(feet.median()) if len(feet) else float("nan"),
    ]


def shown(joints: torch.Tensor, clip: CaptionedClip, fps: float) -> list[float]:
    """Whether rules see what the clip's person was to do; NaN where its captions claim nothing."""
    found, wanted = measured_attributes(joints.numpy(), fps), clip.attributes
    return [float(found.get(name) == wanted[name]) if name in wanted else float("nan") for name in CLAIMS]


def main() -> None:
    """Sample, read in several ways, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", choices=("val", "test"), default="test", help="whose clips (default test)")
    parser.add_argument("--clips", type=int, default=360, help="clips at most (default 360)")
    args = parser.parse_args()
    model, parts = mw.load_run("sentences"), load_clips(Config.preset("laptop").data)
    test, layout = getattr(parts, args.people)[: args.clips], parts.layout
    lengths = [len(clip.features) // 4 * 4 for clip in test]
    made = [x.double() for x in model.sample(one_caption_each(test, 0), lengths, 0, progress=True)]
    rows = {
        "truth": [joints_of(torch.from_numpy(clip.features).double(), layout) for clip in test],
        "places alone": [joints_of(x, layout) for x in made],
        "together": [fused_joints(x, layout) for x in made],
        **{
            f"together, {name} {weight:g}": [fused_joints(x, layout, **{name: weight}) for x in made]
            for name, weights in WEIGHTS.items()
            for weight in weights
        },
    }
    for name, motions in rows.items():
        said = [torch.from_numpy(clip.features) for clip in test] if name == "truth" else made
        each = zip(motions, said, test, strict=True)
        values = [movement(x, y[: len(x)], layout) + shown(x, clip, layout.fps) for x, y, clip in each]
        for what, column in zip((*NAMES, *(f"{claim} right" for claim in CLAIMS)), torch.tensor(values).T, strict=True):
            there = column[~column.isnan()]
            print(f"{name:28} {what:32} {there.mean():8.3f} ± {there.std() / len(there) ** 0.5:.3f}")
        right = torch.tensor(values)[:, len(NAMES)]
        for action in sorted({str(clip.attributes["action"]) for clip in test}):
            own = right[[clip.attributes["action"] == action for clip in test]]
            print(f"{name:28} {action + ' right':32} {own.mean():8.3f} of {len(own)}")


if __name__ == "__main__":
    main()
