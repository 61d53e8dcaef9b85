"""Commands about runs and grids: train, grid-table, storyboards."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path
from typing import Any

from mwlib import plots
from mwlib.experiments.grid_options import add_set, chosen_grid, configuration, given_changes, grid_options
from mwlib.experiments.report import write_curves, write_ends, write_storyboards
from mwlib.experiments.runs import get_model, get_run, load_run
from mwlib.experiments.shipped import CARD, RECIPES, recipe, ship
from mwlib.experiments.systems import system
from mwlib.experiments.tables import details, differences, lines, measure, provenance
from mwlib.files import write_atomic
from mwlib.paths import CONFIG, run_folder
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import load_data
from mwlib.settings import parse_changes


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's commands."""
    text = "train a preset, or go on with a run that was stopped; prints the run's folder"
    parser = subparsers.add_parser("train", help=text, description=f"{text.capitalize()}.", add_help=False)
    parser.add_argument(
        "-h", "--help", action=_SettingsHelp, nargs=0, help="this list, and the settings of the system named before"
    )
    parser.add_argument(
        "--system",
        default="prediction",
        help="prediction, rebuilding, inbetweening, text_to_motion or matching (default: prediction)",
    )
    parser.add_argument("--preset", default="laptop", help=f"one of {', '.join(Config.presets)} ... (default: laptop)")
    add_set(parser)
    parser.set_defaults(run=_train)

    text = "write the table of a grid, computing the rows that are missing"
    parser = subparsers.add_parser("grid-table", help=text, description=f"{text.capitalize()}.")
    parser.add_argument("grid", help="its id, e.g. table_4")
    grid_options(parser)
    parser.set_defaults(run=_grid_table)

    text = "make a model that comes with the package again: train it, measure it, write its card"
    parser = subparsers.add_parser("ship", help=text, description=f"{text.capitalize()}.", epilog=_SHIPPING)
    parser.add_argument("name", choices=[*RECIPES], help="which")
    parser.add_argument(
        "--out", type=Path, default=Path("build/models"), help="gets a folder of that name; default: build/models"
    )
    parser.set_defaults(run=_ship)

    text = "draw predictions of people never seen, their end poses, and the loss curves; trains the model if it is missing"
    parser = subparsers.add_parser("storyboards", help=text, description=f"{text.capitalize()}.")
    parser.add_argument("--preset", default="laptop", help=f"one of {', '.join(Config.presets)} (default: laptop)")
    add_set(parser)
    text = "a finished run, or the name of a model that comes with the package, instead of a preset; draws no loss curves"
    parser.add_argument("--run", dest="run_folder", default="", metavar="RUN", help=text)
    parser.add_argument("--clips", nargs="+", default=[], metavar="NAME", help="test clips; default: three windows")
    parser.add_argument("--out", type=Path, default=Path("build/storyboards"), help="default: build/storyboards")
    parser.set_defaults(run=_storyboards)


_SHIPPING = (
    "synthetic and the sentences take about an hour of one core, evaluators and critics some minutes, cmu and inbetween half an "
    "hour; names of CMU need the clips under MWLIB_DATA. A graphics card is used where there is one. A training that was stopped "
    "goes on."
)


class _SettingsHelp(Action):
    """Shows the presets and settings of the system that ``--system`` names, so far as it stands before."""

    def __call__(self, parser: ArgumentParser, namespace: Namespace, *_: Any) -> None:
        try:
            config = system(namespace.system).Config
        except ValueError as error:
            parser.error(str(error))
        parser.epilog = (
            f"Presets of {config.system}: {', '.join(config.presets)}. Its settings: {', '.join(sorted(config.owners()))}. "
            "Each system's config.py says what each means."
        )
        parser.print_help()
        parser.exit()


def _train(args: Namespace) -> int:
    print(get_run(system(args.system).Config.preset(args.preset, **parse_changes(args.set)), progress=True))
    return 0


def _ship(args: Namespace) -> int:
    title, cfg = recipe(args.name)
    ship(cfg, args.out / args.name, title, f"mwlib ship {args.name}", progress=True)
    print((args.out / args.name / CARD).read_text(encoding="utf-8"), end="")
    return 0


def _grid_table(args: Namespace) -> int:
    grid = chosen_grid(args)
    cfg, given, columns = configuration(grid, args), [*given_changes(args)], system(grid.system).METRICS
    found = measure(grid, cfg, progress=True, given=given)
    about = provenance(grid, cfg, found, given) | {"preset": args.preset}
    plots.save_table(lines(found, columns, errors=True), args.out, grid.id, provenance=about)
    kind = system(grid.system)
    apart = differences(found, {**columns, **details(kind)}, grid.reference)
    second = lines(found, details(kind), errors=True) if details(kind) else []
    for name, rows in (("details", second), ("paired", apart)):
        if rows and len(rows[0]) > 1:
            plots.save_table(rows, args.out, f"{grid.id}_{name}", provenance=about)
    actions = [{"row": row["name"], "action": action, **means} for row in found for action, means in row["actions"].items()]
    if actions:
        plots.save_table(actions, args.out, f"{grid.id}_actions", provenance=about)
    shown = lines(found, columns)
    best = {column.heading: column.better for column in columns.values() if column.better and column.heading in shown[0]}
    table = plots.results_table(shown, better=best)
    write_atomic(args.out / f"{grid.id}.md", f"{table}\n")
    print(table)
    return 0


def _storyboards(args: Namespace) -> int:
    cfg, predictor = _of_a_run(args) if args.run_folder else (Config.preset(args.preset, **parse_changes(args.set)), None)
    split = load_data(cfg)
    if predictor is None:
        predictor = get_model(cfg, split, progress=True)
        write_curves(cfg, split, args.out)
    for write in (write_storyboards, write_ends):
        write(cfg, split, predictor, args.out, args.clips)
    print(args.out)
    return 0


def _of_a_run(args: Namespace) -> tuple[Config, Predictor]:
    """Settings and model of the finished run that a command names."""
    if args.set:
        raise ValueError("both --run and --set are given; expected one of them: a finished run has its settings")
    predictor, folder = load_run(args.run_folder), run_folder(args.run_folder)
    if not isinstance(predictor, Predictor) or folder is None:
        raise ValueError(f"{args.run_folder} is a run of another system; expected one of prediction")
    return Config.from_yaml(folder / CONFIG), predictor
