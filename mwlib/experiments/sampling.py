"""Motions between keyframes and from sentences, by a model that is named."""

import difflib
import logging
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from mwlib.body.motion import Motion
from mwlib.data.doubts import some
from mwlib.experiments.runs import load_run
from mwlib.inbetweening.bridge import Bridge, filled
from mwlib.networks.matching import UNIT
from mwlib.settings import of_kind, real, several, whole
from mwlib.synthetic.acts import usual_seconds
from mwlib.synthetic.sentences import Attributes
from mwlib.synthetic.sentences_typed import as_learnt, claims, is_plain
from mwlib.text_to_motion.attributes import CLAIMS, measured_attributes
from mwlib.text_to_motion.model import WHERE_WORDS, TextToMotion
from mwlib.text_to_motion.motions import motion_of
from mwlib.text_to_motion.released import CODES, open_released

log = logging.getLogger(__name__)
INBETWEENING_MODEL, SENTENCE_MODEL = "inbetween", "sentences"  # the models that come with the package
FORESEEN = 60  # frames up to which the model that comes with the package is nearer than a straight line, by its card
MOST = 1000  # samples of a sentence: the next sentence's motions have noise of their own
SECONDS = 4.0  # of a motion, where nobody says how long it takes
AGAIN = 10**12  # identities of one attempt's motions begin so far from those of the attempt before
MOST_TOLD = 5  # unknown words in a warning, and motions that miss what was said
EXPECTED_ACTIONS = "expected one of those that `mwlib generate --words` lists, or two such as walk and then wave"
Model = TypeVar("Model")


def model_of(run: str | Path | Model, kind: type[Model], system: str) -> Model:
    """A trained model of one system.

    Args:
        run: folder of a finished run, a name that `load_run` knows, a file that `open_released` takes, or the model itself.
        kind: of the system's models.
        system: its name, for the message.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is one of another system.
    """
    if not isinstance(run, str | Path):
        return of_kind("run", run, kind, f"a run of {system}: its folder, its name or its model")
    model = open_released(run) if Path(run).suffix in CODES else load_run(run)
    if not isinstance(model, kind):
        raise ValueError(f"run is {run}, a run of another system; expected one of {system}")
    return model


def inbetween(
    start: Motion,
    end: Motion | Sequence[int],
    frames: int | None = None,
    samples: int = 1,
    seed: int = 0,
    run: str | Path | Bridge = INBETWEENING_MODEL,
    progress: bool = False,
    *,
    align: bool = False,
    own_rig: bool = False,
    join: bool = False,
    feet: bool = True,
) -> list[Motion]:
    """Motions that leave one pose and arrive at another.

    Give `start` and `end` two frames or more: then their velocities are known, and the motion leaves and arrives with them. From
    two single poses the model that comes with the package is no nearer to what people did than a straight line; a logged message
    says so.

    Args:
        start: its last frame is the first keyframe; or, with numbers for `end`, the motion whose frames they are.
        end: its first frame is the last keyframe; or numbers of two or more frames of `start`, at the model's rate.
        frames: frames between, at the model's rate; None: the model's own number, or as many as lie between the numbers.
        samples: how many motions.
        seed: of their noise.
        run: folder of a finished run of in-betweening, a name that `load_run` knows, or its model.
        progress: show a bar.
        align: turn and move the motion `end` along the floor, so that it begins where `start` ends.
        own_rig: give them on the body of `start` as its file has it: all joints, bones and channels, at its rate. Joints that the
            model does not know are interpolated; keyframes are as they were.
        join: the same, with all frames of `start` before and all of `start` or `end` behind.
        feet: hold feet that stand where they are, and above the lowest of the frames given; of models of places.

    Returns:
        `samples` motions of `frames` + 2 frames at the model's rate, the keyframes among them; and before these the past, of a
        model that is given one.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is one of another system; an argument is of another kind or out of range; poses are not finite, of no
            human's size, of two bodies, or so far apart that the root would be faster than 12 m/s (own choice); bodies, length or
            keyframes do not fit the model; a rig is asked for and there is none.

    >>> walk = mw.load_motions("synthetic", fps=30.0)[0]
    >>> [motion] = inbetween(walk.cut(0, 2), walk.cut(32, 34), frames=30)
    >>> motion.positions.shape, motion.fps, np.allclose(motion.positions[0], walk.positions[1], atol=1e-5)
    ((32, 17, 3), 30.0, True)
    """
    model = model_of(run, Bridge, "in-betweening")
    found = filled(model, start, end, frames, samples, seed, progress, align=align, own_rig=own_rig, join=join, feet=feet)
    if model.cfg.model.hide and isinstance(end, Motion) and len(start) == len(end) == 1:
        log.warning("two poses say nothing of velocity, and samples are no nearer than a straight line; give two frames each")
    elif model.cfg.model.hide and (frames or 0) > FORESEEN:
        log.warning("more than %d frames apart samples are no nearer to what people did than a straight line", FORESEEN)
    return found


