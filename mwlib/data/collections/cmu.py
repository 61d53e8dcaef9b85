"""CMU's motion capture: ASF/AMC, and conversions of it to BVH."""

import re
from functools import partial

from mwlib.body.skeleton import CMU
from mwlib.data.collections import Collection, Download, listed

BENCHMARK_COLUMNS = 117  # of a line of the prediction benchmark's texts: root translation, then 38 rotation vectors
OWNERS = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from "
    "NSF EIA-0196217."
)
# Of these people all trials were recorded at 60 Hz, and of 136 one: 326 trials of CMU's index, whose others have 120.
AT_60 = frozenset("33 34 42 60 61 62 74 75 77 79 80 87 88 89".split())
ALSO_AT_60 = ("136", "19")


def recorded_at(subject: str, trial: str) -> float:
    """The true frame rate of a trial, hertz; conversions to BVH say 120 in all of their files.

    >>> recorded_at("60", "01"), recorded_at("07", "01"), recorded_at("136", "19")
    (60.0, 120.0, 60.0)
    """
    subject, trial = subject.lstrip("0"), trial.lstrip("0")
    return 60.0 if subject in AT_60 or (subject, trial) == ALSO_AT_60 else 120.0


RECORDS = (
    Collection(
        name="cmu",
        title="CMU motion capture: the clips behind figures/cmu, 134 of 9 people, 120 Hz",
        licence="free, also commercially; not for resale",
        place="cmu/asfamc",
        skeleton=CMU,
        unit="cmu",
        file_name=re.compile(r"(?P<subject>\d+)_\d+"),  # 05_12.amc
        preset="cmu",
        fps=50.0,
        acknowledgement=OWNERS,
        download=Download("76 MB", "http://mocap.cs.cmu.edu/subjects", OWNERS, clips=partial(listed, "cmu")),
    ),
)
