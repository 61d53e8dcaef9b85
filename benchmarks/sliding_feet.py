"""Why feet slide between keyframes: what the sines lose, what the models do where the true feet stand.

Needs Bandai-Namco's files under MWLIB_DATA and the trainings of the grid `bridge_feet`:
python benchmarks/sliding_feet.py figures/bandai_namco
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from torch import Tensor

from mwlib import plots
from mwlib.experiments import get_model, read_grids
from mwlib.experiments.grids import row_config
from mwlib.inbetweening.baselines import between
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.losses import STANDING, floor_of
from mwlib.inbetweening.system import Score, load_data
from mwlib.inbetweening.windows import Clips, PlacedWindows, make_space
from mwlib.metrics import foot_contacts
from mwlib.transforms import DSTTransform

SAMPLES, SUNK = 4, 0.01  # motions of a window; metres below the floor


def described(score: Score, cut: PlacedWindows, x: Tensor) -> dict[str, float]:
    """Skate and jerk of samples (N, S, T, C), and their feet: all, and where and when those of the truth stand."""
    feet, fps = score.feet, score.fps
    truth = score.space.positions(cut.x, cut.offsets)
    floor = floor_of(truth, feet)
    found, joints = score(x, cut), score.space.positions(x, cut.offsets[:, None])
    stand = foot_contacts(truth, feet, fps, floor=floor, fastest=STANDING)[:, None].expand(-1, x.shape[1], -1, -1)
    low = foot_contacts(joints, feet, fps, floor=floor[:, None])
    speed = joints[..., feet, :2].diff(dim=-3).norm(dim=-1) * fps
    height = joints[..., feet, 2] - floor[:, None, None, None]
    return {
        "foot skate (m/s)": float(found["skate"].nanmean()), "jerk (m/s³)": float(found["jerk"].nanmean()),
        "speed where the truth stands (m/s)": float(speed[stand].mean()),
        "height where the truth stands (mm)": 1000 * float(height[..., 1:, :][stand].mean()),
        "share of low feet": float(low.float().mean()), "share of sunk feet": float((height < -SUNK).float().mean()),
    }  # fmt: skip


def main(folder: Path) -> None:
    """Measure on the held-out styles, and write the table."""
    grid, cfg = read_grids()["bridge_feet"], Config.preset("bandai")
    split = load_data(cfg)
    space = make_space(split.train, cfg.task.state)
    cut, score = Clips(split.test, space).windows(cfg.task.frames, cfg.task.test_stride), Score.of(split, space, cfg.task.frames)
    line = between(space, cut.x, "interpolation")
    motions = {"truth": cut.x[:, None], "interpolation": line[:, None]}
    line = cut.x[:, :1] + (cut.x[:, -1:] - cut.x[:, :1]) * torch.linspace(0, 1, cfg.task.frames)[:, None]
    for rows in (8, 16, 30):
        tf = DSTTransform(cfg.task.frames, space.channels, rows)
        motions[f"truth in {rows} sines"] = space.valid(tf.inverse(tf(cut.x - line)) + line)[:, None]
    for row in grid.rows[2:]:
        motions[row.name] = get_model(row_config(grid, row, cfg), split).sample(cut.x, samples=SAMPLES)
    table = [{"motions": name, **described(score, cut, x)} for name, x in motions.items()]
    about = {"data": cfg.data.data, "preset": "bandai", "windows": len(cut.x), "samples": SAMPLES, "seeds": [0]}
    print(plots.save_table(table, folder, "sliding_feet", provenance=about))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
