"""Files of text that are no good: an injury, and the place, the finding and the expectation that the refusal names."""

from __future__ import annotations

import re

import pytest

from mwlib import MotionFormatError, load_motions
from tests.sample_motions import AMC, ASF, BENCHMARK, BVH

WHOLE = {"clip.bvh": BVH, "05_01.amc": AMC, "05.asf": ASF, "clip.txt": BENCHMARK}
DEEP = "HIERARCHY\n" + "".join(f"{'JOINT' if i else 'ROOT'} j{i} {{ OFFSET 0 0 0 CHANNELS 0\n" for i in range(100_000))

# File -> what is replaced, by what, and what is said then.
INJURIES = {
    "clip.bvh": [
        ("OFFSET 85 0 0", "OFFSET 85 0 nan", "joint LeftHand, OFFSET: found 'nan'"),
        ("HIERARCHY", "HIERARCHIE", "expected HIERARCHY"),
        ("MOTION\n", "", "no MOTION"),
        ("Frames: 3", "Frames: 1000000000000", "Frames: found '1000000000000'"),
        ("Frames: 3", "Frames: 1000000", "Frames: found '1000000'; expected .* at most 428571 for 7 joints"),
        ("Frames: 3", "Frames: 4", "3 rows; expected 4"),
        ("Frames: 3", "Frames: 0", "positive number of frames"),
        ("Frame Time: .0083333", "Frame Time: nan", "Frame Time"),
        ("Frame Time: .0083333", "Frame Time: 1e-300", "Frame Time"),
        ("40 41 42\n", "40 41\n", "number of columns changed"),
        (" 47 48", " 47 nan", r"entry \(2, 19\).*nan.*finite"),
        (" 47 48", " 47 1e308", "finite number up to"),
        (" 47 48", " 47 x", "could not convert"),
        ("CHANNELS 1 Zrotation", "", "joint LeftHand: found no CHANNELS"),
        ("OFFSET 85 0 0", "", "joint LeftHand: found no OFFSET"),
        (
            "OFFSET 85 0 0",
            "OFFSET 85,5 0 0",
            r"OFFSET: found '85,5'; expected a finite number up to 1e\+07, with a point and no comma",
        ),
        ("OFFSET 85 0 0", "OFFSET 85 0 inf", "joint LeftHand, OFFSET: found 'inf'"),
        ("CHANNELS 1 Zrotation", "CHANNELS 1 Wrotation", "wrotation"),
        ("CHANNELS 1 Zrotation", "CHANNELS 2 Zrotation Zrotation", "different ones"),
        ("CHANNELS 1 Zrotation", "CHANNELS 99999999 Zrotation", "from 0 to 6"),
        ("RightHand", "LeftHand", "two joints named 'LeftHand'"),
        ("End Site", "End Sight", "End Site"),
        ("}\nMOTION", "MOTION", "1 open braces"),
        ("}\nMOTION", "}\n}\nMOTION", "'}'"),
        ("}\nMOTION", "}\nROOT Other { OFFSET 0 0 0 CHANNELS 0 }\nMOTION", "one ROOT"),
        ("ROOT Hips", f"ROOT {'Hips' * 100}", "a name of at most 200 characters"),
        ("Frame Time: .0083333", "Frame Time: 8.3333", "found 8.3333, which looks like milliseconds; expected seconds"),
        (
            BVH.split("MOTION")[0],
            "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 0 End Site { OFFSET 0 1 0 } }\n",
            "one joint; expected at least two",
        ),
        (BVH.split("MOTION")[0], DEEP, "at most 500, 200 deep"),
        (BVH.split("Time:")[1], " 0.1\n", "no line"),
        (BVH, "", "an empty file"),
    ],
    "05_01.amc": [
        ("larm -6\n", "", "frame 1: found no larm"),
        ("larm -6\n", "larm -6 7\n", "larm with 2 numbers; expected 1"),
        ("larm -6\n", "tail -6\n", "tail with 1 numbers"),
        ("larm -6\n", "lleg 1 2 3\n", "lleg with 3 numbers; expected 3 numbers, once"),
        ("larm -6\n", "larm nan\n", "finite"),
        ("larm -6.5e-1\n", "", "frames: found the number of columns changed"),
        ("larm -6.5e-1\n", "barm -6.5e-1\n", "frames: found could not convert string 'barm' .* at row 1"),
        ("larm -6.5e-1\n", "larm x\n", "could not convert string 'x' .* at row 1"),
        ("larm -6.5e-1\n", "larm 1e300\n", "finite number up to"),
        ("rleg 4.5 5.5\nlarm -6.5e-1\n", "larm -6.5e-1\nrleg 4.5 5.5\n", "frame 2: found other bones"),
        ("\n2\nroot", "\n3\nroot", "after frame 1: found frame 3"),
        ("\n2\nroot", "\nroot", "frame 1: found root with 6 numbers; expected 6 numbers, once"),
        (AMC.split(":DEGREES")[1], "", "no frame"),
        (AMC, "", "no frame"),
    ],
    "05.asf": [
        ("name rleg", "name lleg", "bone lleg: found it twice"),
        ("name rleg", "name root", "bone root"),
        ("     name rleg\n", "", "no name"),
        ("direction 0.6 -0.8 0", "direction 0.6 -0.8", "2 words; expected 3 numbers"),
        ("direction 0.6 -0.8 0", "direction 6 -8 0", "unit vector"),
        ("length 10", "length -10", "expected 0 or more"),
        ("length 10", "length inf", "'inf'"),
        ("length 0.45", "length 0", "0.001 to 1000"),
        ("angle deg", "angle turns", "deg or rad"),
        ("-90 0 20 XYZ", "-90 0 20 ZYX", "'ZYX'; expected XYZ"),
        ("dof ry", "dof ry ry", "different ones"),
        ("dof ry", "dof rx ry", "larm with 1 numbers; expected 2"),
        ("dof ry", "dof tx", "different ones of rx"),
        ("order TX TY TZ", "order TX TY TY", "tx ty ty"),
        ("    chest larm\n", "", "larm does not hang"),
        ("    chest larm\n", "    chest larm\n    lleg larm\n", "larm under lleg"),
        ("    chest larm\n", "    larm larm\n", "larm does not hang"),
        ("    chest larm\n", "    chest tail\n", "tail under chest"),
        (":hierarchy", ":bonedata", "this section twice"),
        ("  begin\n     id 2", "     id 2", "begin to end"),
        (ASF, "", "0 whole bones"),
    ],
    "clip.txt": [
        (BENCHMARK, BENCHMARK + ",0", "number of columns"),
        (BENCHMARK, BENCHMARK.replace(",", " "), "could not convert"),
        (BENCHMARK, "1,2,3", "3 columns; expected lines of 117"),
        ("17.7", "nan", r"entry \(0, 1\): found nan"),
        (BENCHMARK, "", "no line"),
    ],
}


@pytest.mark.parametrize("file, old, new, message", [(file, *row) for file, rows in INJURIES.items() for row in rows])
def test_a_spoilt_file_is_refused_by_name_and_place(tmp_path, file, old, new, message):
    assert old in WHOLE[file]
    for name in ("05.asf", "05_01.amc") if file in ("05.asf", "05_01.amc") else (file,):
        (tmp_path / name).write_text(WHOLE[name].replace(old, new, 1) if name == file else WHOLE[name])
    with pytest.raises(MotionFormatError, match=message) as caught:
        load_motions(tmp_path / ("05_01.amc" if file == "05.asf" else file))
    assert re.search(r"clip.bvh|05_01.amc|05.asf|clip.txt", str(caught.value))
