"""Spoilt arguments: each is refused by a ValueError that names it, says what was found and what is expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.data.windows import prepare
from mwlib.synthetic import synthetic_motions
from tests.inbetweening import sample as bridges
from tests.sample_settings import two_people, untrained

pytestmark = pytest.mark.usefixtures("unchecked")


@pytest.fixture(scope="module")
def predictor():
    return untrained()


@pytest.fixture(scope="module")
def clips() -> list[mw.Motion]:
    return prepare(synthetic_motions(subjects=1)[:2], 10.0)


def times(motion: mw.Motion, factor: float) -> mw.Motion:
    """The same numbers in another unit, or none at all."""
    return replace(motion, positions=motion.positions * factor, rig=None)


def half(motion: mw.Motion) -> mw.Motion:
    """Numbers that are too large for their kind."""
    return replace(motion, positions=np.full_like(motion.positions, np.inf, np.float16), rig=None)


def past() -> torch.Tensor:
    return mw.windows(two_people().train, 6, 14, 9).x_history[:5]


NO_NUMBERS = [("1", "'1'"), (1.0, "1.0"), (1.5, "1.5"), (True, "True"), (float("nan"), "nan"), ([1], r"\[1\]"), (2j, "2j")]
SEEDS = [(value, f"seed is {found}.*; expected a whole number, at least 0") for value, found in NO_NUMBERS] + [
    (-1, "seed is -1; expected at least 0"),
    (np.float32(1), "seed is float32 of shape .*; expected a whole number"),
    (np.bool_(True), "seed is .*; expected a whole number"),
    (torch.tensor(True), "seed is Tensor of shape .*; expected a whole number"),
]
SAMPLES = [(value, f"samples is {found}.*; expected a whole number, at least 1") for value, found in NO_NUMBERS]
SAMPLES += [(0, "samples is 0; expected at least 1"), (-3, "samples is -3; expected at least 1")]
SAMPLES += [(10**12, "samples is 10{12}; expected at most 100000"), (10**40, r"samples is 1e\+40; expected at most 100000")]
SOURCES = {
    "none": (lambda clips: None, "source is None; expected Motions, Windows or a tensor"),
    "number": (lambda clips: 5, "source is 5; expected Motions"),
    "text": (lambda clips: "walk", "source is 'walk'; expected Motions"),
    "lists": (lambda clips: [[0.0] * 48], r"source holds \['list'\]; expected Motions"),
    "nothing": (lambda clips: [], "source holds nothing; expected Motions"),
    "with none": (lambda clips: [*clips, None], r"source holds \['Motion', 'NoneType'\]; expected Motions"),
    "objects": (lambda clips: past().numpy().astype(object), "source is an array of object; expected real numbers"),
    "texts": (lambda clips: past().numpy().astype(str), "source is an array of <U.*; expected real numbers"),
    "complex": (lambda clips: past().to(torch.complex64), "source is a tensor of torch.complex64.*; expected a dense one"),
    "bool": (lambda clips: past() > 0, "source is a tensor of torch.bool.*; expected a dense one"),
    "sparse": (lambda clips: past().to_sparse(), "source is a tensor of .*torch.sparse_coo, .*; expected a dense one"),
    "meta": (lambda clips: past().to("meta"), "source is a tensor of torch.float32, .* on meta; expected a dense one"),
    "frames": (lambda clips: past()[:, :5], r"x_history has shape \(5, 5, 48\); expected \(N, 6, 48\)"),
    "two dimensions": (lambda clips: past()[0], r"x_history has shape \(6, 48\); expected \(N, 6, 48\)"),
    "nested": (lambda clips: torch._nested_tensor_from_tensor_list([past()[0], past()[1]]), "source is a tensor of"),
    "masked": (lambda clips: np.ma.masked_greater(past().numpy(), 0.3), "x_history of window 0 is not finite or holds"),
    "huge": (lambda clips: past().double() * 1e308, "window 0 is not finite or holds numbers over 1e.07; expected metres"),
    "no windows": (lambda clips: past()[:0], "there are no windows"),
    "inf": (lambda clips: past().index_fill(0, torch.tensor(3), torch.inf), "x_history of window 3 is not finite or holds"),
    "clip nan": (lambda clips: [clips[0], times(clips[1], np.nan)], r"source\[1\] \(.+\) is not finite in frame 0; exp"),
    "clip of objects": (lambda clips: [replace(clips[0], positions=clips[0].positions.astype(object), rig=None)], "of object"),
    "mm": (lambda clips: 1000 * past(), r"x_history of window 0 shows a body of 1.+e\+03 m: a person of 1.* if the unit is mm"),
    "cm": (lambda clips: [clips[0], times(clips[1], 100)], "of window 1 shows a body of 1.. m: .* if the unit is cm"),
    "far": (lambda clips: [times(clips[0], 1e30)], r"source\[0\] .* holds places over 1e.07 m in frame 0; expected metres"),
    "half": (lambda clips: [half(clips[0])], r"source\[0\] .* is not finite in frame 0; expected metres"),
    "no rate": (lambda clips: [replace(clips[0], fps=1e-9)], "frames at fps 1e-09, .* s; expected at most 1000000 frames"),
    "small": (lambda clips: 0.1 * past(), r"shows a body of 0.1.* m; expected metres, and a human of 0.5 to 2.5 m"),
    "one place": (lambda clips: 0 * past(), "shows a body of 0 m; expected metres, and a human"),
}  # fmt: skip
OPTIONS = [
    *[("samples", *row) for row in SAMPLES], *[("seed", *row) for row in SEEDS],
    ("chunk", 0, "chunk is 0; expected at least 1"), ("chunk", -1, "chunk is -1; expected at least 1"),
    ("chunk", 2.0, "chunk is 2.0; expected a whole number"), ("chunk", False, "chunk is False; expected a whole number"),
    ("window_ids", 5, "window_ids is 5; expected several whole numbers"),
    ("window_ids", "01234", "window_ids is '01234'; expected several"),
    ("window_ids", [0.5, 1, 2, 3, 4], r"window_ids\[0\] is 0.5; expected a whole number, at least 0"),
    ("window_ids", [0, 1, None, 3, 4], r"window_ids\[2\] is None; expected a whole number"),
    ("window_ids", [0, 1, 2, 3, -1], r"window_ids\[4\] is -1; expected at least 0"),
    ("window_ids", torch.rand(5), r"window_ids\[0\] is Tensor of shape \(\); expected a whole number"),
    ("window_ids", torch.tensor(3), "window_ids is Tensor of shape .*; expected several"),
    ("window_ids", range(4), "window_ids has 4 entries for 5 windows"),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore:The PyTorch API of nested tensors")
@pytest.mark.parametrize("source, message", SOURCES.values(), ids=SOURCES)
def test_predict_refuses_what_no_future_follows_from(predictor, clips, source, message):
    with pytest.raises(ValueError, match=message):
        predictor.predict(source(clips), 1)


@pytest.mark.parametrize("name, value, message", OPTIONS)
def test_predict_refuses_numbers_that_are_none(predictor, name, value, message):
    with pytest.raises(ValueError, match=message):
        predictor.predict(past(), **{"samples": 1, name: value})


def test_predict_takes_numbers_of_any_library_and_a_single_motion(predictor, clips):
    x, ids = past(), [4, 3, 2, 1, 0]
    expected = predictor.predict(x, 2, 7, window_ids=ids)
    for kind in (torch.tensor, np.array, tuple):
        assert torch.equal(predictor.predict(x, np.int64(2), torch.tensor(7), window_ids=kind(ids), chunk=np.int32(9)), expected)
    assert torch.equal(predictor.predict(clips[0], 2), predictor.predict(clips[:1], 2))
    for same in (x.double(), x.numpy().astype(np.float64), x.numpy().astype(">f4"), np.asfortranarray(x.numpy()),
                 x.flip(0).numpy()[::-1], x.numpy().astype(np.longdouble)):  # fmt: skip
        assert torch.equal(predictor.predict(same, 2, 7, window_ids=ids), expected)


def test_samples_that_overflow_are_refused_with_the_settings(predictor):
    hot = predictor.with_sampling(guidance_weight=1e30)
    with pytest.raises(
        ValueError, match=r"samples are not finite: .*guidance_weight=1e\+30.*; expected such as keep them finite"
    ):
        hot.predict(past(), 1)


WINDOWS = [
    *[(name, -5, f"{name} is -5; expected at least 1") for name in ("history", "future", "stride")],
    *[(name, 0, f"{name} is 0; expected at least 1") for name in ("history", "future", "stride")],
    *[(name, 0.5, f"{name} is 0.5; expected a whole number, at least 1") for name in ("history", "future", "stride")],
    ("stride", True, "stride is True; expected a whole"), ("future", 10**30, r"future is 1e\+30; expected at most 1000000"),
    ("motions", None, "motions is None; expected Motions"), ("motions", [], "motions holds nothing; expected Motions"),
    ("motions", [None], r"motions holds \['NoneType'\]; expected Motions"),
    ("motions", np.zeros((40, 17, 3)), r"motions is ndarray of shape \(40, 17, 3\); expected Motions"),
]  # fmt: skip


@pytest.mark.parametrize("name, value, message", WINDOWS)
def test_windows_refuses_what_cannot_be_cut(clips, name, value, message):
    with pytest.raises(ValueError, match=message):
        mw.windows(**{"motions": clips, "history": 6, "future": 14, "stride": 5, name: value})


def test_windows_refuses_places_that_are_no_numbers_and_takes_one_motion(clips):
    bad = times(clips[1], 1.0)
    bad.positions[7, 3, 1] = np.nan
    with pytest.raises(ValueError, match=r"motions\[1\] \(.+\) is not finite in frame 7; expected metres"):
        mw.windows([clips[0], bad], 6, 14, 5)
    assert torch.equal(mw.windows(clips[0], 6, 14, 5).x, mw.windows(clips[:1], 6, 14, 5).x)


def test_windows_names_the_clips_that_are_too_short(clips):
    short = [replace(clips[0].cut(0, 20), name=f"short {n}") for n in range(7)]
    with pytest.warns(
        UserWarning, match=r"7 of 8 clips give no window.*longer than 20 frames.*short 0 \(20 frames\).*4 .*, \.\.\.;"
    ):
        assert set(mw.windows([clips[0], *short], 6, 14, 5).clip.tolist()) == {0}


POSES = [
    ("start", lambda walk: None, "start is None; expected a Motion"),
    ("start", lambda walk: [walk], r"start is \[Motion.*list\); expected a Motion"),
    ("start", lambda walk: times(walk, np.nan), r"start \(.+\) is not finite in frame 0; expected metres"),
    ("start", lambda walk: times(walk, 100), r"start shows a body of 1.. m: .* if the unit is cm; expected metres, and a human"),
    ("end", lambda walk: times(walk, np.nan), r"end \(.+\) is not finite in frame 0; expected metres"),
    ("end", lambda walk: times(walk, 1000), r"end shows a body of 1.+e\+03 m: .* if the unit is mm; expected metres"),
    ("end", lambda walk: None, "end is None; expected several whole numbers: the numbers of keyframes in start; or a Motion"),
    ("end", lambda walk: 8, "end is 8; expected several whole numbers"),
    ("end", lambda walk: [0.5, 5], r"end\[0\] is 0.5; expected a whole number, at least 0"),
    ("end", lambda walk: [-1, 6], r"end\[0\] is -1; expected at least 0"),
    ("end", lambda walk: [0, 10**20], r"keyframes are \[0, 1.*\] of a motion of .* frames at 10 Hz; expected"),
    ("end", lambda walk: away(walk, 1000.0), r"keyframes 0 and 1 are 99. m and 0.7 s apart.*1.4.e.03 m/s; expected at most 12"),
    ("end", lambda walk: away(walk, 16.0), r"which needs 1[345]\.?\d* m/s; expected at most 12 m/s: more frames, or nearer"),
    *[("frames", lambda walk, value=value: value, f"frames is {found}.*; expected a whole") for value, found in NO_NUMBERS],
    ("frames", lambda walk: 0, "frames is 0; expected at least 1"),
    ("frames", lambda walk: 10**18, "frames is 1e.18; expected at most"),
    ("frames", lambda walk: 60, "frames between is 60; expected 6 to 6, for which the model was trained"),
    *[("seed", lambda walk, value=value: value, message) for value, message in SEEDS],
    *[("samples", lambda walk, value=value: value, message) for value, message in SAMPLES],
]  # fmt: skip


def away(motion: mw.Motion, metres: float) -> mw.Motion:
    """The same motion elsewhere."""
    return replace(motion, positions=motion.positions + np.array([metres, 0, 0], motion.positions.dtype), rig=None)


@pytest.fixture(scope="module")
def bridge():
    return bridges.untrained()


@pytest.mark.parametrize("name, make, message", POSES)
def test_inbetween_refuses_what_no_motion_lies_between(bridge, clips, name, make, message):
    with pytest.raises(ValueError, match=message):
        mw.inbetween(**{"start": clips[0], "end": clips[0], "frames": 6, "run": bridge, name: make(clips[0])})


def test_inbetween_refuses_keyframes_of_one_motion_that_nobody_gets_to(bridge, clips):
    torn = clips[0].positions.copy()
    torn[10:] += [200, 0, 0]
    with pytest.raises(
        ValueError, match=r"keyframes 0 and 1 are 2.*e?\+?0?2? m and 0.7 s apart, which needs 2.. m/s; expected at m"
    ):
        mw.inbetween(replace(clips[0], positions=torn, rig=None), [8, 15], run=bridge)
    assert len(mw.inbetween(clips[0], [8, 15], run=bridge)) == 1


def test_inbetweens_that_overflow_are_refused_with_the_settings(bridge, clips):
    with pytest.raises(ValueError, match=r"samples are not finite: .*temperature=1e\+38.*; expected such as keep them finite"):
        mw.inbetween(clips[0].cut(0, 8), [0, 7], run=bridge.with_sampling(temperature=1e38))


PATHS = [None, 5, b"runs", ["runs"], 1.5]
RATES = [("25", "'25'"), (True, "True"), (float("nan"), "nan"), (float("inf"), "inf"), ([25], r"\[25\]"), (1j, "1j")]


@pytest.mark.parametrize("value", PATHS, ids=repr)
def test_what_is_no_path_is_refused(value):
    with pytest.raises(ValueError, match="source is .*; expected a path, 'synthetic' or one of tiny"):
        mw.load_motions(value)
    with pytest.raises(ValueError, match="folder is .*; expected the folder of a run or one of .*synthetic"):
        mw.load_run(value)


@pytest.mark.parametrize("name", ["fps", "file_fps"])
@pytest.mark.parametrize("value, found", RATES)
def test_rates_that_are_none_are_refused(name, value, found):
    with pytest.raises(ValueError, match=f"^{name} is {found}.*; expected a finite number"):
        mw.load_motions("synthetic", **{name: value})


def test_runs_that_are_none_are_refused_for_in_betweens(clips, predictor):
    for run, found in ((None, "None"), (5, "5"), (predictor, "<mwlib.*")):
        with pytest.raises(
            ValueError, match=f"run is {found}; expected a run of in-betweening: its folder, its name or its model"
        ):
            mw.inbetween(clips[0], [8, 15], run=run)


OBJECTS = [
    *[("Motion", {"positions": value}, "positions is .*; expected a NumPy array of real numbers")
      for value in (None, "x", 5, [[[0.0] * 3] * 17], torch.zeros(5, 17, 3), np.zeros((5, 17, 3), complex),
                    np.full((5, 17, 3), None), np.full((5, 17, 3), "0"), np.zeros((5, 17, 3), bool))],
    ("Motion", {"positions": np.zeros((5, 3))}, r"positions have shape \(5, 3\); expected \(T, 17, 3\)"),
    *[("Motion", {"fps": value}, f"fps is {found}.*; expected a finite number") for value, found in RATES],
    ("Motion", {"fps": None}, "fps is None; expected a finite"), ("Motion", {"fps": 0}, "fps is 0; expected a positive"),
    ("Motion", {"skeleton": "H36M17"}, "skeleton is 'H36M17'; expected a Skeleton"),
    *[("Motion", {name: 5}, f"{name} is 5; expected a text") for name in ("subject", "action", "name")],
    ("Motion", {"up": ["z"]}, r"up is \['z'\] \(list\); expected one of y, z"),
    ("Motion", {"rig": {}}, "rig is .*; expected a Rig"),
    *[("resample", {"fps": value}, f"fps is {found}.*; expected a finite number") for value, found in RATES],
    *[("turn", {"angle": value}, f"angle is {found}.*; expected a finite number") for value, found in RATES],
    ("with_up", {"up": []}, r"up is \[\].*; expected one of y, z"), ("with_up", {"up": "x"}, "up is 'x'; expected one of y, z"),
    ("retarget", {"skeleton": "CMU"}, "skeleton is 'CMU'; expected a Skeleton"),
    *[("cut", {"start": value, "stop": 9}, f"start is {found}.*; expected a whole number") for value, found in NO_NUMBERS],
    ("cut", {"start": -5, "stop": 9}, "start is -5; expected at least 0"),
    ("cut", {"start": 900, "stop": 901}, "start is 900; .* most"),
    ("cut", {"start": 5, "stop": 5}, "stop is 5; expected at least 6"),
    ("cut", {"start": 0, "stop": None}, "stop is None; expected a wh"),
    ("Skeleton", {"name": None}, "name is None; expected a text"),
    ("Skeleton", {"joints": 5}, "joints is 5; expected several names"),
    ("Skeleton", {"joints": "ab"}, "joints is 'ab'; expected several names"),
    ("Skeleton", {"joints": ("a", 5)}, r"joints\[1\] is 5; expected a text"),
    ("Skeleton", {"parents": (-1, 0.5)}, r"chain: parents\[1\] is 0.5; expected a whole number"),
    ("Skeleton", {"left": (7,), "right": (1,)}, r"chain: left\[0\] is 7; expected at most 1"),
    ("Skeleton", {"parts": 5}, "parts is 5; expected a Mapping"),
    ("Skeleton", {"parts": {5: (1,)}}, "a part is 5; expected a text"),
    ("Skeleton", {"parts": {"arm": (9,)}}, r"chain: parts\['arm'\]\[0\] is 9; expected at most 1"),
    *[("channels", {"part": value}, f"H36M17 has no part {found}; it has") for value, found in ((None, "None"), ([], r"\[\]"))],
    *[(name, {"motion": value}, f"motion is .*{type(value).__name__}.*; expected a Motion")
      for name in ("write_bvh", "write_glb") for value in ([], np.zeros(3))],
    *[(name, {"file": value}, "file is .*; expected a path") for name in ("write_bvh", "write_glb") for value in (None, b"x", 5)],
    ("write_bvh", {"up": []}, r"up is \[\].*; expected one of y, z"),
    ("thin", {"count": -3}, "count is -3; expected at least 0"),
    ("thin", {"count": 2.5}, "count is 2.5; expected a whole number"),
    ("get_run", {"cfg": None}, "cfg is None; expected a configuration"),
    ("get_model", {"cfg": "tiny"}, "cfg is 'tiny'; expected a conf"),
    ("get_run", {"data": 5}, "data is 5; expected what the system's load_data gives"),
    ("preset", {"name": None}, "preset is None; expected one of"), ("preset", {"name": []}, r"preset is \[\].*; expected one of"),
    ("preset", {"name": "tiny", "wavelet": []}, r"wavelet is \[\]"),
]  # fmt: skip


@pytest.mark.parametrize("name, spoilt, message", OBJECTS)
def test_what_people_make_and_write_themselves_is_refused(clips, tmp_path, name, spoilt, message):
    walk, file = clips[0], {"motion": clips[0], "file": tmp_path / "walk.xyz"}
    call, whole = {
        "Motion": (mw.Motion, {"positions": np.zeros((5, 17, 3)), "fps": 25.0, "skeleton": walk.skeleton}),
        "Skeleton": (mw.Skeleton, {"name": "chain", "joints": ("a", "b"), "parents": (-1, 0)}),
        "write_bvh": (mw.write_bvh, file | {"file": tmp_path / "walk.bvh"}),
        "write_glb": (mw.write_glb, file | {"file": tmp_path / "walk.glb"}),
        "thin": (mw.windows(clips, 6, 14, 5).thin, {}), "channels": (walk.skeleton.channels, {}),
        "get_run": (mw.get_run, {"cfg": mw.Config.preset("tiny")}), "get_model": (mw.get_model, {}),
        "preset": (mw.Config.preset, {}),
    }.get(name) or (getattr(walk, name), {})  # fmt: skip
    with pytest.raises(ValueError, match=message):
        call(**whole | spoilt)
    assert not [*tmp_path.iterdir()]


def test_a_skeleton_of_lists_and_numpy_numbers_is_the_one_of_tuples():
    made = mw.Skeleton("chain", ["a", "b", "c"], list(np.array([-1, 0, 0])), [1], [2], {"arm": [1]})
    assert made == mw.Skeleton("chain", ("a", "b", "c"), (-1, 0, 0), (1,), (2,), {"arm": (1,)})
    assert hash(made) and repr(made.parents) == "(-1, 0, 0)"
