"""CMU's motion capture: ASF/AMC, and conversions of it to BVH."""

from __future__ import annotations

import re
from functools import partial

from mwlib.body.skeleton import CMU
from mwlib.data.collections.record import Collection, Download, listed

BENCHMARK_COLUMNS = 117  # of a line of the prediction benchmark's texts: root translation, then 38 rotation vectors
OWNERS = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from "
    "NSF EIA-0196217."
)
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
