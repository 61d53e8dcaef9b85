"""Tiny motion files in every text format, and a seeded mutator that spoils them."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path

import numpy as np

# A stick figure in centimetres: 2.3 m along the bones from a foot to the other side's hand.
BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT LeftLeg
  {
    OFFSET 10 -80 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0 -5 12
    }
  }
  JOINT RightLeg
  {
    OFFSET -10 -80 0
    CHANNELS 3 Xrotation Yrotation Zrotation
  }
  JOINT Chest
  {
    OFFSET 0 60 0
    CHANNELS 3 Yrotation Xrotation Zrotation
    JOINT LeftHand
    {
      OFFSET 85 0 0
      CHANNELS 1 Zrotation
    }
    JOINT RightHand
    {
      OFFSET -85 0 0
      CHANNELS 4 Yposition Zrotation Xrotation Yrotation
    }
  }
}
MOTION
Frames: 3
Frame Time: .0083333
1 90 2 10 20 30 1 2 3 4 5 6 7 8 9 10 3 40 41 42
2 91 2 11 20 30 1 2 3 4 5 6 7 8 9 11 4 43 44 45
3 92 2 12 20 30 1 2 3 4 5 6 7 8 9 12 5 46 47 48
"""

ASF = """# comment
:version 1.10
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lleg
     direction 0 -1 0
     length 16
     axis 10 20 30 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-70.0 70.0)
  end
  begin
     id 2
     name rleg
     direction 0.6 -0.8 0
     length 16
     axis 0 0 0 XYZ
    dof rx rz
  end
  begin
     id 3
     name chest
     direction 0 1 0
     length 10
     axis 0 0 20 XYZ
  end
  begin
     id 4
     name larm
     direction 1 0 0
     length 15
     axis -90 0 20 XYZ
    dof ry
  end
:hierarchy
  begin
    root lleg rleg chest
    chest larm
  end
"""

AMC = """#!OML:ASF some path
:FULLY-SPECIFIED
:DEGREES
1
root 1 17 2 10 20 30
lleg 1 2 3
rleg 4e0 5
larm -6
2
root 1.5 17.1 2 11 21 31
lleg 1.5 2.5 3.5
rleg 4.5 5.5
larm -6.5e-1
"""

BENCHMARK = "\n".join(
    ",".join(str(v) for v in [1.5, 17.7, -29.0 + row, *([0.0] * 3 if row == 0 else [0.1, 0.2, 0.3]), *([0.1 * row] * 111)])
    for row in range(3)
)

WORDS = (
    "nan inf -inf 1e308 -1e308 1e12 999999999999 10000000000000000000000 -1 0 0x10 1_0 { } ROOT begin end : , ; \x00 é".split()
)


def mutate(data: bytes, rng: random.Random) -> bytes:
    """One to four random injuries: flipped bytes, deleted, doubled or swapped lines, replaced words, truncation."""
    for _ in range(rng.randint(1, 4)):
        kind = rng.randrange(6)
        lines = data.split(b"\n")
        at = rng.randrange(len(lines))
        if kind == 0 and data:
            place = rng.randrange(len(data))
            data = data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :]
        elif kind == 1:
            data = b"\n".join(lines[:at] + lines[at + 1 :])
        elif kind == 2:
            data = b"\n".join(lines[:at] + [lines[at]] * rng.choice((2, 2, 300)) + lines[at + 1 :])
        elif kind == 3:
            words = list(re.finditer(rb"[^\s,]+", data)) or [re.match(b"", data)]
            word = rng.choice(words)
            data = data[: word.start()] + rng.choice(WORDS).encode() + data[word.end() :]
        elif kind == 4:
            data = data[: rng.randrange(len(data) + 1)]
        else:
            other = rng.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
            data = b"\n".join(lines)
    return data


def write_positions_3d(path: Path, tree: object) -> Path:
    """An npz file as VideoPose3D writes it."""
    np.savez_compressed(path, positions_3d=np.array(tree, dtype=object))
    return path


def python2_pickle(subject: str, action: str, array: np.ndarray) -> bytes:
    """{subject: {action: array}} in a 0-d object array, as NumPy pickles it under Python 2: text where Python 3 has bytes."""

    def text(word: bytes) -> bytes:
        return b"T" + struct.pack("<i", len(word)) + word

    def number(value: int) -> bytes:
        return b"J" + struct.pack("<i", value)

    def pickled(shape: bytes, code: bytes, order: bytes, content: bytes) -> bytes:
        head = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\x00t" + text(b"b") + b"tR"
        kind = b"cnumpy\ndtype\n(" + text(code) + b"K\x00K\x01tR(K\x03" + text(order) + b"NNN" + number(-1) * 2 + b"K\x00tb"
        return head + b"(K\x01" + shape + kind + b"I00\n" + content + b"tb"

    shape = b"(" + b"".join(number(n) for n in array.shape) + b"t"
    inner = pickled(shape, b"f4", b"<", text(array.astype("<f4").tobytes()))
    tree = b"}" + text(subject.encode()) + b"}" + text(action.encode()) + inner + b"ss"
    return b"\x80\x02" + pickled(b"(t", b"O8", b"|", b"]" + tree + b"a") + b"."


def tree_bvh(joints, parents, offsets, channels, rows, step: str = "0.0333333") -> str:
    """BVH text of any tree; `channels` names each joint's channels; End Sites under the joints that have no children."""

    def joint(i: int) -> str:
        inner = "".join(joint(c) for c, p in enumerate(parents) if p == i) or "End Site { OFFSET 0 1 2 }\n"
        head = f"{'JOINT' if i else 'ROOT'} {joints[i]}\n{{\nOFFSET {' '.join(map(str, offsets[i]))}\n"
        return f"{head}CHANNELS {len(channels[i])} {' '.join(channels[i])}\n{inner}}}\n"

    table = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows)
    return f"HIERARCHY\n{joint(0)}MOTION\nFrames: {len(rows)}\nFrame Time: {step}\n{table}\n"
