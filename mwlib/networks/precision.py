"""In which precision a network multiplies matrices; everything around it stays in float32."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Literal

import torch

Precision = Literal["float32", "tf32", "bf16"]


@contextmanager
def products_in(precision: Precision, device: torch.device) -> Iterator[None]:
    """Products of matrices in this precision, until the block ends.

    Args:
        precision: "float32" leaves everything as it is; "tf32" multiplies 10-bit mantissas on graphics cards that can;
            "bf16" is torch's autocast: 7-bit mantissas, faster on new cards and processors.
        device: where the network is.

    >>> with products_in("bf16", torch.device("cpu")):
    ...     (torch.ones(2, 2) @ torch.ones(2, 2)).dtype
    torch.bfloat16
    """
    before = torch.get_float32_matmul_precision()
    try:
        if precision == "tf32":
            torch.set_float32_matmul_precision("high")
        with torch.autocast(device.type, torch.bfloat16) if precision == "bf16" else nullcontext():
            yield
    finally:
        torch.set_float32_matmul_precision(before)
