"""What was found in motion data, beside what is known of the same data: clips.csv, and published counts of windows."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from mwlib.body.motion import Motion
from mwlib.data import known
from mwlib.data.hints import clips_row
from mwlib.data.windowing import windows

PROTOCOLS = {"HUMANEVA15": (60.0, 15, 60, 15)}  # hertz, history, future, stride
STANDARD = (50.0, 25, 100, 25)
MOST_NAMES = 12


def line(word: str, text: str) -> str:
    """A line of a report."""
    return f"  {word:<9} {text}"


def protocol(motions: list[Motion]) -> tuple[float, int, int, int]:
    """Rate, history, future and stride at which papers cut such clips."""
    return PROTOCOLS.get(motions[0].skeleton.name, STANDARD)


def window_count(motion: Motion, cut: tuple[float, int, int, int]) -> int:
    """How many windows a clip gives at this rate, history, future and stride."""
    fps, history, future, stride = cut
    return len(range(0, frames_at(motion, fps) - history - future, stride))


def frames_at(motion: Motion, fps: float) -> int:
    """How many frames a clip has at another rate."""
    return len(replace(motion, rig=None).resample(fps))  # rotations would take far longer


def frames_differ(file: Path, motion: Motion) -> list[str]:
    """Empty if clips.csv lists no such file; else "" or what differs."""
    row, table = clips_row(file)
    listed = row.get("frames") or row.get("rows")
    if listed is None:
        return []
    added = row.get("tpose_frame0") or str(int("rows" in row))
    if not re.fullmatch(r"\d{1,12}", listed) or added not in ("0", "1"):
        return [f"{motion.name} has {len(motion)}, {table.name} says {listed[:40]!r} less {added[:40]!r}"]
    expected = int(listed) - int(added)
    return ["" if len(motion) == expected else f"{motion.name} has {len(motion)}, clips.csv says {expected}"]


def known_frames(compared: list[str]) -> list[str]:
    """Lines on how many clips are as long as clips.csv says, from what `frames_differ` gave for each."""
    wrong = [text for text in compared if text]
    if not compared:
        return []
    return [
        line("known", f"frames as clips.csv says in {len(compared) - len(wrong)} of {len(compared)} clips"),
        *map(_wrong, wrong),
    ]


def _wrong(text: str) -> str:
    return line("DIFFERS", text)


def known_protocol(motions: list[Motion]) -> list[str]:
    """Published counts beside those found, for data in VideoPose3D's layout."""
    subjects = {m.subject for m in motions}
    if motions[0].skeleton.name == "HUMANEVA15":
        test = sum(window_count(m, protocol([m])) for m in motions if m.subject.startswith("Validate/"))
        return [line("known", f"{test} test windows in Validate/*; published never, at most {known.HUMANEVA_MOST_WINDOWS}")]
    if motions[0].skeleton.name != "H36M17" or not subjects & set(known.H36M_SUBJECTS):
        return []
    found = {m.name: window_count(m, protocol([m])) for m in motions if m.subject in known.H36M_TEST_SUBJECTS}
    lines = []
    for subject in (*known.H36M_TEST_SUBJECTS, ""):
        here, there = (sum(n for name, n in counts.items() if name.startswith(subject)) for counts in (found, known.H36M_WINDOWS))
        lines.append(line("known", f"{subject or 'S9 + S11'}: {here} test windows, published {there}"))
    names = [name for name in known.H36M_WINDOWS | found if found.get(name) != known.H36M_WINDOWS.get(name)]
    lines += [_wrong(f"{n}: {found.get(n, 'none')}, published {known.H36M_WINDOWS.get(n, 'none')}") for n in names[:MOST_NAMES]]
    lines += [_wrong(f"and {len(names) - MOST_NAMES} more sequences")] if len(names) > MOST_NAMES else []
    return lines + (_known_neighbours(motions) if not names else [])


def _known_neighbours(motions: list[Motion]) -> list[str]:
    """How many test windows share their last observed pose with others, against what two published codes agree on."""
    _, history, future, stride = STANDARD
    test = [m for m in motions if m.subject in known.H36M_TEST_SUBJECTS]
    last = windows(test, history, future, stride).x_history[:, -1].numpy()
    others = KDTree(last).query_ball_point(last, known.H36M_THRESHOLD, return_length=True) - 1
    counts = (int(np.sum(others == 0)), int(np.sum(others <= 9)))
    published = (known.H36M_ALONE, known.H36M_FEW)
    text = f"{counts[0]} windows without a neighbour, {counts[1]} with at most nine; published {published[0]}, {published[1]}"
    return [line("known", text)]
