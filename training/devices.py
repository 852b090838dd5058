"""Devices for training, and their fast data types."""

import argparse

import torch


def available_device(name: str) -> str:
    """Return the name of a device that is there; the type of a command-line option.

    Parameters
    ----------
    name : {"cpu", "cuda"}

    Returns
    -------
    str

    Raises
    ------
    argparse.ArgumentTypeError
        If the name is unknown, or PyTorch finds no such device.
    """
    if name not in ("cpu", "cuda"):
        raise argparse.ArgumentTypeError(f"unknown device {name!r}: cpu or cuda")
    if name == "cuda" and not torch.cuda.is_available():
        raise argparse.ArgumentTypeError("PyTorch finds no CUDA device: leave out --device")
    return name


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
