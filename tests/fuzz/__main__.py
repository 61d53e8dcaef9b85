"""python -m tests.fuzz: read thousands of spoilt files; exit status 1 if one does anything but be read or be refused."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from tests.fuzz.campaign import cases
from tests.fuzz.worker import BYTES, SECONDS, Worker


def main() -> int:
    """Run the campaign and print its figures."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description=f"Read spoilt motion files of every kind, each within {SECONDS:g} s and {BYTES // 2**20} MiB. "
        "What is neither read nor refused with a reason is kept, and makes the exit status 1.",
    )
    parser.add_argument("--files", type=int, default=15_000, help="how many (default 15000)")
    parser.add_argument("--seed", type=int, default=0, help="which ones (default 0)")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="folder of files at fault (default build/fuzz)")
    arguments = parser.parse_args()
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
                    (kept / name).write_bytes(content)
                tqdm.write(f"{kept / case.name} ({case.kind}): {outcome.fault[:300]}", file=sys.stderr)
        worker.close()
    print(", ".join(f"{count} {word}" for word, count in counts.most_common()))
    print(f"{time.perf_counter() - started:.0f} s; slowest {slowest[0]:.2f} s ({slowest[1]}); largest {largest:.0f} MiB")
    return 1 if counts["at fault"] else 0


if __name__ == "__main__":
    sys.exit(main())