def generate(
    texts: str | Sequence[str],
    seconds: float | Sequence[float] | None = None,
    samples: int = 1,
    seed: int = 0,
    run: str | Path | TextToMotion = SENTENCE_MODEL,
    progress: bool = False,
    fused: bool = True,
    attempts: int = 3,
) -> list[Motion]:
    """Motions that do what sentences say.

    A motion of the synthetic people that does not show what its sentence says, by the rules of `measured_attributes`, is made
    again; of all `attempts` the nearest is kept. Own choice: a sample is cheap, and the rules see what a plain sentence says (see
    `is_plain`). A logged message tells of motions that still do not. Tables and cards count first attempts alone.

    Args:
        texts: a sentence, or several.
        seconds: length of each motion, or one length for all; rounded to a multiple of four frames. None: as long as synthetic
            people take for what the sentence says; of other models and sentences 4, if the model makes so long ones. Given more
            time, a motion does more.
        samples: motions of each sentence, at most 1000.
        seed: of their noise. The first motions do not depend on how many are asked for.
        run: folder of a finished run of text-to-motion, a name that `load_run` knows, a file of a released model (see
            `open_released`; data and CLIP lie in their usual folders), or the model.
        progress: show a bar.
        fused: read places, steps and contacts together (see `fused_joints`), which trembles less; else places alone, as usual.
        attempts: at each motion, at most 1000; 1 keeps what comes first.

    Returns:
        `samples` motions of the first sentence, then of the second, ...; metres, y up, named by their sentences as they were
        given.

    A model of the synthetic people reads sentences in the words of their grammar, see `as_learnt`; others read them as they are.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is one of another system; an argument is of another kind or out of range; a sentence has no word that the
            model knows, or asks for what `as_learnt` refuses; a length is not one that it was trained for; or the settings of
            its sampling make numbers overflow.

    Warns of words that the model does not know, with near ones that it knows. To a model that has learnt its words they are all
    one unknown word; one that reads CLIP's features, or parts of words, makes something of any word. Warns, too, of a sentence
    with no action that the people's model has learnt, or with two that never follow each other in its grammar.

    >>> [walk] = generate("a person walks in a circle to the left", seconds=3.0)
    >>> walk.positions.shape, walk.fps, walk.skeleton.name
    ((60, 22, 3), 20.0, 'HUMANML22')
    """
    model = model_of(run, TextToMotion, "text_to_motion")
    texts = [texts] if isinstance(texts, str) else several("texts", texts, "sentences, or one")
    samples, attempts = whole("samples", samples, 1, MOST), whole("attempts", attempts, 1, MOST)
    model.check(texts, [model.lengths[0]] * len(texts))
    read = understood(model, texts)
    frames = _frames(model, read, seconds)
    model.check(texts, frames)
    _warn_of_words(model, read)
    wanted = [claims(text) if _has_grammar(model) and is_plain(text) else {} for text in read]
    many = [i for i in range(len(texts)) for _ in range(samples)]  # which sentence

    def make(which: list[int], attempt: int) -> list[Motion]:
        """One attempt at some of the motions."""
        ids = [MOST * many[k] + k % samples + AGAIN * attempt for k in which]
        asked = [read[many[k]] for k in which], [frames[many[k]] for k in which]
        made = model.sample(*asked, seed, ids=ids, progress=progress)
        return [motion_of(x, model.layout, texts[many[k]], fused) for k, x in zip(which, made, strict=True)]

    found = _nearest(make, [wanted[i] for i in many], attempts)
    usual = [
        _usual_seconds(read[i]) if missed and seconds is not None else None for i, (missed, _) in zip(many, found, strict=True)
    ]
    _tell_of_misses(found, usual)
    return [motion for _, motion in found]


def _nearest(
    make: Callable[[list[int], int], list[Motion]], wanted: Sequence[Attributes], attempts: int
) -> list[tuple[list[str], Motion]]:
    """Of some attempts at each motion the one that misses least, and what; who misses nothing is not made again."""
    found, left = dict[int, tuple[list[str], Motion]](), [*range(len(wanted))]
    for attempt in range(attempts):
        for k, motion in zip(left, make(left, attempt), strict=True):
            missed = _missed(motion, wanted[k])
            if k not in found or len(missed) < len(found[k][0]):
                found[k] = missed, motion
        if not (left := [k for k in left if found[k][0]]):
            break
    return [found[k] for k in range(len(wanted))]


