"""A bar that counts the functions that numba compiles in the first run: without it, the first run looks dead."""

from contextlib import AbstractContextManager

from numba.core.event import Listener, install_listener
from tqdm.auto import tqdm


class CompileBar(Listener):
    """Counts compiled functions; the bar is shown as soon as there is one."""

    bar: tqdm | None = None

    def on_start(self, event: object) -> None:
        """Show the bar.

        Parameters
        ----------
        event : numba.core.event.Event
            The start or the end of a compilation.
        """
        if self.bar is None:
            self.bar = tqdm(desc="compiling, only the first time", unit=" functions")

    def on_end(self, event: object) -> None:
        """Count a function. Parameters are those of `CompileBar.on_start`."""
        self.bar.update()


def counting_compiled() -> AbstractContextManager:
    """Return a context in which a bar counts the functions that are compiled."""
    return install_listener("numba:compile", CompileBar())
