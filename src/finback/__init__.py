"""Finback: a validation harness for reduced models of high-angle-of-attack flight."""


def __getattr__(name: str) -> str:
    if name != "__version__":
        raise AttributeError(f"module 'finback' has no attribute '{name}'")
    # Reading it takes longer than all else that happens before the program can answer a Ctrl-C.
    from importlib.metadata import version  # noqa: PLC0415

    return version("finback")
