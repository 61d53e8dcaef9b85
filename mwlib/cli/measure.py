"""Commands that train and measure: train, judge, grid-table, ship, storyboards, reproduction."""

from collections.abc import Sequence
from json import dumps
from pathlib import Path
from typing import Any

from mwlib import plots
from mwlib.cli import options
from mwlib.cli.options import Repeated
from mwlib.experiments import claims as claiming
from mwlib.experiments import judging, report, shipped
from mwlib.experiments.grids import system as system_named
from mwlib.experiments.runs import get_model, get_run
from mwlib.experiments.sampling import SENTENCE_MODEL, model_of
from mwlib.experiments.tables import details, differences, lines, measure, provenance
from mwlib.files import write_atomic, write_json
from mwlib.paths import CONFIG, run_folder
from mwlib.plots.lines import evidence
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import load_data
from mwlib.settings import parse_changes, whole
from mwlib.text_to_motion.config import CLIP
from mwlib.text_to_motion.judging import REAL, Protocol
from mwlib.text_to_motion.system import METRICS


def train(*, system: str = "prediction", preset: str = "laptop", set: Repeated[str] = ()) -> None:
    """Train a preset, or go on with a run that was stopped; prints the run's folder.

    Presets and settings of the system stand below.

    Args:
        system: prediction, rebuilding, inbetweening, text_to_motion or matching.
        preset: one of `mwlib.prediction.config.PRESETS` ... (default: laptop).
        set: change one setting, e.g. data=my/folder or lr=1e-3; may be repeated.
    """
    print(get_run(system_named(system).Config.preset(preset, **parse_changes(set)), progress=True))


def _protocol(
    *,
    pool: int = 32,
    clips: int = 0,
    frames: int = 0,
    whole: bool = False,
    padded_words: bool = False,
    own_statistics: bool = False,
    best_of: int = 1,
    repeated: int = 100,
    repeats: int = 30,
) -> dict[str, Any]:
    """How motions are made and judged; as papers on HumanML3D do, but for what is said.

    Args:
        pool: of R-precision.
        clips: motions that are made, spread evenly over the test set; 0 = one for each clip.
        frames: of every motion that is made; 0 = as many as its clip has.
        whole: take clips from their first frame, none shortened, in place of random pieces.
        padded_words: read the padding behind a sentence as words.
        own_statistics: show the judge motions in the model's scale in place of its own.
        best_of: of each sentence keep that of so many motions which the judge likes best, as if it were the critic.
        repeated: sentences of MultiModality.
        repeats: motions of each of them.
    """
    return locals()


def judge(
    model: str | None = None,
    *,
    data: str = "",
    evaluator: str = "",
    clip_folder: str = CLIP,
    replicates: int = 20,
    seed: int = 0,
    compare: bool = False,
    json: bool = False,
    out: Path = Path("build/judged"),
    **protocol: Any,
) -> None:
    """Score a model of sentences as papers do: FID, R-precision, MM-Dist, Diversity, MultiModality, with intervals.

    Each replicate has a file of its own; a command that was stopped goes on, and one that asks for more replicates adds them.
    Intervals hold 95 %, over replicates: over noise, captions, pieces and pools, not over trainings.

    Args:
        model: a run, the name of a model that comes with the package, or a released file: MDM's model*.pt, or latest.tar of
            StableMoFusion or Free-T2M (default: sentences).
        data: people, cmu, or a folder of HumanML3D or KIT-ML (default: what the model was trained on).
        evaluator: a run, a name that comes with the package, or a folder of the published one (default: that of the data).
        clip_folder: of CLIP ViT-B/32, for a released file.
        replicates: how often all is drawn again.
        seed: of the first one; the others are 1000 apart.
        compare: tell, too, how far each known way in which scores go wrong or differ moves each of them.
        json: print JSON.
        out: gets a folder for these settings.
    """
    whole("replicates", replicates, 1)
    how = Protocol(**protocol)
    model = model or SENTENCE_MODEL
    opened = judging.open_all(model, data, evaluator, clip_folder)
    folder, found = judging.replicates(opened, how, replicates, seed, out, compare, progress=True)
    absolute = {name: judging.with_intervals([row[name] for row in found]) for name in (REAL, "model")}
    less = [row["model"] for row in found]
    moved = {n: judging.with_intervals([row[n] for row in found], less) for n in found[0] if n not in absolute}
    told = {"model": model, "replicates": replicates, "scores": absolute, "moved": moved, "folder": str(folder)}
    write_json(folder / "result.json", told)
    tables = [_scores({REAL: absolute[REAL], model: absolute["model"]})] + ([_scores(moved)] if moved else [])
    text = f"\n\nHow far each moves the scores of {model}:\n\n".join(map(repr, tables))
    write_atomic(folder / "table.md", f"{text}\n")
    print(dumps(told, indent=1) if json else f"{text}\n\n{replicates} replicates, 95 % intervals over them: {folder}")


def _scores(rows: dict[str, dict[str, tuple[float, float]]]) -> plots.Table:
    return plots.results_table([
        {"": name, **{column.heading: row.get(metric) for metric, column in METRICS.items()}} for name, row in rows.items()
    ])  # fmt: skip