def _tell_of_misses(found: Sequence[tuple[list[str], Motion]], usual: Sequence[float | None]) -> None:
    """Log what motions miss, and how long people take, where that is said; of many the first ones."""
    left = [k for k, (missed, _) in enumerate(found) if missed]
    for k in left[:MOST_TOLD]:
        missed, motion = found[k]
        took = f"{len(motion) / motion.fps:g} s" + (f", where people take {usual[k]:g}" if usual[k] else "")
        asked = f"motion {k + 1} of {len(found)} does not show what {motion.name[:80]!r} asks for in {took}"
        log.warning("%s: %s", asked, "; ".join(missed))
    if len(left) > MOST_TOLD:
        log.warning("nor do %d more", len(left) - MOST_TOLD)


def _missed(motion: Motion, wanted: Attributes) -> list[str]:
    """What a motion is seen to do otherwise than its sentence says, or besides; nothing of one too short to be looked at."""
    if not wanted or len(motion) < motion.fps / 2:
        return []
    seen, wanted = measured_attributes(motion.positions, motion.fps), {"then": "nothing"} | wanted
    found = {name: seen.get(name, "nothing") for name in CLAIMS if name in wanted}
    return [f"{name} is {value}, expected {wanted[name]}" for name, value in found.items() if value != wanted[name]]


def understood(model: TextToMotion, texts: Sequence[str]) -> list[str]:
    """Sentences as a model reads them: one that has learnt the words of the synthetic people's grammar, in these words.

    Raises:
        ValueError: as `as_learnt`.
    """
    if not _has_grammar(model):
        return [*texts]
    read = []
    for i, text in enumerate(texts):
        try:
            read.append(as_learnt(text).text or text)
        except ValueError as error:
            raise ValueError(f"texts[{i}] is {error}") from None
    return read


def _has_grammar(model: TextToMotion) -> bool:
    return model.cfg.data.data == "people" and bool(model.net.text.vocabulary)


def _usual_seconds(text: str) -> float | None:
    """How long people take for a sentence of the grammar's actions; None of any other."""
    return usual_seconds(claims(text)) if as_learnt(text).is_learnt else None


def _frames(model: TextToMotion, texts: Sequence[str], seconds: float | Sequence[float] | None) -> list[int]:
    """Lengths in whole movements, one for each sentence."""
    fps, (shortest, longest) = model.layout.fps, model.lengths
    if seconds is None:
        usual = [(_usual_seconds(text) if _has_grammar(model) else None) or SECONDS for text in texts]
        return [min(max(round(one * fps / UNIT) * UNIT, shortest), longest) for one in usual]
    if isinstance(seconds, int | float) or getattr(seconds, "ndim", 1) == 0:
        lasting = [real("seconds", seconds)] * len(texts)
    else:
        lasting = [real(f"seconds[{i}]", one) for i, one in enumerate(several("seconds", seconds, "numbers, or one"))]
    frames = [round(one * fps / UNIT) * UNIT for one in lasting]
    if wrong := [one for one, count in zip(lasting, frames, strict=True) if not shortest <= count <= longest]:
        expected = f"{shortest / fps:g} to {longest / fps:g}, {shortest} to {longest} frames at {fps:g} Hz"
        raise ValueError(f"seconds is {wrong[0]:g}; expected {expected}, as the model was trained")
    return frames


def _warn_of_words(model: TextToMotion, texts: Sequence[str]) -> None:
    """Tell of words that the model does not know, with near ones that begin alike, and of actions that it has not learnt."""
    strange, known, told = model.check_words(texts), model.net.text.vocabulary, []
    for i, found in enumerate(map(as_learnt, texts) if _has_grammar(model) else ()):
        if not found.is_learnt:
            asked = " and then ".join(found.actions) or "no action"
            warnings.warn(f"texts[{i}] asks for {asked}, which the model has not learnt; {EXPECTED_ACTIONS}", stacklevel=3)
    for word in strange:
        near = difflib.get_close_matches(word, [other for other in known if other[0] == word[0]], n=3, cutoff=0.7)
        told.append(f"{word!r}" + f" (near: {', '.join(near)})" * bool(near))
    if told:
        expected = f"it takes each for one unknown word; expected its {len(known)} words, {WHERE_WORDS}"
        warnings.warn(f"the model does not know {some(told, MOST_TOLD)}: {expected}", stacklevel=3)
