"""What reading places, steps and contacts together does to generated bodies: jerk, sliding feet, bones, beside the truth.

    python benchmarks/fused_joints.py [--clips 360]

One caption of each test clip, one motion each; means over clips, with standard errors.
"""

from __future__ import annotations

import argparse

import torch

import mwlib as mw
from mwlib.body.kinematics import bones_of
from mwlib.data.formats.humanml import FeatureLayout, joints_of
from mwlib.metrics import foot_skate, jerk, speed
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.dataset import load_clips
from mwlib.text_to_motion.draws import one_caption_each
from mwlib.text_to_motion.motions import fused_joints

NAMES = ("speed (m/s)", "jerk (m/s³)", "skate (m/s)", "bones from frame to frame (mm)")


def movement(joints: torch.Tensor, layout: FeatureLayout) -> list[float]:
    """The four numbers of a motion (T, J, 3)."""
    flat, toes = joints.flatten(-2)[None, None], layout.contact_joints[1::2]
    floor = float(joints[:, toes, 1].amin())
    bones = bones_of((joints[:, 1:] - joints[:, :1]).flatten(-2), layout.skeleton).norm(dim=-1)
    slides = foot_skate(joints.flatten(-2), toes, layout.fps, up="y", floor=floor)
    return [
        float(speed(flat, layout.fps)),
        float(jerk(flat, layout.fps)),
        float(slides),
        1000 * float(bones.diff(dim=0).abs().mean()),
    ]


def main() -> None:
    """Sample, read in both ways, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=360, help="test clips at most (default 360: all)")
    args = parser.parse_args()
    model, parts = mw.load_run("sentences"), load_clips(Config.preset("laptop").data)
    test, layout = parts.test[: args.clips], parts.layout
    lengths = [len(clip.features) // 4 * 4 for clip in test]
    made = [x.double() for x in model.sample(one_caption_each(test, 0), lengths, 0, progress=True)]
    rows = {
        "truth": [joints_of(torch.from_numpy(clip.features).double(), layout) for clip in test],
        "places alone": [joints_of(x, layout) for x in made],
        "places, steps and contacts": [fused_joints(x, layout) for x in made],
    }
    for name, motions in rows.items():
        values = torch.tensor([movement(joints, layout) for joints in motions])
        for what, column in zip(NAMES, values.T, strict=True):
            there = column[~column.isnan()]
            print(f"{name:28} {what:32} {there.mean():8.3f} ± {there.std() / len(there) ** 0.5:.3f}")


if __name__ == "__main__":
    main()