def grid_table(**choice_of: Any) -> None:
    """Write the table of a grid, computing the rows that are missing."""
    chosen = options.choice_of(**choice_of)
    asked, given, kind = chosen.grid, [*chosen.changes], system_named(chosen.grid.system)
    chosen.out.mkdir(parents=True, exist_ok=True)  # what cannot be written is told before hours of work
    found = measure(asked, chosen.cfg, progress=True, given=given)
    tables = {
        "": lines(found, kind.METRICS, errors=True),
        "_details": lines(found, details(kind), errors=True) if details(kind) else [],
        "_paired": differences(found, {**kind.METRICS, **details(kind)}, asked.reference),
        "_actions": [
            {"row": row["name"], "action": action, **means} for row in found for action, means in row["actions"].items()
        ],
    }
    about = provenance(asked, chosen.cfg, found, given) | {"preset": chosen.preset}
    for ending, rows in tables.items():
        if rows and len(rows[0]) > 1:
            plots.save_table(rows, chosen.out, f"{asked.id}{ending}", provenance=about)
    shown = lines(found, kind.METRICS)
    best = {column.heading: column.better for column in kind.METRICS.values() if column.better and column.heading in shown[0]}
    table = plots.results_table(shown, better=best)
    write_atomic(chosen.out / f"{asked.id}.md", f"{table}\n")
    print(table)


def ship(name: str, *, out: Path = Path("build/models")) -> None:
    """Make a model that comes with the package again: train it, measure it, write its card.

    sentences takes some hours of one core, synthetic and sentences_early about an hour, evaluators and critics some minutes, cmu
    and inbetween half an hour; names of CMU need the clips under MWLIB_DATA. A graphics card is used where there is one. A
    training that was stopped goes on. sentences begins with the weights of sentences_first, which does not come along: it is made
    first, in build/models, unless it lies there.

    Args:
        name: one of `mwlib.experiments.shipped.RECIPES`.
        out: gets a folder of that name.
    """
    title, cfg = shipped.recipe(name)
    if "start" in cfg.owners() and cfg.get("start") == shipped.FIRST and run_folder(shipped.FIRST) is None:
        ship(Path(shipped.FIRST).name, out=Path(shipped.FIRST).parent)
    (out / name).mkdir(parents=True, exist_ok=True)
    shipped.ship(cfg, out / name, title, f"mwlib ship {name}", progress=True)
    print((out / name / shipped.CARD).read_text(encoding="utf-8"), end="")


def storyboards(
    *,
    preset: str = "laptop",
    set: Repeated[str] = (),
    run: str = "",
    clips: Sequence[str] = (),
    out: Path = Path("build/storyboards"),
) -> None:
    """Draw predictions of people never seen, their end poses, and the loss curves; trains the model if it is missing.

    Args:
        preset: one of `mwlib.prediction.config.PRESETS` (default: laptop).
        set: change one setting, e.g. data=my/folder or lr=1e-3; may be repeated.
        run: a finished run, or the name of a model that comes with the package, instead of a preset; draws no loss curves.
        clips: test clips (default: three windows).
        out: folder.
    """
    if run and set:
        raise ValueError("both --run and --set are given; expected one of them: a finished run has its settings")
    if run:
        predictor, folder = model_of(run, Predictor, "prediction"), run_folder(run)
        assert folder is not None  # the model came from there
        cfg = Config.from_yaml(folder / CONFIG)
        split = load_data(cfg)
    else:
        cfg = Config.preset(preset, **parse_changes(set))
        split = load_data(cfg)
        predictor = get_model(cfg, split, progress=True)
        report.write_curves(cfg, split, out)
    report.write_storyboards(cfg, split, predictor, out, clips)
    report.write_ends(cfg, split, predictor, out, clips)
    print(out)


EVIDENCE = (
    "A strip of marks for each theme of claims: blue ones to the right of a grey band came out as the paper says, orange ones to "
    "the left the other way, grey ones inside it are undecided."
)


def reproduction(*, claims: Path | None = None, tables: Path | None = None, out: Path = Path("REPRODUCTION.md")) -> None:
    """Write the report on the paper's claims: what holds, what does not, what cannot be tested, and where to look.

    Numbers come from measured tables, verdicts from conditions over them. A verdict that no longer follows from its table is
    refused, and so is a link to a section that a notebook does not have; the message names the claim, what was found and what was
    expected.

    Args:
        claims: their file (default: figures/claims.yaml).
        tables: folder of measured tables (default: figures/cmu).
        out: the page; its picture goes to figures/verdicts.png beside it.
    """
    measured = claiming.Tables(tables)
    write_atomic(out, claiming.reproduction(claims, measured))
    if rows := claiming.scores(claiming.findings(claims, measured)):
        strips = {row["theme"]: [each["errors"] for each in rows if each["theme"] == row["theme"]] for row in rows}
        figure, _ = evidence(strips, beyond=claiming.BEYOND)
        origin = {"command": "mwlib reproduction"}
        plots.save(figure, out.parent / "figures", "verdicts", data=rows, alt=EVIDENCE, provenance=origin)
    print(out)
