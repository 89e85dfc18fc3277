"""A student's stages beside the package's: which pictures they can change, and what the page says about them."""

from dataclasses import dataclass
from html import escape

MADE_BY = {
    "scores": ("segment",),
    "occupancy": ("track",),
    "grid": ("track", "segment", "sample", "fuse"),
    "refined": ("track", "segment", "sample", "fuse", "refine"),
    "remembered": ("track", "segment", "sample", "fuse", "remember"),
}
"""The stages on which each picture of the page depends."""

STAGE_WORDS = {
    "track": ("l → o", "Bayes filter, CMCDOT"),
    "segment": ("i → s", "image network"),
    "sample": ("s → p", "sampling on planes"),
    "fuse": ("(p, o) → g", "reduction and fusion"),
    "refine": ("g → g", "CRF, mean field"),
    "remember": ("g → g", "memory of classes"),
}
"""Input and output of each stage, in the symbols of the paper's Fig. 2, and what the package's own stage does."""


@dataclass(frozen=True)
class Comparison:
    """Which stages of the second run come from a student's file; all others are the package's in both runs.

    Parameters
    ----------
    file : str
        Name of the student's file, without its folder.
    stages : tuple of str
        Names of the stages that the file defines, such as ("track", "refine").
    memory : bool
        Whether both runs remember classes over frames.
    """

    file: str
    stages: tuple[str, ...]
    memory: bool = False

    @property
    def changed(self) -> tuple[str, ...]:
        """The pictures that these stages can change. The page shows each of them twice."""
        return tuple(name for name in pictures_of(self.memory) if set(MADE_BY[name]) & set(self.stages))

    def lead(self) -> str:
        """Return the sentences that open the page, as HTML."""
        named = _listed([f"<b>{name}</b> ({STAGE_WORDS[name][0]})" for name in self.stages])
        return (
            f"This page compares two runs over the same frames. The first is the package's own. In the second, {named} "
            f"{'comes' if len(self.stages) == 1 else 'come'} from <b>{escape(self.file)}</b>, and the other stages are "
            "the package's. A picture that can differ is shown twice, the package's first."
        )

    def made_with(self, picture: str) -> str:
        """Say which of the file's stages a picture depends on.

        Parameters
        ----------
        picture : str
            Name of the picture, a key of `MADE_BY`.

        Returns
        -------
        str
            Two sentences, as HTML.
        """
        stages = [f"<b>{name}</b>" for name in self.stages if name in MADE_BY[picture]]
        return f"Made with {_listed(stages)} of {escape(self.file)}. Where does it differ from the package's picture?"


def pictures_of(memory: bool) -> tuple[str, ...]:
    """Return the names of the pictures that a run makes.

    Parameters
    ----------
    memory : bool
        Whether it remembers classes over frames.
    """
    return tuple(name for name in MADE_BY if memory or name != "remembered")


def _listed(words: list[str]) -> str:
    """Join words as in a sentence: "a, b and c"."""
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last
