"""Showing a recording to a person, in the viewer that comes with the package."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from finback.errors import InputError
from finback.views.recording import check_recording
from finback.views.viewer import viewer_environment, viewer_program

_GRACE_S: Final = 5.0  # for the viewer to close after Ctrl-C
_NO_DRIVER: Final = ("Failed to get render context", "No suitable graphics adapter", "does not support drawing")
_NO_SCREEN: Final = ("EventLoopError", "open connection to X server")


def open_viewer(path: Path) -> None:
    """Open a recording in the Rerun viewer and wait until its window is closed.

    The viewer listens on 127.0.0.1 only and sends nothing. Ctrl-C closes it.

    Raises:
        InputError: the file is missing, no recording, damaged or unfinished; there is no screen; there is no Vulkan
            driver; the viewer ended with an error.
        KeyboardInterrupt: Ctrl-C; the viewer is closed.
    """
    check_recording(path)
    if not has_screen(os.environ, sys.platform):
        raise InputError(
            f"{path} cannot be shown: there is no screen (neither DISPLAY nor WAYLAND_DISPLAY is set)",
            hint="replay it where there is one; over ssh, copy the file or use ssh -X",
        )
    command = [
        str(viewer_program()),
        str(path.resolve()),
        "--bind",
        "127.0.0.1",
        "--port",
        "0",
        "--hide-welcome-screen",
    ]
    with subprocess.Popen(  # noqa: S603 - the program of the installed package, a checked file
        command, env=viewer_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as viewer:
        try:
            _, said = viewer.communicate()
        except KeyboardInterrupt:
            _close(viewer)
            raise
    if viewer.returncode != 0:
        raise failure(path, viewer.returncode, said)


def has_screen(environment: Mapping[str, str], platform: str) -> bool:
    """Tell whether a window can be opened at all; only Unix without macOS says so in its environment."""
    if platform in ("win32", "darwin"):
        return True
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


def failure(path: Path, code: int, said: str) -> InputError:
    """Return what went wrong with the viewer as a message with a way out.

    Args:
        path: the recording.
        code: exit code of the viewer.
        said: what it wrote to stderr.
    """
    if any(sign in said for sign in _NO_DRIVER):
        return InputError(
            f"{path} cannot be drawn: the viewer found no Vulkan driver",
            hint="install the graphics card's driver, or the software one: apt-get install mesa-vulkan-drivers",
        )
    if any(sign in said for sign in _NO_SCREEN):
        return InputError(
            f"{path} cannot be shown: the screen named by DISPLAY or WAYLAND_DISPLAY does not answer",
            hint="replay it where there is one; over ssh, copy the file",
        )
    last = next((line for line in reversed(said.splitlines()) if line.startswith("Error")), "it gave no reason")
    return InputError(f"{path}: the viewer ended with exit code {code}: {last}", hint="try: rerun " + str(path))


def _close(viewer: subprocess.Popen[str]) -> None:
    viewer.terminate()
    try:
        viewer.wait(_GRACE_S)
    except subprocess.TimeoutExpired:
        viewer.kill()
        viewer.wait()
