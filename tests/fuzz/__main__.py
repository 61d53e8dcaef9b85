"""python -m tests.fuzz: thousands of spoilt files and calls; exit status 1 if one does anything but be taken or be refused."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from tests.fuzz.calls import calls, outcome
from tests.fuzz.campaign import cases
from tests.fuzz.worker import BYTES, SECONDS, Worker


def main() -> int:
    """Run both campaigns and print their figures."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description=f"Read spoilt files of every kind, each within {SECONDS:g} s and {BYTES // 2**20} MiB, and call predict, "
        "inbetween, generate and windows with spoilt arguments. What is neither taken nor refused with a reason makes the exit "
        "status 1; files are kept.",
    )
    parser.add_argument("--files", type=int, default=15_000, help="how many files (default 15000)")
    parser.add_argument("--calls", type=int, default=2000, help="how many calls (default 2000)")
    parser.add_argument("--seed", type=int, default=0, help="which ones (default 0)")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="folder of files at fault (default build/fuzz)")
    arguments = parser.parse_args()
    return int(any([read_files(arguments), make_calls(arguments)]))


def read_files(arguments: argparse.Namespace) -> int:
    """How many files were at fault."""
    counts: Counter[str] = Counter()
    slowest, largest, started = (0.0, ""), 0.0, time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        worker = Worker(Path(folder) / "files")
        for number, case in enumerate(tqdm(cases(arguments.files, arguments.seed), "fuzz", arguments.files, unit="file")):
            outcome = worker.read(case.name, case.files)
            slowest = max(slowest, (outcome.seconds, f"file {number}, {case.kind}"))
            largest = max(largest, outcome.mebibytes)
            counts["at fault" if outcome.fault else "read" if outcome.is_read else "refused"] += 1
            if outcome.fault:
                kept = arguments.keep / f"{arguments.seed}-{number}"
                kept.mkdir(parents=True, exist_ok=True)
                for name, content in case.files.items():
                    (kept / name).parent.mkdir(exist_ok=True)
                    (kept / name).write_bytes(content)
                tqdm.write(f"{kept / case.name} ({case.kind}): {outcome.fault[:300]}", file=sys.stderr)
        worker.close()
    print(", ".join(f"{count} {word}" for word, count in counts.most_common()))
    print(f"{time.perf_counter() - started:.0f} s; slowest {slowest[0]:.2f} s ({slowest[1]}); largest {largest:.0f} MiB")
    return counts["at fault"]


def make_calls(arguments: argparse.Namespace) -> int:
    """How many calls were at fault."""
    counts: Counter[str] = Counter()
    for number, call in enumerate(tqdm(calls(arguments.calls, arguments.seed), "fuzz", arguments.calls, unit="call")):
        fault, has_result = outcome(call)
        counts["at fault" if fault else "answered" if has_result else "refused"] += 1
        if fault:
            given = {name: repr(call.arguments[name])[:100] for name in call.spoilt}
            tqdm.write(f"call {number} of seed {arguments.seed}, {call.function} with {given}: {fault[:300]}", file=sys.stderr)
    print(", ".join(f"{count} {word}" for word, count in counts.most_common()) or "no calls")
    return counts["at fault"]


if __name__ == "__main__":
    sys.exit(main())
