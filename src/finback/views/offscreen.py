"""Pictures of a recording, made by the viewer without a screen. For tests and for pictures in documents.

The client interface is experimental in Rerun 0.41; nothing else uses it.
"""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self, final

from rerun.experimental import ViewerClient

from finback.errors import RefusedError
from finback.views.clock import TIMELINE
from finback.views.viewer import viewer_environment, viewer_program

DRIVER_HINT: Final = "a Vulkan driver is needed; without a graphics card: apt-get install mesa-vulkan-drivers"
_START_S: Final = 30.0
_LOAD_S: Final = 30.0
_SETTLE_S: Final = 20.0
_EQUAL_PICTURES: Final = 2  # repeats of one picture, after which nothing moves any more


@final
class OffscreenViewer:
    """A viewer without a screen, on a port of 127.0.0.1 of its own. Use it in a ``with`` block.

    Args:
        size: width and height of the window in pixels.

    Raises:
        RefusedError: the viewer does not start or does not load the recording.
    """

    def __init__(self, size: tuple[int, int] = (1600, 1000)) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        arguments = ["--headless", "--bind", "127.0.0.1", "--port", str(self.port), "--hide-welcome-screen"]
        arguments += ["--window-size", f"{size[0]}x{size[1]}", "--memory-limit", "2GB"]
        self._process = subprocess.Popen(  # noqa: S603 - the program of the installed package, own arguments
            [str(viewer_program()), *arguments],
            env=viewer_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            self._client: Any = self._connected()
            self._ask(self._client.get_state)
        except BaseException:
            self.close()
            raise

    def load(self, path: Path) -> list[str]:
        """Show a recording; returns the names of its views."""
        self._ask(lambda: self._client.open(str(path.resolve())))
        end = time.monotonic() + _LOAD_S
        while time.monotonic() < end:
            state = self._ask(self._client.get_state)
            if not state.loading and state.recordings and state.recordings[-1].timelines and state.views:
                return [str(view.name) for view in state.views]
            time.sleep(0.05)
        raise RefusedError(f"the viewer did not load {path} within {_LOAD_S:g} s", hint=DRIVER_HINT)

    def seek(self, time_s: float) -> None:
        """Show the flight as it was at ``time_s``."""
        self._ask(lambda: self._client.set_time(TIMELINE, duration=float(time_s), play_state="paused"))

    def picture(self) -> bytes:
        """Return the window as PNG, once it no longer changes."""
        last, equal, end = b"", 0, time.monotonic() + _SETTLE_S
        while equal < _EQUAL_PICTURES and time.monotonic() < end:
            png = bytes(self._ask(self._client.take_screenshot))
            last, equal = png, equal + 1 if png == last else 0
            time.sleep(0.2)
        return last

    def problems(self) -> list[str]:
        """Return what the viewer reports about its views; empty if all is drawn."""
        views = self._ask(self._client.get_state).views
        return [f"{view.name}: {report.severity}: {report.summary}" for view in views for report in view.reports]

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, question: Callable[[], Any]) -> Any:
        try:
            return question()
        except Exception as error:
            # Without a driver the viewer starts, listens, and dies when it draws its first picture.
            raise RefusedError(f"the viewer does not answer: {error}", hint=DRIVER_HINT) from error

    def _connected(self) -> Any:
        end = time.monotonic() + _START_S
        while True:
            if self._process.poll() is not None or time.monotonic() > end:
                raise RefusedError(f"the viewer did not start (exit code {self._process.poll()})", hint=DRIVER_HINT)
            try:
                socket.create_connection(("127.0.0.1", self.port), 0.2).close()
            except OSError:
                time.sleep(0.05)
            else:
                return ViewerClient.connect(f"rerun+http://127.0.0.1:{self.port}/proxy")
