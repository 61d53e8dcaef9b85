"""The command reproduction."""

from __future__ import annotations

from argparse import Namespace, _SubParsersAction
from pathlib import Path

from mwlib.experiments.claims import Tables, claims_file
from mwlib.experiments.claims import reproduction as report
from mwlib.files import write_atomic


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's command."""
    text = "write the report on the paper's claims: what holds, what does not, what cannot be tested, and where to look"
    parser = subparsers.add_parser(
        "reproduction",
        help=text,
        description=f"{text[0].upper()}{text[1:]}. Numbers come from measured tables, verdicts from conditions over them. A "
        "verdict that no longer follows from its table is refused, and so is a link to a section that a notebook does not have; "
        "the message names the claim, what was found and what was expected.",
    )
    parser.add_argument("--claims", type=Path, default=claims_file(), metavar="FILE", help="default: figures/claims.yaml")
    parser.add_argument("--tables", type=Path, metavar="FOLDER", help="measured tables (default: figures/cmu)")
    parser.add_argument(
        "--out", type=Path, default=Path("REPRODUCTION.md"), help="default: REPRODUCTION.md, in the working folder"
    )
    parser.set_defaults(run=_reproduction)


def _reproduction(args: Namespace) -> int:
    write_atomic(args.out, report(args.claims, Tables(args.tables)))
    print(args.out)
    return 0
