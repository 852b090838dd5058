"""What the device that fits a network is good at."""

import torch


def halves_are_fast(device: str) -> bool:
    """Return whether products of bfloat16 are faster than those of float32.

    Parameters
    ----------
    device : str
        "cpu" or "cuda".

    Returns
    -------
    bool
        On a processor without instructions for them they take ten times as long.
    """
    if device != "cpu":
        return True
    known = torch.cpu.get_capabilities()
    return bool(known.get("avx512_bf16") or known.get("amx_bf16") or known.get("bf16"))
